//! The front of the service: the steps that every request passes before its handler, and its answer after it.

use super::route::Routes;
use super::router::router;
use super::state::App;
use super::{admit, authorise, layers};
use axum::Router;
use axum::extract::Request;
use axum::response::{IntoResponse, Response};
use futures::FutureExt;
use std::panic::AssertUnwindSafe;
use tower::ServiceExt;

/// Request handlers of the service, with the steps that every request passes before its handler. The steps are calls,
/// not layers of axum: for each request, a layer there copies all that is below it and allocates its future.
pub(crate) struct Front {
    app: App,
    router: Router,
    routes: Routes,
}

impl Front {
    pub(crate) fn new(app: App) -> Self {
        Self { router: router(app.clone()), app, routes: Routes::new() }
    }

    /// Answers a request: records it, checks host and origin, identifies the caller, admits the request, and calls the
    /// handler of its route. A panic after the check of host and origin becomes an answer with status 500.
    pub(crate) async fn answer(&self, mut request: Request) -> Response {
        if let Some(route) = self.routes.at(request.uri().path()) {
            request.extensions_mut().insert(route);
        }
        let handled = async |request| self.router.clone().oneshot(request).await.into_response();
        let admitted = |request| admit::admit(&self.app, request, handled);
        let authorised = |request| authorise::authorise(&self.app, request, admitted);
        let caught =
            async |request| AssertUnwindSafe(authorised(request)).catch_unwind().await.unwrap_or_else(layers::panicked);
        layers::outermost(&self.app, request, caught).await
    }
}
