//! `/v1/materials/{id}/export`: a material in an exchange format, with the error that the format adds.

use super::content::{FOR_GOOD, not_modified};
use super::export_description::{ExportParams, ExportedFile, FORMAT};
use super::extract::{Id, Query, unknown_parameter};
use super::places::Place;
use super::problem::{Kind, Problem};
use super::query::open;
use super::seen::seen;
use super::state::{App, Service};
use crate::export::{self, ExportFormat, ExportOptions, Exported, Summary};
use crate::formats::manifest_of;
use crate::jobs::Client;
use crate::pipeline::{OnGrid, export_on_grid};
use crate::store::Digest;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use serde_json::Map;
use std::convert::Infallible;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Response header that states the error of an exported file relative to the material, in addition to the error of the
/// material itself.
pub(crate) const EXPORT_ERROR: HeaderName = HeaderName::from_static("wavelume-export-error");

/// Bytes of an exported file handed to the connection at a time.
const PIECE: usize = 1 << 20;

/// HTTP routes of exports to other file formats.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(export))
}

/// Query of an export: the format, and the values of the options that the query states.
#[derive(Debug)]
struct ExportQuery {
    format: String,
    options: ExportOptions,
}

/// Parses the query parameters of an export. An error names the faulty parameter.
fn read(pairs: Vec<(String, String)>) -> Result<ExportQuery, String> {
    let (mut format, mut stated) = (None, Map::new());
    for (name, text) in pairs {
        let is_twice = if name == FORMAT {
            format.replace(text).is_some()
        } else {
            let declared = ExportOptions::OPTIONS.iter().find(|declared| declared.name == name);
            let declared = declared.ok_or_else(|| unknown_option(&name))?;
            let value = declared.read(&text).map_err(|expected| {
                let shown: String = text.chars().take(40).collect();
                format!("{name}: found `{shown}`, {expected}")
            })?;
            stated.insert(name.clone(), value).is_some()
        };
        if is_twice {
            return Err(format!("duplicate field `{name}`"));
        }
    }
    let format = format.ok_or_else(|| format!("missing field `{FORMAT}`"))?;
    Ok(ExportQuery { format, options: ExportOptions::read(stated)? })
}

fn unknown_option(name: &str) -> String {
    unknown_parameter(name, std::iter::once(FORMAT).chain(ExportOptions::OPTIONS.iter().map(|declared| declared.name)))
}

impl<'de> Deserialize<'de> for ExportQuery {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        read(Vec::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

/// Export a material to another file format.
#[utoipa::path(
    get, path = "/v1/materials/{id}/export", tag = "materials",
    params(("id" = Digest, Path, description = "Id of the material"), ExportParams),
    responses(ExportedFile)
)]
async fn export(
    app: App,
    Id(id): Id,
    client: Client,
    Query(query): Query<ExportQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = match query.format.as_str() {
        "manifest" => None,
        name => Some(ExportFormat::of_name(name).map_err(|_| unknown(name))?),
    };
    let options = ExportOptions {
        // An exported file stays within the upload limit, so that it can be uploaded again.
        most_bytes: usize::try_from(app.engine.limits.upload_bytes).unwrap_or(usize::MAX),
        ..query.options
    };
    let seen = seen(&app, id).await?;
    // The version is part of the key: another version may write another file.
    let what = format!("{id} export {format:?} {options:?} {}", env!("CARGO_PKG_VERSION"));
    let etag = format!("\"{}\"", Digest::of(what.as_bytes()));
    let mut response = if not_modified(&headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        match format {
            Some(format) => file(&seen.app, client, id, format, options).await?,
            None => manifest(&seen.app, id, options).await?,
        }
    };
    let headers = response.headers_mut();
    headers.extend(HeaderValue::from_str(&etag).ok().map(|value| (header::ETAG, value)));
    headers.insert(header::CACHE_CONTROL, FOR_GOOD);
    Ok(seen.mark(response))
}

