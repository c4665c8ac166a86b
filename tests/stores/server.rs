//! A web server on loopback that serves one file by ranges, and counts what it was asked for.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

/// Trouble with a request, by the number of requests before it.
pub type Trouble = fn(usize) -> Option<&'static str>;

pub struct Server {
    pub url: String,
    ranges: Arc<Mutex<Vec<(u64, u64)>>>,
}

impl Server {
    /// Serves a file under any name that ends with `.mcap`.
    pub fn new(file: Vec<u8>, trouble: Trouble) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/x.mcap", listener.local_addr().unwrap());
        let ranges = Arc::new(Mutex::new(Vec::new()));
        let (file, asked) = (Arc::new(file), Arc::clone(&ranges));
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (file, asked) = (Arc::clone(&file), Arc::clone(&asked));
                thread::spawn(move || while answer(stream.as_ref().unwrap(), &file, &asked, trouble).is_some() {});
            }
        });
        Self { url, ranges }
    }

    /// First and last byte of each request so far.
    pub fn ranges(&self) -> Vec<(u64, u64)> {
        self.ranges.lock().unwrap().clone()
    }
}

fn answer(mut stream: &TcpStream, file: &[u8], asked: &Mutex<Vec<(u64, u64)>>, trouble: Trouble) -> Option<()> {
    let lines: Vec<_> =
        BufReader::new(stream).lines().map_while(Result::ok).take_while(|line| !line.is_empty()).collect();
    // The answer to one has no body, which the next request on the connection would take for its own.
    let is_head = lines.first()?.starts_with("HEAD ");
    let is_file = lines.first()?.contains(".mcap ");
    let range = lines.iter().find_map(|line| line.to_lowercase().strip_prefix("range: bytes=").map(str::to_owned));
    let (from, until) = range.as_deref().unwrap_or("0-").split_once('-')?;
    let length = file.len() as u64;
    let (from, until) = match (from.parse::<u64>(), until.parse::<u64>()) {
        (Err(_), Ok(last)) => (length.saturating_sub(last), length - 1),
        (Ok(from), until) => (from, until.unwrap_or(length - 1).min(length - 1)),
        _ => return None,
    };
    let number = {
        let mut asked = asked.lock().unwrap();
        asked.push((from, until));
        asked.len() - 1
    };
    let trouble = trouble(number);
    let body = &file[from as usize..=until as usize];
    let head = |status: &str, length: usize| {
        format!(
            "HTTP/1.1 {status}\r\nContent-Length: {length}\r\nContent-Range: bytes {from}-{until}/{}\r\nETag: \"1\"\r\n\
             Last-Modified: Mon, 01 Jan 2024 00:00:00 GMT\r\n\r\n",
            file.len()
        )
    };
    match trouble {
        _ if !is_file => stream.write_all(head("404 Not Found", 0).as_bytes()).ok()?,
        Some("whole") => {
            stream
                .write_all(format!("HTTP/1.1 200 OK\r\nContent-Length: {length}\r\nETag: \"1\"\r\n\r\n").as_bytes())
                .ok()?;
            stream.write_all(if is_head { &[] } else { file }).ok()?;
        }
        Some("cut") => {
            stream.write_all(head("206 Partial Content", body.len()).as_bytes()).ok()?;
            stream.write_all(&body[..body.len() / 2]).ok()?;
            stream.shutdown(std::net::Shutdown::Both).ok()?;
            return None;
        }
        Some(status) => stream.write_all(head(status, 0).as_bytes()).ok()?,
        None => {
            stream.write_all(head("206 Partial Content", body.len()).as_bytes()).ok()?;
            stream.write_all(if is_head { &[] } else { body }).ok()?;
        }
    }
    Some(())
}
