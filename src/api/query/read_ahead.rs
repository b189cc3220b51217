//! A body read ahead of whoever takes it, up to a number of bytes.
//!
//! Many clients write their whole body before they read any of the answer. With room for a million records between the
//! two they need not know that the answer begins before the body ends.

use super::super::extract::linger_body;
use super::super::problem::{Kind, Problem};
use axum::body::{Body, Bytes};
use futures::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

/// Bytes that are read and not taken yet.
const AHEAD: usize = 16 << 20;

/// What a piece costs beside its bytes.
const OVERHEAD: usize = 128;

/// The pieces of a body.
#[derive(Debug)]
pub(super) struct ReadAhead {
    pieces: mpsc::UnboundedReceiver<Piece>,
}

#[derive(Debug)]
struct Piece {
    bytes: Result<Bytes, Problem>,
    /// Its share of [`AHEAD`], until it is taken.
    _share: Option<OwnedSemaphorePermit>,
}

impl ReadAhead {
    /// Begins to read. When this is dropped a task takes a little of what is left, because most clients read the answer
    /// only after they have sent a good part of their body.
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
                // Nobody takes it: the loop ends where it waits for that.
                let _ = sender.send(Piece { bytes, _share: share });
                if last {
                    return;
                }
            }
            linger_body(Body::from_stream(body)).await;
        });
        Self { pieces }
    }

    /// The next piece; `None` at the end of the body.
    pub(super) async fn next(&mut self) -> Option<Result<Bytes, Problem>> {
        self.pieces.recv().await.map(|piece| piece.bytes)
    }
}
