//! `/v1/materials` and `/v1/blobs`: compressed materials, their manifests and their bytes.

use super::caller::Caller;
use super::content::{self, MATERIAL};
use super::extract::{Id, Query, SmallJson, parse_json, word};
use super::measurements::deleted;
use super::page::page;
use super::problem::{Kind, Problem};
use super::schemas::{Binary, CursorText, PageSize, TenantText, VisibleText, Word};
use super::seen::{absent, find, forget, seen, seen_lately};
use super::state::{App, Service};
use crate::catalog::{MaterialFilter, MaterialRow, Namer, Opened, Opening, Sight};
use crate::domain::Quantity;
use crate::jobs::Manifest;
use crate::paper::Table;
use crate::store::{Digest, StoreError};
use crate::trust::Tenant;
use axum::Json;
use axum::extract::Request;
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
        .routes(routes!(get_material, delete_material, change_material))
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
    /// Largest number of items on a page.
    #[param(value_type = Option<PageSize>)]
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
    /// Materials to list: one's own (`own`, the default), those that other tenants share (`shared`), or the public ones
    /// of other tenants (`public`).
    #[param(value_type = Option<VisibleText>)]
    visible: Option<Whose>,
}

/// Materials to list, by the reason for which the caller may read them: owned, shared or public.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Whose {
    /// The caller's tenant owns the material.
    #[default]
    Own,
    /// Another tenant shares the material with the caller's.
    Shared,
    /// The material of another tenant is public.
    Public,
}

/// Right of others to read a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Visibility {
    /// Only the owner and the tenants that it names may read the material.
    Private,
    /// Everybody may read the material.
    Public,
}

/// Change of the right of others to read a material. A field that is absent changes nothing.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct MaterialChange {
    /// Right of everybody to read the material.
    visibility: Option<Visibility>,
    /// Ids of all tenants that may read the material although it is private; at most 100.
    #[schema(value_type = Option<Vec<TenantText>>, max_items = 100)]
    shared_with: Option<Vec<String>>,
}

/// Upper bound on the number of tenants with which one material is shared. Raising it lengthens the manifest for its
/// owner.
const MOST_READERS: usize = 100;

/// Description of a material (a compressed measurement): its content, its errors and its provenance.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Material {
    /// Digest of the material file.
    id: Digest,
    /// Latest name that a job or an upload gave to the material.
    name: Option<String>,
    /// Tags that jobs and uploads gave to the material.
    tags: Vec<String>,
    /// Right of others to read the material.
    visibility: Visibility,
    /// Ids of the tenants that may read the material although it is private; only its owner sees them.
    #[schema(value_type = Vec<TenantText>)]
    shared_with: Vec<String>,
    /// Ids of the stored measurements that the material was made from; several if their compression gave equal bytes,
    /// none if it was uploaded without a stored measurement. Only the owner of the material sees them.
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
    responses((status = 200, description = "One page of the list", body = MaterialPage))
)]
async fn list_materials(app: App, Query(query): Query<ListQuery>) -> Result<Json<MaterialPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let filter =
        MaterialFilter { quantity: query.quantity, measurement: query.measurement, tag: query.tag, q: query.q };
    let catalog = &app.engine.archive.catalog;
    let whose = query.visible.unwrap_or_default();
    if whose != Whose::Own && filter.measurement.is_some() {
        let detail = format!("measurement: the source measurements of {} materials are hidden", whose.text());
        return Err(Problem::new(Kind::BadQuery, detail));
    }
    let sight = match whose {
        Whose::Own => Sight::Own,
        Whose::Shared => Sight::Shared,
        Whose::Public => Sight::Public,
    };
    let page = catalog.visible_materials(sight, &filter, cursor, limit).await?;
    let shown = if whose == Whose::Own { Material::of } else { Material::of_another };
    let items = page.items.into_iter().map(shown).collect::<Result<_, _>>()?;
    Ok(Json(MaterialPage { items, next: page.next.map(|cursor| cursor.to_string()) }))
}

/// Get the manifest of a material: content, errors and provenance.
#[utoipa::path(
    get, path = "/v1/materials/{id}", tag = "materials", params(("id" = Digest, Path, description = "Id of the material")),
    responses((status = 200, description = "Manifest of the material", body = Material))
)]
async fn get_material(app: App, Id(id): Id) -> Result<Json<Material>, Problem> {
    if let Some(row) = app.engine.archive.catalog.material(id).await? {
        return Material::of(row).map(Json);
    }
    let seen = seen(&app, id).await?;
    let row = seen.app.engine.archive.catalog.material(id).await?;
    let row = row.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))?;
    if seen.sight == Sight::Own { Material::of(row) } else { Material::of_another(row) }.map(Json)
}

/// Change who may read a material: everybody, or the tenants that are named. Readers get the manifest without the
/// source measurements, and may run all queries until the material is made private again.
#[utoipa::path(
    patch, path = "/v1/materials/{id}", tag = "materials", params(("id" = Digest, Path, description = "Id of the material")),
    request_body = MaterialChange,
    responses((status = 200, description = "Changed", body = Material))
)]
async fn change_material(app: App, Id(id): Id, SmallJson(body): SmallJson) -> Result<Json<Material>, Problem> {
    let change: MaterialChange = parse_json(&body.bytes)?;
    let readers = change.shared_with.map(|ids| readers(&app, &ids)).transpose()?;
    let opening = Opening { is_public: change.visibility.map(|visibility| visibility == Visibility::Public), readers };
    match app.engine.archive.catalog.open_material(id, &opening).await? {
        Opened::Done => {}
        Opened::Absent => return Err(Problem::new(Kind::NotFound, absent(id))),
        Opened::NoTenant(tenant) => {
            return Err(Problem::invalid(format!("shared_with: there is no tenant {tenant}")));
        }
    }
    app.remembered.forget();
    tracing::info!(material = %id, ?opening, "the tenants that may read a material were changed");
    let row = app.engine.archive.catalog.material(id).await?;
    Material::of(row.ok_or_else(|| Problem::new(Kind::NotFound, absent(id)))?).map(Json)
}

