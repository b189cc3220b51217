//! The router: every route as a table of contents, the layers around it, and the description generated from it.

use super::state::{App, Service};
use super::{admit, authorise, description, layers};
use axum::Router;
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::openapi::{OpenApi, OpenApiBuilder};
use utoipa_axum::router::OpenApiRouter;

/// Returns every HTTP route of the service, grouped by resource.
fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::with_openapi(OpenApiBuilder::new().info(description::info()).build())
        .merge(super::root::routes())
        .merge(super::measurements::routes())
        .merge(super::resumable::routes())
        .merge(super::jobs::routes())
        .merge(super::materials::routes())
        .merge(super::material_upload::routes())
        .merge(super::query::routes())
        .merge(super::color::routes())
        .merge(super::preview::routes())
        .merge(super::export::routes())
        .merge(super::tenants::routes())
        .merge(super::known::routes())
        .merge(super::keys::routes())
        .merge(super::audit::routes())
}

/// Builds the HTTP routes with the middleware around them. Middleware that is added later runs first.
pub(super) fn router(app: App) -> Router {
    let (router, _) = routes().split_for_parts();
    let access = Arc::clone(&app.access);
    router
        .fallback(layers::no_route)
        .method_not_allowed_fallback(layers::no_method)
        .with_state(Service::new(app.clone()))
        .layer(axum::middleware::from_fn_with_state(app.clone(), admit::admit))
        .layer(axum::middleware::from_fn_with_state(app, authorise::authorise))
        .layer(axum::extract::DefaultBodyLimit::disable())
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(axum::middleware::from_fn_with_state(access, layers::outermost))
}

/// Returns the OpenAPI description of every route, generated from the router.
pub fn openapi() -> OpenApi {
    description::complete(routes().into_openapi())
}
