//! Batches by POST: their requests, and the three encodings of their bodies.

use super::super::caller::client;
use super::super::extract::{Id, JsonBytes, Query, declared_length, linger, parse_json};
use super::super::problem::{Kind, Problem};
use super::super::schemas::{Angles, Binary, Lines, LuminaireAngles, OneOrMoreAngles};
use super::super::state::App;
use super::answers::{AlbedosAnswer, EvaluateAnswer, PdfAnswer, SampleAnswer};
use super::blocks::{Cutter, Source, cut_off};
use super::media::Encoding;
use super::one::json_response;
use super::opened::open;
use super::options::{
    AlbedoOptions, EvaluateOptions, PdfOptions, SampleOptions, check_wavelengths, indices, read, wavelengths,
};
use super::places::{Line, Outgoing, Places};
use super::question::Question;
use super::read_ahead::ReadAhead;
use super::stream::{stream, whole};
use crate::evaluate::{Beyond, Interpolation};
use crate::store::Digest;
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use axum::response::Response;
use serde::Deserialize;
use std::sync::Arc;
use utoipa::ToSchema;

/// Pairs of directions for which spectra are evaluated, in degrees `[θ, φ]`. A list of one direction is combined with
/// every direction of the other list.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct EvaluateRequest {
    /// Incoming directions, for physical quantities that have them.
    #[serde(default)]
    #[schema(value_type = Option<Vec<Angles>>)]
    wi: Option<Vec<[f64; 2]>>,
    /// Outgoing directions, for physical quantities that have them.
    #[serde(default)]
    #[schema(value_type = Option<Vec<Angles>>)]
    wo: Option<Vec<[f64; 2]>>,
    /// Outgoing directions of a luminaire as `[C, gamma]`, instead of `wo`: theta = 180° − gamma, phi = C.
    #[serde(default)]
    #[schema(value_type = Option<Vec<LuminaireAngles>>)]
    c_gamma: Option<Vec<[f64; 2]>>,
    /// Wavelengths of the spectra in nm. Default: the material's own.
    #[serde(default)]
    wavelengths: Option<Vec<f64>>,
    /// Interpolation over directions.
    #[serde(default)]
    interpolation: Interpolation,
    /// Rule for values at wavelengths outside the measured range.
    #[serde(default)]
    beyond: Beyond,
    /// Zero-based position on each index axis (tensor axis before the directions).
    #[serde(default)]
    index: Vec<usize>,
}

/// Request for sampling densities at pairs of directions. Incoming and outgoing directions are two lists of `[θ, φ]` in
/// degrees; a list of one direction is combined with every direction of the other list.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct PdfRequest {
    /// Incoming directions, for physical quantities that have them.
    #[serde(default)]
    #[schema(value_type = Option<Vec<Angles>>)]
    wi: Option<Vec<[f64; 2]>>,
    /// Outgoing directions whose sampling densities are evaluated; needed unless there is `c_gamma`.
    #[serde(default)]
    #[schema(value_type = Option<Vec<Angles>>, min_items = 1)]
    wo: Option<Vec<[f64; 2]>>,
    /// Outgoing directions of a luminaire as `[C, gamma]`, instead of `wo`: theta = 180° − gamma, phi = C.
    #[serde(default)]
    #[schema(value_type = Option<Vec<LuminaireAngles>>, min_items = 1)]
    c_gamma: Option<Vec<[f64; 2]>>,
    /// Subdivision level of the triangles from which directions are drawn; a lower one is coarser. Default: the
    /// material's own.
    #[serde(default)]
    #[schema(maximum = 255)]
    level: Option<u8>,
    /// Zero-based position on each index axis (tensor axis before the directions).
    #[serde(default)]
    index: Vec<usize>,
}

