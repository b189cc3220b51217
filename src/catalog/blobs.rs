//! Rows about stored bytes: which object holds a digest, which objects are being written, and which are to be deleted.
//!
//! ```text
//! (absent) ─ intent ─▶ being written ─ row in, intent out ─▶ live ─ row out ─▶ doomed ─ deleted, row out ─▶ gone
//!                            └────────── intent expired ─────────────────────────▲
//! ```
//!
//! Each arrow is one transaction. An object's name never comes back, so that neither a late write nor a late deletion
//! can touch bytes that are in use. Rows that name a digest refer to `blobs` by a foreign key: a digest cannot be
//! doomed while a row names it, and a row cannot name a digest that was doomed before.

use super::database::{Catalog, Write};
use super::error::{CatalogError, digest, tenant};
use crate::store::{Digest, Object};
use crate::trust::Tenant;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::time::Duration;

/// Row of the catalog about the stored bytes that have a given BLAKE3 digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Blob {
    /// Stored object (file in the store) that holds the bytes with a given digest.
    pub object: Object,
    /// Size of the stored object in bytes; `None` if the catalog does not know it yet.
    pub bytes: Option<u64>,
    /// True if the stored bytes were found missing or damaged.
    pub suspect: bool,
}

/// Permission for a row of the catalog to refer to stored bytes, held by the process that stored or found the bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Claim {
    /// The catalog already listed stored bytes with this digest, so nothing was written.
    Known(Digest),
    /// The process has written an object of this many bytes, which it had announced to the catalog before.
    Written(Object, u64),
}

/// Kind of catalog row that refers to stored bytes by their digest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Namer {
    /// Row of the catalog for a material, which refers to the material's file.
    Material,
    /// Row of the catalog for a job, which refers to the report that the job made.
    Report,
    /// Row of the catalog for a measurement, which refers to the measurement's content.
    Measurement,
}

/// Outcome of checking that no row of the catalog refers to a digest any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Doom {
    /// No row of the catalog refers to the digest: its object, of this many bytes, is now listed for deletion.
    Doomed(u64),
    /// Another row of the catalog still refers to the digest, so its object is kept.
    Named,
    /// The catalog does not list stored bytes with the digest any more.
    Gone,
}

/// SQL query for the catalog rows of the tenant `$2` that refer to the digest `$1`.
macro_rules! named {
    () => {
        "SELECT 1 AS kind FROM materials WHERE tenant = $2 AND id = $1 \
         UNION ALL SELECT 2 FROM jobs WHERE tenant = $2 AND report = $1 \
         UNION ALL SELECT 3 FROM measurements WHERE tenant = $2 AND content = $1"
    };
}

/// Query for the row about the stored bytes of the tenant `$2` with the digest `$1`.
macro_rules! blob {
    () => {
        "SELECT tenant, digest, generation, bytes, suspect FROM blobs WHERE tenant = $2 AND digest = $1"
    };
}

impl Claim {
    /// Returns the digest to which this claim lets a row of the catalog refer.
    pub(crate) fn digest(&self) -> Digest {
        match self {
            Self::Known(digest) => *digest,
            Self::Written(object, _) => object.digest(),
        }
    }
}

