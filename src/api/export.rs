//! `/v1/materials/{id}/export`: a material in a format that others read.

use super::extract::{Id, Query};
use super::materials::absent;
use super::problem::{Kind, Problem};
use super::state::App;
use crate::formats::{manifest_of, write_npy};
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(export))
}

/// Which format.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ExportQuery {
    /// `npy`: the dense float32 tensor, NaN = masked; `manifest`: its axes.
    format: String,
}

/// A material in another format.
#[utoipa::path(
    get, path = "/v1/materials/{id}/export", tag = "materials",
    params(("id" = String, Path, description = "The material"), ExportQuery),
    responses((status = 200, description = "The file", content(
        (String = "application/octet-stream"), (serde_json::Value = "application/json"),
    )))
)]
async fn export(State(app): State<App>, Id(id): Id, Query(query): Query<ExportQuery>) -> Result<Response, Problem> {
    let json = match query.format.as_str() {
        "npy" => false,
        "manifest" => true,
        other => {
            let shown: String = other.chars().take(40).collect();
            let detail = format!("format: `{shown}` is not available yet, expected npy or manifest");
            return Err(Problem::new(Kind::NotAvailable, detail));
        }
    };
    if app.engine.archive.catalog.material(id).await?.is_none() {
        return Err(Problem::new(Kind::NotFound, absent(id)));
    }
    let measurement = app.engine.decoded(id).await.map_err(|error| Problem::from(&error))?.measurement;
    let (bytes, media_type, extension) = app
        .engine
        .queries
        .run(move || {
            if json {
                (manifest_of(&measurement).to_string().into_bytes(), "application/json", "axes.json")
            } else {
                let tensor = &measurement.tensor;
                (write_npy(&tensor.shape(), tensor.samples()), "application/octet-stream", "npy")
            }
        })
        .await?;
    let name = format!("attachment; filename=\"{}.{extension}\"", &id.to_string()[..15]);
    let mut response = ([(header::CONTENT_TYPE, HeaderValue::from_static(media_type))], bytes).into_response();
    response.headers_mut().extend(HeaderValue::from_str(&name).ok().map(|v| (header::CONTENT_DISPOSITION, v)));
    Ok(response)
}
