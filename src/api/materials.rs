//! `/v1/materials` and `/v1/blobs`: compressed materials, their manifests and their bytes.

use super::content::{self, MATERIAL};
use super::extract::{Id, Query, word};
use super::measurements::{deleted, page};
use super::problem::{Kind, Problem};
use super::schemas::{Binary, CursorText, DigestText, QuantityName, Word};
use super::state::App;
use crate::catalog::{MaterialFilter, MaterialRow, Namer};
use crate::domain::Quantity;
use crate::store::{Digest, StoreError};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, Method, StatusCode};
use axum::response::Response;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(list_materials))
        .routes(routes!(get_material, delete_material))
        .routes(routes!(get_material_content))
        .routes(routes!(get_blob))
}

/// Which materials to list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// `next` of an earlier answer.
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// How many at most, 1 to 1000; 50 if nothing is said.
    #[param(minimum = 1, maximum = 1000)]
    limit: Option<usize>,
    /// Of this quantity.
    #[param(value_type = Option<QuantityName>)]
    quantity: Option<Quantity>,
    /// Made of this measurement.
    #[param(value_type = Option<DigestText>)]
    measurement: Option<Digest>,
    /// With this tag.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    tag: Option<String>,
    /// With this in one of its names or tags.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    q: Option<String>,
}

/// A material: what it is, how good it is, where it comes from.
#[derive(Debug, Serialize, ToSchema)]
struct Material {
    /// The digest of the file.
    #[schema(value_type = DigestText)]
    id: Digest,
    /// The last name that a job gave it.
    name: Option<String>,
    /// The tags that any of its jobs gave it.
    tags: Vec<String>,
    /// The measurements it was made of; several if they gave equal bytes.
    #[schema(value_type = Vec<DigestText>)]
    measurements: Vec<Digest>,
    #[serde(flatten)]
    manifest: Manifest,
    /// When it came, ms of the Unix epoch.
    created_ms: i64,
    links: Links,
}

