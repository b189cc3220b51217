//! `/v1/tenants`: the tenants of the service, for those who administer it.

use super::caller::{Actor, Caller};
use super::extract::{Name, SmallJson, parse_json};
use super::problem::{Kind, Problem};
use super::schemas::TenantText;
use super::state::{App, Service};
use crate::catalog::{Act, Limit, MOST_WEIGHT, Quotas, Settled, TenantChange, TenantRow, TenantState};
use crate::jobs::{Text, check_text};
use crate::trust::Tenant;
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of tenants.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(list_tenants, create_tenant)).routes(routes!(get_tenant, change_tenant))
}

/// State of a tenant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = TenantState)]
enum StateText {
    /// Requests of the tenant are answered, and its jobs start.
    Active,
    /// Requests of the tenant are refused, and its waiting jobs do not start; its data are kept.
    Closed,
}

/// Description of a tenant: its limits, and what it uses.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Tenant)]
pub(crate) struct About {
    #[schema(value_type = TenantText)]
    id: String,
    name: String,
    state: StateText,
    /// Weight of the tenant when tenants share the workers: with 200 its jobs get twice the share that they get with
    /// 100, the default.
    weight: u64,
    /// Upper bound on the total size in bytes of the tenant's measurements and materials; null for no limit.
    max_bytes: Option<u64>,
    /// Upper bound on the number of the tenant's materials; null for no limit.
    max_materials: Option<u64>,
    /// Upper bound on the number of the tenant's waiting jobs; null for no limit.
    max_queued: Option<u64>,
    /// Upper bound on the requests of the tenant to each node within a minute; null for no limit.
    max_requests: Option<u64>,
    /// Total size in bytes of the tenant's measurements and materials.
    used_bytes: u64,
    /// Number of the tenant's materials.
    used_materials: u64,
    /// Time of creation, in milliseconds since the Unix epoch.
    created_ms: i64,
}

/// All tenants of the service.
#[derive(Debug, Serialize, ToSchema)]
struct TenantList {
    items: Vec<About>,
}

/// Request for a new tenant.
#[derive(Debug, ToSchema)]
#[allow(dead_code, reason = "describes the body; serde cannot refuse unknown fields of flattened structs")]
struct TenantRequest {
    /// Id of the tenant, which never changes.
    #[schema(value_type = TenantText)]
    id: String,
    #[serde(flatten)]
    change: ChangeRequest,
}

/// Properties of a tenant to set. An absent property of an existing tenant stays unchanged; that of a new tenant gets
/// its default.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = TenantChange)]
struct ChangeRequest {
    /// Name of the tenant, for people. Default: the id.
    #[schema(value_type = Option<Text>)]
    name: Option<String>,
    /// State of the tenant. Default: `active`.
    state: Option<StateText>,
    /// Weight of the tenant when tenants share the workers: with 200 its jobs get twice the share that they get with
    /// 100, the default.
    #[schema(minimum = 1, maximum = 10_000)]
    weight: Option<u64>,
    /// Upper bound on the total size in bytes of the tenant's measurements and materials; null for no limit.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<u64>, maximum = 9_223_372_036_854_775_807_u64)]
    max_bytes: Option<Limit>,
    /// Upper bound on the number of the tenant's materials; null for no limit.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<u64>, maximum = 9_223_372_036_854_775_807_u64)]
    max_materials: Option<Limit>,
    /// Upper bound on the number of the tenant's waiting jobs; null for no limit.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<u64>, maximum = 9_223_372_036_854_775_807_u64)]
    max_queued: Option<Limit>,
    /// Upper bound on the requests of the tenant to each node within a minute; null for no limit.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<u64>, maximum = 9_223_372_036_854_775_807_u64)]
    max_requests: Option<Limit>,
}

/// Largest value that a limit of a tenant may have, because the database cannot store a larger integer.
const MOST: u64 = i64::MAX as u64;

/// Deserialises a limit of a tenant so that a null field (no limit) differs from an absent one (no change).
fn given<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Limit>, D::Error> {
    let limit = Option::<u64>::deserialize(deserializer)?;
    match limit.filter(|limit| *limit > MOST) {
        Some(limit) => Err(serde::de::Error::custom(format!("found the limit {limit}, expected at most {MOST}"))),
        None => Ok(Some(Limit(limit))),
    }
}

/// List all tenants.
#[utoipa::path(
    get, path = "/v1/tenants", tag = "tenants",
    responses((status = 200, description = "The tenants", body = TenantList))
)]
async fn list_tenants(app: App) -> Result<Json<TenantList>, Problem> {
    let rows = app.engine.archive.catalog.tenants().await?;
    Ok(Json(TenantList { items: rows.into_iter().map(About::of).collect() }))
}

