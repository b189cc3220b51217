//! Audit trail: rows that say who did what, kept for longer than the objects that were acted on.

use super::database::{Catalog, Write};
use super::error::CatalogError;
use super::page::{Cursor, Page, filtered};
use crate::trust::Tenant;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::time::Duration;

/// An act to record in the audit trail. It never holds the secret of a key.
#[derive(Clone, Debug, Default)]
pub(crate) struct Act {
    /// Tenant that may read the record; `None` if the act belongs to no tenant, such as an attempt with an unknown key.
    pub tenant: Option<Tenant>,
    /// Actor: the id of the access key that was used, directly or by its token or link; otherwise the name of the
    /// command.
    pub actor: String,
    /// Name of the act to record, such as `key.create`.
    pub action: &'static str,
    /// Id of the key, material or other object that the act concerned.
    pub subject: Option<String>,
    /// Further facts about the act to record, in words.
    pub detail: Option<String>,
    /// Network address of the client.
    pub address: Option<String>,
    /// Id of the HTTP request.
    pub request: Option<String>,
}

/// An act as recorded in the audit trail.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ActRow {
    /// Id of the record in the audit trail.
    pub id: String,
    /// Time of the recorded act, ms of the Unix epoch.
    pub at_ms: i64,
    /// Actor: the id of the access key that was used, directly or by its token or link; otherwise the name of the
    /// command.
    pub actor: String,
    /// Name of the recorded act, such as `key.create`.
    pub action: String,
    /// Id of the key, material or other object that the act concerned.
    pub subject: Option<String>,
    /// Further facts about the recorded act, in words.
    pub detail: Option<String>,
    /// Network address of the client.
    pub address: Option<String>,
    /// Id of the HTTP request.
    pub request: Option<String>,
}

/// Upper bound on the old records of the audit trail that one transaction deletes. Raising it makes other writers wait
/// for longer.
const MOST: i64 = 1000;

/// Age at which records of the audit trail that belong to no tenant, which anybody may cause, are deleted. Raising it
/// lets a flood of wrong keys take more room.
const UNOWNED: Duration = Duration::from_hours(30 * 24);

impl Catalog {
    /// Records an act in the audit trail, in a transaction of its own.
    pub(crate) async fn record(&self, act: &Act) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            record(&mut write, act).await?;
            write.commit().await
        })
        .await
    }

    /// Returns a page of the audit trail of a tenant, newest first; with `None`, of the acts that belong to no tenant.
    pub(crate) async fn acts(
        &self,
        tenant: Option<&Tenant>,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<ActRow>, CatalogError> {
        let after = after.unwrap_or_else(Cursor::newest);
        let statement = filtered(
            "SELECT id, at, actor, action, subject, detail, address, request FROM audit WHERE (at, id) < ($1, $2)",
            &[(tenant.is_some(), "tenant = $3"), (tenant.is_none(), "tenant IS NULL")],
            " ORDER BY at DESC, id DESC LIMIT $4",
        );
        let mut list = self.list().await?;
        let rows = sqlx::query(statement)
            .bind(after.created_at)
            .bind(after.id)
            .bind(tenant.map(Tenant::to_string).unwrap_or_default())
            .bind(limit as i64 + 1)
            .fetch_all(&mut *list)
            .await?;
        list.commit().await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::of(rows, limit, |row| Cursor { created_at: row.at_ms, id: row.id.clone() }))
    }

    /// Deletes records of the audit trail that are older than `age`. A record that belongs to no tenant is also deleted
    /// once it is older than 30 days.
    pub(super) async fn forget_acts(&self, age: Duration) -> Result<(), CatalogError> {
        let old = "WITH old AS MATERIALIZED (SELECT id FROM audit WHERE at < {now} - $1 ORDER BY at LIMIT $2) \
                   DELETE FROM audit WHERE id {among SELECT id FROM old}";
        let unowned = "WITH old AS MATERIALIZED (SELECT id FROM audit WHERE tenant IS NULL AND at < {now} - $1 \
                       ORDER BY at LIMIT $2) DELETE FROM audit WHERE id {among SELECT id FROM old}";
        for (statement, age) in [(old, age), (unowned, age.min(UNOWNED))] {
            loop {
                let turn = self.turn().await;
                let gone = sqlx::query(self.sql(statement)).bind(age.as_millis() as i64).bind(MOST);
                let gone = gone.execute(&self.pool).await?;
                drop(turn);
                if gone.rows_affected() < MOST as u64 {
                    break;
                }
            }
        }
        Ok(())
    }
}

/// Records an act in the audit trail, in the transaction that carries out the act.
pub(super) async fn record(write: &mut Write, act: &Act) -> Result<(), CatalogError> {
    sqlx::query(
        "INSERT INTO audit (id, at, tenant, actor, action, subject, detail, address, request) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(uuid::Uuid::now_v7().to_string())
    .bind(write.now)
    .bind(act.tenant.as_ref().map(Tenant::to_string))
    .bind(act.actor.clone())
    .bind(act.action)
    .bind(act.subject.clone())
    .bind(act.detail.clone())
    .bind(act.address.clone())
    .bind(act.request.clone())
    .execute(&mut *write.transaction)
    .await?;
    Ok(())
}

fn read(row: &AnyRow) -> Result<ActRow, CatalogError> {
    Ok(ActRow {
        id: row.try_get(0)?,
        at_ms: row.try_get(1)?,
        actor: row.try_get(2)?,
        action: row.try_get(3)?,
        subject: row.try_get(4)?,
        detail: row.try_get(5)?,
        address: row.try_get(6)?,
        request: row.try_get(7)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    #[tokio::test]
    async fn a_trail_is_read_in_pages_by_its_tenant_and_forgotten_by_age() {
        for (catalog, _guard) in testing::catalogs().await {
            let act = |tenant: Option<&str>, action| Act {
                tenant: tenant.map(|id| id.parse().unwrap()),
                actor: "someone".to_owned(),
                action,
                detail: Some("é \"x\"".to_owned()),
                ..Act::default()
            };
            for (tenant, action) in [(Some("a"), "one"), (Some("b"), "two"), (None, "three"), (Some("a"), "four")] {
                catalog.record(&act(tenant, action)).await.unwrap();
            }
            let a: Tenant = "a".parse().unwrap();
            let first = catalog.acts(Some(&a), None, 1).await.unwrap();
            assert_eq!((first.items[0].action.as_str(), first.items.len()), ("four", 1));
            assert_eq!((first.items[0].detail.as_deref(), &first.items[0].subject), (Some("é \"x\""), &None));
            let second = catalog.acts(Some(&a), first.next, 1).await.unwrap();
            assert_eq!((second.items[0].action.as_str(), second.next), ("one", None));
            assert_eq!(catalog.acts(None, None, 9).await.unwrap().items[0].action, "three");
            catalog.forget_acts(Duration::from_mins(1)).await.unwrap();
            assert_eq!(testing::count(&catalog, "audit").await, 4);
            sqlx::query("UPDATE audit SET at = 0 WHERE tenant = 'a'").execute(&catalog.pool).await.unwrap();
            catalog.forget_acts(Duration::from_mins(1)).await.unwrap();
            assert_eq!(testing::count(&catalog, "audit").await, 2);
            sqlx::query("UPDATE audit SET at = at - 2678400000").execute(&catalog.pool).await.unwrap();
            catalog.forget_acts(Duration::from_hours(400 * 24)).await.unwrap();
            assert_eq!(testing::count(&catalog, "audit").await, 1, "31 days are too old for what belongs to nobody");
        }
    }
}
