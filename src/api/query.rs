//! `/v1/materials/{id}/spectrum`, `evaluate`, `pdf`, `sample`: questions to an opened material, in degrees and JSON.

use super::extract::{Id, JsonBytes, Query, parse_json};
use super::materials::absent;
use super::problem::{Kind, Problem};
use super::state::App;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Direction, Unit, WavelengthGrid};
use crate::evaluate::{Beyond, Interpolation, Material, Place};
use crate::store::Digest;
use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize, Serializer};
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(get_spectrum))
        .routes(routes!(evaluate))
        .routes(routes!(pdf))
        .routes(routes!(sample))
}

/// Where to look, once.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct SpectrumQuery {
    /// The incoming direction `θ,φ` in degrees, for quantities that have one.
    wi: Option<String>,
    /// The outgoing direction `θ,φ` in degrees, for quantities that have one.
    wo: Option<String>,
    /// `A,B,C` or `START:STOP:STEP` in nm; the material's own if nothing is said.
    wavelengths: Option<String>,
    /// One entry, from 0, for each leading index axis: `I,J`.
    index: Option<String>,
    /// `smooth` (the default) or `constant`.
    interpolation: Option<How>,
}

/// How samples become a function of direction.
#[derive(Clone, Copy, Debug, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Interpolation)]
enum How {
    Constant,
    #[default]
    Smooth,
}

/// Pairs of directions in degrees `[θ, φ]`; a list of one is used with every entry of the other.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct EvaluateRequest {
    /// Incoming, for quantities that have one.
    #[serde(default)]
    wi: Option<Vec<[f64; 2]>>,
    /// Outgoing, for quantities that have one.
    #[serde(default)]
    wo: Option<Vec<[f64; 2]>>,
    /// In nm; the material's own if nothing is said.
    #[serde(default)]
    wavelengths: Option<Vec<f64>>,
    /// `smooth` (the default) or `constant`.
    #[serde(default)]
    interpolation: How,
    /// One entry, from 0, for each leading index axis.
    #[serde(default)]
    index: Vec<usize>,
}

/// Pairs of directions in degrees `[θ, φ]`; a list of one is used with every entry of the other.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct PdfRequest {
    /// Incoming, for quantities that have one.
    #[serde(default)]
    wi: Option<Vec<[f64; 2]>>,
    /// Outgoing.
    wo: Vec<[f64; 2]>,
    /// The subdivision level at which directions are drawn; the material's own if nothing is said.
    #[serde(default)]
    level: Option<u8>,
    /// One entry, from 0, for each leading index axis.
    #[serde(default)]
    index: Vec<usize>,
}

/// How many directions to draw.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct SampleRequest {
    /// The incoming direction `[θ, φ]` in degrees, for quantities that have one.
    #[serde(default)]
    wi: Option<[f64; 2]>,
    /// How many.
    #[serde(default = "one")]
    count: usize,
    /// The same seed gives the same directions anywhere.
    #[serde(default)]
    seed: u64,
    /// Stop the descent at this subdivision level.
    #[serde(default)]
    level: Option<u8>,
    /// One entry, from 0, for each leading index axis.
    #[serde(default)]
    index: Vec<usize>,
}

fn one() -> usize {
    1
}

/// One spectrum.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Spectrum)]
struct SpectrumAnswer {
    /// In nm; null for data without wavelengths.
    wavelengths: Option<Vec<f64>>,
    /// One a wavelength; null where masked.
    #[schema(value_type = Vec<Option<f32>>)]
    values: Vec<f32>,
    #[schema(value_type = String)]
    unit: Unit,
}

/// One spectrum a pair.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Spectra)]
struct EvaluateAnswer {
    /// In nm; null for data without wavelengths.
    wavelengths: Option<Vec<f64>>,
    /// `[pair][wavelength]`; null where masked.
    #[schema(value_type = Vec<Vec<Option<f32>>>)]
    values: Rows,
    #[schema(value_type = String)]
    unit: Unit,
}

/// One density a pair.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Densities)]
struct PdfAnswer {
    /// In sr⁻¹.
    pdf: Vec<f64>,
}

/// Parallel arrays.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Samples)]
struct SampleAnswer {
    /// `[θ, φ]` in degrees; null where nothing is emitted or reflected.
    directions: Vec<Option<[f64; 2]>>,
    /// In sr⁻¹.
    pdf: Vec<f64>,
    /// f · |cos θo| / pdf for a BRDF or BTDF, f / pdf otherwise; f is the mean over wavelengths.
    weight: Vec<f64>,
}

