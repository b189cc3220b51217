//! `/v1/materials/{id}/physics`: energy, flux and reciprocity of a material, and the figures of its trade.

use super::extract::Id;
use super::problem::Problem;
use super::query::{compute, open};
use super::state::{App, Service};
use crate::pipeline::PhysicsReport;
use crate::store::Digest;
use axum::response::Response;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of the physical reports on materials.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(physics))
}

/// Check the physics of a material (energy, flux, reciprocity), and compute the figures of its trade.
#[utoipa::path(
    get, path = "/v1/materials/{id}/physics", tag = "evaluation",
    params(("id" = Digest, Path, description = "Id of the material")),
    responses((status = 200, description = "The report", body = PhysicsReport))
)]
async fn physics(app: App, Id(id): Id) -> Result<Response, Problem> {
    let material = open(&app, id).await?;
    compute(&app, move || Ok(PhysicsReport::of(&material)?)).await
}
