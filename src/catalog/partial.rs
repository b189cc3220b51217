//! Rows of uploads that a client may continue after a break, and of their parts.
//!
//! A part is announced like any object that is being written, in `intents`. The upload counts it by setting its digest
//! there, and its announcement then expires with the upload. So the sweep that removes objects whose announcement has
//! expired removes parts, too, and nobody lists the store.

use super::database::{Catalog, Write};
use super::error::CatalogError;
use crate::store::Object;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::time::Duration;

/// An upload that is not complete, or not used yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Partial {
    /// Id of the upload, 32 hexadecimal digits.
    pub id: String,
    /// Size of the whole upload in bytes; `None` if the client has not stated it yet.
    pub length: Option<u64>,
    /// Number of bytes of the upload that were received so far.
    pub received: u64,
    /// Number of parts of the upload that were received so far.
    pub parts: u32,
    /// Metadata of the upload (names, and values in Base64), as the client has sent them.
    pub metadata: String,
    /// Time at which the upload expires, ms of the Unix epoch.
    pub expires_ms: i64,
    /// True if the upload has expired.
    pub is_expired: bool,
    /// True if a request is writing or reading the upload.
    pub is_held: bool,
}

/// An upload to begin.
#[derive(Clone, Debug)]
pub(crate) struct NewPartial {
    /// Id of the upload, 32 hexadecimal digits.
    pub id: String,
    /// Address of the client, to which limits apply.
    pub client: String,
    /// Size of the whole upload in bytes, if the client states it.
    pub length: Option<u64>,
    /// Metadata of the upload (names, and values in Base64), as the client has sent them.
    pub metadata: String,
}

/// Limits on the uploads that are not complete, or not used yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartialLimits {
    /// Upper bound on the number of uploads of all clients.
    pub all: u64,
    /// Upper bound on the number of uploads of one client and tenant.
    pub each: u64,
    /// Upper bound on the number of uploads of one tenant.
    pub tenant: u64,
    /// Upper bound on the stated bytes of the uploads of all clients.
    pub bytes: u64,
    /// Upper bound on the stated bytes of the uploads of one client and tenant.
    pub bytes_each: u64,
    /// Upper bound on the stated bytes of the uploads of one tenant.
    pub bytes_tenant: u64,
    /// Number of bytes that an upload of unknown size adds to the stated bytes.
    pub largest: u64,
    /// Time from the first byte of an upload until the upload expires.
    pub keep: Duration,
}

/// Outcome of beginning an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Begun {
    /// The upload has begun.
    Now(Partial),
    /// The upload is refused, because it would exceed a limit on the number of unfinished or unused uploads.
    TooMany(Bound),
    /// The upload is refused, because it would exceed a limit on the total stated bytes of uploads.
    TooLarge(Bound),
}

/// Uploads whose number and stated bytes a limit bounds together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bound {
    /// Uploads of one client for one tenant.
    Client,
    /// All uploads of one tenant.
    Tenant,
    /// All uploads of all tenants together.
    All,
}

/// Outcome of reserving an upload for one request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Held {
    /// The upload is reserved.
    Now(Partial),
    /// Another request has reserved the upload.
    Busy,
    /// The upload has received another number of bytes than the offset of the request states.
    Elsewhere(Partial),
    /// The upload has expired.
    Expired,
    /// There is no such upload.
    Absent,
}

/// Time after which an upload expires that has received no byte, unless it is to be kept for less. Raising it holds the
/// stated size of uploads that nobody sends for longer.
const UNSENT: Duration = Duration::from_mins(15);

macro_rules! columns {
    () => {
        "id, length, received, parts, metadata, expires_at, CASE WHEN expires_at <= {now} THEN 1 ELSE 0 END AS expired, \
         CASE WHEN lease IS NOT NULL AND lease_until > {now} THEN 1 ELSE 0 END AS held"
    };
}

