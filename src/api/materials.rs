//! `/v1/materials` and `/v1/blobs`: compressed materials, their manifests and their bytes.

use super::content::{self, MATERIAL};
use super::extract::{Id, Query, word};
use super::measurements::{deleted, page};
use super::problem::{Kind, Problem};
use super::schemas::{Binary, CursorText, Word};
use super::state::{App, Service};
use crate::catalog::{MaterialFilter, MaterialRow, Namer};
use crate::domain::Quantity;
use crate::jobs::Manifest;
use crate::paper::Table;
use crate::store::{Digest, StoreError};
use axum::Json;
use axum::http::{HeaderMap, Method, StatusCode};
use axum::response::Response;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of materials.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(list_materials))
        .routes(routes!(get_material, delete_material))
        .routes(routes!(get_material_content))
        .routes(routes!(get_blob))
}

/// Query parameters that filter and page a list of materials.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Cursor of the wanted page: the value `next` of an earlier answer.
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Upper bound on the number of materials on a page, 1 to 1000. Default: 50.
    #[param(minimum = 1, maximum = 1000)]
    limit: Option<usize>,
    /// Physical quantity to filter by: only materials of this quantity are listed.
    quantity: Option<Quantity>,
    /// Id of a measurement to filter by: only materials made from this measurement are listed.
    measurement: Option<Digest>,
    /// Tag to filter by: only materials with this tag are listed.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    tag: Option<String>,
    /// Text to filter by: only materials with this text in one of their names or tags are listed.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    q: Option<String>,
}

/// Description of a material (a compressed measurement): its content, its errors and its provenance.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Material {
    /// Digest of the material file.
    id: Digest,
    /// Latest name that a job or an upload gave to the material.
    name: Option<String>,
    /// Tags that jobs and uploads gave to the material.
    tags: Vec<String>,
    /// Ids of the stored measurements that the material was made from; several if their compression gave equal bytes,
    /// none if it was uploaded without a stored measurement.
    measurements: Vec<Digest>,
    #[serde(flatten)]
    manifest: Manifest,
    /// Time of creation of the material, in milliseconds since the Unix epoch.
    created_ms: i64,
    links: Links,
}

/// URLs of the resources related to a material.
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

/// One page of the list of materials.
#[derive(Debug, Serialize, ToSchema)]
struct MaterialPage {
    items: Vec<Material>,
    /// Cursor of the next page of materials; null on the last page.
    next: Option<String>,
}

/// List materials, newest first.
#[utoipa::path(
    get, path = "/v1/materials", tag = "materials", params(ListQuery),
    responses((status = 200, description = "A page", body = MaterialPage))
)]
async fn list_materials(app: App, Query(query): Query<ListQuery>) -> Result<Json<MaterialPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let filter =
        MaterialFilter { quantity: query.quantity, measurement: query.measurement, tag: query.tag, q: query.q };
    let page = app.engine.archive.catalog.materials(&filter, cursor, limit).await?;
    let items = page.items.into_iter().map(Material::of).collect::<Result<_, _>>()?;
    Ok(Json(MaterialPage { items, next: page.next.map(|cursor| cursor.to_string()) }))
}

/// Get the manifest of a material: content, errors and provenance.
#[utoipa::path(
    get, path = "/v1/materials/{id}", tag = "materials", params(("id" = Digest, Path, description = "Its id")),
    responses((status = 200, description = "The manifest", body = Material))
)]
async fn get_material(app: App, Id(id): Id) -> Result<Json<Material>, Problem> {
    Material::of(row(&app, id).await?).map(Json)
}

/// Delete a material. The next clean-up of the store removes its bytes.
#[utoipa::path(
    delete, path = "/v1/materials/{id}", tag = "materials", params(("id" = Digest, Path, description = "Its id")),
    responses((status = 204, description = "Gone"))
)]
async fn delete_material(app: App, Id(id): Id) -> Result<StatusCode, Problem> {
    let outcome = app.engine.archive.catalog.delete_material(id).await?;
    forget(&app, id).await;
    deleted(outcome, &absent(id))
}

/// Get the file of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}/content", tag = "materials", params(("id" = Digest, Path, description = "Its id")),
    responses(
        (status = 200, description = "The file", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 206, description = "A range of it", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 304, description = "Unchanged"),
    )
)]
async fn get_material_content(app: App, method: Method, headers: HeaderMap, Id(id): Id) -> Result<Response, Problem> {
    let name = known(&app, id).await?;
    let name = format!("{}.wlm", name.as_deref().unwrap_or(&id.to_string()[..15]));
    if let Some(bytes) = app.contents.get(&app.engine.archive, id).await? {
        return content::respond_with(&bytes, id, MATERIAL, Some(&name), &method, &headers);
    }
    content::respond_named(&app, id, MATERIAL, Some(&name), &method, &headers).await
}

/// Get stored bytes by their digest: a material's file, a measurement's content or a report (`application/json`). Bytes
/// to which no material, measurement or report refers any more are not found.
#[utoipa::path(
    get, path = "/v1/blobs/{digest}", tag = "materials", params(("digest" = Digest, Path, description = "Their digest")),
    responses(
        (status = 200, description = "The bytes", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Vec<Table> = "application/json"),
        )),
        (status = 206, description = "A range of them", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Binary = "application/json"),
        )),
        (status = 304, description = "Unchanged"),
    )
)]
async fn get_blob(app: App, method: Method, headers: HeaderMap, Id(digest): Id) -> Result<Response, Problem> {
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

/// Returns the name, if any, of the material `id`; fails if the catalog does not list the material. Every answer about
/// a material asks the catalog first, even if the material is in memory: another process may have deleted it.
pub(super) async fn known(app: &App, id: Digest) -> Result<Option<String>, Problem> {
    if let Some(name) = app.engine.archive.catalog.material_name(id).await? {
        return Ok(name);
    }
    forget(app, id).await;
    Err(Problem::new(Kind::NotFound, absent(id)))
}

/// Frees the memory that an opened material occupies after it was deleted.
async fn forget(app: &App, id: Digest) {
    app.engine.close_material(id).await;
    app.contents.forget(app.engine.archive.catalog.tenant(), id).await;
}

fn absent(id: Digest) -> String {
    format!("there is no material {id}")
}

impl Material {
    pub(super) fn of(row: MaterialRow) -> Result<Self, Problem> {
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
