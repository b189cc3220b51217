//! The router: every route as a table of contents, and the description generated from it.

use super::state::{App, Service};
use super::{description, layers};
use axum::Router;
use std::sync::LazyLock;
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
        .merge(super::physics::routes())
        .merge(super::preview::routes())
        .merge(super::export::routes())
        .merge(super::tenants::routes())
        .merge(super::known::routes())
        .merge(super::keys::routes())
        .merge(super::audit::routes())
}

/// Builds the handlers of the HTTP routes, without the steps that [`Front`](super::front::Front) puts around them.
pub(super) fn router(app: App) -> Router {
    let (router, _) = routes().split_for_parts();
    router.fallback(layers::no_route).method_not_allowed_fallback(layers::no_method).with_state(Service::new(app))
}

/// Returns the OpenAPI description of every route as JSON, which is the same for as long as the process runs and is
/// written when it is asked for first.
pub(super) fn openapi_json() -> &'static Result<String, serde_json::Error> {
    static JSON: LazyLock<Result<String, serde_json::Error>> = LazyLock::new(|| openapi().to_json());
    &JSON
}

/// Returns the OpenAPI description of every route, generated from the router.
pub fn openapi() -> OpenApi {
    description::complete(routes().into_openapi())
}