/// Request to draw outgoing directions at random: their number, the seed, and the incoming directions.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct SampleRequest {
    /// Incoming direction in degrees `[θ, φ]`, or a list of such, for physical quantities that have one.
    #[serde(default)]
    #[schema(value_type = Option<OneOrMoreAngles>)]
    wi: Option<OneOrMore>,
    /// Number of outgoing directions to draw for each incoming direction. Default: 1.
    #[serde(default = "one")]
    #[schema(minimum = 1)]
    count: usize,
    /// Seed of the random numbers. Equal seeds give equal directions on every machine. Default: 0.
    #[serde(default)]
    #[schema(maximum = 18_446_744_073_709_551_615_usize)]
    seed: u64,
    /// Subdivision level of the triangles from which directions are drawn; a lower one is coarser. Default: the
    /// material's own.
    #[serde(default)]
    #[schema(maximum = 255)]
    level: Option<u8>,
    /// Zero-based position on each index axis (tensor axis before the directions).
    #[serde(default)]
    index: Vec<usize>,
}

/// Incoming directions, in degrees `[θ, φ]`, for which values are integrated over outgoing directions.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct AlbedoRequest {
    /// Incoming directions, for physical quantities that have them.
    #[serde(default)]
    #[schema(value_type = Option<Vec<Angles>>)]
    wi: Option<Vec<[f64; 2]>>,
    /// Interpolation over directions.
    #[serde(default)]
    interpolation: Interpolation,
    /// Zero-based position on each index axis (tensor axis before the directions).
    #[serde(default)]
    index: Vec<usize>,
}

/// One direction `[θ, φ]` in degrees, or a list of such directions.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "wi: expected [theta, phi] in degrees or a list of such")]
enum OneOrMore {
    One([f64; 2]),
    More(Vec<[f64; 2]>),
}

fn one() -> usize {
    1
}

/// Function that parses a batch of queries from a JSON request body; the second argument is the largest number of
/// answers.
type Parse = fn(&[u8], usize) -> Result<(Question, Places), Problem>;

/// Evaluate spectra for pairs of directions. The request is one JSON object, NDJSON, or a stream of f32 records (θi,
/// φi, θo, φo, without the directions that the quantity lacks). Each f32 record is answered by one f32 for each
/// wavelength.
#[utoipa::path(
    post, path = "/v1/materials/{id}/evaluate", tag = "evaluation",
    request_body(content(
        (EvaluateRequest = "application/json"), (Line = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )),
    params(("id" = Digest, Path, description = "Id of the material"), EvaluateOptions),
    responses((status = 200, description = "The spectra; each line of NDJSON has `values`", content(
        (EvaluateAnswer = "application/json"), (Lines = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )))
)]
pub(super) async fn evaluate(
    app: App,
    Id(id): Id,
    Query(options): Query<EvaluateOptions>,
    request: Request,
) -> Result<Response, Problem> {
    let parse: Parse = |bytes, most| {
        let request: EvaluateRequest = parse_json(bytes)?;
        if let Some(values) = &request.wavelengths {
            check_wavelengths(values).map_err(Problem::invalid)?;
        }
        let (index, wavelengths) = (request.index, request.wavelengths);
        let (how, beyond) = (request.interpolation, request.beyond);
        Ok((
            Question::Evaluate { index, how, beyond, wavelengths },
            Places::of(request.wi, Outgoing::of(request.wo, request.c_gamma)?, 1, most)?,
        ))
    };
    let plain = options == EvaluateOptions::default();
    let question = read(options.index.as_deref(), indices).and_then(|index| {
        Ok(Question::Evaluate {
            index: index.unwrap_or_default(),
            how: options.interpolation.unwrap_or_default(),
            beyond: options.beyond.unwrap_or_default(),
            wavelengths: read(options.wavelengths.as_deref(), wavelengths)?,
        })
    });
    answer(app, id, request, question, plain, parse).await
}

