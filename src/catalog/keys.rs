//! Rows of access keys: made, looked up by their id, revoked. A row holds a hash, from which no key can be made.

use super::audit::{Act, record};
use super::database::{Catalog, Write};
use super::error::{CatalogError, breaks_reference};
use super::page::{Cursor, Page, filtered};
use super::search::composed;
use crate::trust::{KeyId, Scope, Scopes, SecretHash, Tenant, Verifier};
use sqlx::Row;
use sqlx::any::AnyRow;
use std::time::Duration;

/// An access key to store.
#[derive(Clone, Debug)]
pub(crate) struct NewKey {
    /// Public id of the key, the part of its text by which it is looked up.
    pub id: KeyId,
    /// Tenant for which the key acts.
    pub tenant: Tenant,
    /// Name of the key, for people.
    pub name: String,
    /// Hash of the secret part of the access key.
    pub hash: SecretHash,
    /// Public half of the key pair with which the access key signs links and tokens.
    pub verifier: Option<Verifier>,
    /// Scopes of the key: what it allows.
    pub scopes: Scopes,
    /// Time from now after which the access key is refused.
    pub life: Duration,
    /// Id of the key by which this one was created, or another word for its creator.
    pub created_by: String,
}

/// An access key as stored, without its hash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KeyRow {
    /// Public id of the key.
    pub id: KeyId,
    /// Tenant for which the key acts.
    pub tenant: Tenant,
    /// Name of the key, for people.
    pub name: String,
    /// Scopes of the key: what it allows.
    pub scopes: Scopes,
    /// Time at which the key was created, ms of the Unix epoch.
    pub created_ms: i64,
    /// Time from which the key is refused, ms of the Unix epoch.
    pub expires_ms: Option<i64>,
    /// Time at which the key was revoked, ms of the Unix epoch.
    pub revoked_ms: Option<i64>,
    /// Time at which the key was last used, exact to a minute, in ms of the Unix epoch.
    pub used_ms: Option<i64>,
    /// Id of the key by which this one was created, or another word for its creator.
    pub created_by: Option<String>,
}

/// Stored facts about an access key, by which a request that presents the key is accepted or refused.
#[derive(Clone, Debug)]
pub(crate) struct Credential {
    /// Row of the access key in the catalog.
    pub row: KeyRow,
    /// Hash of the secret part of the access key.
    pub hash: SecretHash,
    /// Public half of the key pair with which the access key signs links and tokens.
    pub verifier: Option<Verifier>,
    /// Time for which the key is still valid; zero if it has expired or was revoked.
    pub left: Duration,
    /// True if the tenant of the key is closed.
    pub is_closed: bool,
    /// True if the last recorded use of the key is older than [`USED`], so that a use now is to be recorded.
    pub is_use_old: bool,
}

/// Outcome of storing an access key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum AddedKey {
    /// The access key is stored.
    Row(Box<KeyRow>),
    /// The tenant that the access key names does not exist.
    NoTenant,
    /// A key with this id is stored already.
    Taken,
    /// The key is refused, because the tenant already has the given number of valid keys, its limit.
    Full(u64),
    /// The key is refused, because the tenant already has the given number of stored keys, expired and revoked ones
    /// included.
    Ended(u64),
}

/// Outcome of revoking an access key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Revoked {
    /// The access key is revoked.
    Done,
    /// There is no access key with the given id, or it is another tenant's.
    Absent,
    /// The key is not revoked, because it has the scope `instance` and the caller does not.
    Operator,
}

/// Interval at which the last use of an access key is recorded. Raising it writes less and records the use less
/// exactly.
const USED: Duration = Duration::from_mins(1);

/// Upper bound on the stored keys of a tenant, valid or ended, as a multiple of the limit on its valid keys. Raising it
/// lets a tenant replace its keys more often before ended ones are deleted, and lengthens the search through them.
const ROWS: u64 = 10;

/// Upper bound on the expired and revoked access keys that one transaction deletes. Raising it makes other writers wait
/// for longer.
const MOST: i64 = 1000;

