//! Clients that ask nothing, or listen to nothing, keep nobody else from being served.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use crate::common::Folder;
use crate::watch;

/// The answer to a request, unless there is none for a long time.
fn ask(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn idlers_and_those_who_never_read_take_nobodys_place() {
    let folder = Folder::new();
    watch(&folder, "--metrics 127.0.0.1:0", |said| {
        let Some((_, rest)) = said.split_once("metrics at http://") else { return false };
        let Some((address, _)) = rest.split_once("/metrics") else { return false };
        let idle: Vec<_> = (0..100).map(|_| TcpStream::connect(address).unwrap()).collect();
        let deaf = (0..40).map(|_| {
            let mut stream = TcpStream::connect(address).unwrap();
            // It may be cut off meanwhile.
            let _ = stream.write_all("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(500).as_bytes());
            stream
        });
        let deaf: Vec<_> = deaf.collect();
        for path in ["/healthz", "/metrics"] {
            assert!(ask(address, path).starts_with("HTTP/1.1 200"), "{path}");
        }
        drop((idle, deaf));
        true
    });
}
