//! HTTP: translation only; one file a resource, one place that maps errors to problems.

mod color;
mod content;
mod events;
mod export;
mod extract;
mod jobs;
mod known;
mod layers;
mod materials;
mod measurements;
mod patient;
mod preview;
mod problem;
mod query;
mod root;
mod server;
mod state;
mod upload;

pub use server::{ServeConfig, ServeError, Server, serve};

use axum::Router;
use state::App;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::request_id::{PropagateRequestIdLayer, SetRequestIdLayer};
use utoipa::openapi::{ContentBuilder, InfoBuilder, OpenApi, OpenApiBuilder, Ref, RefOr, ResponseBuilder};
use utoipa::{PartialSchema, ToSchema};
use utoipa_axum::router::OpenApiRouter;

/// Every route, as a table of contents.
fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(OpenApiBuilder::new().info(info()).build())
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

/// The routes with everything around them. Layers below run first.
fn router(app: App) -> Router {
    let (router, _) = routes().split_for_parts();
    router
        .fallback(layers::no_route)
        .method_not_allowed_fallback(layers::no_method)
        .with_state(app)
        .layer(axum::extract::DefaultBodyLimit::disable())
        .layer(axum::middleware::from_fn(layers::same_origin_writes))
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(axum::middleware::from_fn(layers::harden))
        .layer(layers::cors())
        .layer(axum::middleware::from_fn(layers::observe))
        .layer(PropagateRequestIdLayer::new(layers::REQUEST_ID))
        .layer(SetRequestIdLayer::new(layers::REQUEST_ID, layers::Ids))
}

/// The description of every route, generated from the router.
pub fn openapi() -> OpenApi {
    let mut openapi = routes().into_openapi();
    // Whatever goes wrong is a problem, everywhere.
    let name = problem::ProblemBody::name();
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name(name.clone()))).build();
    let problem = ResponseBuilder::new().description("A problem").content("application/problem+json", content).build();
    for path in openapi.paths.paths.values_mut() {
        let operations = [&mut path.get, &mut path.post, &mut path.delete];
        for operation in operations.into_iter().flatten() {
            operation.responses.responses.insert("default".to_owned(), RefOr::T(problem.clone()));
        }
    }
    let components = openapi.components.get_or_insert_default();
    components.schemas.insert(name.into_owned(), problem::ProblemBody::schema());
    openapi
}

fn info() -> utoipa::openapi::Info {
    InfoBuilder::new()
        .title("wavelume")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(
            "Acquired radiometric measurements, compressed with generic wavelet transforms to a promised error. \
             Angles are degrees, wavelengths nm, digests `b3-<64 hex>` (BLAKE3); errors are RFC 9457 problems.",
        ))
        .build()
}
