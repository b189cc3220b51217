//! Refusals of requests to a resumable upload.

use crate::api::problem::{Kind, Problem};
use axum::http::header;

pub(super) fn absent(id: &str) -> Problem {
    Problem::new(Kind::NotFound, format!("there is no upload {id}: it was used, deleted, or has expired"))
}

pub(super) fn expired(id: &str) -> Problem {
    Problem::new(Kind::Gone, format!("the upload {id} has expired; begin another one"))
}

pub(super) fn locked(id: &str) -> Problem {
    let detail = format!("another request is using the upload {id}; try again when it has ended");
    Problem::new(Kind::Locked, detail).with(header::RETRY_AFTER, "2")
}
