//! `/v1/formats` and `/v1/bases`: what is known here.

use super::state::App;
use crate::transform::BasisInfo;
use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(formats)).routes(routes!(bases))
}

/// A format.
#[derive(Debug, Serialize, ToSchema)]
struct Format {
    name: &'static str,
    description: &'static str,
    /// Usual file extensions; only hints.
    extensions: Vec<&'static str>,
    reads: bool,
    writes: bool,
}

/// The formats that are recognised, in the order they are probed.
#[utoipa::path(
    get, path = "/v1/formats", tag = "known",
    responses((status = 200, description = "The formats", body = Vec<Format>))
)]
async fn formats() -> Json<Vec<Format>> {
    let known = crate::formats::formats().into_iter().map(|format| Format {
        name: format.name,
        description: format.description,
        extensions: format.extensions.to_vec(),
        reads: format.reads,
        writes: format.writes,
    });
    Json(known.collect())
}

/// The wavelet bases.
#[utoipa::path(
    get, path = "/v1/bases", tag = "known",
    responses((status = 200, description = "The bases", body = Vec<serde_json::Value>))
)]
async fn bases() -> Json<Vec<BasisInfo>> {
    Json(crate::transform::bases())
}
