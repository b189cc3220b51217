//! `/v1/keys`: access keys of a tenant, made, listed and revoked by those who administer it.

use super::caller::Caller;
use super::extract::{KeyIdPath, Query, SmallJson, parse_json};
use super::page::page;
use super::problem::{Kind, Problem};
use super::schemas::{CursorText, KeyIdText, PageSize, TenantText};
use super::state::{App, Service};
use crate::catalog::{Act, AddedKey, KeyRow, NewKey, Revoked};
use crate::jobs::{Text, check_text};
use crate::trust::{Key, Scope, Scopes, Signer, Tenant};
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of access keys.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(list_keys, create_key)).routes(routes!(revoke_key))
}

/// Request for a new access key.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct KeyRequest {
    /// Name of the key, for people.
    #[schema(value_type = Option<Text>)]
    name: Option<String>,
    /// Scopes of the key: at most those of the key that makes it, unless that has the scope `instance`.
    #[schema(value_type = Vec<Scope>, min_items = 1)]
    scopes: Scopes,
    /// Tenant of the key, for callers with the scope `instance`; by default the caller's own.
    #[schema(value_type = Option<TenantText>)]
    tenant: Option<String>,
    /// Seconds for which the key is valid. Default and upper bound: the setting `key-age`, a year. The key ends no
    /// later than the key that makes it, unless that one has the scope `instance`.
    #[schema(minimum = 1)]
    valid_s: Option<u64>,
}

/// Description of an access key, without its secret.
#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct AccessKey {
    /// Public id of the key, the second part of its text.
    #[schema(value_type = KeyIdText)]
    id: String,
    #[schema(value_type = TenantText)]
    tenant: String,
    name: String,
    #[schema(value_type = Vec<Scope>)]
    scopes: Scopes,
    /// Time of creation, in milliseconds since the Unix epoch.
    created_ms: i64,
    /// Time from which the key is refused, in milliseconds since the Unix epoch.
    expires_ms: Option<i64>,
    /// Time at which the key was revoked, in milliseconds since the Unix epoch; null if it was not.
    revoked_ms: Option<i64>,
    /// Time of the last use, exact to a minute, in milliseconds since the Unix epoch; null if the key was never used.
    used_ms: Option<i64>,
    /// Maker of the key: `key` and the id of the key that was used, or another text such as the name of a command.
    created_by: Option<String>,
}

/// A new access key with its text, which is shown this once.
#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct MadeKey {
    /// Text of the key, for the header `Authorization: Bearer KEY`. It is not stored, so it cannot be shown again.
    key: String,
    #[serde(flatten)]
    about: AccessKey,
}

/// One page of the list of access keys.
#[derive(Debug, Serialize, ToSchema)]
struct KeyPage {
    items: Vec<AccessKey>,
    /// Cursor of the next page of access keys; null on the last page.
    next: Option<String>,
}

/// Query of one page of the list of access keys.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Tenant whose keys are listed, for callers with the scope `instance`; by default the caller's own
    #[param(value_type = Option<TenantText>)]
    tenant: Option<String>,
    /// Cursor at which the page starts: `next` of the previous page of the list; none for the first page
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Largest number of items on a page.
    #[param(value_type = Option<PageSize>, nullable = false)]
    limit: Option<usize>,
}

