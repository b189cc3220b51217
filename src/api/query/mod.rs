//! `/v1/materials/{id}/spectrum`, `evaluate`, `pdf`, `sample`, `albedo`: queries of an opened material, in degrees.
//!
//! A batch arrives in one of three encodings and is answered in one of them. JSON is whole: one object in, and an
//! answer or a problem out, within the limits of a body and of an answer. NDJSON (one record a line) and little-endian
//! f32 are streams of any length:
//!
//! ```text
//! body ─ read ahead (16 MiB) ─ cut into blocks ─ 3 blocks on the threads for queries ─ body of the answer
//! ```
//!
//! A block is evaluated only when there is room for its answer. The service therefore stops reading from a client that
//! does not read, and the memory of a stream is constant. Every block waits for a turn of its own, so that a long
//! stream waits behind a short query, never before it. A client that disconnects ends its stream.
//!
//! If the first record cannot be answered, the whole answer is a problem. Later the status has been sent: NDJSON then
//! ends with the problem as its last line, and f32 with the connection cut before the end that its framing promised.

mod answering;
mod answers;
mod batch;
mod blocks;
mod media;
mod one;
mod opened;
mod options;
mod places;
mod question;
mod read_ahead;
mod stream;

pub(super) use one::compute;
pub(super) use opened::open;
pub(super) use options::{direction, indices, outgoing, read};

use super::state::Service;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of queries of a material: evaluation, sampling and albedo.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(one::get_spectrum))
        .routes(routes!(one::get_albedo, batch::albedo))
        .routes(routes!(batch::evaluate))
        .routes(routes!(batch::pdf))
        .routes(routes!(batch::sample))
}