impl Catalog {
    /// Returns the row of the catalog about the stored bytes with the given digest, if there is one.
    pub(crate) async fn blob(&self, digest: Digest) -> Result<Option<Blob>, CatalogError> {
        sqlx::query(blob!())
            .bind(digest.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?
            .map(|row| read(&row))
            .transpose()
    }

    /// Announces to the catalog that an object is about to be written. The announcement expires after `time`. The
    /// object's name must never have been used before.
    pub(crate) async fn intend(&self, object: &Object, bytes: u64, time: Duration) -> Result<(), CatalogError> {
        self.announce(object, object.digest().to_string(), bytes, time).await
    }

    async fn announce(&self, object: &Object, digest: String, bytes: u64, time: Duration) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            sqlx::query(self.sql(
                "INSERT INTO intents (object, tenant, digest, bytes, expires_at) \
                 VALUES ($1, $5, $2, $3, {now} + $4) ON CONFLICT (object) DO NOTHING",
            ))
            .bind(object.to_string())
            .bind(digest.clone())
            .bind(bytes as i64)
            .bind(time.as_millis() as i64)
            .bind(self.tenant.to_string())
            .execute(&self.pool)
            .await?;
            Ok(())
        })
        .await
    }

    /// Announces to the catalog that a part of an upload is about to be written; see [`Self::intend`]. Its digest stays
    /// empty until the upload counts the part.
    pub(crate) async fn intend_part(&self, part: &Object, bytes: u64, time: Duration) -> Result<(), CatalogError> {
        self.announce(part, String::new(), bytes, time).await
    }

    /// Extends the announcement that an object is being written. Returns false if it has expired: the object may be
    /// deleted at any moment and must not be used. An expired announcement is never renewed.
    pub(crate) async fn prolong(&self, object: &Object, time: Duration) -> Result<bool, CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            let prolonged = sqlx::query(
                self.sql("UPDATE intents SET expires_at = {now} + $2 WHERE object = $1 AND expires_at > {now}"),
            )
            .bind(object.to_string())
            .bind(time.as_millis() as i64)
            .execute(&self.pool)
            .await?;
            Ok(prolonged.rows_affected() == 1)
        })
        .await
    }

    /// Lists an announced object for deletion at once, because no row will refer to it.
    pub(crate) async fn withdraw(&self, object: &Object) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            let announced = sqlx::query("DELETE FROM intents WHERE object = $1 RETURNING bytes")
                .bind(object.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            if let Some(row) = announced {
                doom(&mut write, object.to_string(), row.try_get(0)?, Duration::ZERO).await?;
            }
            write.commit().await
        })
        .await
    }

    /// Marks stored objects in the catalog, in one transaction, as missing or damaged, so that the next upload of the
    /// same bytes replaces them.
    pub(crate) async fn suspect(&self, objects: &[Object]) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            for object in objects {
                sqlx::query("UPDATE blobs SET suspect = 1 WHERE tenant = $3 AND digest = $1 AND generation = $2")
                    .bind(object.digest().to_string())
                    .bind(object.generation().to_owned())
                    .bind(object.tenant().to_string())
                    .execute(&mut *write.transaction)
                    .await?;
            }
            write.commit().await
        })
        .await
    }

    /// Records in the catalog that the digest of a stored object was just recomputed from its bytes and is right.
    pub(crate) async fn checked(&self, object: &Object, bytes: u64) -> Result<(), CatalogError> {
        let _turn = self.turn().await;
        sqlx::query(self.sql(
            "UPDATE blobs SET suspect = 0, checked_at = {now}, bytes = $3 \
             WHERE tenant = $4 AND digest = $1 AND generation = $2",
        ))
        .bind(object.digest().to_string())
        .bind(object.generation().to_owned())
        .bind(bytes as i64)
        .bind(object.tenant().to_string())
        .execute(&self.pool)
        .await?;
        Ok(())
    }

    /// Returns the kind of catalog row that refers to `digest`, if there is one. Bytes to which no row refers must not
    /// be served to clients.
    pub(crate) async fn namer(&self, digest: Digest) -> Result<Option<Namer>, CatalogError> {
        let row = sqlx::query(concat!(named!(), " ORDER BY kind LIMIT 1"))
            .bind(digest.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        let kind = row.map(|row| row.try_get::<i64, _>(0)).transpose()?;
        Ok(kind.map(|kind| match kind {
            1 => Namer::Material,
            2 => Namer::Report,
            _ => Namer::Measurement,
        }))
    }

    /// Returns the kind and id of a catalog row that refers to `digest`, such as `material b3-…`, if there is one.
    pub(crate) async fn named_by(&self, digest: Digest) -> Result<Option<String>, CatalogError> {
        let row = sqlx::query(
            "SELECT 'material ' || id FROM materials WHERE tenant = $2 AND id = $1 \
             UNION ALL SELECT 'job ' || id FROM jobs WHERE tenant = $2 AND report = $1 \
             UNION ALL SELECT 'measurement ' || id FROM measurements WHERE tenant = $2 AND content = $1 LIMIT 1",
        )
        .bind(digest.to_string())
        .bind(self.tenant.to_string())
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.map(|row| row.try_get(0)).transpose()?)
    }

    /// Lists for deletion at most `most` objects of all tenants whose announced write has expired, and returns their
    /// number. They are deleted only after a delay of `later`, because a slow write may still be under way.
    pub(crate) async fn doom_expired(&self, most: u32, later: Duration) -> Result<u64, CatalogError> {
        let mut write = self.write().await?;
        let expired =
            write.sql("SELECT object, bytes FROM intents WHERE expires_at <= $1 ORDER BY expires_at LIMIT $2{skip}");
        let rows =
            sqlx::query(expired).bind(write.now).bind(i64::from(most)).fetch_all(&mut *write.transaction).await?;
        for row in &rows {
            let (object, bytes): (String, i64) = (row.try_get(0)?, row.try_get(1)?);
            doom(&mut write, object.clone(), bytes, later).await?;
            sqlx::query("DELETE FROM intents WHERE object = $1").bind(object).execute(&mut *write.transaction).await?;
        }
        write.commit().await?;
        Ok(rows.len() as u64)
    }

    /// Returns at most `most` digests of all tenants that may be unused, because a row that referred to them was
    /// deleted.
    pub(crate) async fn unnamed(&self, most: u32) -> Result<Vec<(Tenant, Digest)>, CatalogError> {
        let rows = sqlx::query(
            self.sql("SELECT tenant, digest FROM unnamed WHERE not_before <= {now} ORDER BY not_before LIMIT $1"),
        )
        .bind(i64::from(most))
        .fetch_all(&self.pool)
        .await?;
        rows.iter()
            .map(|row| {
                let (owner, text): (String, String) = (row.try_get(0)?, row.try_get(1)?);
                Ok((tenant("unnamed", &text, &owner)?, digest("unnamed", &text, &text)?))
            })
            .collect()
    }

    /// Lists the object with this digest for deletion, unless a row of the catalog refers to the digest. The deletion
    /// waits for `grace`, so that a reader who has just looked the object up can finish.
    pub(crate) async fn doom_unnamed(&self, digest: Digest, grace: Duration) -> Result<Doom, CatalogError> {
        let mut write = self.write().await?;
        let text = digest.to_string();
        // The list first: a row that ceases to name the digest later lists it again, and one that ceased before is not
        // seen any more by the statement that looks for names.
        sqlx::query("DELETE FROM unnamed WHERE tenant = $2 AND digest = $1")
            .bind(text.clone())
            .bind(self.tenant.to_string())
            .execute(&mut *write.transaction)
            .await?;
        // Then the lock: a row that names the digest is written before, and seen by the next statement, or after, and
        // refused by its foreign key.
        let row = sqlx::query(write.sql(concat!(blob!(), "{lock}")))
            .bind(text.clone())
            .bind(self.tenant.to_string())
            .fetch_optional(&mut *write.transaction)
            .await?;
        let doomed = match row.map(|row| read(&row)).transpose()? {
            None => Doom::Gone,
            Some(blob) => {
                let named = sqlx::query(named!())
                    .bind(text.clone())
                    .bind(self.tenant.to_string())
                    .fetch_optional(&mut *write.transaction)
                    .await?;
                if named.is_some() {
                    Doom::Named
                } else {
                    let bytes = blob.bytes.map_or(-1, |bytes| bytes as i64);
                    sqlx::query("DELETE FROM blobs WHERE tenant = $2 AND digest = $1")
                        .bind(text.clone())
                        .bind(self.tenant.to_string())
                        .execute(&mut *write.transaction)
                        .await?;
                    doom(&mut write, blob.object.to_string(), bytes, grace).await?;
                    Doom::Doomed(bytes.max(0) as u64)
                }
            }
        };
        write.commit().await?;
        Ok(doomed)
    }

    /// Reserves at most `most` objects that are due for deletion, and returns them with their sizes in bytes. No other
    /// process can reserve them for `time`. Returns none during a hold.
    pub(crate) async fn take_doomed(&self, most: u32, time: Duration) -> Result<Vec<(Object, u64)>, CatalogError> {
        let _turn = self.turn().await;
        let rows = sqlx::query(self.sql(
            "WITH due AS MATERIALIZED (SELECT object FROM doomed WHERE not_before <= {now} AND NOT EXISTS (SELECT 1 \
             FROM facts WHERE CASE WHEN name LIKE 'hold:%' THEN CAST(value AS BIGINT) > {now} ELSE false END) \
             ORDER BY not_before LIMIT $1{skip}) UPDATE doomed SET not_before = {now} + $2, tries = tries + 1 \
             WHERE object {among SELECT object FROM due} RETURNING object, bytes",
        ))
        .bind(i64::from(most))
        .bind(time.as_millis() as i64)
        .fetch_all(&self.pool)
        .await?;
        let taken = rows.iter().map(|row| {
            let (object, bytes): (String, i64) = (row.try_get(0)?, row.try_get(1)?);
            let parsed = object.parse::<Object>();
            let fault = |reason| CatalogError::Row { table: "doomed", id: object.clone(), reason };
            Ok((parsed.map_err(|error| fault(error.to_string()))?, bytes.max(0) as u64))
        });
        taken.collect()
    }

    /// Makes objects that wait for the end of their grace period due for deletion at once. Returns their number.
    pub(crate) async fn end_grace(&self) -> Result<u64, CatalogError> {
        let _turn = self.turn().await;
        let ended =
            sqlx::query(self.sql("UPDATE doomed SET not_before = {now} WHERE not_before > {now} AND tries = 0"))
                .execute(&self.pool)
                .await?;
        Ok(ended.rows_affected())
    }

    /// Records in the catalog that the given objects were deleted from the store.
    pub(crate) async fn deleted(&self, objects: &[Object]) -> Result<(), CatalogError> {
        let names: Vec<String> = objects.iter().map(Object::to_string).collect();
        let _turn = self.turn().await;
        sqlx::query(self.sql("DELETE FROM doomed WHERE object {among $1}"))
            .bind(serde_json::json!(names).to_string())
            .execute(&self.pool)
            .await?;
        Ok(())
    }

    /// Returns the number of stored objects, and the number and total size of the objects that wait for deletion.
    pub(crate) async fn blob_counts(&self) -> Result<BlobCounts, CatalogError> {
        let row = sqlx::query(
            "SELECT (SELECT COUNT(*) FROM blobs), (SELECT COUNT(*) FROM doomed), \
             (SELECT CAST(COALESCE(SUM(CASE WHEN bytes > 0 THEN bytes ELSE 0 END), 0) AS BIGINT) FROM doomed)",
        )
        .fetch_one(&self.pool)
        .await?;
        let number = |at: usize| row.try_get::<i64, _>(at).map(|number| number.max(0) as u64);
        Ok(BlobCounts { live: number(0)?, doomed: number(1)?, doomed_bytes: number(2)? })
    }

    /// Returns the next rows about stored bytes whose digest begins with byte `first` (any byte if `None`). They are
    /// sorted by digest and follow the digest `after`.
    pub(crate) async fn blobs_beginning(
        &self,
        first: Option<u8>,
        after: Option<Digest>,
        most: u32,
    ) -> Result<Vec<Blob>, CatalogError> {
        let low = low(first, after);
        // The character after `f`, the last of a hexadecimal digit.
        let high = first.map_or("b3-g".to_owned(), |first| format!("b3-{first:02x}g"));
        let rows = sqlx::query(
            "SELECT tenant, digest, generation, bytes, suspect FROM blobs \
             WHERE tenant = $4 AND digest > $1 AND digest < $2 ORDER BY digest LIMIT $3",
        )
        .bind(low)
        .bind(high)
        .bind(i64::from(most))
        .bind(self.tenant.to_string())
        .fetch_all(&self.pool)
        .await?;
        rows.iter().map(read).collect()
    }

    /// Returns true if the catalog lists the given object: as stored, as being written, or as waiting for deletion.
    pub(crate) async fn knows(&self, object: &Object) -> Result<bool, CatalogError> {
        let row = sqlx::query(
            "SELECT 1 FROM blobs WHERE tenant = $4 AND digest = $1 AND generation = $2 \
             UNION ALL SELECT 1 FROM intents WHERE object = $3 UNION ALL SELECT 1 FROM doomed WHERE object = $3 LIMIT 1",
        )
        .bind(object.digest().to_string())
        .bind(object.generation().to_owned())
        .bind(object.to_string())
        .bind(object.tenant().to_string())
        .fetch_optional(&self.pool)
        .await?;
        Ok(row.is_some())
    }

    /// Returns true if a digest is listed for the next sweep (removal of unused objects), because a row that referred
    /// to it was deleted.
    pub(crate) async fn is_unnamed(&self, digest: Digest) -> Result<bool, CatalogError> {
        let row = sqlx::query("SELECT 1 FROM unnamed WHERE tenant = $2 AND digest = $1")
            .bind(digest.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        Ok(row.is_some())
    }

    /// Lists for deletion an object of the store that the catalog does not know. The object is deleted after `grace`.
    pub(crate) async fn doom_stray(&self, object: &Object, bytes: u64, grace: Duration) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        doom(&mut write, object.to_string(), bytes as i64, grace).await?;
        write.commit().await
    }

    /// Lists a digest for the next sweep, which deletes its object unless a row of the catalog refers to it.
    pub(crate) async fn list_unnamed(&self, digest: Digest) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        let tenant = self.tenant.to_string();
        unname(&mut write, tenant, digest.to_string()).await?;
        write.commit().await
    }
}