/// Make an access key. The answer shows its text, which is not stored and cannot be shown again.
#[utoipa::path(
    post, path = "/v1/keys", tag = "access", request_body = KeyRequest,
    responses((status = 201, description = "The key, with its text", body = MadeKey))
)]
async fn create_key(app: App, caller: Caller, SmallJson(body): SmallJson) -> Result<Response, Problem> {
    let request: KeyRequest = parse_json(&body.bytes)?;
    drop(body);
    if let Some(name) = &request.name {
        check_text("name", name).map_err(Problem::invalid)?;
    }
    let tenant = tenant_of(&caller, request.tenant.as_deref(), Problem::invalid)?;
    if request.scopes.is_empty() {
        return Err(Problem::invalid("scopes: expected at least one"));
    }
    if !caller.is_operator() && !request.scopes.is_within(caller.scopes) {
        let (asked, own) = (request.scopes, caller.scopes);
        let detail = format!("scopes: found {asked}, expected at most those of the key that makes it: {own}");
        return Err(Problem::new(Kind::MissingScope, detail));
    }
    // A key that is known for a short time only makes none for longer.
    let own = caller.left().filter(|_| !caller.is_operator());
    let longest = app.engine.limits.key_age;
    let most = own.map_or(longest, |own| own.min(longest));
    let life = request.valid_s.map_or(most, Duration::from_secs);
    if life > most || life.is_zero() {
        let (found, seconds) = (life.as_secs(), most.as_secs());
        let then = if most < longest { ", when the key that makes it ends" } else { "" };
        return Err(Problem::invalid(format!("valid_s: found {found}, expected 1 to {seconds}{then}")));
    }
    let key = Key::generate().map_err(|error| Problem::internal(&error))?;
    let verifier = Signer::of(&key).and_then(|signer| signer.verifier()).map_err(|error| Problem::internal(&error))?;
    let act = caller.act("key.create", key.id());
    let new = NewKey {
        id: key.id(),
        tenant: tenant.clone(),
        name: request.name.unwrap_or_default(),
        hash: key.secret().hash(),
        verifier: Some(verifier),
        scopes: request.scopes,
        life,
        created_by: caller.actor.to_string(),
    };
    let act = Act { tenant: Some(tenant.clone()), detail: Some(new.scopes.to_string()), ..act };
    let limit = app.engine.limits.keys_each;
    match app.engine.archive.catalog.add_key(&new, limit, &act).await? {
        AddedKey::Row(row) => {
            tracing::info!(key = %row.id, tenant = %row.tenant, scopes = %row.scopes, by = %caller.actor, "key made");
            let made = MadeKey::of(&key, *row);
            let mut response = (StatusCode::CREATED, Json(made)).into_response();
            response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
            Ok(response)
        }
        AddedKey::NoTenant => Err(Problem::invalid(format!("tenant: there is no tenant {tenant}"))),
        AddedKey::Taken => Err(Problem::internal(&"the random id of a new key is that of another key")),
        AddedKey::Full(valid) => {
            let detail = format!("the tenant has {valid} of {limit} valid keys; revoke one of them first");
            Err(Problem::over_quota(limit, valid, detail))
        }
        AddedKey::Ended(all) => {
            let detail = format!(
                "the tenant has {all} keys, the most that it may have: expired and revoked ones count too, and are \
                 forgotten after 30 days"
            );
            Err(Problem::over_quota(all, all, detail))
        }
    }
}

/// List access keys, newest first. Their texts are not stored and cannot be listed.
#[utoipa::path(
    get, path = "/v1/keys", tag = "access", params(ListQuery),
    responses((status = 200, description = "A page", body = KeyPage))
)]
async fn list_keys(app: App, caller: Caller, Query(query): Query<ListQuery>) -> Result<Json<KeyPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let tenant = tenant_of(&caller, query.tenant.as_deref(), |detail| Problem::new(Kind::BadQuery, detail))?;
    let page = app.engine.archive.catalog.keys(Some(&tenant), cursor, limit).await?;
    Ok(Json(KeyPage {
        items: page.items.into_iter().map(AccessKey::of).collect(),
        next: page.next.map(|cursor| cursor.to_string()),
    }))
}

/// Revoke an access key. This node refuses it at once, other nodes within five seconds.
#[utoipa::path(
    delete, path = "/v1/keys/{id}", tag = "access", params(("id" = KeyIdText, Path, description = "Id of the key")),
    responses((status = 204, description = "Revoked"))
)]
async fn revoke_key(app: App, caller: Caller, KeyIdPath(id): KeyIdPath) -> Result<StatusCode, Problem> {
    let own = (!caller.is_operator()).then_some(&caller.tenant);
    let act = caller.act("key.revoke", id);
    match app.engine.archive.catalog.revoke_key(id, own, &act).await? {
        Revoked::Done => {
            app.guard.decisions.forget(id);
            tracing::info!(key = %id, by = %caller.actor, "key revoked");
            Ok(StatusCode::NO_CONTENT)
        }
        Revoked::Absent => Err(Problem::new(Kind::NotFound, format!("there is no key {id}"))),
        Revoked::Operator => {
            let detail = format!("the key {id} has the scope `instance`, expected a caller with it");
            Err(Problem::new(Kind::MissingScope, detail))
        }
    }
}

/// Returns the tenant that a request of `caller` names, by default the caller's own.
pub(super) fn tenant_of(
    caller: &Caller,
    named: Option<&str>,
    wrong: impl Fn(String) -> Problem,
) -> Result<Tenant, Problem> {
    let Some(named) = named else { return Ok(caller.tenant.clone()) };
    let tenant = named.parse::<Tenant>().map_err(|error| wrong(format!("tenant: {error}")))?;
    if tenant == caller.tenant || caller.is_operator() {
        return Ok(tenant);
    }
    let detail = "tenant: another one than the caller's own needs the scope `instance`";
    Err(Problem::new(Kind::MissingScope, detail))
}

impl MadeKey {
    /// Builds the answer that describes a new access key and contains the key's text.
    pub(crate) fn of(key: &Key, row: KeyRow) -> Self {
        Self { key: key.reveal(), about: AccessKey::of(row) }
    }
}

impl AccessKey {
    /// Builds the description of an access key from its row in the database.
    pub(crate) fn of(row: KeyRow) -> Self {
        Self {
            id: row.id.to_string(),
            tenant: row.tenant.to_string(),
            name: row.name,
            scopes: row.scopes,
            created_ms: row.created_ms,
            expires_ms: row.expires_ms,
            revoked_ms: row.revoked_ms,
            used_ms: row.used_ms,
            created_by: row.created_by,
        }
    }
}