/// Flat values, written row by row.
#[derive(Debug)]
struct Rows {
    values: Vec<f32>,
    width: usize,
}

impl Serialize for Rows {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // JSON has no NaN: masked values are written as null.
        serializer.collect_seq(self.values.chunks(self.width.max(1)))
    }
}

/// One spectrum.
#[utoipa::path(
    get, path = "/v1/materials/{id}/spectrum", tag = "evaluation",
    params(("id" = String, Path, description = "The material"), SpectrumQuery),
    responses((status = 200, description = "The spectrum", body = SpectrumAnswer))
)]
async fn get_spectrum(
    State(app): State<App>,
    Id(id): Id,
    Query(query): Query<SpectrumQuery>,
) -> Result<Response, Problem> {
    let bad = |detail: String| Problem::new(Kind::BadQuery, detail);
    let wi = query.wi.as_deref().map(|text| angles("wi", text)).transpose().map_err(bad)?;
    let wo = query.wo.as_deref().map(|text| angles("wo", text)).transpose().map_err(bad)?;
    let wavelengths = query.wavelengths.as_deref().map(wavelengths).transpose().map_err(bad)?;
    let index = query.index.as_deref().map_or(Ok(Vec::new()), indices).map_err(bad)?;
    let how = query.interpolation.unwrap_or_default();
    let material = open(&app, id).await?;
    compute(&app, move |_| {
        let mut values = vec![0.0; width(&material, wavelengths.as_deref())];
        let place = Place { index: &index, wi, wo };
        look(&material, place, how, wavelengths.as_deref(), &mut values)?;
        let wavelengths = wavelengths.or_else(|| material.wavelengths());
        Ok(SpectrumAnswer { wavelengths, values, unit: material.unit() })
    })
    .await
}

/// Spectra for pairs of directions.
#[utoipa::path(
    post, path = "/v1/materials/{id}/evaluate", tag = "evaluation", request_body = EvaluateRequest,
    params(("id" = String, Path, description = "The material")),
    responses((status = 200, description = "The spectra", body = EvaluateAnswer))
)]
async fn evaluate(State(app): State<App>, Id(id): Id, body: JsonBytes) -> Result<Response, Problem> {
    let material = open(&app, id).await?;
    compute(&app, move |limits| {
        let request: EvaluateRequest = parse_json(&body.bytes)?;
        let pairs = pairs(request.wi.as_deref(), request.wo.as_deref(), limits.batch)?;
        if let Some(values) = &request.wavelengths {
            check_wavelengths(values).map_err(invalid)?;
        }
        let asked = request.wavelengths.as_deref();
        let width = width(&material, asked);
        if pairs.len().saturating_mul(width) > limits.values {
            return Err(invalid(format!(
                "{} pairs of {width} wavelengths, expected at most {} values in one answer",
                pairs.len(),
                limits.values
            )));
        }
        let mut values = vec![0.0; pairs.len() * width];
        values.par_chunks_mut(width.max(1)).zip(&pairs).try_for_each(|(row, &(wi, wo))| {
            look(&material, Place { index: &request.index, wi, wo }, request.interpolation, asked, row)
        })?;
        let wavelengths = request.wavelengths.or_else(|| material.wavelengths());
        Ok(EvaluateAnswer { wavelengths, values: Rows { values, width }, unit: material.unit() })
    })
    .await
}

/// The densities with which `sample` draws directions.
#[utoipa::path(
    post, path = "/v1/materials/{id}/pdf", tag = "evaluation", request_body = PdfRequest,
    params(("id" = String, Path, description = "The material")),
    responses((status = 200, description = "The densities", body = PdfAnswer))
)]
async fn pdf(State(app): State<App>, Id(id): Id, body: JsonBytes) -> Result<Response, Problem> {
    let material = open(&app, id).await?;
    compute(&app, move |limits| {
        let request: PdfRequest = parse_json(&body.bytes)?;
        let pairs = pairs(request.wi.as_deref(), Some(&request.wo), limits.batch)?;
        let density = |&(wi, wo): &(Option<Direction>, Option<Direction>)| {
            let wo = wo.ok_or_else(|| invalid("wo: expected outgoing directions".to_owned()))?;
            Ok::<_, Problem>(material.pdf(&request.index, wi, wo, request.level)?)
        };
        Ok(PdfAnswer { pdf: pairs.par_iter().map(density).collect::<Result<_, _>>()? })
    })
    .await
}

