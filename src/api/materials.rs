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

/// Filter of a list of materials.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Cursor: `next` of an earlier answer.
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Upper bound on the number of items, 1 to 1000. Default: 50.
    #[param(minimum = 1, maximum = 1000)]
    limit: Option<usize>,
    /// Only materials of this quantity.
    #[param(value_type = Option<QuantityName>)]
    quantity: Option<Quantity>,
    /// Only materials made from this measurement.
    #[param(value_type = Option<DigestText>)]
    measurement: Option<Digest>,
    /// Only materials with this tag.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    tag: Option<String>,
    /// Only materials with this text in one of their names or tags.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    q: Option<String>,
}

/// A material: its content, its errors and its provenance.
#[derive(Debug, Serialize, ToSchema)]
struct Material {
    /// Digest of the file.
    #[schema(value_type = DigestText)]
    id: Digest,
    /// Latest name given by a job.
    name: Option<String>,
    /// Tags given by any of its jobs.
    tags: Vec<String>,
    /// Measurements that it was made from; several if they gave equal bytes.
    #[schema(value_type = Vec<DigestText>)]
    measurements: Vec<Digest>,
    #[serde(flatten)]
    manifest: Manifest,
    /// Time of creation, ms of the Unix epoch.
    created_ms: i64,
    links: Links,
}

/// Results of a compression, in the names of `wavelume compress --json`.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
struct Manifest {
    /// Digest of the file without its metadata chunk: equal for equal decoded samples and equal settings.
    payload_digest: String,
    /// Names given by jobs, at most 32, the latest last. Jobs with equal results share a material.
    #[serde(default)]
    names: Vec<String>,
    /// Latest licence given by a job.
    licence: Option<String>,
    /// Licences given by jobs, at most 32, the latest last.
    #[serde(default)]
    licences: Vec<String>,
    /// Format of the measurement file.
    format: String,
    dialect: String,
    quantity: String,
    unit: String,
    /// Human-readable axes, outermost first.
    axes: Vec<String>,
    policy: String,
    basis: String,
    /// Size of the file in bytes.
    bytes: u64,
    kept_coefficients: Option<u64>,
    /// Samples per kept coefficient.
    ratio_coefficients: Option<f64>,
    /// Bytes of the float32 tensor per byte of the file.
    ratio_bytes: Option<f64>,
    /// Number of samples that the measurement states. The following errors and counts are those of the decoded file at
    /// these samples. Relative errors are taken over samples above zero and not below the floor.
    samples: u64,
    er_l1: Option<f64>,
    er_l2: Option<f64>,
    max_relative_error: Option<f64>,
    relative_rmse: Option<f64>,
    /// Values at which these errors are measured, if not at the numbers of the file. They are values after resampling
    /// to other wavelengths, or all pairs of a direction and a wavelength of a joined spectrum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    errors_at: Option<String>,
    /// Cells times wavelengths, if samples were averaged over cells. `er_l1_cells`, `er_l2_cells`,
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
    /// Colour differences, if the target bounds them: `illuminant`, `largest` and `mean` CIEDE2000, `spectra`,
    /// `unscored_spectra`.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    delta_e: Option<Value>,
    /// Preservation of the light of every direction and wavelength (directional albedo, flux): its `largest` and `rms`
    /// relative error, and the `brightest` light of the measurement. Null without directions.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    light: Option<Value>,
    /// Interpolation between incidences and its errors. `interpolation` is the chosen method. `left_out_er_l2` is the
    /// leave-one-out er(L2) of the inner incidences. `estimated_er_l2` is the er(L2) expected between incidences, and
    /// `estimated_moved` the largest share of light expected in the wrong place there. Null if no incidence lies
    /// between others.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    incidences: Option<Value>,
    /// Errors at scattered samples. `noise`: root mean square of their relative noise (null if too few samples show
    /// it). `fit`: er(L2) of the evaluated material at all samples that were not rejected; `fit_all`: also at the
    /// rejected ones. `added`: the part of `fit` that the material adds to the noise; `allowed`: the upper bound on it.
    /// `rejected`: the number of `values` left out as outliers, and their share of all `samples` and of their `light`;
    /// `isolated`: the same for rejected values that lie alone. `lobe`: number of values far above their neighbours
    /// that form a narrow lobe and were not rejected. `light`: the largest differences `kept`, `together` and `all` of
    /// `light_at_samples`, null without samples. `within_2u`: as below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    scattered: Option<Value>,
    /// Lobe of a scan that is narrower than its cells and is added to them. `lobe` has its numbers, named as in section
    /// 18 of the container's text. `full_width` is the full width at half maximum along both axes, in degrees.
    /// `samples_within_half` counts the samples of all incidences within half its maximum; `is_resolved` is true for
    /// three or more. `light` is the mean of its albedo over the `incidences` (degrees) that it was fitted to, and
    /// `light_range` are its limits if few samples constrain it. `reduced` is the part of its light that was removed so
    /// that no albedo exceeds 1. `unseen_bands` counts the bands whose colour is that of their neighbours. Absent if
    /// the cells hold everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    lobe: Option<Value>,
    /// Light of the material minus that of scattered samples, relative to the latter. Each entry is one incidence
    /// (`theta_i` and `phi_i` in degrees) and one group of bands (first and last of `wavelengths` in nm and of
    /// `channels`). `kept` compares at the samples that were not rejected, `together` adds the rejected samples that
    /// lie together, and `all` adds all. Each is null if there is no such sample. Sums are weighted by the area that a
    /// sample represents, times cos θ for scattering. `light` is that of the samples without isolated rejected ones,
    /// averaged over the channels. If it is `by_area` and the samples cover the hemisphere, it is the albedo or flux.
    /// `noise` is the standard error of `together`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(value_type = Vec<Object>)]
    light_at_samples: Vec<Value>,
    /// Share (0 to 1) of the values with a stated standard uncertainty u that the file keeps within 2u. Absent if the
    /// measurement states none, or if its grid was averaged over triangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1.0)]
    within_2u: Option<f64>,
    /// Stopping point of the target `auto`. `stopped_at` is `uncertainty` (relative root mean square of the stated
    /// uncertainties) or `noise` (the estimated one), whichever is larger. Both values stand beside it, null if
    /// unknown. Absent for other targets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    auto: Option<Value>,
    /// Standard deviations of the relative noise of the measurement, estimated from its lack of structure: `relative`
    /// of one sample, its `uncertainty`, and the part `common` to neighbouring spectral samples. Null if there is no
    /// estimate.
    #[schema(value_type = Option<Object>)]
    noise: Option<Value>,
    /// Coverage of the projection: numbers of measured, interpolated, filled and empty cells.
    #[schema(value_type = Object)]
    coverage: Value,
    /// Everything the parser assumed, filled or skipped, and warnings: of a target below the noise, of incoming
    /// directions too sparse for the lobe, of a lobe no wider than the instrument resolves, and of light that differs
    /// from that of scattered samples.
    #[schema(value_type = Vec<Object>)]
    notes: Vec<Value>,
    /// Levels that the first bytes of the file decode to, coarsest first, the whole last. One range request fetches a
    /// coarser material.
    #[serde(default)]
    levels: Vec<MaterialLevel>,
    /// Measurement, options, request and program of the first job that made the material.
    #[schema(value_type = Object)]
    provenance: Value,
}

