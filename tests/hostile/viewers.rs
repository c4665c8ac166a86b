//! Who connects to a live recording: pages of strangers, those who never ask, those who never finish, and too many.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::common::Folder;
use crate::watch;

/// A connection that has asked to become a WebSocket, and the head of the answer.
fn ask(address: &str, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let request = format!(
        "GET / HTTP/1.1\r\n{headers}Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    while !answer.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        match stream.read(&mut byte) {
            Ok(1) => answer.push(byte[0]),
            _ => break,
        }
    }
    (stream, String::from_utf8(answer).unwrap())
}

/// The text of the next message, as the server frames it.
fn next_text(stream: &mut TcpStream) -> String {
    let mut head = [0; 2];
    stream.read_exact(&mut head).unwrap();
    let length = match head[1] {
        126 => {
            let mut long = [0; 2];
            stream.read_exact(&mut long).unwrap();
            u16::from_be_bytes(long).into()
        }
        short => usize::from(short),
    };
    let mut body = vec![0; length];
    stream.read_exact(&mut body).unwrap();
    String::from_utf8_lossy(&body).into_owned()
}

/// Runs a live watch, and something with its address.
fn live(arguments: &str, check: impl Fn(&str)) {
    let folder = Folder::new();
    watch(&folder, &format!("--live 127.0.0.1:0 {arguments}"), |said| {
        let Some((_, rest)) = said.split_once("live at ws://") else { return false };
        let Some(address) = rest.lines().next().filter(|_| rest.contains("watching")) else { return false };
        check(address);
        true
    });
}

/// Whether the other side ends a connection in time.
fn is_let_go(stream: &mut TcpStream, within: Duration) -> bool {
    let began = Instant::now();
    let mut buffer = [0; 4096];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return true,
            Err(error) if !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return true,
            _ if began.elapsed() > within => return false,
            _ => {}
        }
    }
}

#[test]
fn pages_of_strangers_are_not_served_and_viewers_are() {
    live("--live-allow https://viewer.example", |address| {
        for (headers, status) in [
            ("", "101"),
            ("Origin: https://app.foxglove.dev\r\n", "101"),
            ("Origin: http://localhost:8080\r\n", "101"),
            ("Origin: https://viewer.example\r\n", "101"),
            ("Origin: http://evil.example\r\n", "403"),
            ("Origin: null\r\n", "403"),
        ] {
            let (mut stream, answer) = ask(address, &format!("Host: {address}\r\n{headers}"));
            assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{headers}: {answer}");
            assert!(status != "101" || next_text(&mut stream).contains("serverInfo"));
        }
        // A name of a stranger that was made to lead here.
        for headers in ["Host: evil.example\r\n", "Host: evil.example\r\nOrigin: http://evil.example\r\n"] {
            assert!(ask(address, headers).1.starts_with("HTTP/1.1 403"), "{headers}");
        }
        assert!(ask(address, "").1.starts_with("HTTP/1.1 400"), "no host");
    });
}

#[test]
fn who_never_asks_is_sent_away_and_keeps_nobody_out() {
    live("", |address| {
        let mut idle: Vec<_> = (0..200).map(|_| TcpStream::connect(address).unwrap()).collect();
        for stream in &mut idle {
            stream.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
            // A part of a request.
            let _ = stream.write_all(b"GET / HTTP/1.1\r\n");
        }
        let (_viewer, answer) = ask(address, &format!("Host: {address}\r\n"));
        assert!(answer.starts_with("HTTP/1.1 101"), "{answer}");
        for stream in &mut idle {
            assert!(is_let_go(stream, Duration::from_secs(20)));
        }
    });
}

#[test]
fn there_are_so_many_viewers_and_no_more() {
    live("--set limits.viewers=3", |address| {
        let host = format!("Host: {address}\r\n");
        let mut viewers: Vec<_> = (0..3).map(|_| ask(address, &host)).collect();
        assert!(viewers.iter().all(|(_, answer)| answer.starts_with("HTTP/1.1 101")));
        assert!(ask(address, &host).1.starts_with("HTTP/1.1 503"), "the fourth");
        viewers.pop();
        let began = Instant::now();
        while !ask(address, &host).1.starts_with("HTTP/1.1 101") {
            assert!(began.elapsed() < Duration::from_secs(20), "its place is free");
        }
    });
}

#[test]
fn who_owes_too_much_of_a_message_is_let_go() {
    live("--set limits.viewer_kib=64", |address| {
        // One frame that claims 60 MB, and many that never end a message.
        let claim = [&[0x82, 0xff][..], &60_000_000_u64.to_be_bytes(), &[0; 4]].concat();
        let piece = [&[0x00, 0xfe, 0x40, 0x00, 0, 0, 0, 0][..], &[0; 0x4000]].concat();
        let begun = [&[0x02, 0x80, 0, 0, 0, 0][..], &piece.repeat(5)].concat();
        for bytes in [claim, begun] {
            let (mut stream, answer) = ask(address, &format!("Host: {address}\r\n"));
            assert!(answer.starts_with("HTTP/1.1 101"));
            let _ = stream.write_all(&bytes);
            assert!(is_let_go(&mut stream, Duration::from_secs(20)));
        }
    });
}
