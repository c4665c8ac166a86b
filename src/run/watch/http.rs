//! `/healthz`, `/readyz` and `/metrics` over HTTP. [`Metrics`] provides the content.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::CONTENT_TYPE;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::task::AbortHandle;

use crate::Error;
use crate::run::watch::metrics::Metrics;

/// Most connections at a time; metrics need few. The next one replaces the oldest, so that silent ones keep nobody out.
const CONNECTIONS: usize = 32;
/// Longest time of a connection, whether it sends, receives or does neither.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time without a look through the directory after which the service is unhealthy.
const ALIVE: Duration = Duration::from_secs(60);

/// Serves until the process ends; returns the address.
///
/// # Errors
///
/// If it cannot listen on the address.
pub fn serve(address: SocketAddr, metrics: Arc<Metrics>) -> Result<SocketAddr, Error> {
    let refused = |error| Error::io("listen on", address.to_string().as_ref())(error);
    let listener = TcpListener::bind(address).and_then(|listener| listener.set_nonblocking(true).map(|()| listener));
    let listener = listener.map_err(refused)?;
    let bound = listener.local_addr().map_err(refused)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(refused)?;
    std::thread::Builder::new().spawn(move || runtime.block_on(accept(listener, metrics))).map_err(refused)?;
    Ok(bound)
}

async fn accept(listener: TcpListener, metrics: Arc<Metrics>) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let mut open: VecDeque<AbortHandle> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let metrics = metrics.clone();
        open.retain(|connection| !connection.is_finished());
        if open.len() >= CONNECTIONS
            && let Some(oldest) = open.pop_front()
        {
            oldest.abort();
        }
        let connection = tokio::spawn(async move {
            let answer = service_fn(move |request| answer(request, metrics.clone()));
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .keep_alive(false)
                .header_read_timeout(PATIENCE)
                .serve_connection(TokioIo::new(stream), answer);
            // A client that goes away or stalls does not matter.
            let _ = tokio::time::timeout(PATIENCE, connection).await;
        });
        open.push_back(connection.abort_handle());
    }
}

async fn answer(request: Request<Incoming>, metrics: Arc<Metrics>) -> Result<Response<Full<Bytes>>, Infallible> {
    let good =
        |good: bool| if good { (StatusCode::OK, "ok\n") } else { (StatusCode::SERVICE_UNAVAILABLE, "not yet\n") };
    let (status, body) = match (request.method(), request.uri().path()) {
        (&Method::GET | &Method::HEAD, "/metrics") => (StatusCode::OK, metrics.text()),
        (&Method::GET | &Method::HEAD, "/healthz") => {
            let (status, text) = good(!metrics.is_ready() || metrics.is_alive(ALIVE));
            (status, text.to_owned())
        }
        (&Method::GET | &Method::HEAD, "/readyz") => {
            let (status, text) = good(metrics.is_alive(ALIVE));
            (status, text.to_owned())
        }
        (&Method::GET | &Method::HEAD, _) => {
            (StatusCode::NOT_FOUND, "here are /healthz, /readyz and /metrics\n".to_owned())
        }
        _ => (StatusCode::METHOD_NOT_ALLOWED, "only GET\n".to_owned()),
    };
    let mut response = Response::new(Full::new(Bytes::from(body)));
    *response.status_mut() = status;
    let kind = hyper::header::HeaderValue::from_static("text/plain; version=0.0.4; charset=utf-8");
    response.headers_mut().insert(CONTENT_TYPE, kind);
    Ok(response)
}