/// What was achieved, in the names of `wavelume compress --json`.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
struct Manifest {
    /// The digest of the file without its metadata chunk: equal for equal decoded samples of equal settings.
    payload_digest: String,
    /// Every name that a job gave it, at most 32, the last one last: jobs with equal results share a material.
    #[serde(default)]
    names: Vec<String>,
    /// The last licence that a job gave it.
    licence: Option<String>,
    /// Every licence that a job gave it, at most 32, the last one last.
    #[serde(default)]
    licences: Vec<String>,
    /// The format of the measurement.
    format: String,
    dialect: String,
    quantity: String,
    unit: String,
    /// For people, outermost first.
    axes: Vec<String>,
    policy: String,
    basis: String,
    /// The size of the file.
    bytes: u64,
    kept_coefficients: Option<u64>,
    /// Samples per kept coefficient.
    ratio_coefficients: Option<f64>,
    /// Bytes of the float32 tensor per byte of the file.
    ratio_bytes: Option<f64>,
    /// The samples that the measurement states; the errors and counts that follow are those of the decoded file at them. Relative
    /// errors are taken over samples above zero and not below the floor.
    samples: u64,
    er_l1: Option<f64>,
    er_l2: Option<f64>,
    max_relative_error: Option<f64>,
    relative_rmse: Option<f64>,
    /// Values that these errors are measured at, where these are not the numbers of the file: values after resampling to other
    /// wavelengths, or all pairs of a direction and a wavelength of a joined spectrum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    errors_at: Option<String>,
    /// Cells times wavelengths, where samples were averaged over cells; `er_l1_cells`, `er_l2_cells`,
    /// `max_relative_error_cells` and `relative_rmse_cells` are the errors of the decoded file against those averages.
    #[serde(default)]
    samples_cells: Option<u64>,
    #[serde(default)]
    er_l1_cells: Option<f64>,
    #[serde(default)]
    er_l2_cells: Option<f64>,
    #[serde(default)]
    max_relative_error_cells: Option<f64>,
    #[serde(default)]
    relative_rmse_cells: Option<f64>,
    max_absolute_error: Option<f64>,
    scored_samples: u64,
    zero_samples: u64,
    negative_samples: u64,
    below_floor_samples: u64,
    masked_samples: u64,
    max_absolute_error_unscored: Option<f64>,
    mask_mismatches: u64,
    /// Colour differences, where they were promised: `illuminant`, `largest` and `mean` CIEDE2000, `spectra`,
    /// `unscored_spectra`.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    delta_e: Option<Value>,
    /// How much of the light of every direction and wavelength (directional albedo, flux) the file keeps: `largest` and
    /// `rms` relative error, and the `brightest` of the measurement; null without directions.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    light: Option<Value>,
    /// Interpolation between incidences, and its errors: `interpolation`, what was chosen; `left_out_er_l2`, er(L2) of each
    /// inner incidence where it is left out; `estimated_er_l2`, er(L2) that is expected between incidences, and
    /// `estimated_moved`, the largest share of light expected in the wrong place there; null where none stands between others.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    incidences: Option<Value>,
    /// Errors at scattered samples: `noise`, the root mean square of their relative noise (null where too few samples show it);
    /// `fit`, er(L2) of the evaluated material at all that were not rejected; `fit_all`, with these; `added`, the part of `fit`
    /// that the material adds to the noise; `allowed`, the largest part that it may add; `rejected`, the `values` left out as
    /// outliers, and their share of all `samples` and of their `light`; `isolated`, the same of those that lie alone; `lobe`, the
    /// number of values far above their neighbours that are a narrow lobe and were not rejected; `light`, the largest
    /// differences `kept`, `together` and `all` of `light_at_samples`, null without samples; `within_2u` as below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    scattered: Option<Value>,
    /// Lobe of a scan that is narrower than its cells and stands beside them: `lobe`, its numbers as the container's text
    /// (section 18) has them; `full_width` at half its maximum, in degrees, along both axes; `samples_within_half`, the number of
    /// samples of all incidences within half its maximum; `is_resolved`, whether these are three or more; `light`, the mean of its
    /// albedo over the `incidences` (degrees) that it was fitted to, and `light_range`, its limits where few samples tell it;
    /// `reduced`, the part of its light that was taken from it so that no albedo exceeds 1; `unseen_bands`, the number of bands
    /// that have the colour of their neighbours. Absent where the cells hold everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    lobe: Option<Value>,
    /// Light of the material less that of scattered samples, in parts of the latter, by incidence (`theta_i` and `phi_i` in
    /// degrees) and group of bands (first and last of `wavelengths` in nm and of `channels`): `kept` at the samples that were
    /// not rejected, `together` with the rejected ones that lie together, `all` with all; null where there is no sample. Each is a
    /// sum by the area that a sample stands for, times cos θ for scattering; `light` is that of the samples but for rejected ones
    /// that lie alone, the mean over the channels, and where it is `by_area` and they cover the hemisphere the albedo or flux;
    /// `noise` is the standard error of `together`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<Object>)]
    light_at_samples: Vec<Value>,
    /// Share of the values with a stated standard uncertainty u from which the file is at most 2u away, 0 to 1; absent
    /// where the measurement states none, and where its grid was averaged over triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1.0)]
    within_2u: Option<f64>,
    /// Where the target `auto` stopped: `stopped_at` is `uncertainty`, the relative root mean square of the
    /// uncertainties that the measurement states, or `noise`, the estimated one, whichever is larger; both beside it,
    /// null where unknown. Absent for other targets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    auto: Option<Value>,
    /// Standard deviations of the relative noise of the measurement, found by its lack of structure: `relative` of one
    /// sample, its `uncertainty`, `common` to neighbouring spectral samples; null where none can be told.
    #[schema(value_type = Option<Object>)]
    noise: Option<Value>,
    /// What the cells of the projection stand on.
    #[schema(value_type = Object)]
    coverage: Value,
    /// Everything the parser assumed, filled or skipped, and warnings where the target lies below the noise, where
    /// incoming directions are too sparse for the lobe, where a lobe is no wider than the instrument resolves, and
    /// where the material has another light than scattered samples.
    #[schema(value_type = Vec<Object>)]
    notes: Vec<Value>,
    /// What the first bytes of the file hold, coarse first, the whole last: a coarser material is one range request away.
    #[serde(default)]
    levels: Vec<MaterialLevel>,
    /// The measurement, its options, the request and the program, of the first job that made it.
    #[schema(value_type = Object)]
    provenance: Value,
}

