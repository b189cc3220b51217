//! Pins of digests that are about to be named. A publisher pins a digest first, and either names it before its pin
//! expires or publishes again. A sweep takes a blob's name away only while it holds the write lock and has seen neither
//! a row nor a live pin for it.
//!
//! ```text
//! publisher: pin ─ publish ─ [ pin still live? row in, pin out ]     [ … ]: one write transaction
//! sweep:     [ no row, no live pin? retire ] ─ remove the bytes
//! ```
//!
//! The two transactions exclude each other. If the publisher's comes first, the sweep sees the row. If the sweep's
//! comes first, the pin had expired, so the publisher is refused and publishes again. The bytes are removed after the
//! transaction, under a name that nobody publishes to. A slow removal therefore delays no writer, and a late one hits
//! nothing that was published since.

use super::database::{Catalog, Write};
use super::error::CatalogError;
use crate::store::Digest;
use sqlx::Row;
use std::collections::BTreeMap;
use std::time::Duration;

/// Kind of row that refers to the bytes of a digest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Namer {
    /// A material, whose file they are.
    Material,
    /// A job, whose report they are.
    Report,
    /// A measurement, whose content they are.
    Measurement,
}

impl Catalog {
    /// Keeps sweeps away from `digest` for `time`, or until [`Catalog::add_measurement`] or [`Catalog::end`] names it.
    /// A pin of the same holder is renewed.
    pub(crate) async fn pin(&self, digest: Digest, holder: &str, time: Duration) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        let until = write.now.saturating_add(time.as_millis() as i64);
        sqlx::query(
            "INSERT INTO pins (digest, holder, expires_at) VALUES ($1, $2, $3) \
             ON CONFLICT (digest, holder) DO UPDATE SET expires_at = excluded.expires_at",
        )
        .bind(digest.to_string())
        .bind(holder)
        .bind(until)
        .execute(&mut *write.transaction)
        .await?;
        write.commit().await
    }

    /// Calls `retire` if no row and no live pin names `digest`, while none can be added; returns its result.
    ///
    /// Every writer waits for `retire`, so it must be short. It is a plain call and not a future: it can neither be
    /// dropped half-way nor outlive the transaction.
    pub(crate) async fn unless_named<T>(
        &self,
        digest: Digest,
        retire: impl FnOnce() -> T + Send,
    ) -> Result<Option<T>, CatalogError> {
        let mut write = self.write().await?;
        let named = sqlx::query(
            "SELECT 1 FROM measurements WHERE content = $1 \
             UNION ALL SELECT 1 FROM materials WHERE id = $1 \
             UNION ALL SELECT 1 FROM jobs WHERE report = $1 \
             UNION ALL SELECT 1 FROM pins WHERE digest = $1 AND expires_at > $2 LIMIT 1",
        )
        .bind(digest.to_string())
        .bind(write.now)
        .fetch_optional(&mut *write.transaction)
        .await?;
        let retired = named.is_none().then(retire);
        // Nothing was written; the lock must be free before the caller goes on to slow work.
        write.transaction.rollback().await?;
        Ok(retired)
    }

    /// Deletes idempotency keys older than `age`, and expired pins.
    pub(crate) async fn forget_keys(&self, age: Duration) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        sqlx::query("DELETE FROM pins WHERE expires_at <= $1").bind(write.now).execute(&mut *write.transaction).await?;
        sqlx::query("DELETE FROM idempotency_keys WHERE created_at < $1")
            .bind(write.now.saturating_sub(age.as_millis() as i64))
            .execute(&mut *write.transaction)
            .await?;
        write.commit().await
    }

    /// Returns the kind of row that names `digest`, if there is one. Bytes that no row names must not be served.
    pub(crate) async fn namer(&self, digest: Digest) -> Result<Option<Namer>, CatalogError> {
        let row = sqlx::query(
            "SELECT 1 AS kind FROM materials WHERE id = $1 \
             UNION ALL SELECT 2 FROM jobs WHERE report = $1 \
             UNION ALL SELECT 3 FROM measurements WHERE content = $1 ORDER BY kind LIMIT 1",
        )
        .bind(digest.to_string())
        .fetch_optional(&self.pool)
        .await?;
        let kind = row.map(|row| row.try_get::<i64, _>(0)).transpose()?;
        Ok(kind.map(|kind| match kind {
            1 => Namer::Material,
            2 => Namer::Report,
            _ => Namer::Measurement,
        }))
    }

    /// Returns every digest that a row names, each with a description of the row.
    pub(crate) async fn named(&self) -> Result<BTreeMap<Digest, String>, CatalogError> {
        let rows = sqlx::query(
            "SELECT content, 'measurement ' || id FROM measurements UNION ALL SELECT id, 'material ' || id FROM materials \
             UNION ALL SELECT report, 'job ' || id FROM jobs WHERE report IS NOT NULL",
        )
        .fetch_all(&self.pool)
        .await?;
        let mut named = BTreeMap::new();
        for row in rows {
            let (text, by): (String, String) = (row.try_get(0)?, row.try_get(1)?);
            let digest = text.parse().map_err(|e| CatalogError::Row {
                table: "measurements, materials, jobs",
                id: by.clone(),
                reason: format!("{e}"),
            })?;
            named.insert(digest, by);
        }
        Ok(named)
    }
}

