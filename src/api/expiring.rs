//! Body of a long answer, which breaks off when the rights of its caller end.

use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll};

/// Size in bytes up to which an answer is sent whole, even if the rights of its caller end meanwhile. Raising it lets
/// longer answers go on after a key was revoked.
pub(crate) const SHORT: u64 = 1 << 20;

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
}