/// Directions drawn in proportion to what the material sends there.
#[utoipa::path(
    post, path = "/v1/materials/{id}/sample", tag = "evaluation", request_body = SampleRequest,
    params(("id" = String, Path, description = "The material")),
    responses((status = 200, description = "The directions", body = SampleAnswer))
)]
async fn sample(State(app): State<App>, Id(id): Id, body: JsonBytes) -> Result<Response, Problem> {
    let material = open(&app, id).await?;
    compute(&app, move |limits| {
        let request: SampleRequest = parse_json(&body.bytes)?;
        if request.count == 0 || request.count > limits.batch {
            return Err(invalid(format!("count: found {}, expected 1 to {}", request.count, limits.batch)));
        }
        let wi = request.wi.map(|angles| direction("wi", angles)).transpose().map_err(invalid)?;
        let mut random = Pcg64Mcg::seed_from_u64(request.seed);
        let mut answer = SampleAnswer { directions: Vec::new(), pdf: Vec::new(), weight: Vec::new() };
        for _ in 0..request.count {
            let u = [uniform(&mut random), uniform(&mut random)];
            let drawn = material.sample(&request.index, wi, u, request.level)?;
            answer.directions.push(drawn.map(|s| [s.direction.theta_degrees(), s.direction.phi_degrees()]));
            answer.pdf.push(drawn.map_or(0.0, |s| s.pdf));
            answer.weight.push(drawn.map_or(0.0, |s| s.weight));
        }
        Ok(answer)
    })
    .await
}

/// The opened material; the catalog is asked only when it is not open.
pub(super) async fn open(app: &App, id: Digest) -> Result<Arc<Material>, Problem> {
    if let Some(material) = app.engine.opened(id).await {
        return Ok(material);
    }
    if app.engine.archive.catalog.material(id).await?.is_none() {
        return Err(Problem::new(Kind::NotFound, absent(id)));
    }
    app.engine.material(id).await.map_err(|error| Problem::from(&*error))
}

/// Computes an answer and writes its JSON where the maths run.
pub(super) async fn compute<T: Serialize>(
    app: &App,
    work: impl FnOnce(&crate::jobs::Limits) -> Result<T, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let engine = Arc::clone(&app.engine);
    let json = app.engine.queries.run(move || {
        let answer = work(&engine.limits)?;
        serde_json::to_vec(&answer).map_err(|error| Problem::internal(&error))
    });
    let json = json.await??;
    Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], json).into_response())
}

fn look(
    material: &Material,
    place: Place<'_>,
    how: How,
    wavelengths: Option<&[f64]>,
    out: &mut [f32],
) -> Result<(), Problem> {
    let how = match how {
        How::Constant => Interpolation::Constant,
        How::Smooth => Interpolation::Smooth,
    };
    match wavelengths {
        Some(wavelengths) => material.at_wavelengths(place, how, Beyond::Masked, wavelengths, out)?,
        None => material.spectrum(place, how, out)?,
    }
    Ok(())
}

fn width(material: &Material, wavelengths: Option<&[f64]>) -> usize {
    wavelengths.map_or_else(|| material.lambdas(), <[f64]>::len)
}

type Pair = (Option<Direction>, Option<Direction>);

/// Lists of directions side by side; without any list there is one place, which has no direction.
fn pairs(wi: Option<&[[f64; 2]]>, wo: Option<&[[f64; 2]]>, most: usize) -> Result<Vec<Pair>, Problem> {
    let count = match (wi.map(<[_]>::len), wo.map(<[_]>::len)) {
        (None, None) => 1,
        (Some(n), None) | (None, Some(n)) => n,
        (Some(a), Some(b)) if a == b || b == 1 => a,
        (Some(1), Some(b)) => b,
        (Some(a), Some(b)) => {
            return Err(invalid(format!("{a} directions in wi and {b} in wo, expected as many, or one of them")));
        }
    };
    if count == 0 || count > most {
        return Err(invalid(format!("{count} directions, expected 1 to {most}")));
    }
    let at = |what, list: Option<&[[f64; 2]]>, i: usize| {
        list.map(|list| direction(what, list[if list.len() == 1 { 0 } else { i }])).transpose().map_err(invalid)
    };
    (0..count).into_par_iter().map(|i| Ok((at("wi", wi, i)?, at("wo", wo, i)?))).collect()
}

