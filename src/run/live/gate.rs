//! The door to the live server: who may come in, how long the first words may take, how many may stay, and how much of a
//! message each may leave unfinished. The library that serves viewers asks none of this, so that it listens at a place of
//! its own on this machine that nobody is told, and what comes through the door is passed on.
//!
//! Which pages may connect is left to [`door`](super::door).

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

/// Who has not asked by then is sent away.
const PATIENCE: Duration = Duration::from_secs(5);
/// Connections that have not asked yet. The next one takes the place of the oldest, so that those who ask nothing keep
/// nobody out.
const ARRIVING: usize = 16;
/// Longest request, in bytes.
const REQUEST: usize = 8 << 10;

/// What viewers may do.
#[derive(Clone, Debug)]
pub struct Viewers {
    /// So many at a time.
    pub most: usize,
    /// Bytes of an unfinished message that each may hold, and of a message that each is shown.
    pub owed: usize,
    /// Messages a second that they are shown.
    pub rate: u32,
    /// Hosts and origins besides those of this machine and its neighbours.
    pub allowed: Vec<String>,
}

/// A place on this machine that no page can guess: every address that begins with 127 is ours, where the system knows it.
pub(super) fn unguessable() -> Ipv4Addr {
    let [a, b, c] = rand::random::<[u8; 3]>();
    Ipv4Addr::new(127, a, b, c.clamp(1, 254))
}

/// Lets viewers in for as long as the runtime lives.
pub(super) async fn keep(listener: TcpListener, inner: SocketAddr, viewers: Viewers) {
    let door = Arc::new(Door::new(viewers.allowed));
    let places = Arc::new(Semaphore::new(viewers.most));
    let mut arriving: VecDeque<(Arc<AtomicBool>, AbortHandle)> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Out of descriptors, for instance; that passes.
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
            // A viewer that goes away is no matter.
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

/// Passes bytes on, both ways, until either side ends or the guest leaves too much unfinished.
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

/// A request or an answer up to the empty line that ends its head.
async fn head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        if head.len() >= REQUEST {
            return Err(io::ErrorKind::InvalidData.into());
        }
        // What follows is not ours to take.
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
