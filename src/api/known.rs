//! `/v1/formats`, their templates and `/v1/bases`: the known file formats and wavelet bases.

use super::extract::Name;
use super::problem::{Kind, Problem};
use super::state::Service;
use crate::formats::ArrayManifest;
use crate::transform::BasisInfo;
use axum::Json;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of the lists of file formats and wavelet bases.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(list_formats)).routes(routes!(get_template)).routes(routes!(list_bases))
}

/// A file format that can be read or written.
#[derive(Debug, Serialize, ToSchema)]
struct Format {
    name: &'static str,
    description: &'static str,
    /// Usual file extensions of the format; only hints, because formats are recognised by content.
    extensions: Vec<&'static str>,
    reads: bool,
    writes: bool,
}

/// List the recognised file formats, in the order in which they are probed.
#[utoipa::path(
    get, path = "/v1/formats", tag = "known",
    responses((status = 200, description = "The formats", body = Vec<Format>))
)]
async fn list_formats() -> Json<Vec<Format>> {
    let known = crate::formats::formats().into_iter().map(|format| Format {
        name: format.name,
        description: format.description,
        extensions: format.extensions.to_vec(),
        reads: format.reads,
        writes: format.writes,
    });
    Json(known.collect())
}

/// Get a template file of a format to fill in, which is valid without changes: `radiometric-csv-long`,
/// `radiometric-csv-wide`, `npy-manifest`, `phase-table`, or the script `radiometric-arrow-python`. The name of a
/// format selects its first template.
#[utoipa::path(
    get, path = "/v1/formats/{name}/template", tag = "known",
    params(("name" = String, Path, description = "Name of a template or of a format")),
    responses((status = 200, description = "The template", content(
        (String = "text/csv"), (ArrayManifest = "application/json"), (String = "text/x-python"), (String = "text/plain")
    )))
)]
async fn get_template(Name(name): Name) -> Result<Response, Problem> {
    let template = crate::formats::template(&name).ok_or_else(|| {
        let known: Vec<&str> = crate::formats::TEMPLATES.iter().map(|template| template.name).collect();
        Problem::new(Kind::NotFound, format!("there is no such template, expected one of {}", known.join(", ")))
    })?;
    Ok(([(CONTENT_TYPE, template.media_type)], template.text).into_response())
}

/// List the wavelet bases.
#[utoipa::path(
    get, path = "/v1/bases", tag = "known",
    responses((status = 200, description = "The bases", body = Vec<BasisInfo>))
)]
async fn list_bases() -> Json<Vec<BasisInfo>> {
    Json(crate::transform::bases())
}