#[cfg(test)]
impl Catalog {
    /// Clears the list of digests that the next sweep would check for rows that still refer to them.
    pub(crate) async fn forget_unnamed(&self) {
        sqlx::query("DELETE FROM unnamed").execute(&self.pool).await.unwrap();
    }
}

/// Counts of the stored objects and of those that wait for deletion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlobCounts {
    /// Number of objects that the catalog lists as stored, one for each digest.
    pub live: u64,
    /// Number of objects that wait for deletion.
    pub doomed: u64,
    /// Total size in bytes of the objects that wait for deletion.
    pub doomed_bytes: u64,
}

/// Lets the row that the transaction `write` adds to the catalog refer to stored bytes. Returns false if the permission
/// (`claim`) has expired: the row must not be written, and the bytes must be stored again.
pub(super) async fn take(write: &mut Write, claim: &Claim) -> Result<bool, CatalogError> {
    let (object, bytes) = match claim {
        // The foreign key of the row decides.
        Claim::Known(_) => return Ok(true),
        Claim::Written(object, bytes) => (object, *bytes as i64),
    };
    let live = sqlx::query("DELETE FROM intents WHERE object = $1 AND expires_at > $2")
        .bind(object.to_string())
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
    if live.rows_affected() != 1 {
        return Ok(false);
    }
    let digest = object.digest().to_string();
    let inserted = sqlx::query(
        "INSERT INTO blobs (tenant, digest, generation, bytes, checked_at, created_at) \
         VALUES ($5, $1, $2, $3, $4, $4) ON CONFLICT (tenant, digest) DO NOTHING",
    )
    .bind(digest.clone())
    .bind(object.generation().to_owned())
    .bind(bytes)
    .bind(write.now)
    .bind(object.tenant().to_string())
    .execute(&mut *write.transaction)
    .await?;
    if inserted.rows_affected() == 1 {
        return Ok(true);
    }
    // Another publisher of the same bytes was faster. Its object stays, unless its bytes were found damaged.
    let row = sqlx::query(write.sql(concat!(blob!(), "{lock}")))
        .bind(digest.clone())
        .bind(object.tenant().to_string())
        .fetch_optional(&mut *write.transaction)
        .await?;
    let Some(known) = row.map(|row| read(&row)).transpose()? else { return Ok(false) };
    let unused = if known.suspect {
        sqlx::query(
            "UPDATE blobs SET generation = $2, bytes = $3, suspect = 0, checked_at = $4 \
             WHERE tenant = $5 AND digest = $1",
        )
        .bind(digest)
        .bind(object.generation().to_owned())
        .bind(bytes)
        .bind(write.now)
        .bind(object.tenant().to_string())
        .execute(&mut *write.transaction)
        .await?;
        known.object
    } else {
        object.clone()
    };
    doom(write, unused.to_string(), bytes, GRACE).await?;
    Ok(true)
}