/// A level that a material can be decoded to: of its last triangle axis, or a coarser grid of angles.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
struct MaterialLevel {
    /// The level.
    level: u8,
    /// Bytes of the file, from its start, that the level needs.
    bytes: u64,
    /// er(L2), rounded up: against the averages of the original samples over the level's triangles, or of evaluating the level at
    /// the angles of the file.
    er_l2: f64,
}

/// Where to go from a material.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = MaterialLinks)]
struct Links {
    #[serde(rename = "self")]
    this: String,
    content: String,
    blob: String,
    spectrum: String,
    evaluate: String,
    pdf: String,
    sample: String,
    albedo: String,
    export: String,
    measurements: Vec<String>,
}

/// A page of materials.
#[derive(Debug, Serialize, ToSchema)]
struct MaterialPage {
    items: Vec<Material>,
    /// The cursor of the next page; null on the last.
    next: Option<String>,
}

/// List materials, newest first.
#[utoipa::path(
    get, path = "/v1/materials", tag = "materials", params(ListQuery),
    responses((status = 200, description = "A page", body = MaterialPage))
)]
async fn list_materials(State(app): State<App>, Query(query): Query<ListQuery>) -> Result<Json<MaterialPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let filter =
        MaterialFilter { quantity: query.quantity, measurement: query.measurement, tag: query.tag, q: query.q };
    let page = app.engine.archive.catalog.materials(&filter, cursor, limit).await?;
    let items = page.items.into_iter().map(Material::of).collect::<Result<_, _>>()?;
    Ok(Json(MaterialPage { items, next: page.next.map(|cursor| cursor.to_string()) }))
}

/// The manifest of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}", tag = "materials", params(("id" = DigestText, Path, description = "Its id")),
    responses((status = 200, description = "The manifest", body = Material))
)]
async fn get_material(State(app): State<App>, Id(id): Id) -> Result<Json<Material>, Problem> {
    Material::of(row(&app, id).await?).map(Json)
}

/// Forget a material; its bytes go with the next sweep.
#[utoipa::path(
    delete, path = "/v1/materials/{id}", tag = "materials", params(("id" = DigestText, Path, description = "Its id")),
    responses((status = 204, description = "Gone"))
)]
async fn delete_material(State(app): State<App>, Id(id): Id) -> Result<StatusCode, Problem> {
    let outcome = app.engine.archive.catalog.delete_material(id).await?;
    forget(&app, id).await;
    deleted(outcome, &absent(id))
}

/// The container.
#[utoipa::path(
    get, path = "/v1/materials/{id}/content", tag = "materials", params(("id" = DigestText, Path, description = "Its id")),
    responses(
        (status = 200, description = "The file", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 206, description = "A range of it", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 304, description = "Unchanged"),
    )
)]
async fn get_material_content(
    State(app): State<App>,
    method: Method,
    headers: HeaderMap,
    Id(id): Id,
) -> Result<Response, Problem> {
    let name = known(&app, id).await?;
    let name = format!("{}.wlm", name.as_deref().unwrap_or(&id.to_string()[..15]));
    if let Some(bytes) = app.contents.get(&app.engine.archive.store, id).await? {
        return content::respond_with(&bytes, id, MATERIAL, Some(&name), &method, &headers);
    }
    content::respond_named(&app, id, MATERIAL, Some(&name), &method, &headers).await
}

