//! One connection from its first byte to its close, within limits of time, size and number.

use super::admit::is_health;
use super::body::{Guarded, Passed};
use super::front::Front;
use super::patient::Patient;
use super::places::{Full, Peer, Place, Places};
use super::problem::Problem;
use super::tls::{Handshake, Wire};
use super::traffic::{Silence, Traffic};
use crate::jobs::Limits;
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::{Bytes, BytesMut};
use hyper::server::conn::{http1, http2};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulConnection;
use std::convert::Infallible;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt};
use tokio::net::TcpStream;
use tokio::time::{Instant, MissedTickBehavior, interval};
use tokio_util::sync::CancellationToken;

/// First bytes of every HTTP/2 connection, the client preface of RFC 9113 section 3.4.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Lifetime of a connection that takes one of the few reserve slots, which exist for health checks. Raising it lets a
/// client hold such a slot for longer.
const RESERVE_LIFE: Duration = Duration::from_secs(10);

/// Upper bound in bytes on unsent data of one connection (HTTP/1) or stream (HTTP/2). A large body piece may exceed it.
const SEND_BUFFER: usize = 128 << 10;

/// Upper bound in bytes on the payload of an HTTP/2 frame.
const FRAME: u32 = 16 << 10;

/// HTTP/2 flow-control window in bytes, per stream and per connection: data that a client may send before the service
/// reads it.
const RECEIVE_WINDOW: u32 = 1 << 20;

/// Number of streams of an HTTP/2 connection that may end with a client error before the connection is closed.
const ERROR_RESETS: usize = 128;

/// Limits on open connections: ordinary places, and reserve places for health checks when the ordinary ones are taken.
#[derive(Debug)]
pub(crate) struct Entrance {
    ordinary: Places,
    health: Places,
}

/// Permit that a new connection takes, since the number of open connections is limited.
#[derive(Debug)]
pub(crate) enum Admission {
    /// Permit for a connection within the ordinary limit; every request on it is served.
    Ordinary(Place),
    /// Permit for a connection beyond the ordinary limit; health checks on it are answered and all other requests
    /// refused.
    Reserve(Place, Full),
}

impl Entrance {
    pub(crate) fn new(limits: &Limits) -> Self {
        let (all, each) = (limits.health_connections, limits.health_connections_each);
        Self {
            ordinary: Places::new("connections", limits.connections, limits.connections_each),
            health: Places::new("connections beyond", all, each),
        }
    }

    /// Takes a permit for a connection of the client `peer`. Returns `None` if even the permits of the reserve are
    /// taken.
    pub(crate) fn admit(&self, peer: Peer) -> Option<Admission> {
        match self.ordinary.take(peer, 1) {
            Ok(place) => Some(Admission::Ordinary(place)),
            Err(full) => self.health.take(peer, 1).ok().map(|place| Admission::Reserve(place, full)),
        }
    }
}

/// Request handlers of the service, and limits that all connections of a listener share.
pub(crate) struct Host {
    front: Front,
    /// TLS handshake that begins each connection; `None` serves plain HTTP.
    handshake: Option<Handshake>,
    idle: Duration,
    first_bytes: Duration,
    http1: http1::Builder,
    http2: http2::Builder<TokioExecutor>,
    /// Token that is cancelled to close every connection after its running requests.
    stop: CancellationToken,
    /// Token that is cancelled to close every connection at once, even during a request.
    cut: CancellationToken,
}

impl Host {
    pub(crate) fn new(
        front: Front,
        limits: &Limits,
        handshake: Option<Handshake>,
        stop: CancellationToken,
        cut: CancellationToken,
    ) -> Arc<Self> {
        let mut http1 = http1::Builder::new();
        http1
            .timer(TokioTimer::new())
            .header_read_timeout(limits.idle)
            .max_header_size(limits.header_bytes)
            .max_buf_size(limits.header_bytes.max(SEND_BUFFER));
        let mut http2 = http2::Builder::new(TokioExecutor::new());
        http2
            .timer(TokioTimer::new())
            .keep_alive_interval(limits.idle)
            .keep_alive_timeout(limits.idle)
            .max_concurrent_streams(limits.h2_streams)
            // Rapid resets (CVE-2023-44487) and resets of our own that a client provokes.
            .max_pending_accept_reset_streams(limits.h2_resets)
            .max_local_error_reset_streams(ERROR_RESETS)
            // Header bytes also bound the CONTINUATION frames of one header (CVE-2024-27316).
            .max_header_list_size(u32::try_from(limits.header_bytes).unwrap_or(u32::MAX))
            .max_frame_size(FRAME)
            .initial_stream_window_size(RECEIVE_WINDOW)
            .initial_connection_window_size(RECEIVE_WINDOW)
            .max_send_buf_size(SEND_BUFFER);
        let (idle, first_bytes) = (limits.idle, limits.first_bytes);
        Arc::new(Self { front, handshake, idle, first_bytes, http1, http2, stop, cut })
    }

    /// Serves the requests of one TCP connection until the connection is closed.
    pub(crate) async fn serve(self: Arc<Self>, stream: TcpStream, peer: Peer, admission: Admission) {
        let ended = match admission {
            Admission::Ordinary(_place) => self.converse(stream, peer, None).await,
            Admission::Reserve(_place, full) => {
                let brief = tokio::time::timeout(RESERVE_LIFE, self.converse(stream, peer, Some(full))).await;
                brief.unwrap_or(Err("a connection reserved for health checks was open for too long".to_owned()))
            }
        };
        if let Err(reason) = ended {
            tracing::debug!(%peer, reason, "a connection ended early");
        }
    }