impl Catalog {
    /// Begins an upload, if the client, the tenant and all together are within `limits`. Uploads of other tenants do
    /// not count for the client, so that the answer tells nothing of them.
    pub(crate) async fn begin_partial(&self, new: &NewPartial, limits: &PartialLimits) -> Result<Begun, CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            // The update of nothing lets uploads begin one after the other, so that each sees those before.
            sqlx::query(
                "INSERT INTO facts (name, value) VALUES ('uploads', '') \
                 ON CONFLICT (name) DO UPDATE SET value = excluded.value",
            )
            .execute(&mut *write.transaction)
            .await?;
            let row = sqlx::query(
                "SELECT COUNT(*), CAST(COALESCE(SUM(COALESCE(length, $2)), 0) AS BIGINT), \
                 CAST(COALESCE(SUM(CASE WHEN tenant = $5 AND key = $3 THEN 1 ELSE 0 END), 0) AS BIGINT), \
                 CAST(COALESCE(SUM(CASE WHEN tenant = $5 AND key = $3 THEN COALESCE(length, $2) ELSE 0 END), 0) \
                 AS BIGINT), CAST(COALESCE(SUM(CASE WHEN tenant = $5 THEN 1 ELSE 0 END), 0) AS BIGINT), \
                 CAST(COALESCE(SUM(CASE WHEN tenant = $5 THEN COALESCE(length, $2) ELSE 0 END), 0) AS BIGINT) \
                 FROM uploads WHERE expires_at > $1 AND id <> $4",
            )
            .bind(write.now)
            .bind(limits.largest as i64)
            .bind(new.client.clone())
            .bind(new.id.clone())
            .bind(self.tenant.to_string())
            .fetch_one(&mut *write.transaction)
            .await?;
            let number = |at: usize| row.try_get::<i64, _>(at).map(|number| number.max(0) as u64);
            let size = new.length.unwrap_or(limits.largest);
            for (bound, at, most, bytes) in [
                (Bound::Client, 2, limits.each, limits.bytes_each),
                (Bound::Tenant, 4, limits.tenant, limits.bytes_tenant),
                (Bound::All, 0, limits.all, limits.bytes),
            ] {
                if number(at)? >= most {
                    return Ok(Begun::TooMany(bound));
                }
                if number(at + 1)?.saturating_add(size) > bytes {
                    return Ok(Begun::TooLarge(bound));
                }
            }
            let expires_ms = write.now.saturating_add(limits.keep.min(UNSENT).as_millis() as i64);
            // A repetition after an answer that was lost finds the upload that it has begun.
            sqlx::query(
                "INSERT INTO uploads (id, tenant, key, length, received, parts, metadata, expires_at) \
                 VALUES ($1, $6, $2, $3, 0, 0, $4, $5) ON CONFLICT (id) DO NOTHING",
            )
            .bind(new.id.clone())
            .bind(new.client.clone())
            .bind(new.length.map(|length| length as i64))
            .bind(new.metadata.clone())
            .bind(expires_ms)
            .bind(self.tenant.to_string())
            .execute(&mut *write.transaction)
            .await?;
            write.commit().await?;
            Ok(Begun::Now(Partial {
                id: new.id.clone(),
                length: new.length,
                received: 0,
                parts: 0,
                metadata: new.metadata.clone(),
                expires_ms,
                is_expired: false,
                is_held: false,
            }))
        })
        .await
    }

    /// Returns an upload, if it exists.
    pub(crate) async fn partial(&self, id: &str) -> Result<Option<Partial>, CatalogError> {
        sqlx::query(self.sql(concat!("SELECT ", columns!(), " FROM uploads WHERE id = $1 AND tenant = $2")))
            .bind(id.to_owned())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?
            .map(|row| read(&row))
            .transpose()
    }

    /// Reserves an upload for the request `holder` for the time `lease`. With `at`, the upload must have received that
    /// many bytes.
    pub(crate) async fn hold_partial(
        &self,
        id: &str,
        holder: &str,
        lease: Duration,
        at: Option<u64>,
    ) -> Result<Held, CatalogError> {
        self.repeat(|_| async {
            let turn = self.turn().await;
            let held = sqlx::query(self.sql(
                "UPDATE uploads SET lease = $2, lease_until = {now} + $3 \
                 WHERE id = $1 AND tenant = $5 AND expires_at > {now} \
                 AND (lease IS NULL OR lease = $2 OR lease_until <= {now}) AND ($4 < 0 OR received = $4)",
            ))
            .bind(id.to_owned())
            .bind(holder.to_owned())
            .bind(lease.as_millis() as i64)
            .bind(at.map_or(-1, |at| i64::try_from(at).unwrap_or(i64::MAX)))
            .bind(self.tenant.to_string())
            .execute(&self.pool)
            .await?;
            drop(turn);
            let Some(partial) = self.partial(id).await? else { return Ok(Held::Absent) };
            Ok(match partial {
                partial if held.rows_affected() == 1 => Held::Now(partial),
                partial if partial.is_expired => Held::Expired,
                partial if partial.is_held => Held::Busy,
                partial if at.is_some_and(|at| at != partial.received) => Held::Elsewhere(partial),
                _ => Held::Busy,
            })
        })
        .await
    }

    /// Extends the reservation of an upload, which does not expire while its first bytes arrive. Returns false if
    /// another request holds it. A reservation that ran out and that nobody has taken is taken again, so that a
    /// database that stood still for longer than the lease does not end a long request.
    pub(crate) async fn keep_partial(&self, id: &str, holder: &str, lease: Duration) -> Result<bool, CatalogError> {
        let _turn = self.turn().await;
        let kept = sqlx::query(self.sql(
            "UPDATE uploads SET lease_until = {now} + $3, \
                 expires_at = CASE WHEN received = 0 AND expires_at < {now} + $3 THEN {now} + $3 ELSE expires_at END \
                 WHERE id = $1 AND lease = $2",
        ))
        .bind(id.to_owned())
        .bind(holder.to_owned())
        .bind(lease.as_millis() as i64)
        .execute(&self.pool)
        .await?;
        Ok(kept.rows_affected() == 1)
    }

    /// Ends the reservation of an upload by the request `holder`.
    pub(crate) async fn release_partial(&self, id: &str, holder: &str) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            sqlx::query("UPDATE uploads SET lease = NULL, lease_until = 0 WHERE id = $1 AND lease = $2")
                .bind(id.to_owned())
                .bind(holder.to_owned())
                .execute(&self.pool)
                .await?;
            Ok(())
        })
        .await
    }

    /// Adds a part, which was announced and stored before, to an upload. `before` is the upload as the request `holder`
    /// found or left it; if `is_last`, the reservation by that request ends. Returns `None` if the upload or the part
    /// has changed since: the part is then removed when its announcement expires.
    pub(crate) async fn add_part(
        &self,
        before: &Partial,
        holder: &str,
        (part, bytes): (&Object, u64),
        length: Option<u64>,
        keep: Duration,
        is_last: bool,
    ) -> Result<Option<Partial>, CatalogError> {
        self.repeat(|again| async move {
            let received = before.received.saturating_add(bytes);
            let mut write = self.write().await?;
            let expires_ms = match (before.received, bytes) {
                (0, 1..) => write.now.saturating_add(keep.as_millis() as i64),
                _ => before.expires_ms,
            };
            let counted = sqlx::query(
                "UPDATE uploads SET received = $3, parts = $4, length = COALESCE(length, $5), expires_at = $9, \
                 lease = CASE WHEN $10 = 1 THEN NULL ELSE lease END, \
                 lease_until = CASE WHEN $10 = 1 THEN 0 ELSE lease_until END \
                 WHERE id = $1 AND lease = $2 AND received = $6 AND parts = $7 AND expires_at > $8",
            )
            .bind(before.id.clone())
            .bind(holder.to_owned())
            .bind(received as i64)
            .bind(i64::from(before.parts) + 1)
            .bind(length.map(|length| length as i64))
            .bind(before.received as i64)
            .bind(i64::from(before.parts))
            .bind(write.now)
            .bind(expires_ms)
            .bind(i64::from(is_last))
            .execute(&mut *write.transaction)
            .await?;
            if counted.rows_affected() == 1 {
                let named = sqlx::query(
                    "UPDATE intents SET digest = $2, expires_at = $3 WHERE object = $1 AND digest = '' AND expires_at > $4",
                )
                .bind(part.to_string())
                .bind(part.digest().to_string())
                .bind(expires_ms)
                .bind(write.now)
                .execute(&mut *write.transaction)
                .await?;
                if named.rows_affected() == 1 {
                    write.commit().await?;
                    let length = before.length.or(length);
                    let parts = before.parts + 1;
                    let is_held = !is_last;
                    return Ok(Some(Partial { length, received, parts, expires_ms, is_held, ..before.clone() }));
                }
                return Ok(None);
            }
            drop(write);
            // A repetition after an answer that was lost finds the part that it has added.
            if again && self.is_part(part).await? {
                return self.partial(&before.id).await;
            }
            Ok(None)
        })
        .await
    }

    async fn is_part(&self, part: &Object) -> Result<bool, CatalogError> {
        let row = sqlx::query("SELECT 1 FROM intents WHERE object = $1 AND digest <> ''")
            .bind(part.to_string())
            .fetch_optional(&self.pool)
            .await?;
        Ok(row.is_some())
    }

    /// Returns the parts of an upload in their order, each with its size in bytes.
    pub(crate) async fn parts_of(&self, id: &str) -> Result<Vec<(Object, u64)>, CatalogError> {
        let [from, to] = Object::parts_of(id);
        let rows = sqlx::query(
            "SELECT object, bytes FROM intents WHERE object > $1 AND object < $2 AND digest <> '' ORDER BY object",
        )
        .bind(from)
        .bind(to)
        .fetch_all(&self.pool)
        .await?;
        let parts = rows.iter().map(|row| {
            let (object, bytes): (String, i64) = (row.try_get(0)?, row.try_get(1)?);
            let fault = |error: &dyn std::fmt::Display| CatalogError::Row {
                table: "intents",
                id: object.clone(),
                reason: error.to_string(),
            };
            Ok((object.parse::<Object>().map_err(|error| fault(&error))?, bytes.max(0) as u64))
        });
        parts.collect()
    }

    /// Deletes an upload and lists its parts for deletion after `later`. Returns false if there is no such upload.
    pub(crate) async fn end_partial(&self, id: &str, later: Duration) -> Result<bool, CatalogError> {
        self.repeat(|again| async move {
            let mut write = self.write().await?;
            let gone = sqlx::query("DELETE FROM uploads WHERE id = $1 AND tenant = $2")
                .bind(id.to_owned())
                .bind(self.tenant.to_string())
                .execute(&mut *write.transaction)
                .await?;
            if gone.rows_affected() == 0 {
                return Ok(again);
            }
            doom_parts(&mut write, id, later).await?;
            write.commit().await?;
            Ok(true)
        })
        .await
    }

    /// Deletes the rows of uploads that have been expired for longer than `remembered`, and returns their number. The
    /// announcements of the uploads' parts have expired too.
    pub(crate) async fn forget_partials(&self, remembered: Duration) -> Result<u64, CatalogError> {
        let _turn = self.turn().await;
        let gone = sqlx::query(self.sql("DELETE FROM uploads WHERE expires_at < {now} - $1"))
            .bind(remembered.as_millis() as i64)
            .execute(&self.pool)
            .await?;
        Ok(gone.rows_affected())
    }
}

