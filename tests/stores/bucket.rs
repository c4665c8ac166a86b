//! A bucket on loopback that speaks as much of S3 as is used here.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;

use crate::common::{Folder, Run, finish, program};

/// Answer to a request instead of the right one, by its first line: status and body.
pub type Trouble = fn(&str) -> Option<(&'static str, &'static str)>;

#[derive(Clone)]
struct Entry {
    bytes: Vec<u8>,
    mark: Option<String>,
    /// Number of objects that were put before it, which is its version and the second of its time.
    number: usize,
}

#[derive(Default)]
struct Objects {
    by_key: BTreeMap<String, Entry>,
    puts: usize,
    requests: Vec<String>,
}

pub struct Bucket {
    address: String,
    objects: Arc<Mutex<Objects>>,
}

impl Bucket {
    pub fn new(trouble: Trouble) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let objects = Arc::<Mutex<Objects>>::default();
        let shared = Arc::clone(&objects);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let shared = Arc::clone(&shared);
                thread::spawn(move || {
                    let stream = stream.unwrap();
                    let mut reader = BufReader::new(&stream);
                    while answer(&mut reader, &stream, &shared, trouble).is_some() {}
                });
            }
        });
        Self { address, objects }
    }

    pub fn put(&self, key: &str, bytes: &[u8]) {
        put(&mut self.objects.lock().unwrap(), key, bytes.to_vec(), None);
    }

    pub fn get(&self, key: &str) -> Vec<u8> {
        self.objects.lock().unwrap().by_key[key].bytes.clone()
    }

    pub fn keys(&self, prefix: &str) -> Vec<String> {
        let objects = self.objects.lock().unwrap();
        objects.by_key.keys().filter(|key| key.starts_with(prefix)).cloned().collect()
    }

    /// First lines of the requests so far.
    pub fn requests(&self) -> Vec<String> {
        self.objects.lock().unwrap().requests.clone()
    }

    /// Command that runs the program with this store, as `s3://bucket`.
    pub fn command(&self, folder: &Folder, line: &str) -> Command {
        let mut command = Command::new(program());
        command.args(line.split_whitespace()).current_dir(folder.path());
        command.env("AWS_ENDPOINT_URL", format!("http://{}", self.address)).env("AWS_ALLOW_HTTP", "true");
        command.env("AWS_SKIP_SIGNATURE", "true").env("AWS_REGION", "us-east-1").env("STILLPOINT_RETRY_S", "0.5");
        command
    }

    pub fn say(&self, folder: &Folder, line: &str) -> Run {
        finish(&mut self.command(folder, line))
    }

    /// URL of the same place as that of a web server.
    pub fn web(&self) -> String {
        format!("http://{}", self.address)
    }
}

fn put(objects: &mut Objects, key: &str, bytes: Vec<u8>, mark: Option<String>) {
    objects.puts += 1;
    let number = objects.puts;
    objects.by_key.insert(key.to_owned(), Entry { bytes, mark, number });
}

fn answer(
    reader: &mut BufReader<&TcpStream>,
    mut stream: &TcpStream,
    objects: &Mutex<Objects>,
    trouble: Trouble,
) -> Option<()> {
    let lines: Vec<_> = reader.lines().map_while(Result::ok).take_while(|line| !line.is_empty()).collect();
    let first = lines.first()?.clone();
    let header = |name: &str| {
        let named = lines.iter().find(|line| line.to_lowercase().starts_with(&format!("{name}: ")));
        named.map(|line| line[name.len() + 2..].to_owned())
    };
    let mut body = vec![0; header("content-length").map_or(0, |length| length.parse().unwrap())];
    reader.read_exact(&mut body).ok()?;
    let (method, url) = first.split_once(' ')?;
    let (path, query) = url.split_once(' ')?.0.split_once('?').unwrap_or((url.split_once(' ')?.0, ""));
    let key = path.trim_start_matches('/').split_once('/').map_or("", |(_, key)| key);
    let mut objects = objects.lock().unwrap();
    objects.requests.push(first.clone());
    let (status, headers, content) = match (trouble(&first), method) {
        (Some((status, body)), _) => (status.to_owned(), String::new(), body.as_bytes().to_vec()),
        (None, "PUT") => match header("if-none-match").filter(|_| objects.by_key.contains_key(key)) {
            Some(_) => ("412 Precondition Failed".to_owned(), String::new(), Vec::new()),
            None => {
                put(&mut objects, key, body, header("x-amz-meta-stillpoint"));
                ("200 OK".to_owned(), "ETag: \"new\"\r\n".to_owned(), Vec::new())
            }
        },
        (None, "GET") if key.is_empty() => ("200 OK".to_owned(), String::new(), list(&objects, query)),
        (None, _) => match objects.by_key.get(key) {
            Some(entry) => content_of(entry, header("range").as_deref()),
            None => ("404 Not Found".to_owned(), String::new(), b"<Code>NoSuchKey</Code>".to_vec()),
        },
    };
    drop(objects);
    write!(stream, "HTTP/1.1 {status}\r\nContent-Length: {}\r\n{headers}\r\n", content.len()).ok()?;
    stream.write_all(if method == "HEAD" { &[] } else { &content }).ok()
}

fn content_of(entry: &Entry, range: Option<&str>) -> (String, String, Vec<u8>) {
    let length = entry.bytes.len();
    let (from, until) = range.unwrap_or("bytes=0-").trim_start_matches("bytes=").split_once('-').unwrap();
    let (from, until) = match (from.parse::<usize>(), until.parse::<usize>()) {
        (Err(_), Ok(last)) => (length.saturating_sub(last), length),
        (Ok(from), until) => (from, until.map_or(length, |until| until + 1).min(length)),
        _ => (0, length),
    };
    let mut headers = format!(
        "ETag: \"{}\"\r\nLast-Modified: Mon, 01 Jan 2024 00:00:{:02} GMT\r\nContent-Range: bytes {from}-{}/{length}\r\n",
        entry.number,
        entry.number,
        until.saturating_sub(1)
    );
    entry.mark.iter().for_each(|mark| write!(headers, "x-amz-meta-stillpoint: {mark}\r\n").unwrap());
    let status = if range.is_some() { "206 Partial Content" } else { "200 OK" };
    (status.to_owned(), headers, entry.bytes[from..until].to_vec())
}

fn list(objects: &Objects, query: &str) -> Vec<u8> {
    let prefix = query.split('&').find_map(|part| part.strip_prefix("prefix=")).unwrap_or_default();
    let prefix = prefix.replace("%2F", "/");
    let mut text = "<ListBucketResult><Name>bucket</Name><IsTruncated>false</IsTruncated>".to_owned();
    for (key, entry) in objects.by_key.iter().filter(|(key, _)| key.starts_with(&prefix)) {
        let (number, size) = (entry.number, entry.bytes.len());
        write!(
            text,
            "<Contents><Key>{key}</Key><LastModified>2024-01-01T00:00:{number:02}.000Z</LastModified>\
             <ETag>\"{number}\"</ETag><Size>{size}</Size></Contents>"
        )
        .unwrap();
    }
    (text + "</ListBucketResult>").into_bytes()
}
