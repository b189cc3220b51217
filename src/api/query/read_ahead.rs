//! Read-ahead of a body, up to a number of bytes.
//!
//! Many clients write their whole body before they read any of the answer. With room for a million records in between
//! they work, although the answer begins before the body ends.

use super::super::extract::linger_body;
use super::super::problem::{Kind, Problem};
use axum::body::{Body, Bytes};
use futures::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

/// Upper bound in bytes on data read ahead of one request body. Raising it serves clients that send a long body before
/// they read the answer, at the cost of memory.
const AHEAD: usize = 16 << 20;

/// Bytes of memory assumed for holding one received piece of a request body, beyond its data, in the limit on data read
/// ahead. Raising it reads fewer small pieces ahead.
const OVERHEAD: usize = 128;

/// Pieces of a request body, read before they are needed.
#[derive(Debug)]
pub(super) struct ReadAhead {
    pieces: mpsc::UnboundedReceiver<Piece>,
}

#[derive(Debug)]
struct Piece {
    bytes: Result<Bytes, Problem>,
    /// Permit that counts the bytes of one piece of a request body against [`AHEAD`], the limit on bytes that are read
    /// before they are needed. It is released when the piece is taken from the queue of such pieces.
    _share: Option<OwnedSemaphorePermit>,
}

impl ReadAhead {
    /// Starts reading a request body ahead. When the reader is dropped, a task drains a little of the remaining body:
    /// most clients read the answer only after sending a good part of their body.
    pub(super) fn new(body: Body, idle: Duration) -> Self {
        let (sender, pieces) = mpsc::unbounded_channel();
        tokio::spawn(async move {
            let mut body = body.into_data_stream();
            let room = Arc::new(Semaphore::new(AHEAD));
            loop {
                let piece = tokio::select! {
                    () = sender.closed() => break,
                    piece = tokio::time::timeout(idle, body.next()) => piece,
                };
                let bytes = match piece {
                    Ok(None) => return,
                    Ok(Some(Ok(bytes))) => Ok(bytes),
                    Ok(Some(Err(_))) => Err(Problem::new(Kind::BadBody, "the body ended early")),
                    Err(_) => Err(Problem::new(Kind::TooSlow, format!("nothing came for {idle:?}"))),
                };
                let last = bytes.is_err();
                let cost = bytes.as_ref().map_or(0, |bytes| (bytes.len() + OVERHEAD).min(AHEAD));
                let share = tokio::select! {
                    () = sender.closed() => break,
                    share = Arc::clone(&room).acquire_many_owned(cost as u32) => share.ok(),
                };
                // Fails only if the receiver is gone; the next wait then ends the loop.
                let _ = sender.send(Piece { bytes, _share: share });
                if last {
                    return;
                }
            }
            linger_body(Body::from_stream(body)).await;
        });
        Self { pieces }
    }

    /// Returns the next piece of the request body; `None` at its end.
    pub(super) async fn next(&mut self) -> Option<Result<Bytes, Problem>> {
        self.pieces.recv().await.map(|piece| piece.bytes)
    }
}