macro_rules! columns {
    () => {
        "id, tenant, name, scopes, created_at, expires_at, revoked_at, used_at, created_by"
    };
}

impl Catalog {
    /// Stores an access key and records that it was made. A tenant has at most `most` valid keys.
    pub(crate) async fn add_key(&self, new: &NewKey, most: u64, act: &Act) -> Result<AddedKey, CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            // Keys of one tenant are made one after the other, so that none is beyond the bound.
            sqlx::query(write.sql("SELECT id FROM tenants WHERE id = $1{lock}"))
                .bind(new.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            let (valid, all) = count(&mut write, &new.tenant, most.saturating_mul(ROWS)).await?;
            if valid >= most {
                return Ok(AddedKey::Full(valid));
            }
            if all >= most.saturating_mul(ROWS) {
                return Ok(AddedKey::Ended(all));
            }
            let row = match insert(&mut write, new).await {
                Err(CatalogError::Sql(error)) if breaks_reference(&error) => return Ok(AddedKey::NoTenant),
                Ok(None) => return Ok(AddedKey::Taken),
                row => row?,
            };
            record(&mut write, act).await?;
            write.commit().await?;
            Ok(row.map_or(AddedKey::Taken, |row| AddedKey::Row(Box::new(row))))
        })
        .await
    }

    /// Stores the first access key. Returns false, and stores nothing, if there has ever been a key.
    pub(crate) async fn add_first_key(&self, new: &NewKey, act: &Act) -> Result<bool, CatalogError> {
        self.repeat(|again| async move {
            let mut write = self.write().await?;
            // The update of nothing lets nodes that start at once come one after the other.
            sqlx::query(
                "INSERT INTO facts (name, value) VALUES ('first_key', '') \
                 ON CONFLICT (name) DO UPDATE SET value = excluded.value",
            )
            .execute(&mut *write.transaction)
            .await?;
            let any = sqlx::query("SELECT id FROM keys LIMIT 1").fetch_optional(&mut *write.transaction).await?;
            if let Some(row) = any {
                // A repetition after an answer that was lost finds the key that it has stored.
                return Ok(again && row.try_get::<String, _>(0)? == new.id.to_string());
            }
            insert(&mut write, new).await?;
            record(&mut write, act).await?;
            write.commit().await?;
            Ok(true)
        })
        .await
    }

    /// Returns the stored facts by which a request that presents the key `id` is accepted or refused, if there is such
    /// a key.
    pub(crate) async fn credential(&self, id: KeyId) -> Result<Option<Credential>, CatalogError> {
        let row = sqlx::query(self.sql(concat!(
            "SELECT ",
            columns!(),
            ", hash, verifier, {now} AS now, (SELECT t.state FROM tenants t WHERE t.id = keys.tenant) AS tenant_state \
             FROM keys WHERE id = $1"
        )))
        .bind(id.to_string())
        .fetch_optional(&self.pool)
        .await?;
        let Some(found) = row else { return Ok(None) };
        let (row, now) = (read(&found)?, found.try_get::<i64, _>(11)?);
        let left = match (row.revoked_ms, row.expires_ms) {
            (Some(_), _) => 0,
            (None, Some(expires)) => expires.saturating_sub(now).max(0),
            (None, None) => i64::MAX,
        };
        let (hash, verifier): (String, Option<String>) = (found.try_get(9)?, found.try_get(10)?);
        let id = id.to_string();
        let is_use_old = row.used_ms.is_none_or(|used| now.saturating_sub(used) >= USED.as_millis() as i64);
        Ok(Some(Credential {
            hash: hash.parse().map_err(|error| fault(&id, &error))?,
            verifier: verifier.map(|text| text.parse().map_err(|error| fault(&id, &error))).transpose()?,
            left: Duration::from_millis(left as u64),
            is_closed: found.try_get::<Option<String>, _>(12)?.as_deref() == Some("closed"),
            is_use_old,
            row,
        }))
    }

    /// Records that a key is used now, unless a use within the last minute is recorded.
    pub(crate) async fn note_use(&self, id: KeyId) -> Result<(), CatalogError> {
        let _turn = self.turn().await;
        sqlx::query(
            self.sql("UPDATE keys SET used_at = {now} WHERE id = $1 AND (used_at IS NULL OR used_at <= {now} - $2)"),
        )
        .bind(id.to_string())
        .bind(USED.as_millis() as i64)
        .execute(&self.pool)
        .await?;
        Ok(())
    }

    /// Returns a page of the keys of a tenant, newest first; with `None`, of the keys of all tenants.
    pub(crate) async fn keys(
        &self,
        tenant: Option<&Tenant>,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<KeyRow>, CatalogError> {
        let after = after.unwrap_or_else(Cursor::newest);
        let statement = filtered(
            concat!("SELECT ", columns!(), " FROM keys WHERE (created_at, id) < ($1, $2)"),
            &[(tenant.is_some(), "tenant = $3")],
            " ORDER BY created_at DESC, id DESC LIMIT $4",
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
        Ok(Page::of(rows, limit, |row| Cursor { created_at: row.created_ms, id: row.id.to_string() }))
    }

    /// Revokes a key, and records the act. With `tenant`, only keys of this tenant are found, and those with the scope
    /// `instance` are not revoked. A key that is revoked already stays as it is.
    pub(crate) async fn revoke_key(
        &self,
        id: KeyId,
        tenant: Option<&Tenant>,
        act: &Act,
    ) -> Result<Revoked, CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            let found = sqlx::query(write.sql("SELECT tenant, revoked_at, scopes FROM keys WHERE id = $1{lock}"))
                .bind(id.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            let Some(found) = found else { return Ok(Revoked::Absent) };
            let (owner, scopes): (String, String) = (found.try_get(0)?, found.try_get(2)?);
            if tenant.is_some_and(|tenant| tenant.as_str() != owner) {
                return Ok(Revoked::Absent);
            }
            let scopes: Scopes = scopes.parse().map_err(|error| fault(&id.to_string(), &error))?;
            if tenant.is_some() && scopes.has(Scope::Instance) {
                return Ok(Revoked::Operator);
            }
            if found.try_get::<Option<i64>, _>(1)?.is_some() {
                return Ok(Revoked::Done);
            }
            sqlx::query("UPDATE keys SET revoked_at = $2 WHERE id = $1")
                .bind(id.to_string())
                .bind(write.now)
                .execute(&mut *write.transaction)
                .await?;
            record(&mut write, &Act { tenant: owner.parse().ok(), ..act.clone() }).await?;
            write.commit().await?;
            Ok(Revoked::Done)
        })
        .await
    }

    /// Deletes access keys that expired or were revoked more than `age` ago. The newest key stays: a service without
    /// any stored key would accept a first key from its environment.
    pub(super) async fn forget_ended_keys(&self, age: Duration) -> Result<(), CatalogError> {
        loop {
            let turn = self.turn().await;
            let gone = sqlx::query(self.sql(
                "WITH old AS MATERIALIZED (SELECT id FROM keys WHERE COALESCE(revoked_at, expires_at) < {now} - $1 \
                 AND created_at < (SELECT MAX(created_at) FROM keys) LIMIT $2) \
                 DELETE FROM keys WHERE id {among SELECT id FROM old}",
            ))
            .bind(age.as_millis() as i64)
            .bind(MOST)
            .execute(&self.pool)
            .await?;
            drop(turn);
            if gone.rows_affected() < MOST as u64 {
                return Ok(());
            }
        }
    }
}