fn invalid(detail: String) -> Problem {
    Problem::new(Kind::InvalidRequest, detail)
}

fn direction(what: &str, [theta, phi]: [f64; 2]) -> Result<Direction, String> {
    if (0.0..=180.0).contains(&theta) && phi.is_finite() {
        Ok(Direction::from_degrees(theta, phi))
    } else {
        Err(format!("{what}: found [{theta}, {phi}], expected [theta, phi] in degrees with theta from 0 to 180"))
    }
}

pub(super) fn angles(what: &str, text: &str) -> Result<Direction, String> {
    let refused = || {
        let shown: String = text.chars().take(80).collect();
        format!("{what}: found `{shown}`, expected THETA,PHI in degrees with THETA from 0 to 180")
    };
    let angles: Vec<f64> = numbers(text).ok_or_else(refused)?;
    let &[theta, phi] = angles.as_slice() else { return Err(refused()) };
    direction(what, [theta, phi])
}

fn wavelengths(text: &str) -> Result<Vec<f64>, String> {
    if text.contains(':') {
        return WavelengthGrid::parse_range(text).map(|grid| grid.values()).map_err(|e| format!("wavelengths: {e}"));
    }
    let refused = || "wavelengths: expected A,B,C or START:STOP:STEP in nm".to_owned();
    let values = numbers(text).ok_or_else(refused)?;
    check_wavelengths(&values)?;
    Ok(values)
}

fn check_wavelengths(values: &[f64]) -> Result<(), String> {
    if values.is_empty() || values.len() > MAX_WAVELENGTHS {
        return Err(format!("wavelengths: found {}, expected 1 to {MAX_WAVELENGTHS}", values.len()));
    }
    match values.iter().find(|v| !(v.is_finite() && **v > 0.0)) {
        Some(bad) => Err(format!("wavelengths: found {bad}, expected positive numbers of nm")),
        None => Ok(()),
    }
}

pub(super) fn indices(text: &str) -> Result<Vec<usize>, String> {
    numbers(text).ok_or_else(|| "index: expected numbers from 0 with commas between them".to_owned())
}

fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split(',').map(|part| part.trim().parse().ok()).collect()
}

/// A number from [0, 1) with 53 random bits, as the command line draws them.
fn uniform(random: &mut Pcg64Mcg) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_directions_pair_up() {
        let (two, three) = ([[0.0, 0.0], [30.0, 90.0]], [[0.0, 0.0]; 3]);
        assert_eq!(pairs(Some(&two), Some(&two), 9).unwrap().len(), 2);
        assert_eq!(pairs(Some(&two[..1]), Some(&three), 9).unwrap().len(), 3);
        assert_eq!(pairs(None, None, 9).unwrap(), [(None, None)]);
        assert!(pairs(Some(&two), Some(&three), 9).is_err());
        assert!(pairs(Some(&[]), None, 9).is_err() && pairs(Some(&three), None, 2).is_err());
        assert!(pairs(None, Some(&[[200.0, 0.0]]), 9).is_err());
    }

    #[test]
    fn texts_of_queries_are_checked() {
        assert!(angles("wi", "30,90").is_ok() && angles("wi", " 30 , -90 ").is_ok());
        for bad in ["", "30", "30,90,1", "x,y", "-1,0", "nan,0", "0,inf"] {
            assert!(angles("wi", bad).unwrap_err().contains("expected"), "{bad}");
        }
        assert_eq!(wavelengths("400:420:10").unwrap(), [400.0, 410.0, 420.0]);
        assert_eq!(wavelengths("550,400").unwrap(), [550.0, 400.0]);
        for bad in ["", "0", "-5", "nan", "400:", "1:1e12:1"] {
            assert!(wavelengths(bad).is_err(), "{bad}");
        }
        assert_eq!(indices("3,0").unwrap(), [3, 0]);
        assert!(indices("-1").is_err());
    }

    #[test]
    fn masked_values_are_null() {
        let rows = Rows { values: vec![1.0, f32::NAN, 0.5, 0.25], width: 2 };
        assert_eq!(serde_json::to_string(&rows).unwrap(), "[[1.0,null],[0.5,0.25]]");
    }
}