/// Parses the ids of the tenants with which a material is shared, and leaves out that of its owner.
fn readers(app: &App, ids: &[String]) -> Result<Vec<Tenant>, Problem> {
    if ids.len() > MOST_READERS {
        return Err(Problem::invalid(format!("shared_with: {} tenants, expected at most {MOST_READERS}", ids.len())));
    }
    let parsed = ids.iter().map(|id| id.parse::<Tenant>());
    let mut readers =
        parsed.collect::<Result<Vec<_>, _>>().map_err(|error| Problem::invalid(format!("shared_with: {error}")))?;
    readers.retain(|reader| reader != app.engine.archive.catalog.tenant());
    Ok(readers)
}

/// Delete a material. The next clean-up of the store removes its bytes.
#[utoipa::path(
    delete, path = "/v1/materials/{id}", tag = "materials", params(("id" = Digest, Path, description = "Id of the material")),
    responses((status = 204, description = "The material is deleted"))
)]
async fn delete_material(app: App, Id(id): Id) -> Result<StatusCode, Problem> {
    let outcome = app.engine.archive.catalog.delete_material(id).await?;
    app.remembered.forget();
    forget(&app, id).await;
    deleted(outcome, &absent(id))
}

/// Get the file of a material.
#[utoipa::path(
    get, path = "/v1/materials/{id}/content", tag = "materials", params(("id" = Digest, Path, description = "Id of the material")),
    responses(
        (status = 200, description = "The file of the material", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 206, description = "The requested range of the file", body = Binary, content_type = "application/vnd.wavelume.material"),
        (status = 304, description = "The content still has the entity tag of `If-None-Match`"),
        (status = 307, description = "The file is at `Location`, a URL of the store that is valid for a short time"),
    )
)]
async fn get_material_content(app: App, Id(id): Id, request: Request) -> Result<Response, Problem> {
    let left = Caller::of_extensions(request.extensions())?.left();
    let (method, headers) = (request.method(), request.headers());
    let seen = seen_lately(&app, id).await?;
    let app = &seen.app;
    let name = seen.name.clone().unwrap_or_else(|| id.to_string()[..15].to_owned()) + ".wlm";
    let redirected = content::redirected(app, id, MATERIAL, Some(&name), method, headers, left);
    if let Some(answer) = redirected.await? {
        return Ok(answer);
    }
    let response = if let Some(bytes) = app.contents.get(&app.engine.archive, id).await? {
        content::respond_with(&bytes, id, MATERIAL, Some(&name), method, headers)?
    } else {
        content::respond_named(app, id, MATERIAL, Some(&name), method, headers).await?
    };
    Ok(seen.mark(response))
}

/// Get stored bytes by their digest: a material's file, a measurement's content or a report (`application/json`). Bytes
/// to which no material, measurement or report refers any more are not found.
#[utoipa::path(
    get, path = "/v1/blobs/{digest}", tag = "materials", params(("digest" = Digest, Path, description = "Digest of the bytes")),
    responses(
        (status = 200, description = "The bytes", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Vec<Table> = "application/json"),
        )),
        (status = 206, description = "The requested range of the bytes", content(
            (Binary = "application/octet-stream"), (Binary = "application/vnd.wavelume.material"), (Binary = "application/json"),
        )),
        (status = 304, description = "The content still has the entity tag of `If-None-Match`"),
    )
)]
async fn get_blob(app: App, method: Method, headers: HeaderMap, Id(digest): Id) -> Result<Response, Problem> {
    let media_type = match app.engine.archive.catalog.namer(digest).await? {
        Some(Namer::Material) => MATERIAL,
        Some(Namer::Report) => "application/json",
        Some(Namer::Measurement) => "application/octet-stream",
        // The bytes may exist until the next sweep, but nobody may read them. Others' materials may be read.
        None => {
            let seen = find(&app, digest).await?.ok_or(StoreError::NotFound(digest))?;
            let response = content::respond(&seen.app, digest, MATERIAL, None, &method, &headers).await?;
            return Ok(seen.mark(response));
        }
    };
    content::respond(&app, digest, media_type, None, &method, &headers).await
}

impl Whose {
    /// Returns the value `own`, `shared` or `public` of the query parameter that chooses the materials to list.
    fn text(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Shared => "shared",
            Self::Public => "public",
        }
    }
}

impl Material {
    /// Builds the description of another tenant's material. Leaves out the measurements from which it was made and the
    /// tenants that may read it.
    fn of_another(row: MaterialRow) -> Result<Self, Problem> {
        let mut material = Self::of(MaterialRow { measurements: Vec::new(), readers: Vec::new(), ..row })?;
        material.manifest.hide_measurements();
        Ok(material)
    }

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
            visibility: if row.is_public { Visibility::Public } else { Visibility::Private },
            shared_with: row.readers.iter().map(ToString::to_string).collect(),
            measurements: row.measurements,
            manifest,
            created_ms: row.created_ms,
        })
    }
}