/// Returns the number of valid keys and the number of all keys of a tenant, counted over at most `rows` stored keys.
async fn count(write: &mut Write, tenant: &Tenant, rows: u64) -> Result<(u64, u64), CatalogError> {
    let counted = sqlx::query(
        "SELECT CAST(COALESCE(SUM(CASE WHEN revoked_at IS NULL AND (expires_at IS NULL OR expires_at > $2) THEN 1 \
         ELSE 0 END), 0) AS BIGINT), COUNT(*) \
         FROM (SELECT revoked_at, expires_at FROM keys WHERE tenant = $1 ORDER BY created_at DESC, id DESC LIMIT $3) AS k",
    )
    .bind(tenant.to_string())
    .bind(write.now)
    .bind(i64::try_from(rows).unwrap_or(i64::MAX))
    .fetch_one(&mut *write.transaction)
    .await?;
    let (valid, all): (i64, i64) = (counted.try_get(0)?, counted.try_get(1)?);
    Ok((valid.max(0) as u64, all.max(0) as u64))
}

/// Inserts the row of a key; returns `None` if its id is taken.
async fn insert(write: &mut Write, new: &NewKey) -> Result<Option<KeyRow>, CatalogError> {
    let expires_ms = write.now.saturating_add(i64::try_from(new.life.as_millis()).unwrap_or(i64::MAX));
    let inserted = sqlx::query(
        "INSERT INTO keys (id, tenant, name, hash, verifier, scopes, expires_at, created_by, created_at) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9) ON CONFLICT (id) DO NOTHING",
    )
    .bind(new.id.to_string())
    .bind(new.tenant.to_string())
    .bind(composed(&new.name))
    .bind(new.hash.to_string())
    .bind(new.verifier.map(|verifier| verifier.to_string()))
    .bind(new.scopes.to_string())
    .bind(expires_ms)
    .bind(new.created_by.clone())
    .bind(write.now)
    .execute(&mut *write.transaction)
    .await?;
    Ok((inserted.rows_affected() == 1).then(|| KeyRow {
        id: new.id,
        tenant: new.tenant.clone(),
        name: composed(&new.name),
        scopes: new.scopes,
        created_ms: write.now,
        expires_ms: Some(expires_ms),
        revoked_ms: None,
        used_ms: None,
        created_by: Some(new.created_by.clone()),
    }))
}

