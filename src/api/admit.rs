//! Admission: each request holds a place until the last byte of its answer is sent.

use super::body::{Guarded, Passed};
use super::extract::linger;
use super::places::{Full, KIB, Peer, Place};
use super::problem::Problem;
use super::state::App;
use axum::body::{Body, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Size in bytes above which an in-memory answer counts towards the limit on answer memory. Raising it leaves more
/// answers uncounted.
const LARGE: u64 = 64 << 10;

/// Returns true for health-check paths, which answer even when all places are taken.
pub(crate) fn is_health(path: &str) -> bool {
    matches!(path, "/healthz" | "/readyz")
}

/// Returns true for routes that compute on a material. Each such request also takes a place among the queries.
fn is_query(route: &str) -> bool {
    let Some(question) = route.strip_prefix("/v1/materials/{id}/") else { return false };
    !matches!(question, "content" | "export")
}

/// Admits a request if its peer has a free place, and releases the place when the answer is sent or dropped.
pub(crate) async fn admit(State(app): State<App>, request: Request, next: Next) -> Response {
    if is_health(request.uri().path()) {
        return next.run(request).await;
    }
    let peer = Peer::of_request(&request);
    let asks = request.extensions().get::<MatchedPath>().is_some_and(|route| is_query(route.as_str()));
    let taken = app.held.requests.take(peer, 1).and_then(|request| {
        let query = asks.then(|| app.held.queries.take(peer, 1)).transpose()?;
        Ok((request, query))
    });
    let places = match taken {
        Ok(places) => places,
        Err(full) => {
            linger(request).await;
            return Problem::from(full).into_response();
        }
    };
    let response = peer.on_behalf(next.run(request)).await;
    match share(&app, peer, response.body()) {
        Ok(answer) => response.map(|body| Body::new(Guarded::new(body, Holding { _places: (places, answer) }))),
        Err(full) => Problem::from(full).into_response(),
    }
}

/// Takes the share of answer memory that `body` needs. Only a body held whole in memory knows its size.
fn share(app: &App, peer: Peer, body: &Body) -> Result<Option<Place>, Full> {
    let bytes = body.size_hint().exact().filter(|bytes| *bytes > LARGE);
    bytes.map(|bytes| app.held.answers.take(peer, (bytes as usize).div_ceil(KIB))).transpose()
}

/// Places held by the body of an answer: for the request, for the query, and in the answer memory.
struct Holding {
    _places: ((Place, Option<Place>), Option<Place>),
}

impl Passed for Holding {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_to_materials_are_queries() {
        assert!(is_query("/v1/materials/{id}/evaluate") && is_query("/v1/materials/{id}/preview.png"));
        assert!(!is_query("/v1/materials/{id}") && !is_query("/v1/materials/{id}/content") && !is_query("/v1/jobs"));
    }
}
