//! Admission: each request holds a place until the last byte of its answer is sent.

use super::body::{Guarded, Passed};
use super::caller::{Caller, client};
use super::extract::linger;
use super::places::{Full, KIB, Place};
use super::problem::Problem;
use super::route::Route;
use super::state::App;
use crate::jobs::Client;
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::response::{IntoResponse, Response};

/// Size in bytes above which an in-memory response counts towards the memory limit for responses. Raising it leaves
/// more responses uncounted.
const LARGE: u64 = 64 << 10;

/// Returns true for the paths of health checks, which answer even when the limit of simultaneous requests is reached.
pub(crate) fn is_health(path: &str) -> bool {
    matches!(path, "/healthz" | "/readyz")
}

/// Returns true for routes that compute on a material. Such a request counts towards the limit of simultaneous queries,
/// too.
fn is_query(route: &str) -> bool {
    let Some(question) = route.strip_prefix("/v1/materials/{id}/") else { return false };
    !matches!(question, "content" | "export")
}

/// Step that admits a request to the steps `next` if its tenant has not used up its requests per minute, and its client
/// is below its limits of simultaneous requests. The request counts as under way until its response is sent or dropped.
pub(crate) async fn admit<F: Future<Output = Response>>(
    app: &App,
    request: Request,
    next: impl FnOnce(Request) -> F,
) -> Response {
    if is_health(request.uri().path()) {
        return next(request).await;
    }
    let caller = request.extensions().get::<Caller>();
    let client = client(request.extensions());
    let tenant = caller.filter(|caller| caller.actor.key().is_some()).map(|caller| caller.tenant.clone());
    if let Some(tenant) = tenant
        && let Err(problem) = app.rates.take(&app.engine.archive.catalog, &tenant).await
    {
        linger(request).await;
        return problem.into_response();
    }
    let asks = Route::of(request.extensions()).is_some_and(is_query);
    let taken = app.held.requests.take(client.clone(), 1).and_then(|request| {
        let query = asks.then(|| app.held.queries.take(client.clone(), 1)).transpose()?;
        Ok((request, query))
    });
    let places = match taken {
        Ok(places) => places,
        Err(full) => {
            linger(request).await;
            return Problem::from(full).into_response();
        }
    };
    let response = client.clone().on_behalf(next(request)).await;
    match share(app, client, response.body()) {
        Ok(answer) => response.map(|body| Body::new(Guarded::new(body, Holding { _places: (places, answer) }))),
        Err(full) => Problem::from(full).into_response(),
    }
}

/// Reserves the response memory that `body` needs. Only a body held whole in memory has a known size.
fn share(app: &App, client: Client, body: &Body) -> Result<Option<Place>, Full> {
    let bytes = body.size_hint().exact().filter(|bytes| *bytes > LARGE);
    bytes.map(|bytes| app.held.answers.take(client, (bytes as usize).div_ceil(KIB))).transpose()
}

/// Places that a response occupies, until its body is sent, in three limits of the service: on simultaneous requests,
/// on simultaneous queries, and on memory for responses.
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