fn read(row: &AnyRow) -> Result<KeyRow, CatalogError> {
    let id: String = row.try_get(0)?;
    let (tenant, scopes): (String, String) = (row.try_get(1)?, row.try_get(3)?);
    Ok(KeyRow {
        id: id.parse().map_err(|error| fault(&id, &error))?,
        tenant: tenant.parse().map_err(|error| fault(&id, &error))?,
        name: row.try_get(2)?,
        scopes: scopes.parse().map_err(|error| fault(&id, &error))?,
        created_ms: row.try_get(4)?,
        expires_ms: row.try_get(5)?,
        revoked_ms: row.try_get(6)?,
        used_ms: row.try_get(7)?,
        created_by: row.try_get(8)?,
    })
}

fn fault<E: std::fmt::Display>(id: &str, error: &E) -> CatalogError {
    CatalogError::Row { table: "keys", id: id.to_owned(), reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;
    use crate::trust::Key;

    fn new(key: &Key, scopes: &str, life: Duration) -> NewKey {
        NewKey {
            id: key.id(),
            tenant: Tenant::default(),
            name: "fu\u{308}r \"mich\"".to_owned(),
            hash: key.secret().hash(),
            verifier: None,
            scopes: scopes.parse().unwrap(),
            life,
            created_by: "test".to_owned(),
        }
    }

    fn act(action: &'static str) -> Act {
        Act { tenant: Some(Tenant::default()), actor: "test".to_owned(), action, ..Act::default() }
    }

    const DAY: Duration = Duration::from_hours(24);

    #[tokio::test]
    async fn a_key_is_stored_listed_used_and_revoked() {
        for (catalog, _guard) in testing::catalogs().await {
            let key = Key::generate().unwrap();
            assert!(catalog.credential(key.id()).await.unwrap().is_none());
            let AddedKey::Row(row) =
                catalog.add_key(&new(&key, "read,jobs", DAY), 9, &act("key.create")).await.unwrap()
            else {
                panic!("not stored")
            };
            assert_eq!(row.name, "für \"mich\"");
            let again = catalog.add_key(&new(&key, "read,instance", DAY), 9, &act("key.create")).await.unwrap();
            assert_eq!(again, AddedKey::Taken, "a key never changes what it allows");
            let nobody = NewKey { tenant: "nobody".parse().unwrap(), ..new(&Key::generate().unwrap(), "read", DAY) };
            assert_eq!(catalog.add_key(&nobody, 9, &act("key.create")).await.unwrap(), AddedKey::NoTenant);

            let found = catalog.credential(key.id()).await.unwrap().unwrap();
            assert_eq!((&found.row, found.hash, found.is_use_old), (&*row, key.secret().hash(), true));
            assert!(found.left <= DAY && found.left > DAY / 2, "{:?}", found.left);
            assert_eq!(found.row.scopes.to_string(), "read,jobs");
            catalog.note_use(key.id()).await.unwrap();
            let used = catalog.credential(key.id()).await.unwrap().unwrap();
            assert!(used.row.used_ms.is_some() && !used.is_use_old);
            sqlx::query("UPDATE keys SET used_at = used_at - 30000").execute(&catalog.pool).await.unwrap();
            catalog.note_use(key.id()).await.unwrap();
            let same = catalog.credential(key.id()).await.unwrap().unwrap();
            assert_eq!(same.row.used_ms, used.row.used_ms.map(|used| used - 30_000), "recorded once a minute");

            let (own, other) = (Tenant::default(), "other".parse::<Tenant>().unwrap());
            let revoke = async |id, tenant| catalog.revoke_key(id, tenant, &act("key.revoke")).await.unwrap();
            assert_eq!(revoke(key.id(), Some(&other)).await, Revoked::Absent);
            assert_eq!(catalog.credential(key.id()).await.unwrap().unwrap().row.revoked_ms, None);
            for _ in 0..2 {
                assert_eq!(revoke(key.id(), Some(&own)).await, Revoked::Done);
            }
            let revoked = catalog.credential(key.id()).await.unwrap().unwrap();
            assert_eq!((revoked.left, revoked.row.revoked_ms.is_some()), (Duration::ZERO, true));
            assert_eq!(revoke(Key::generate().unwrap().id(), None).await, Revoked::Absent);
            let trail = catalog.acts(Some(&Tenant::default()), None, 9).await.unwrap();
            let actions: Vec<_> = trail.items.iter().map(|act| act.action.as_str()).collect();
            assert_eq!(actions, ["key.revoke", "key.create"]);
        }
    }

    #[tokio::test]
    async fn keys_expire_and_are_listed_by_tenant_in_pages() {
        for (catalog, _guard) in testing::catalogs().await {
            let keys: Vec<Key> = (0..3).map(|_| Key::generate().unwrap()).collect();
            for (key, life) in keys.iter().zip([Duration::ZERO, DAY, Duration::MAX]) {
                let added = catalog.add_key(&new(key, "read", life), 9, &act("key.create")).await.unwrap();
                assert!(matches!(added, AddedKey::Row(_)));
            }
            assert_eq!(catalog.credential(keys[0].id()).await.unwrap().unwrap().left, Duration::ZERO);
            assert!(catalog.credential(keys[2].id()).await.unwrap().unwrap().left > DAY);
            for tenant in [None, Some(&Tenant::default())] {
                let (mut ids, mut after) = (Vec::new(), None);
                loop {
                    let page = catalog.keys(tenant, after, 2).await.unwrap();
                    ids.extend(page.items.iter().map(|row| row.id));
                    after = page.next;
                    if after.is_none() {
                        break;
                    }
                }
                ids.sort();
                let mut all: Vec<KeyId> = keys.iter().map(Key::id).collect();
                all.sort();
                assert_eq!(ids, all);
            }
            assert!(catalog.keys(Some(&"other".parse().unwrap()), None, 9).await.unwrap().items.is_empty());
        }
    }

    #[tokio::test]
    async fn a_tenant_has_so_many_keys_and_ended_ones_are_forgotten_but_for_the_newest() {
        for (catalog, _guard) in testing::catalogs().await {
            let add = async |scopes: &str| {
                let key = Key::generate().unwrap();
                (key.id(), catalog.add_key(&new(&key, scopes, DAY), 3, &act("key.create")).await.unwrap())
            };
            let all = futures::future::join_all((0..6).map(|_| add("read"))).await;
            let stored: Vec<KeyId> =
                all.iter().filter(|(_, added)| matches!(added, AddedKey::Row(_))).map(|(id, _)| *id).collect();
            assert_eq!(stored.len(), 3, "{all:?}");
            assert_eq!(add("read").await.1, AddedKey::Full(3));
            let other = testing::other(&catalog, "other").await;
            let theirs = NewKey { tenant: other.tenant().clone(), ..new(&Key::generate().unwrap(), "read", DAY) };
            let theirs = catalog.add_key(&theirs, 3, &act("key.create")).await.unwrap();
            assert!(matches!(theirs, AddedKey::Row(_)), "{theirs:?}");
            // One that has ended makes room; many that have ended do not.
            let own = Some(&Tenant::default());
            let mut last = stored[0];
            for _ in stored.len()..3 * ROWS as usize {
                assert_eq!(catalog.revoke_key(last, own, &act("key.revoke")).await.unwrap(), Revoked::Done);
                let (id, added) = add("read").await;
                assert!(matches!(added, AddedKey::Row(_)), "{added:?}");
                last = id;
            }
            catalog.revoke_key(last, own, &act("key.revoke")).await.unwrap();
            assert_eq!(add("read").await.1, AddedKey::Ended(3 * ROWS));

            catalog.forget_ended_keys(DAY).await.unwrap();
            assert_eq!(testing::count(&catalog, "keys").await, 3 * ROWS as i64 + 1, "they ended just now");
            sqlx::query("UPDATE keys SET revoked_at = revoked_at - 90000000").execute(&catalog.pool).await.unwrap();
            // Two may have been made within a millisecond.
            let newest =
                sqlx::query("UPDATE keys SET created_at = created_at + 1 WHERE id = $1").bind(last.to_string());
            newest.execute(&catalog.pool).await.unwrap();
            catalog.forget_ended_keys(DAY).await.unwrap();
            assert_eq!(
                testing::count(&catalog, "keys").await,
                2 + 1 + 1,
                "two valid ones, another tenant's, the newest"
            );
            sqlx::query("UPDATE keys SET expires_at = 0").execute(&catalog.pool).await.unwrap();
            catalog.forget_ended_keys(DAY).await.unwrap();
            assert_eq!(testing::count(&catalog, "keys").await, 1);
            let first = new(&Key::generate().unwrap(), "instance", DAY);
            assert!(!catalog.add_first_key(&first, &act("key.bootstrap")).await.unwrap());
        }
    }

    #[tokio::test]
    async fn a_key_for_the_whole_service_is_not_revoked_by_its_tenant() {
        for (catalog, _guard) in testing::catalogs().await {
            let key = Key::generate().unwrap();
            let added = catalog.add_key(&new(&key, "read,instance", DAY), 3, &act("key.create")).await.unwrap();
            assert!(matches!(added, AddedKey::Row(_)));
            for (tenant, expected) in [(Some(&Tenant::default()), Revoked::Operator), (None, Revoked::Done)] {
                assert_eq!(catalog.revoke_key(key.id(), tenant, &act("key.revoke")).await.unwrap(), expected);
            }
        }
    }

    #[tokio::test]
    async fn a_first_key_is_stored_once_whoever_starts_at_the_same_time() {
        for (catalog, _guard) in testing::catalogs().await {
            let keys: Vec<Key> = (0..4).map(|_| Key::generate().unwrap()).collect();
            let stored = futures::future::join_all(keys.iter().map(async |key| {
                catalog.add_first_key(&new(key, "instance", DAY), &act("key.bootstrap")).await.unwrap()
            }));
            assert_eq!(stored.await.iter().filter(|stored| **stored).count(), 1);
            assert_eq!(testing::count(&catalog, "keys").await, 1);
        }
    }
}