fn unknown(name: &str) -> Problem {
    let shown: String = name.chars().take(40).collect();
    let names: Vec<&str> = ExportFormat::ALL.iter().map(|format| format.name()).collect();
    let detail =
        format!("format: `{shown}` is no format that can be written, expected one of manifest, {}", names.join(", "));
    Problem::new(Kind::NotAvailable, detail)
}

async fn manifest(app: &App, id: Digest, options: ExportOptions) -> Result<Response, Problem> {
    let measurement = app.engine.decoded(id).await.map_err(|error| Problem::from(&error))?;
    export::check_whole(&measurement, "manifest", &options)?;
    let text = app.engine.queries.run(move || manifest_of(&measurement).to_string()).await?;
    let mut response = ([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], text).into_response();
    name(&mut response, id, "axes.json");
    Ok(response)
}

async fn file(
    app: &App,
    client: Client,
    id: Digest,
    format: ExportFormat,
    options: ExportOptions,
) -> Result<Response, Problem> {
    // A file stays whole in memory until its last byte is sent. The computation holds the place too, because it
    // continues when the client disconnects.
    let place = app.held.exports.take(client, 1)?;
    let (exported, place) = if format.takes_samples() {
        let measurement = app.engine.decoded(id).await.map_err(|error| Problem::from(&error))?;
        app.engine.exports.run(move || (export::samples(&measurement, format, &options), place)).await?
    } else {
        self::seen(app, id).await?;
        let bytes = app.engine.bytes(id).await.map_err(|error| Problem::from(&error))?;
        let how = options.clone();
        let (on_grid, place) = app.engine.exports.run(move || (export_on_grid(&bytes, format, &how), place)).await?;
        if let OnGrid::File(file) = on_grid? {
            (Ok(*file), place)
        } else {
            let material = open(app, id).await?;
            app.engine.exports.run(move || (export::export(&material, format, &options), place)).await?
        }
    };
    let Exported { bytes, about } = exported?;
    let length = bytes.len();
    let mut response = pieces(bytes, place).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_LENGTH, HeaderValue::from(length));
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(format.media_type()));
    let stated = stated(&about);
    headers.extend(HeaderValue::from_str(&stated).ok().map(|value| (EXPORT_ERROR, value)));
    name(&mut response, id, format.extension());
    Ok(response)
}

/// Formats the value of the response header `Wavelume-Export-Error`.
fn stated(about: &Summary) -> String {
    let error = &about.error;
    let luminaire = match (&about.lamp, about.flux_error) {
        (Some(lamp), _) => format!(
            ", peak={:.6}, flux={:.6}, rms_of_peak={:.6}, er_l2_bright={:.6}",
            lamp.peak, lamp.flux, lamp.rms_of_peak, lamp.er_l2_bright
        ),
        (None, Some(flux)) => format!(", flux={flux:.6}"),
        (None, None) => String::new(),
    };
    let promise = if about.warning.is_some() { ", promise=\"broken\"" } else { "" };
    format!(
        "er_l2={:.6}, er_l1={:.6}, max={:.6}, relative_rmse={:.6}, pairs={}, of=\"{}\"{luminaire}{promise}",
        error.er_l2, error.er_l1, error.max_relative_error, error.relative_rmse, error.pairs, error.compared
    )
}

fn name(response: &mut Response, id: Digest, extension: &str) {
    let name = format!("attachment; filename=\"{}.{extension}\"", &id.to_string()[..15]);
    response.headers_mut().extend(HeaderValue::from_str(&name).ok().map(|v| (header::CONTENT_DISPOSITION, v)));
}

/// Streams the bytes of an exported file in pieces. The export occupies its place in the limit on exports until the
/// last piece is taken.
fn pieces(bytes: Vec<u8>, place: Place) -> Body {
    let parts = futures::stream::unfold((Bytes::from(bytes), place), |(mut rest, place)| async move {
        if rest.is_empty() {
            return None;
        }
        let piece = rest.split_to(rest.len().min(PIECE));
        Some((Ok::<_, Infallible>(piece), (rest, place)))
    });
    Body::from_stream(parts)
}