/// Lists for deletion the parts that were added to an upload. A part that is still being written stays announced: it
/// may arrive late, and is removed when its announcement expires.
async fn doom_parts(write: &mut Write, id: &str, later: Duration) -> Result<(), CatalogError> {
    let [from, to] = Object::parts_of(id);
    sqlx::query(
        "INSERT INTO doomed (object, bytes, not_before) SELECT object, bytes, $3 FROM intents \
         WHERE object > $1 AND object < $2 AND digest <> '' ON CONFLICT (object) DO NOTHING",
    )
    .bind(from.clone())
    .bind(to.clone())
    .bind(write.now.saturating_add(later.as_millis() as i64))
    .execute(&mut *write.transaction)
    .await?;
    sqlx::query("DELETE FROM intents WHERE object > $1 AND object < $2 AND digest <> ''")
        .bind(from)
        .bind(to)
        .execute(&mut *write.transaction)
        .await?;
    Ok(())
}

fn read(row: &AnyRow) -> Result<Partial, CatalogError> {
    let number = |name: &str| row.try_get::<i64, _>(name).map(|number| number.max(0) as u64);
    Ok(Partial {
        id: row.try_get("id")?,
        length: row.try_get::<Option<i64>, _>("length")?.map(|length| length.max(0) as u64),
        received: number("received")?,
        parts: number("parts")?.try_into().unwrap_or(u32::MAX),
        metadata: row.try_get("metadata")?,
        expires_ms: row.try_get("expires_at")?,
        is_expired: number("expired")? != 0,
        is_held: number("held")? != 0,
    })
}
