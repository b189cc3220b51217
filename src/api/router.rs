//! The router: every route as a table of contents, the layers around it, and the description generated from it.

use super::state::App;
use super::{admit, color, description, export, jobs, known, layers, materials, measurements, preview, query, root};
use axum::Router;
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::openapi::{OpenApi, OpenApiBuilder};
use utoipa_axum::router::OpenApiRouter;

/// Every route, as a table of contents.
fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(OpenApiBuilder::new().info(description::info()).build())
        .merge(root::routes())
        .merge(measurements::routes())
        .merge(jobs::routes())
        .merge(materials::routes())
        .merge(query::routes())
        .merge(color::routes())
        .merge(preview::routes())
        .merge(export::routes())
        .merge(known::routes())
}

/// Builds the routes with the layers around them. Layers below run first.
pub(super) fn router(app: App) -> Router {
    let (router, _) = routes().split_for_parts();
    let access = Arc::clone(&app.access);
    router
        .fallback(layers::no_route)
        .method_not_allowed_fallback(layers::no_method)
        .with_state(app.clone())
        .layer(axum::middleware::from_fn_with_state(app, admit::admit))
        .layer(axum::extract::DefaultBodyLimit::disable())
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(axum::middleware::from_fn_with_state(access, layers::hosts_and_origins))
        .layer(axum::middleware::from_fn(layers::harden))
        .layer(axum::middleware::from_fn(layers::observe))
}

/// The description of every route, generated from the router.
pub fn openapi() -> OpenApi {
    description::complete(routes().into_openapi())
}
