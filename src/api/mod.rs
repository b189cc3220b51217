//! HTTP: translation only; one file a resource, one place that maps errors to problems.

mod server;

pub use server::{ServeConfig, ServeError, Server, serve};

/// The description of every route, generated from the router.
pub fn openapi() -> utoipa::openapi::OpenApi {
    unimplemented!()
}