/// Bytes by their digest: a material's file, a measurement's content or a report (`application/json`). Bytes that none of
/// them names any more are not there.
#[utoipa::path(
    get, path = "/v1/blobs/{digest}", tag = "materials", params(("digest" = DigestText, Path, description = "Their digest")),
    responses(
        (status = 200, description = "The bytes", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Value = "application/json"),
        )),
        (status = 206, description = "A range of them", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Binary = "application/json"),
        )),
        (status = 304, description = "Unchanged"),
    )
)]
async fn get_blob(
    State(app): State<App>,
    method: Method,
    headers: HeaderMap,
    Id(digest): Id,
) -> Result<Response, Problem> {
    let media_type = match app.engine.archive.catalog.namer(digest).await? {
        Some(Namer::Material) => MATERIAL,
        Some(Namer::Report) => "application/json",
        Some(Namer::Measurement) => "application/octet-stream",
        // The bytes may be there until the next sweep: they are nobody's to read.
        None => return Err(StoreError::NotFound(digest).into()),
    };
    content::respond(&app, digest, media_type, None, &method, &headers).await
}

async fn row(app: &App, id: Digest) -> Result<MaterialRow, Problem> {
    let row = app.engine.archive.catalog.material(id).await?;
    row.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))
}

/// The name of a material that the catalog knows. Every answer about a material asks this first, whatever is in memory:
/// another process may have deleted the material.
pub(super) async fn known(app: &App, id: Digest) -> Result<Option<String>, Problem> {
    if let Some(name) = app.engine.archive.catalog.material_name(id).await? {
        return Ok(name);
    }
    forget(app, id).await;
    Err(Problem::new(Kind::NotFound, absent(id)))
}

/// Frees the memory that a deleted material takes.
async fn forget(app: &App, id: Digest) {
    app.engine.close_material(id).await;
    app.contents.forget(id).await;
}

fn absent(id: Digest) -> String {
    format!("there is no material {id}")
}

impl Manifest {
    /// Reads the document of a catalog. Those of before 2026-11-23 name the errors of the cells as `er_l2` and so on, and have
    /// those at the samples in an object of their own.
    fn read(document: &str) -> Result<Self, serde_json::Error> {
        let mut document: Map<String, Value> = serde_json::from_str(document)?;
        if let Some(Value::Object(at_samples)) = document.remove("errors_at_samples") {
            for name in ["samples", "er_l1", "er_l2", "max_relative_error", "relative_rmse"] {
                let of_cells = document.remove(name).unwrap_or(Value::Null);
                document.insert(format!("{name}_cells"), of_cells);
            }
            document.extend(at_samples);
        }
        serde_json::from_value(Value::Object(document))
    }
}

impl Material {
    fn of(row: MaterialRow) -> Result<Self, Problem> {
        let mut manifest = Manifest::read(&row.document)
            .map_err(|error| Problem::internal(&format!("manifest of material {}: {error}", row.id)))?;
        // Documents of before have no lists.
        if manifest.names.is_empty() {
            manifest.names.extend(row.name.clone());
        }
        if manifest.licences.is_empty() {
            manifest.licences.extend(manifest.licence.clone());
        }
        let this = format!("/v1/materials/{}", row.id);
        Ok(Self {
            links: Links {
                content: format!("{this}/content"),
                blob: format!("/v1/blobs/{}", row.id),
                spectrum: format!("{this}/spectrum"),
                evaluate: format!("{this}/evaluate"),
                pdf: format!("{this}/pdf"),
                sample: format!("{this}/sample"),
                albedo: format!("{this}/albedo"),
                export: format!("{this}/export?format=npy"),
                measurements: row.measurements.iter().map(|id| format!("/v1/measurements/{id}")).collect(),
                this,
            },
            id: row.id,
            name: row.name,
            tags: row.tags,
            measurements: row.measurements,
            manifest,
            created_ms: row.created_ms,
        })
    }
}
