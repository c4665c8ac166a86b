//! Entrance of the live server: it limits who may connect, the time until the first request, the number of viewers, and
//! the unfinished bytes of a message. The library that serves viewers limits none of this, so it listens at a separate,
//! secret address on this machine, and admitted connections are forwarded.
//!
//! [`door`](super::door) decides which pages may connect.

use std::collections::VecDeque;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use super::door::{Door, Refused};
use super::unfinished::Unfinished;

/// Longest wait for the request of a new connection.
const PATIENCE: Duration = Duration::from_secs(5);
/// Most connections that have not sent a request yet. The next one replaces the oldest, so that silent ones keep nobody
/// out.
const ARRIVING: usize = 16;
/// Longest request, in bytes.
const REQUEST: usize = 8 << 10;

/// Limits for viewers.
#[derive(Clone, Debug)]
pub struct Viewers {
    /// Most viewers at a time.
    pub most: usize,
    /// Most bytes of an unfinished message from each viewer, and of a message that is shown.
    pub owed: usize,
    /// Most messages per second that are shown.
    pub rate: u32,
    /// Allowed hosts and origins besides those of this machine and its neighbours.
    pub allowed: Vec<String>,
}

/// A loopback address that no page can guess: where the system supports it, all of 127.0.0.0/8 is ours.
pub(super) fn unguessable() -> Ipv4Addr {
    let [a, b, c] = rand::random::<[u8; 3]>();
    Ipv4Addr::new(127, a, b, c.clamp(1, 254))
}

/// Admits viewers for as long as the runtime lives.
pub(super) async fn keep(listener: TcpListener, inner: SocketAddr, viewers: Viewers) {
    let door = Arc::new(Door::new(viewers.allowed));
    let places = Arc::new(Semaphore::new(viewers.most));
    let mut arriving: VecDeque<(Arc<AtomicBool>, AbortHandle)> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Out of descriptors, for example; that passes.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        arriving.retain(|(is_inside, task)| !task.is_finished() && !is_inside.load(Ordering::Relaxed));
        if arriving.len() >= ARRIVING
            && let Some((_, oldest)) = arriving.pop_front()
        {
            oldest.abort();
        }
        let is_inside = Arc::new(AtomicBool::new(false));
        let (door, places, owed, enters) = (door.clone(), places.clone(), viewers.owed, is_inside.clone());
        let task = tokio::spawn(async move {
            // A viewer that goes away does not matter.
            let _ = receive(stream, inner, &door, &places, &enters, owed).await;
        });
        arriving.push_back((is_inside, task.abort_handle()));
    }
}

async fn receive(
    mut guest: TcpStream,
    inner: SocketAddr,
    door: &Door,
    places: &Semaphore,
    enters: &AtomicBool,
    owed: usize,
) -> io::Result<()> {
    let greeted = timeout(PATIENCE, async {
        let request = head(&mut guest).await?;
        let place = match door.judge(&request) {
            Err(refused) => Err(refused),
            Ok(()) => places.try_acquire().map_err(|_| Refused::full()),
        };
        let place = match place {
            Ok(place) => place,
            Err(refused) => return refuse(&mut guest, &refused).await.map(|()| None),
        };
        let mut server = TcpStream::connect(inner).await?;
        server.write_all(&request).await?;
        let answer = head(&mut server).await?;
        guest.write_all(&answer).await?;
        Ok::<_, io::Error>(Some((place, server)))
    });
    let Some((_place, server)) = greeted.await?? else { return Ok(()) };
    enters.store(true, Ordering::Relaxed);
    pass(guest, server, owed).await
}

/// Forwards bytes in both directions until either side ends or the guest leaves too much unfinished.
async fn pass(mut guest: TcpStream, mut server: TcpStream, owed: usize) -> io::Result<()> {
    let _ = (guest.set_nodelay(true), server.set_nodelay(true));
    let (mut from_guest, mut to_guest) = guest.split();
    let (mut from_server, mut to_server) = server.split();
    let asks = async {
        let mut unfinished = Unfinished::default();
        let mut buffer = vec![0; 4 << 10];
        loop {
            let read = from_guest.read(&mut buffer).await?;
            let bytes = buffer.get(..read).unwrap_or_default();
            if read == 0 || unfinished.take(bytes) > owed as u64 {
                return Ok(());
            }
            to_server.write_all(bytes).await?;
        }
    };
    let answers = async { tokio::io::copy(&mut from_server, &mut to_guest).await.map(drop) };
    tokio::select! { ended = asks => ended, ended = answers => ended }
}

/// Head of a request or an answer, through the empty line.
async fn head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        if head.len() >= REQUEST {
            return Err(io::ErrorKind::InvalidData.into());
        }
        // Byte by byte, since the bytes behind the head must stay in the stream.
        head.push(stream.read_u8().await?);
    }
    Ok(head)
}

async fn refuse(guest: &mut TcpStream, refused: &Refused) -> io::Result<()> {
    let Refused { status, why } = refused;
    let length = why.len() + 1;
    let answer = format!(
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{why}\n"
    );
    guest.write_all(answer.as_bytes()).await?;
    guest.shutdown().await
}