/// Hours for which an object is kept after another object with the same bytes took its place. Raising it gives slow
/// readers longer to finish.
const GRACE: Duration = Duration::from_hours(1);

/// Lists a tenant's digest for the next sweep (removal of unused objects), in the transaction that deletes a row that
/// referred to it.
pub(super) async fn unname(write: &mut Write, tenant: String, digest: String) -> Result<(), CatalogError> {
    sqlx::query(
        "INSERT INTO unnamed (tenant, digest, not_before) VALUES ($3, $1, $2) \
         ON CONFLICT (tenant, digest) DO UPDATE SET not_before = excluded.not_before",
    )
    .bind(digest)
    .bind(write.now)
    .bind(tenant)
    .execute(&mut *write.transaction)
    .await?;
    Ok(())
}

async fn doom(write: &mut Write, object: String, bytes: i64, later: Duration) -> Result<(), CatalogError> {
    sqlx::query("INSERT INTO doomed (object, bytes, not_before) VALUES ($1, $2, $3) ON CONFLICT (object) DO NOTHING")
        .bind(object)
        .bind(bytes)
        .bind(write.now.saturating_add(later.as_millis() as i64))
        .execute(&mut *write.transaction)
        .await?;
    Ok(())
}

/// Returns the text after which the wanted digests sort: those that begin with byte `first` (any byte if `None`) and
/// follow `after`. Without `after` the text is their common beginning.
pub(super) fn low(first: Option<u8>, after: Option<Digest>) -> String {
    let start = || first.map_or("b3-".to_owned(), |first| format!("b3-{first:02x}"));
    after.map_or_else(start, |digest| digest.to_string())
}