/// Evaluate the probability densities with which `sample` draws directions. The request is one JSON object, NDJSON, or
/// a stream of f32 records (θi, φi, θo, φo; for emission θo, φo). Each f32 record is answered by one f32.
#[utoipa::path(
    post, path = "/v1/materials/{id}/pdf", tag = "evaluation",
    request_body(content(
        (PdfRequest = "application/json"), (Line = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )),
    params(("id" = Digest, Path, description = "Id of the material"), PdfOptions),
    responses((status = 200, description = "The densities; each line of NDJSON has `pdf`", content(
        (PdfAnswer = "application/json"), (Lines = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )))
)]
pub(super) async fn pdf(
    app: App,
    Id(id): Id,
    Query(options): Query<PdfOptions>,
    request: Request,
) -> Result<Response, Problem> {
    let parse: Parse = |bytes, most| {
        let request: PdfRequest = parse_json(bytes)?;
        let question = Question::Pdf { index: request.index, level: request.level };
        let outgoing = Outgoing::of(request.wo, request.c_gamma)?;
        if outgoing.is_none() {
            return Err(Problem::invalid("missing field `wo`"));
        }
        Ok((question, Places::of(request.wi, outgoing, 1, most)?))
    };
    let plain = options == PdfOptions::default();
    let question = read(options.index.as_deref(), indices)
        .map(|index| Question::Pdf { index: index.unwrap_or_default(), level: options.level });
    answer(app, id, request, question, plain, parse).await
}

/// Draw random directions in proportion to the light that the material sends there. A JSON object requests `count`
/// directions for each incoming one; its answer is streamed if NDJSON or f32 is accepted. A stream of incoming
/// directions (NDJSON, or f32 θi, φi) gets one direction for each, in f32 as θo, φo, pdf, weight.
#[utoipa::path(
    post, path = "/v1/materials/{id}/sample", tag = "evaluation",
    request_body(content(
        (SampleRequest = "application/json"), (Line = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )),
    params(("id" = Digest, Path, description = "Id of the material"), SampleOptions),
    responses((status = 200, description = "The directions; each line of NDJSON has `direction`, `pdf`, `weight`", content(
        (SampleAnswer = "application/json"), (Lines = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )))
)]
pub(super) async fn sample(
    app: App,
    Id(id): Id,
    Query(options): Query<SampleOptions>,
    request: Request,
) -> Result<Response, Problem> {
    let parse: Parse = |bytes, most| {
        let request: SampleRequest = parse_json(bytes)?;
        let wi = request.wi.map(|wi| match wi {
            OneOrMore::One(wi) => vec![wi],
            OneOrMore::More(wi) => wi,
        });
        let question = Question::Sample { index: request.index, level: request.level, seed: request.seed };
        Ok((question, Places::of(wi, None, request.count, most)?))
    };
    let plain = options == SampleOptions::default();
    let question = read(options.index.as_deref(), indices).map(|index| Question::Sample {
        index: index.unwrap_or_default(),
        level: options.level,
        seed: options.seed.unwrap_or_default(),
    });
    answer(app, id, request, question, plain, parse).await
}

/// Integrate over outgoing directions for given incoming ones. The request is one JSON object, NDJSON, or a stream of
/// f32 records (θi, φi). Each f32 record is answered by one f32 for each wavelength.
#[utoipa::path(
    post, path = "/v1/materials/{id}/albedo", tag = "evaluation",
    request_body(content(
        (AlbedoRequest = "application/json"), (Line = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )),
    params(("id" = Digest, Path, description = "Id of the material"), AlbedoOptions),
    responses((status = 200, description = "The albedos; each line of NDJSON has `values`", content(
        (AlbedosAnswer = "application/json"), (Lines = "application/x-ndjson"), (Binary = "application/octet-stream"),
    )))
)]
pub(super) async fn albedo(
    app: App,
    Id(id): Id,
    Query(options): Query<AlbedoOptions>,
    request: Request,
) -> Result<Response, Problem> {
    let parse: Parse = |bytes, most| {
        let request: AlbedoRequest = parse_json(bytes)?;
        let question = Question::Albedo { index: request.index, how: request.interpolation };
        Ok((question, Places::of(request.wi, None, 1, most)?))
    };
    let plain = options == AlbedoOptions::default();
    let question = read(options.index.as_deref(), indices).map(|index| Question::Albedo {
        index: index.unwrap_or_default(),
        how: options.interpolation.unwrap_or_default(),
    });
    answer(app, id, request, question, plain, parse).await
}