    async fn converse(self: &Arc<Self>, stream: TcpStream, peer: Peer, refusal: Option<Full>) -> Result<(), String> {
        let Some(mut stream) = self.secured(stream).await? else { return Ok(()) };
        let Some(head) = self.opening(first_bytes(&mut stream)).await? else { return Ok(()) };
        let is_http2 = head == PREFACE;
        let traffic = Traffic::new();
        let io = TokioIo::new(Patient::new(stream, head, self.idle));
        let service = hyper::service::service_fn(|request: hyper::Request<hyper::body::Incoming>| {
            let mut running = traffic.enter();
            let mut request = request.map(Body::new);
            request.extensions_mut().insert(peer);
            let host = Arc::clone(self);
            async move {
                let response = answer(&host.front, request, refusal).await;
                // HTTP/2 does not poll the body while the client's flow-control window is closed.
                if !response.body().is_end_stream() {
                    running.gave();
                }
                Ok::<_, Infallible>(response.map(|body| Guarded::new(body, running)))
            }
        });
        if is_http2 {
            self.attend(self.http2.serve_connection(io, service), &traffic, refusal.is_some()).await
        } else {
            self.attend(self.http1.serve_connection(io, service), &traffic, false).await
        }
    }

    /// Makes the TLS handshake, if the service has a certificate. Returns `None` if the client has left, or has sent
    /// plain HTTP and was told to use HTTPS.
    async fn secured(&self, stream: TcpStream) -> Result<Option<Wire>, String> {
        let Some(handshake) = &self.handshake else { return Ok(Some(Wire::Plain(stream))) };
        let made = self.opening(handshake.accept(stream)).await;
        made.inspect_err(|_| metrics::counter!("wavelume_handshakes_failed_total").increment(1))
    }

    /// Waits for a step at the beginning of a connection, such as the TLS handshake. Fails after the time
    /// `first_bytes`, or if the service stops meanwhile.
    async fn opening<T>(&self, step: impl Future<Output = std::io::Result<T>>) -> Result<T, String> {
        tokio::select! {
            () = self.stop.cancelled() => Err("the service stops".to_owned()),
            ended = tokio::time::timeout(self.first_bytes, step) => {
                let late = "the TLS handshake or the first bytes of the connection did not come in time";
                ended.map_err(|_| late.to_owned())?.map_err(|e| e.to_string())
            }
        }
    }

    /// Drives an HTTP connection until it is closed. Shuts it down when the service stops or the client is silent for
    /// too long.
    async fn attend<C: GracefulConnection>(&self, connection: C, traffic: &Traffic, once: bool) -> Result<(), String>
    where
        C::Error: std::fmt::Display,
    {
        let mut connection = pin!(connection);
        let mut ticks = interval((self.idle / 8).max(Duration::from_millis(50)));
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut closing = false;
        loop {
            let close = tokio::select! {
                ended = connection.as_mut() => return ended.map_err(|error| error.to_string()),
                () = self.cut.cancelled() => return Err("the service stopped before the requests had ended".to_owned()),
                () = self.stop.cancelled(), if !closing => true,
                _ = ticks.tick() => match traffic.silence(self.idle, Instant::now()) {
                    Some(Silence::Unread) => return Err("the client did not read its answer for too long".to_owned()),
                    // The client had time to read the remaining answer and to close.
                    Some(Silence::Idle) if closing && traffic.silence(2 * self.idle, Instant::now()).is_some() => {
                        return Err("the client did not close the connection in time".to_owned());
                    }
                    Some(Silence::Idle) => !closing,
                    None => once && !closing && traffic.begun() > 0,
                }
            };
            if close {
                closing = true;
                connection.as_mut().graceful_shutdown();
            }
        }
    }
}

/// Answers a request. If `refusal` is set, the connection is one of those reserved for health checks: other requests
/// are refused, and HTTP/1 answers tell the client to close.
async fn answer(front: &Front, request: Request, refusal: Option<Full>) -> Response {
    let Some(full) = refusal else { return front.answer(request).await };
    let http1 = request.version() < axum::http::Version::HTTP_2;
    let mut response =
        if is_health(request.uri().path()) { front.answer(request).await } else { Problem::from(full).into_response() };
    if http1 {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Reads just enough bytes to tell HTTP/1 from HTTP/2. Returns `None` if the client closes before the first byte.
async fn first_bytes(stream: &mut (impl AsyncRead + Unpin)) -> std::io::Result<Option<Bytes>> {
    let mut head = BytesMut::with_capacity(PREFACE.len());
    while head.len() < PREFACE.len() && PREFACE.starts_with(&head) {
        let missing = PREFACE.len() - head.len();
        if (&mut *stream).take(missing as u64).read_buf(&mut head).await? == 0 {
            break;
        }
    }
    Ok((!head.is_empty()).then(|| head.freeze()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_preface_is_told_from_a_request_by_as_few_bytes_as_possible() {
        for (sent, taken) in [
            (&b"GET / HTTP/1.1\r\n\r\n"[..], Some(18)),
            (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n and frames", Some(24)),
            (b"PUT", Some(3)),
            (b"PRI", Some(3)),
            (b"", None),
        ] {
            let mut stream = sent;
            assert_eq!(first_bytes(&mut stream).await.unwrap().map(|head| head.len()), taken);
        }
    }
}
