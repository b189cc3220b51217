//! Rows of tenants: the owners of everything else, their limits and their shares of the workers.

use super::database::Catalog;
use super::error::{CatalogError, tenant};
use super::search::composed;
use crate::trust::Tenant;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::fmt;

/// State of a tenant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TenantState {
    /// Requests of the tenant are answered, and its jobs start.
    Active,
    /// Requests of the tenant are refused, and its waiting jobs do not start; its data are kept.
    Closed,
}

/// Limits on what a tenant may have; `None` is no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Quotas {
    /// Upper bound on the total size in bytes of the tenant's measurements and materials.
    pub bytes: Option<u64>,
    /// Upper bound on the number of the tenant's materials.
    pub materials: Option<u64>,
    /// Upper bound on the number of the tenant's waiting jobs.
    pub queued: Option<u64>,
    /// Upper bound on the requests of the tenant to each process within a minute.
    pub requests: Option<u64>,
}

/// Limit on an amount that a tenant may have, such as its number of materials; `None` is no limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Limit(pub Option<u64>);

/// A tenant as stored in the catalog, with what it uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TenantRow {
    /// Id of the tenant.
    pub id: Tenant,
    /// Name of the tenant, for people.
    pub name: String,
    /// State of the tenant.
    pub state: TenantState,
    /// Weight of the tenant when tenants share the workers: with 200 its jobs get twice the share that they get with
    /// 100, the default.
    pub weight: u64,
    /// Limits on what the tenant may have.
    pub quotas: Quotas,
    /// Total size in bytes of the tenant's measurements and materials.
    pub bytes: u64,
    /// Number of the tenant's materials.
    pub materials: u64,
    /// Time at which the tenant was created, ms of the Unix epoch.
    pub created_ms: i64,
}

/// Change of the properties of a tenant; a field that is `None` changes nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct TenantChange {
    /// Name of the tenant, for people.
    pub name: Option<String>,
    /// State of the tenant.
    pub state: Option<TenantState>,
    /// Weight of the tenant when tenants share the workers, from 1 to 10,000; 100 is the default.
    pub weight: Option<u64>,
    /// Limit on the total size in bytes of the tenant's measurements and materials.
    pub bytes: Option<Limit>,
    /// Limit on the number of the tenant's materials.
    pub materials: Option<Limit>,
    /// Limit on the number of the tenant's waiting jobs.
    pub queued: Option<Limit>,
    /// Limit on the requests of the tenant to each process within a minute.
    pub requests: Option<Limit>,
}

/// Outcome of creating or changing a tenant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Settled {
    /// The tenant was created or changed as requested; holds its new description.
    Row(Box<TenantRow>),
    /// Another tenant has the requested id or name, so nothing was written.
    Taken,
    /// No tenant has the given id.
    Absent,
}

macro_rules! columns {
    () => {
        "SELECT t.id, t.name, t.state, t.weight, t.most_bytes, t.most_materials, t.most_queued, t.most_requests, \
         t.created_at, \
         CAST(COALESCE((SELECT SUM(u.bytes) FROM usage u WHERE u.tenant = t.id), 0) AS BIGINT) AS bytes, \
         CAST(COALESCE((SELECT SUM(u.materials) FROM usage u WHERE u.tenant = t.id), 0) AS BIGINT) AS materials \
         FROM tenants t"
    };
}

impl TenantState {
    /// All states of a tenant.
    pub(crate) const ALL: [Self; 2] = [Self::Active, Self::Closed];

    /// Returns the stable name of the state.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Closed => "closed",
        }
    }
}

impl Catalog {
    /// Returns the ids of all tenants, sorted.
    pub(crate) async fn tenant_ids(&self) -> Result<Vec<Tenant>, CatalogError> {
        let rows = sqlx::query("SELECT id FROM tenants ORDER BY id").fetch_all(&self.pool).await?;
        let ids = rows.iter().map(|row| {
            let id: String = row.try_get(0)?;
            tenant("tenants", &id, &id)
        });
        ids.collect()
    }

    /// Returns all tenants, in the order of their ids.
    pub(crate) async fn tenants(&self) -> Result<Vec<TenantRow>, CatalogError> {
        let rows = sqlx::query(concat!(columns!(), " ORDER BY t.id")).fetch_all(&self.pool).await?;
        rows.iter().map(read).collect()
    }