/// Ends the pin that kept `digest` while it was published. Returns false if it has expired: a sweep may have removed
/// the blob, and nothing may name it.
pub(super) async fn unpin(write: &mut Write, digest: Digest, holder: &str) -> Result<bool, CatalogError> {
    let live = sqlx::query("DELETE FROM pins WHERE digest = $1 AND holder = $2 AND expires_at > $3")
        .bind(digest.to_string())
        .bind(holder.to_owned())
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
    Ok(live.rows_affected() == 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Added, testing};

    #[tokio::test]
    async fn pinned_digests_are_left_alone_until_they_expire() {
        let (catalog, _directory) = testing::catalog().await;
        let digest = Digest::of(b"about to be named");
        assert_eq!(catalog.unless_named(digest, || 1).await.unwrap(), Some(1));
        catalog.pin(digest, "a", Duration::from_mins(1)).await.unwrap();
        catalog.pin(digest, "b", Duration::ZERO).await.unwrap();
        assert_eq!(catalog.unless_named(digest, || 2).await.unwrap(), None);
        catalog.pin(digest, "a", Duration::ZERO).await.unwrap();
        assert_eq!(catalog.unless_named(digest, || 3).await.unwrap(), Some(3));
        catalog.forget_keys(Duration::from_hours(1)).await.unwrap();
        assert_eq!(testing::count(&catalog, "pins").await, 0);
    }

    #[tokio::test]
    async fn a_row_is_refused_once_its_pin_has_run_out() {
        let (catalog, _directory) = testing::catalog().await;
        let lamp = testing::measurement("lamp");
        assert!(matches!(catalog.add_measurement(&lamp, "a").await.unwrap(), Added::Unpinned), "never pinned");
        catalog.pin(lamp.content, "a", Duration::ZERO).await.unwrap();
        assert!(matches!(catalog.add_measurement(&lamp, "a").await.unwrap(), Added::Unpinned));
        assert!(catalog.measurement(lamp.id).await.unwrap().is_none());
        catalog.pin(lamp.content, "b", Duration::from_mins(1)).await.unwrap();
        assert!(matches!(catalog.add_measurement(&lamp, "a").await.unwrap(), Added::Unpinned), "another's pin");
        assert!(matches!(catalog.add_measurement(&lamp, "b").await.unwrap(), Added::Row(_, true)));
        assert_eq!(catalog.namer(lamp.content).await.unwrap(), Some(Namer::Measurement));
        assert_eq!(catalog.namer(Digest::of(b"other")).await.unwrap(), None);
    }
}
