//! Single queries by GET: a spectrum, an albedo.

use super::super::extract::{Id, Query};
use super::super::problem::Problem;
use super::super::schemas::{DirectionText, IndexText, WavelengthsText};
use super::super::state::App;
use super::answers::{AlbedoAnswer, SpectrumAnswer};
use super::opened::open;
use super::options::{direction, indices, outgoing, read, wavelengths};
use crate::evaluate::{Beyond, Interpolation, Place};
use crate::store::Digest;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::IntoParams;

/// Query parameters of the evaluation of one spectrum: directions, wavelengths, index and interpolation.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SpectrumQuery {
    /// Incoming direction `θ,φ` in degrees, for physical quantities that have one.
    #[param(value_type = Option<DirectionText>)]
    wi: Option<String>,
    /// Outgoing direction `θ,φ` in degrees, for physical quantities that have one.
    #[param(value_type = Option<DirectionText>)]
    wo: Option<String>,
    /// Azimuth C of the outgoing direction of a luminaire in degrees, with `gamma` instead of `wo` (phi = C).
    c: Option<f64>,
    /// Angle of the outgoing direction of a luminaire from straight down in degrees, with `c` instead of `wo` (theta =
    /// 180° − gamma).
    #[param(minimum = 0, maximum = 180)]
    gamma: Option<f64>,
    /// Wavelengths of the spectrum: `A,B,C` or `START:STOP:STEP` in nm. Default: the material's own.
    #[param(value_type = Option<WavelengthsText>)]
    wavelengths: Option<String>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    /// Interpolation over directions.
    interpolation: Option<Interpolation>,
    /// Rule for values at wavelengths outside the measured range.
    beyond: Option<Beyond>,
}

/// Query parameters of one directional albedo: incoming direction, index and interpolation.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct AlbedoQuery {
    /// Incoming direction `θ,φ` in degrees, for physical quantities that have one.
    #[param(value_type = Option<DirectionText>)]
    wi: Option<String>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    /// Interpolation over directions.
    interpolation: Option<Interpolation>,
}

/// Evaluate one spectrum of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}/spectrum", tag = "evaluation",
    params(("id" = Digest, Path, description = "Id of the material"), SpectrumQuery),
    responses((status = 200, description = "The spectrum", body = SpectrumAnswer))
)]
pub(super) async fn get_spectrum(
    app: App,
    Id(id): Id,
    Query(query): Query<SpectrumQuery>,
) -> Result<Response, Problem> {
    let wi = read(query.wi.as_deref(), |text| direction("wi", text))?;
    let wo = read(query.wo.as_deref(), |text| direction("wo", text))?;
    let wavelengths = read(query.wavelengths.as_deref(), wavelengths)?;
    let index = read(query.index.as_deref(), indices)?.unwrap_or_default();
    let how = query.interpolation.unwrap_or_default();
    let beyond = query.beyond.unwrap_or_default();
    let material = open(&app, id).await?;
    compute(&app, move || {
        let wo = outgoing(wo, (query.c, query.gamma), &material)?;
        let place = Place { index: &index, wi, wo };
        let mut values = vec![0.0; wavelengths.as_ref().map_or_else(|| material.lambdas(), Vec::len)];
        match &wavelengths {
            Some(wavelengths) => material.at_wavelengths(place, how, beyond, wavelengths, &mut values)?,
            None => material.evaluate(place, how, &mut values)?,
        }
        let wavelengths = wavelengths.or_else(|| material.wavelengths());
        let extrapolated = material.is_extrapolated(wi, wo);
        Ok(SpectrumAnswer { wavelengths, values, unit: material.unit(), extrapolated })
    })
    .await
}

/// Integrate one spectrum over all outgoing directions: the directional albedo of a BRDF or BTDF, the flux of an
/// emission.
#[utoipa::path(
    get, path = "/v1/materials/{id}/albedo", tag = "evaluation",
    params(("id" = Digest, Path, description = "Id of the material"), AlbedoQuery),
    responses((status = 200, description = "The albedo", body = AlbedoAnswer))
)]
pub(super) async fn get_albedo(app: App, Id(id): Id, Query(query): Query<AlbedoQuery>) -> Result<Response, Problem> {
    let wi = read(query.wi.as_deref(), |text| direction("wi", text))?;
    let index = read(query.index.as_deref(), indices)?.unwrap_or_default();
    let how = query.interpolation.unwrap_or_default();
    let material = open(&app, id).await?;
    compute(&app, move || {
        let mut values = vec![0.0; material.lambdas()];
        material.albedo(&index, wi, how, &mut values)?;
        let extrapolated = material.is_extrapolated(wi, None);
        Ok(AlbedoAnswer { wavelengths: material.wavelengths(), values, extrapolated })
    })
    .await
}

/// Computes an answer and encodes it as JSON, both on the thread pool of queries.
pub(in crate::api) async fn compute<T: Serialize>(
    app: &App,
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let json = app.engine.queries.run(move || {
        let answer = work()?;
        serde_json::to_vec(&answer).map_err(|error| Problem::internal(&error))
    });
    Ok(json_response(json.await??))
}

pub(super) fn json_response(json: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], json).into_response()
}