pub(super) fn read(row: &AnyRow) -> Result<Blob, CatalogError> {
    let (text, owner): (String, String) = (row.try_get("digest")?, row.try_get("tenant")?);
    let owner = tenant("blobs", &text, &owner)?;
    Ok(Blob {
        object: Object::of(&owner, digest("blobs", &text, &text)?, row.try_get("generation")?),
        bytes: u64::try_from(row.try_get::<i64, _>("bytes")?).ok(),
        suspect: row.try_get::<i64, _>("suspect")? != 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Added, Deleted, testing};

    const MINUTE: Duration = Duration::from_mins(1);

    fn fresh(digest: Digest) -> Object {
        Object::fresh(&Tenant::default(), digest)
    }

    #[tokio::test]
    async fn a_row_is_refused_once_its_intent_has_run_out() {
        for (catalog, _guard) in testing::catalogs().await {
            let lamp = testing::measurement("lamp");
            let object = fresh(lamp.content);
            let claim = Claim::Written(object.clone(), 4);
            assert!(matches!(catalog.add_measurement(&lamp, &claim).await.unwrap(), Added::Unpublished), "no intent");
            catalog.intend(&object, 4, Duration::ZERO).await.unwrap();
            assert!(matches!(catalog.add_measurement(&lamp, &claim).await.unwrap(), Added::Unpublished), "expired");
            assert!(catalog.measurement(lamp.id).await.unwrap().is_none());
            let unstored = catalog.add_measurement(&lamp, &Claim::Known(lamp.content)).await.unwrap();
            assert!(matches!(unstored, Added::Unpublished), "the digest was never stored");
            let object = fresh(lamp.content);
            catalog.intend(&object, 4, MINUTE).await.unwrap();
            assert!(catalog.prolong(&object, MINUTE).await.unwrap());
            let claim = Claim::Written(object, 4);
            assert!(matches!(catalog.add_measurement(&lamp, &claim).await.unwrap(), Added::Row(_, true)));
            assert_eq!(catalog.namer(lamp.content).await.unwrap(), Some(Namer::Measurement));
            assert_eq!(catalog.namer(Digest::of(b"other")).await.unwrap(), None);
            assert_eq!(catalog.blob(lamp.content).await.unwrap().unwrap().bytes, Some(4));
        }
    }

    #[tokio::test]
    async fn an_expired_intent_dooms_its_object_for_good() {
        for (catalog, _guard) in testing::catalogs().await {
            let object = fresh(Digest::of(b"late"));
            catalog.intend(&object, 4, Duration::ZERO).await.unwrap();
            assert_eq!(catalog.doom_expired(9, Duration::ZERO).await.unwrap(), 1);
            assert_eq!(catalog.doom_expired(9, Duration::ZERO).await.unwrap(), 0);
            assert!(!catalog.prolong(&object, MINUTE).await.unwrap(), "a doomed object is not announced again");
            assert!(catalog.knows(&object).await.unwrap());
            let taken = catalog.take_doomed(9, MINUTE).await.unwrap();
            assert_eq!(taken, [(object.clone(), 4)]);
            assert!(catalog.take_doomed(9, MINUTE).await.unwrap().is_empty(), "taken by one process at a time");
            catalog.deleted(std::slice::from_ref(&object)).await.unwrap();
            assert!(!catalog.knows(&object).await.unwrap());
        }
    }

    #[tokio::test]
    async fn a_digest_is_doomed_only_when_no_row_names_it() {
        for (catalog, _guard) in testing::catalogs().await {
            let lamp = testing::measurement("lamp");
            let other = crate::catalog::NewMeasurement { id: Digest::of(b"other"), ..lamp.clone() };
            testing::add(&catalog, &lamp).await;
            testing::add(&catalog, &other).await;
            assert_eq!(catalog.delete_measurement(lamp.id).await.unwrap(), Deleted::Done);
            assert_eq!(catalog.unnamed(9).await.unwrap(), [(Tenant::default(), lamp.content)]);
            assert_eq!(catalog.doom_unnamed(lamp.content, MINUTE).await.unwrap(), Doom::Named);
            assert!(catalog.unnamed(9).await.unwrap().is_empty());
            assert_eq!(catalog.delete_measurement(other.id).await.unwrap(), Deleted::Done);
            assert_eq!(catalog.doom_unnamed(lamp.content, MINUTE).await.unwrap(), Doom::Doomed(4));
            assert_eq!(catalog.doom_unnamed(lamp.content, MINUTE).await.unwrap(), Doom::Gone);
            assert!(catalog.take_doomed(9, MINUTE).await.unwrap().is_empty(), "the grace is not over");
            let claim = Claim::Known(lamp.content);
            assert!(matches!(catalog.add_measurement(&lamp, &claim).await.unwrap(), Added::Unpublished));
            // The second upload's own object, which was not needed, is one of them.
            assert_eq!(catalog.end_grace().await.unwrap(), 2);
            assert_eq!(catalog.take_doomed(9, MINUTE).await.unwrap().len(), 2);
        }
    }

    #[tokio::test]
    async fn of_two_publishers_one_object_stays_unless_it_is_damaged() {
        for (catalog, _guard) in testing::catalogs().await {
            let lamp = testing::measurement("lamp");
            let (first, second, third) = (fresh(lamp.content), fresh(lamp.content), fresh(lamp.content));
            for (object, new) in [(&first, true), (&second, false)] {
                catalog.intend(object, 4, MINUTE).await.unwrap();
                let added = catalog.add_measurement(&lamp, &Claim::Written(object.clone(), 4)).await.unwrap();
                assert!(matches!(added, Added::Row(_, is_new) if is_new == new));
            }
            assert_eq!(catalog.blob(lamp.content).await.unwrap().unwrap().object, first);
            assert!(catalog.knows(&second).await.unwrap(), "the second is to be deleted");
            catalog.suspect(std::slice::from_ref(&first)).await.unwrap();
            assert!(catalog.blob(lamp.content).await.unwrap().unwrap().suspect);
            catalog.intend(&third, 4, MINUTE).await.unwrap();
            catalog.add_measurement(&lamp, &Claim::Written(third.clone(), 4)).await.unwrap();
            let healed = catalog.blob(lamp.content).await.unwrap().unwrap();
            assert_eq!((healed.object, healed.suspect), (third, false));
            catalog.end_grace().await.unwrap();
            assert_eq!(catalog.take_doomed(9, MINUTE).await.unwrap().len(), 2);
        }
    }
}