/// A level that a material can be decoded to: of its last triangle axis, or a coarser grid of angles.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
struct MaterialLevel {
    /// Number of the level.
    level: u8,
    /// Length in bytes of the beginning of the file that the level needs.
    bytes: u64,
    /// er(L2), rounded up. For triangles it is taken against the averages of the original samples over the level's
    /// triangles. For a grid it is that of evaluating the level at the angles of the file.
    er_l2: f64,
}

/// URLs related to a material.
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
    /// Cursor of the next page; null on the last page.
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

/// Get the manifest of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}", tag = "materials", params(("id" = DigestText, Path, description = "Its id")),
    responses((status = 200, description = "The manifest", body = Material))
)]
async fn get_material(State(app): State<App>, Id(id): Id) -> Result<Json<Material>, Problem> {
    Material::of(row(&app, id).await?).map(Json)
}

/// Delete a material. The next sweep removes its bytes.
#[utoipa::path(
    delete, path = "/v1/materials/{id}", tag = "materials", params(("id" = DigestText, Path, description = "Its id")),
    responses((status = 204, description = "Gone"))
)]
async fn delete_material(State(app): State<App>, Id(id): Id) -> Result<StatusCode, Problem> {
    let outcome = app.engine.archive.catalog.delete_material(id).await?;
    forget(&app, id).await;
    deleted(outcome, &absent(id))
}

/// Get the file of a material.
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

/// Get bytes by their digest: a material's file, a measurement's content or a report (`application/json`). Bytes that
/// none of them names any more are not found.
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
        // The bytes may exist until the next sweep, but nobody may read them.
        None => return Err(StoreError::NotFound(digest).into()),
    };
    content::respond(&app, digest, media_type, None, &method, &headers).await
}

async fn row(app: &App, id: Digest) -> Result<MaterialRow, Problem> {
    let row = app.engine.archive.catalog.material(id).await?;
    row.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))
}

/// Returns the name of a material that the catalog knows. Every answer about a material checks this first, even if the
/// material is in memory: another process may have deleted it.
pub(super) async fn known(app: &App, id: Digest) -> Result<Option<String>, Problem> {
    if let Some(name) = app.engine.archive.catalog.material_name(id).await? {
        return Ok(name);
    }
    forget(app, id).await;
    Err(Problem::new(Kind::NotFound, absent(id)))
}

/// Frees the memory of a deleted material.
async fn forget(app: &App, id: Digest) {
    app.engine.close_material(id).await;
    app.contents.forget(id).await;
}

fn absent(id: Digest) -> String {
    format!("there is no material {id}")
}

impl Manifest {
    /// Reads a manifest document of the catalog. Documents from before 2026-11-23 name the errors of the cells `er_l2`
    /// and so on, and keep those at the samples in an object of their own.
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
        // Documents of earlier versions have no lists.
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
