//! `/v1/audit`: who did what, readable by the tenant that it concerns.

use super::caller::Caller;
use super::extract::Query;
use super::keys::tenant_of;
use super::page::page;
use super::problem::{Kind, Problem};
use super::schemas::{CursorText, PageSize, TenantText};
use super::state::{App, Service};
use crate::catalog::ActRow;
use axum::Json;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of the audit trail.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(list_audit))
}

/// Record of one act in the audit trail.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Act)]
struct Record {
    id: String,
    /// Time of the act, in milliseconds since the Unix epoch.
    at_ms: i64,
    /// Actor: `key` and the id of the access key that was used, or another text such as the name of a command.
    actor: String,
    /// Name of the act, such as `key.create`, `key.revoke` or `key.refused`.
    action: String,
    /// Id of the key, material or other object that the act concerned.
    subject: Option<String>,
    /// Further information on the recorded act, as text.
    detail: Option<String>,
    /// Network address of the client; of an IPv6 address its first 64 bits.
    address: Option<String>,
    /// Id of the HTTP request, as its answer had it in `Request-Id`.
    request: Option<String>,
}

/// One page of the audit trail.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = AuditPage)]
struct RecordPage {
    items: Vec<Record>,
    /// Cursor of the next page of the audit trail; null on the last page.
    next: Option<String>,
}

/// Query of one page of the audit trail.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Tenant whose trail is read, for callers with the scope `instance`; by default the caller's own
    #[param(value_type = Option<TenantText>)]
    tenant: Option<String>,
    /// True to list the acts that belong to no tenant, such as attempts with wrong keys; for callers with the scope
    /// `instance`
    #[serde(default)]
    #[param(value_type = Option<bool>, nullable = false)]
    unowned: bool,
    /// Cursor at which the page starts: `next` of the previous page of the list; none for the first page
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Largest number of items on a page.
    #[param(value_type = Option<PageSize>, nullable = false)]
    limit: Option<usize>,
}

/// List the records of the audit trail, which say who did what, newest first.
#[utoipa::path(
    get, path = "/v1/audit", tag = "access", params(ListQuery),
    responses((status = 200, description = "A page", body = RecordPage))
)]
async fn list_audit(app: App, caller: Caller, Query(query): Query<ListQuery>) -> Result<Json<RecordPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let tenant = tenant_of(&caller, query.tenant.as_deref(), |detail| Problem::new(Kind::BadQuery, detail))?;
    if query.unowned && !caller.is_operator() {
        let detail = "unowned: to list acts that belong to no tenant, the caller needs the scope `instance`";
        return Err(Problem::new(Kind::MissingScope, detail));
    }
    let owner = (!query.unowned).then_some(&tenant);
    let page = app.engine.archive.catalog.acts(owner, cursor, limit).await?;
    Ok(Json(RecordPage {
        items: page.items.into_iter().map(Record::of).collect(),
        next: page.next.map(|cursor| cursor.to_string()),
    }))
}

impl Record {
    fn of(row: ActRow) -> Self {
        let ActRow { id, at_ms, actor, action, subject, detail, address, request } = row;
        Self { id, at_ms, actor, action, subject, detail, address, request }
    }
}
