//! The body of an answer in small pieces, with a guard that lives as long as the body.

use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll, ready};

/// Bytes of a response body handed to the connection at a time. HTTP/2 takes a whole piece even if the client reads
/// little. A smaller value bounds the unsent bytes but costs more calls.
const PIECE: usize = 128 << 10;

/// Observer that is told how the connection consumes a response body.
pub(crate) trait Passed {
    /// Takes note that the connection has room to send more and asks for the next piece of the response body. Does
    /// nothing by default.
    fn asked(&mut self) {}
    /// Takes note that the connection got bytes to send to the client: a piece of the response body, or the response
    /// head while no piece was requested yet. Does nothing by default.
    fn gave(&mut self) {}
}

/// Response body with a guard object, which is told about sent pieces. The guard is dropped with the body, and then
/// releases the limited resources, such as memory, that the response occupied.
pub(crate) struct Guarded<G> {
    body: Body,
    rest: Bytes,
    guard: G,
}

impl<G: Passed + Unpin> Guarded<G> {
    pub(crate) fn new(body: Body, guard: G) -> Self {
        Self { body, rest: Bytes::new(), guard }
    }
}

impl<G: Passed + Unpin> HttpBody for Guarded<G> {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        this.guard.asked();
        if this.rest.is_empty() {
            match ready!(Pin::new(&mut this.body).poll_frame(context)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(bytes) => this.rest = bytes,
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                other => return Poll::Ready(other),
            }
        }
        let piece = this.rest.split_to(this.rest.len().min(PIECE));
        this.guard.gave();
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let rest = self.rest.len() as u64;
        let inner = self.body.size_hint();
        let mut hint = SizeHint::new();
        hint.set_lower(inner.lower().saturating_add(rest));
        if let Some(upper) = inner.upper() {
            hint.set_upper(upper.saturating_add(rest));
        }
        hint
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::StreamExt;

    #[derive(Default)]
    struct Count(std::sync::Arc<std::sync::atomic::AtomicUsize>);

    impl Passed for Count {
        fn gave(&mut self) {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        }
    }

    #[tokio::test]
    async fn a_large_body_comes_in_pieces_and_keeps_its_length() {
        let count = Count::default();
        let given = std::sync::Arc::clone(&count.0);
        let body = Guarded::new(Body::from(vec![7; 3 * PIECE + 1]), count);
        assert_eq!(body.size_hint().exact(), Some(3 * PIECE as u64 + 1));
        let sizes: Vec<usize> = Body::new(body).into_data_stream().map(|piece| piece.unwrap().len()).collect().await;
        assert_eq!(sizes, [PIECE, PIECE, PIECE, 1]);
        assert_eq!(given.load(std::sync::atomic::Ordering::Relaxed), 4);
        assert!(Guarded::new(Body::empty(), Count::default()).is_end_stream());
    }
}