/// Create a tenant.
#[utoipa::path(
    post, path = "/v1/tenants", tag = "tenants", request_body = TenantRequest,
    responses((status = 201, description = "New", body = About, headers(("Location" = String, description = "The tenant"))))
)]
async fn create_tenant(app: App, SmallJson(body): SmallJson) -> Result<Response, Problem> {
    let mut request: Map<String, Value> = parse_json(&body.bytes)?;
    let id = request.remove("id").and_then(|id| Some(id.as_str()?.to_owned()));
    let id = id.ok_or_else(|| Problem::invalid("found no text in `id`, expected the id of the new tenant"))?;
    let id: Tenant = id.parse().map_err(|error| Problem::invalid(format!("id: {error}")))?;
    let change: Result<ChangeRequest, _> = serde_json::from_value(Value::Object(request));
    let change = change.map_err(|error| Problem::invalid(error.to_string()))?.read()?;
    match app.engine.archive.catalog.create_tenant(&id, &change).await? {
        Settled::Row(row) => {
            tracing::info!(tenant = %id, "a tenant was created");
            let location = HeaderValue::from_str(&format!("/v1/tenants/{id}")).ok();
            let mut response = (StatusCode::CREATED, Json(About::of(*row))).into_response();
            response.headers_mut().extend(location.map(|value| (header::LOCATION, value)));
            Ok(response)
        }
        Settled::Taken => Err(Problem::new(Kind::InUse, format!("there is a tenant with the id or the name {id}"))),
        Settled::Absent => Err(absent(&id.to_string())),
    }
}

/// Get a tenant, with what it uses.
#[utoipa::path(
    get, path = "/v1/tenants/{tenant}", tag = "tenants", params(("tenant" = TenantText, Path, description = "Id of the tenant")),
    responses((status = 200, description = "The tenant", body = About))
)]
async fn get_tenant(app: App, caller: Caller, Name(id): Name) -> Result<Json<About>, Problem> {
    if !caller.is_operator() && id != caller.tenant.as_str() {
        return Err(absent(&id));
    }
    let row = app.engine.archive.catalog.tenant_row(&tenant(&id)?).await?;
    row.map(|row| Json(About::of(row))).ok_or_else(|| absent(&id))
}

/// Change a tenant: its name, its state, its limits, or its share of the workers.
#[utoipa::path(
    patch, path = "/v1/tenants/{tenant}", tag = "tenants", params(("tenant" = TenantText, Path, description = "Id of the tenant")),
    request_body = ChangeRequest,
    responses((status = 200, description = "Changed", body = About))
)]
async fn change_tenant(
    app: App,
    caller: Caller,
    Name(id): Name,
    SmallJson(body): SmallJson,
) -> Result<Json<About>, Problem> {
    let request: ChangeRequest = parse_json(&body.bytes)?;
    let (tenant, change) = (tenant(&id)?, request.read()?);
    match app.engine.archive.catalog.change_tenant(&tenant, &change).await? {
        Settled::Row(row) => {
            tracing::info!(%tenant, ?change, "a tenant was changed");
            record(&app, &caller, &tenant, &change).await;
            Ok(Json(About::of(*row)))
        }
        Settled::Taken => Err(Problem::new(Kind::InUse, "name: another tenant has this name")),
        Settled::Absent => Err(absent(&id)),
    }
}

/// Records the change of a tenant in the audit trail of that tenant, if the caller belongs to another one. Leaves out
/// the caller's address.
async fn record(app: &App, caller: &Caller, tenant: &Tenant, change: &TenantChange) {
    if caller.actor == Actor::Off || caller.tenant == *tenant {
        return;
    }
    let (owner, detail) = (Some(tenant.clone()), Some(change.to_string()));
    let act = Act { tenant: owner, detail, address: None, request: None, ..caller.act("tenant.change", tenant) };
    app.record(&act).await;
}

/// Parses the id of a tenant in a path.
fn tenant(id: &str) -> Result<Tenant, Problem> {
    id.parse().map_err(|error: crate::trust::NotATenant| Problem::new(Kind::NotFound, error.to_string()))
}

fn absent(id: &str) -> Problem {
    Problem::new(Kind::NotFound, format!("there is no tenant {id}"))
}

impl ChangeRequest {
    fn read(self) -> Result<TenantChange, Problem> {
        if let Some(name) = &self.name {
            check_text("name", name).map_err(Problem::invalid)?;
        }
        if let Some(weight) = self.weight.filter(|weight| !(1..=MOST_WEIGHT).contains(weight)) {
            return Err(Problem::invalid(format!("weight: found {weight}, expected 1 to {MOST_WEIGHT}")));
        }
        Ok(TenantChange {
            name: self.name,
            state: self.state.map(|state| match state {
                StateText::Active => TenantState::Active,
                StateText::Closed => TenantState::Closed,
            }),
            weight: self.weight,
            bytes: self.max_bytes,
            materials: self.max_materials,
            queued: self.max_queued,
            requests: self.max_requests,
        })
    }
}

impl About {
    /// Describes a stored tenant.
    pub(crate) fn of(row: TenantRow) -> Self {
        let Quotas { bytes, materials, queued, requests } = row.quotas;
        Self {
            id: row.id.to_string(),
            name: row.name,
            state: match row.state {
                TenantState::Active => StateText::Active,
                TenantState::Closed => StateText::Closed,
            },
            weight: row.weight,
            max_bytes: bytes,
            max_materials: materials,
            max_queued: queued,
            max_requests: requests,
            used_bytes: row.bytes,
            used_materials: row.materials,
            created_ms: row.created_ms,
        }
    }
}