/// Answers an HTTP request with a batch of queries. `question`, the options from the query string, applies to streamed
/// bodies. `plain` is true if the query string sets no option. `parse` reads a JSON body.
async fn answer(
    app: App,
    id: Digest,
    request: Request,
    question: Result<Question, Problem>,
    plain: bool,
    parse: Parse,
) -> Result<Response, Problem> {
    let client = client(request.extensions());
    let headers = request.headers();
    let checked = check(headers, question, plain);
    let (body, answer, question) = match checked {
        Ok(checked) => checked,
        Err(problem) => return refuse(request, problem).await,
    };
    let material = match open(&app, id).await {
        Ok(material) => material,
        Err(problem) => return refuse(request, problem).await,
    };
    if body == Encoding::Json {
        let json = JsonBytes::receive(request, &app).await?;
        let engine = Arc::clone(&app.engine);
        if answer == Encoding::Json {
            let work = move || {
                let (question, places) = parse(&json.bytes, engine.limits.batch)?;
                whole(&material, &question, places, &engine.limits)
            };
            return Ok(json_response(app.engine.queries.run(work).await??));
        }
        let parsed = app.engine.queries.run(move || parse(&json.bytes, engine.limits.drawn)).await?;
        let (question, places) = parsed?;
        let source = Source::Listed { places: Arc::new(places), next: 0 };
        return stream(&app, client, material, question, source, answer, None).await;
    }
    let question = question.simplified(&material);
    let (cutter, length) = if body == Encoding::Lines {
        (Cutter::lines(), None)
    } else {
        let directions = match question.directions(&material) {
            Ok(directions) => directions,
            Err(problem) => return refuse(request, problem).await,
        };
        let declared = declared_length(request.headers());
        let record = directions.bytes() as u64;
        if let Some(bytes) = declared.filter(|bytes| bytes % record != 0) {
            return refuse(request, cut_off(bytes, directions)).await;
        }
        let answered = |bytes: u64| (bytes / record).checked_mul(4 * question.width(&material) as u64);
        let floats = answer == Encoding::Floats;
        (Cutter::floats(directions), declared.filter(|_| floats).and_then(answered))
    };
    let pieces = ReadAhead::new(request.into_body(), app.engine.limits.idle);
    stream(&app, client, material, question, Source::body(pieces, cutter), answer, length).await
}

/// Checks the headers of a batch request and the operation in its query string. Returns the encodings of the request
/// body and of the answer, and the operation. Fails if a header or the query string is invalid.
fn check(
    headers: &HeaderMap,
    question: Result<Question, Problem>,
    plain: bool,
) -> Result<(Encoding, Encoding, Question), Problem> {
    let body = Encoding::of_body(headers)?;
    let answer = body.of_answer(headers)?;
    let question = question?;
    if body == Encoding::Json && !plain {
        return Err(Problem::new(Kind::BadQuery, "the options of a JSON body stand in it, not in the query string"));
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|coding| coding != "identity") {
        return Err(Problem::new(Kind::UnsupportedEncoding, "batches come without Content-Encoding"));
    }
    Ok((body, answer, question))
}

/// Refuses a request before any of its body is read. Discards the start of the body, then returns `problem`.
async fn refuse(request: Request, problem: Problem) -> Result<Response, Problem> {
    linger(request).await;
    Err(problem)
}