    /// Returns the tenant with the given id, if it exists.
    pub(crate) async fn tenant_row(&self, id: &Tenant) -> Result<Option<TenantRow>, CatalogError> {
        let row = sqlx::query(concat!(columns!(), " WHERE t.id = $1"))
            .bind(id.to_string())
            .fetch_optional(&self.pool)
            .await?;
        row.map(|row| read(&row)).transpose()
    }

    /// Returns the limit on the requests of a tenant to each process within a minute.
    pub(crate) async fn most_requests(&self, id: &Tenant) -> Result<Option<u64>, CatalogError> {
        let row = sqlx::query("SELECT most_requests FROM tenants WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.pool)
            .await?;
        let most = row.map(|row| row.try_get::<Option<i64>, _>(0)).transpose()?.flatten();
        Ok(most.map(|most| most.max(0) as u64))
    }

    /// Creates a tenant with the given name, weight in the queue of jobs, and limits.
    pub(crate) async fn create_tenant(&self, id: &Tenant, change: &TenantChange) -> Result<Settled, CatalogError> {
        let turn = self.turn().await;
        let name = change.name.as_deref().map_or_else(|| id.to_string(), composed);
        let inserted = sqlx::query(
            self.sql("INSERT INTO tenants (id, name, created_at) VALUES ($1, $2, {now}) ON CONFLICT DO NOTHING"),
        )
        .bind(id.to_string())
        .bind(name)
        .execute(&self.pool)
        .await?;
        drop(turn);
        if inserted.rows_affected() == 0 {
            return Ok(Settled::Taken);
        }
        self.change_tenant(id, &TenantChange { name: None, ..change.clone() }).await
    }

    /// Changes the name, state, weight or limits of a tenant.
    pub(crate) async fn change_tenant(&self, id: &Tenant, change: &TenantChange) -> Result<Settled, CatalogError> {
        let turn = self.turn().await;
        // 1 for a limit that changes, whatever it becomes.
        let changes = |limit: Option<Limit>| i64::from(limit.is_some());
        let limit = |limit: Option<Limit>| limit?.0.map(|most| i64::try_from(most).unwrap_or(i64::MAX));
        let changed = sqlx::query(
            "UPDATE tenants SET name = COALESCE($2, name), state = COALESCE($3, state), \
             weight = COALESCE($4, weight), \
             most_bytes = CASE WHEN $5 <> 0 THEN $6 ELSE most_bytes END, \
             most_materials = CASE WHEN $7 <> 0 THEN $8 ELSE most_materials END, \
             most_queued = CASE WHEN $9 <> 0 THEN $10 ELSE most_queued END, \
             most_requests = CASE WHEN $11 <> 0 THEN $12 ELSE most_requests END WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(change.name.as_deref().map(composed))
        .bind(change.state.map(|state| state.name().to_owned()))
        .bind(change.weight.map(|weight| weight.clamp(1, MOST_WEIGHT) as i64))
        .bind(changes(change.bytes))
        .bind(limit(change.bytes))
        .bind(changes(change.materials))
        .bind(limit(change.materials))
        .bind(changes(change.queued))
        .bind(limit(change.queued))
        .bind(changes(change.requests))
        .bind(limit(change.requests))
        .execute(&self.pool)
        .await;
        drop(turn);
        match changed {
            Err(sqlx::Error::Database(error)) if error.is_unique_violation() => return Ok(Settled::Taken),
            changed => changed?,
        };
        Ok(self.tenant_row(id).await?.map_or(Settled::Absent, |row| Settled::Row(Box::new(row))))
    }
}

impl fmt::Display for TenantChange {
    /// Writes the changed properties of a tenant with their new values, for the audit trail.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, state, weight, bytes, materials, queued, requests } = self;
        let limit = |limit: &Option<Limit>| {
            limit.map(|Limit(most)| most.map_or_else(|| "none".to_owned(), |most| most.to_string()))
        };
        let changes = [
            ("name", name.clone()),
            ("state", state.map(|state| state.name().to_owned())),
            ("weight", weight.map(|weight| weight.to_string())),
            ("max_bytes", limit(bytes)),
            ("max_materials", limit(materials)),
            ("max_queued", limit(queued)),
            ("max_requests", limit(requests)),
        ];
        let changes = changes.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", value?)));
        f.write_str(&changes.collect::<Vec<_>>().join(", "))
    }
}

/// Upper bound on the weight of a tenant when tenants share the workers; the default weight is 100. Raising it lets one
/// tenant delay others for longer.
pub(crate) const MOST_WEIGHT: u64 = 10_000;

fn read(row: &AnyRow) -> Result<TenantRow, CatalogError> {
    let (id, name): (String, String) = (row.try_get("id")?, row.try_get("state")?);
    let state = TenantState::ALL.into_iter().find(|state| state.name() == name);
    let state = state.ok_or_else(|| CatalogError::Row {
        table: "tenants",
        id: id.clone(),
        reason: format!("unknown state `{name}`"),
    });
    let number = |name: &str| row.try_get::<i64, _>(name).map(|number| number.max(0) as u64);
    let limit = |name: &str| row.try_get::<Option<i64>, _>(name).map(|most| most.map(|most| most.max(0) as u64));
    Ok(TenantRow {
        name: row.try_get("name")?,
        state: state?,
        weight: number("weight")?.max(1),
        quotas: Quotas {
            bytes: limit("most_bytes")?,
            materials: limit("most_materials")?,
            queued: limit("most_queued")?,
            requests: limit("most_requests")?,
        },
        bytes: number("bytes")?,
        materials: number("materials")?,
        created_ms: row.try_get("created_at")?,
        id: tenant("tenants", &id, &id)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    #[tokio::test]
    async fn tenants_are_made_changed_and_listed() {
        for (catalog, _guard) in testing::catalogs().await {
            let lab: Tenant = "lab".parse().unwrap();
            assert_eq!(catalog.change_tenant(&lab, &TenantChange::default()).await.unwrap(), Settled::Absent);
            let change = TenantChange {
                name: Some("Laboratory".to_owned()),
                bytes: Some(Limit(Some(1000))),
                weight: Some(300),
                ..TenantChange::default()
            };
            let Settled::Row(row) = catalog.create_tenant(&lab, &change).await.unwrap() else { panic!() };
            let quotas = Quotas { bytes: Some(1000), ..Quotas::default() };
            assert_eq!((row.name.as_str(), row.weight, row.quotas), ("Laboratory", 300, quotas));
            assert_eq!((row.state, row.bytes, row.materials), (TenantState::Active, 0, 0));
            assert_eq!(catalog.create_tenant(&lab, &change).await.unwrap(), Settled::Taken);
            let other: Tenant = "other".parse().unwrap();
            assert_eq!(catalog.create_tenant(&other, &change).await.unwrap(), Settled::Taken, "the name is taken");
            let named = |name: &str| TenantChange { name: Some(name.to_owned()), ..TenantChange::default() };
            let Settled::Row(row) = catalog.create_tenant(&other, &named("Mu\u{308}he")).await.unwrap() else {
                panic!()
            };
            assert_eq!(row.name, "Mühe");
            assert_eq!(catalog.change_tenant(&lab, &named("Mühe")).await.unwrap(), Settled::Taken);
            assert_eq!(catalog.change_tenant(&other, &change).await.unwrap(), Settled::Taken);

            let close = TenantChange {
                state: Some(TenantState::Closed),
                bytes: Some(Limit(None)),
                queued: Some(Limit(Some(0))),
                ..TenantChange::default()
            };
            assert_eq!(close.to_string(), "state closed, max_bytes none, max_queued 0");
            let Settled::Row(row) = catalog.change_tenant(&lab, &close).await.unwrap() else { panic!() };
            let quotas = Quotas { queued: Some(0), ..Quotas::default() };
            assert_eq!((row.state, row.quotas, row.weight), (TenantState::Closed, quotas, 300));
            let ids: Vec<_> = catalog.tenants().await.unwrap().into_iter().map(|row| row.id.to_string()).collect();
            assert_eq!(ids, ["default", "lab", "other"]);
            assert_eq!(catalog.tenant_row(catalog.tenant()).await.unwrap().unwrap().quotas, Quotas::default());
        }
    }
}
