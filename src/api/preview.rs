//! `/v1/materials/{id}/preview.png`: a picture of a material, drawn on request and never changing.

use super::caller::Caller;
use super::color::Asked;
use super::content::{FOR_GOOD, not_modified};
use super::extract::{Id, Query};
use super::problem::{Kind, Problem};
use super::query::{indices, open};
use super::schemas::{Binary, IlluminantText, IndexText, ObserverText};
use super::seen::seen;
use super::state::{App, Service};
use crate::jobs::Text;
use crate::preview::{DEFAULT_SIZE, Look, SIZES, Style, picture};
use crate::store::Digest;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Largest size of a picture that is drawn on request, in pixels along a side; the command line draws larger ones.
/// Raising it lets a request take more memory and time.
const LARGEST: usize = 512;

/// HTTP routes of preview pictures of materials.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(preview))
}

/// Query parameters of a preview picture: size, index, illuminant and observer.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct PreviewQuery {
    /// Width and height of the picture in pixels, 64 to 512. Default: 256.
    #[param(value_type = Option<u32>, minimum = 64, maximum = 512)]
    size: Option<usize>,
    /// Style of a diagram: `dark` (the default) or `light`, dark lines on white for data sheets.
    #[param(value_type = Option<String>, pattern = "^(dark|light)$")]
    style: Option<String>,
    /// Zero-based position on each index axis (tensor axis before the directions), as `I,J`. Default: the first
    /// position, or every column of a spectral table.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    /// Illuminant: `A`, `B`, `C`, `D50`, `D65` (the default), `F11`, `E`, or the id of a stored material that is a
    /// spectrum.
    #[param(value_type = Option<IlluminantText>)]
    illuminant: Option<String>,
    /// Column of a stored table of illuminants, by its name or by its number, counted from 1.
    #[param(value_type = Option<Text>)]
    illuminant_column: Option<String>,
    /// Observer: `1931` (2°, the default), `1964` (10°), or the id of a stored table of x̄, ȳ, z̄.
    #[param(value_type = Option<ObserverText>)]
    observer: Option<String>,
}

/// Draw a material: a ball of a BRDF, BTDF or BSDF, the polar diagram of a luminaire or phase function, the plot of
/// spectra.
#[utoipa::path(
    get, path = "/v1/materials/{id}/preview.png", tag = "materials",
    params(("id" = Digest, Path, description = "Id of the material"), PreviewQuery),
    responses(
        (status = 200, description = "The picture", content_type = "image/png", body = Binary),
        (status = 304, description = "The content still has the entity tag of `If-None-Match`"),
    )
)]
async fn preview(
    app: App,
    caller: Caller,
    Id(id): Id,
    Query(query): Query<PreviewQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let bad = |detail: String| Problem::new(Kind::BadQuery, detail);
    let size = query.size.unwrap_or(DEFAULT_SIZE);
    if !(*SIZES.start()..=LARGEST).contains(&size) {
        return Err(bad(format!("size: found {size}, expected {} to {LARGEST} pixels", SIZES.start())));
    }
    let style = match query.style.as_deref() {
        None => Style::default(),
        Some(name) => Style::ALL
            .into_iter()
            .find(|style| style.name() == name)
            .ok_or_else(|| bad(format!("style: found `{name}`, expected dark or light")))?,
    };
    let index = query.index.as_deref().map(indices).transpose().map_err(bad)?;
    let asked = Asked::of(query.illuminant, query.illuminant_column, query.observer)?.within(&caller)?;
    let seen = seen(&app, id).await?;
    let material = open(&seen.app, id).await?;
    let in_stored_light = asked.has_stored();
    // The version is part of the key: another version may draw another picture.
    let what = format!("{id} {size} {} {index:?} {} {}", style.name(), asked.key(), env!("CARGO_PKG_VERSION"));
    let etag = format!("\"{}\"", Digest::of(what.as_bytes()));
    let mut response = if not_modified(&headers, &etag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let sources = asked.open(&app).await?;
        let look = Look { size, style, ..Look::default() };
        let work = move || Ok::<_, Problem>(picture(&material, index.as_deref(), &sources.viewing()?, look)?);
        let png = app.engine.queries.run(work).await??;
        ([(header::CONTENT_TYPE, HeaderValue::from_static("image/png"))], png).into_response()
    };
    let headers = response.headers_mut();
    headers.extend(HeaderValue::from_str(&etag).ok().map(|value| (header::ETAG, value)));
    headers.insert(header::CACHE_CONTROL, FOR_GOOD);
    // The light of a stored material may be private although this material is public.
    if in_stored_light { Ok(response) } else { Ok(seen.mark(response)) }
}
