//! Requests under way whose caller loses its rights: they are refused, and a long answer breaks off.

use super::caller::Watched;
use super::decisions::KeyState;
use super::extract::drain;
use super::problem::{Kind, Problem};
use super::state::App;
use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, SizeHint};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

/// Size in bytes up to which an answer is sent whole, even if the rights of its caller end meanwhile. Raising it lets
/// longer answers go on after a key was revoked.
pub(crate) const SHORT: u64 = 1 << 20;

/// Resolves when the rights of a caller end while its request is under way, with the error response to the request.
/// Never resolves for a caller without a key.
pub(crate) async fn ended(app: &App, watched: Option<Watched>) -> Problem {
    let Some(Watched { key, end }) = watched else { return std::future::pending().await };
    match app.guard.decisions.lost(&app.engine.archive.catalog, key, end).await {
        KeyState::Closed => {
            let detail = "the tenant of the key was closed while the request was under way; whoever administers the \
                          service can open it";
            Problem::new(Kind::MissingScope, detail)
        }
        KeyState::Revoked => {
            Problem::unauthorised("the key was revoked while the request was under way: make another one")
        }
        KeyState::Expired | KeyState::Valid => {
            Problem::unauthorised("the key, token or link expired while the request was under way: make another one")
        }
    }
}

/// Body of an answer to a request with a key, token or link. It breaks off when the rights of the caller end.
pub(crate) struct Expiring {
    body: Body,
    /// Future that resolves when the rights of the caller end; `None` once it has resolved.
    end: Option<Pin<Box<dyn Future<Output = ()> + Send>>>,
}

/// Reason for which an answer broke off: the rights of its caller have ended.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the key, token or link of the request is no longer valid")]
struct Ended;

impl Expiring {
    /// Builds a response body that breaks off when `end` resolves.
    pub(crate) fn new(body: Body, end: impl Future<Output = ()> + Send + 'static) -> Self {
        Self { body, end: Some(Box::pin(end)) }
    }
}

impl HttpBody for Expiring {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        let Some(end) = &mut this.end else { return Poll::Ready(None) };
        if end.as_mut().poll(context).is_ready() {
            this.end = None;
            return Poll::Ready(Some(Err(axum::Error::new(Ended))));
        }
        Pin::new(&mut this.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Request body that outlives the handler which reads it, so that the rest can be discarded when the request is refused
/// midway: most clients read the answer only after their body, and many of them would find a broken connection instead.
pub(crate) struct Rest(Arc<Mutex<Option<Body>>>);

/// Request body as its handler reads it. Once the rest is discarded, nothing follows, not even an end: a task that
/// still reads it does not take what has come for the whole.
struct Lent(Arc<Mutex<Option<Body>>>);

impl Rest {
    /// Lends a request body to a handler. Returns `None` beside a body without bytes.
    pub(crate) fn of(body: Body) -> (Option<Self>, Body) {
        if body.is_end_stream() {
            return (None, body);
        }
        let body = Arc::new(Mutex::new(Some(body)));
        (Some(Self(Arc::clone(&body))), Body::new(Lent(body)))
    }

    /// Discards the rest of the body for at most the given time, while the answer is sent.
    pub(crate) fn discard(self, time: Duration) {
        if let Some(body) = self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            tokio::spawn(drain(body, time));
        }
    }
}

impl HttpBody for Lent {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut body = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        body.as_mut().map_or(Poll::Pending, |body| Pin::new(body).poll_frame(context))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::StreamExt;

    #[tokio::test]
    async fn an_answer_breaks_off_when_the_rights_end() {
        let pieces = || futures::stream::iter(0..9).map(|n| Ok::<_, std::io::Error>(Bytes::from(vec![n; 9])));
        let whole = Expiring::new(Body::from_stream(pieces()), std::future::pending());
        assert_eq!(
            Body::new(whole).into_data_stream().filter(|piece| std::future::ready(piece.is_ok())).count().await,
            9
        );
        let (end, ended) = tokio::sync::oneshot::channel::<()>();
        let mut cut =
            Body::new(Expiring::new(Body::from_stream(pieces()), async { drop(ended.await) })).into_data_stream();
        assert_eq!(cut.next().await.unwrap().unwrap(), vec![0; 9]);
        end.send(()).unwrap();
        assert!(cut.next().await.unwrap().is_err());
        assert!(cut.next().await.is_none());
    }

    #[tokio::test]
    async fn the_rest_of_a_body_is_taken_from_its_reader_without_an_end() {
        let (none, _) = Rest::of(Body::empty());
        assert!(none.is_none());
        let (sender, body) = tokio::io::duplex(64);
        let (rest, lent) = Rest::of(Body::from_stream(tokio_util::io::ReaderStream::new(body)));
        let (mut sender, mut lent) = (sender, lent.into_data_stream());
        tokio::io::AsyncWriteExt::write_all(&mut sender, b"first").await.unwrap();
        assert_eq!(lent.next().await.unwrap().unwrap(), "first");
        rest.unwrap().discard(Duration::from_mins(1));
        // More than the pipe holds: somebody reads it.
        tokio::io::AsyncWriteExt::write_all(&mut sender, &[7; 1000]).await.unwrap();
        drop(sender);
        assert!(futures::poll!(lent.next()).is_pending());
    }
}
