//! Digests that are about to be named: whoever publishes pins first, and a sweep removes a blob only while it holds
//! the write lock and has seen neither a row nor a pin that names it.

use super::{Catalog, CatalogError};
use crate::store::Digest;
use std::collections::BTreeMap;
use std::time::Duration;

impl Catalog {
    /// Keeps sweeps away from `digest` for `time`, or until a row names it and [`Catalog::unpin`] is called.
    pub async fn pin(&self, digest: Digest, holder: &str, time: Duration) -> Result<(), CatalogError> {
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

    /// Ends a pin.
    pub async fn unpin(&self, digest: Digest, holder: &str) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        sqlx::query("DELETE FROM pins WHERE digest = $1 AND holder = $2")
            .bind(digest.to_string())
            .bind(holder)
            .execute(&mut *write.transaction)
            .await?;
        write.commit().await
    }

    /// Runs `remove` while nobody can begin to name `digest`, if nothing names it now; returns whether it ran.
    pub async fn unless_named<E>(
        &self,
        digest: Digest,
        remove: impl Future<Output = Result<(), E>>,
    ) -> Result<Result<bool, E>, CatalogError> {
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
        if named.is_some() {
            return Ok(Ok(false));
        }
        let removed = remove.await;
        sqlx::query("DELETE FROM pins WHERE expires_at <= $1").bind(write.now).execute(&mut *write.transaction).await?;
        write.commit().await?;
        Ok(removed.map(|()| true))
    }

    /// Forgets idempotency keys older than `age`.
    pub async fn forget_keys(&self, age: Duration) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        sqlx::query("DELETE FROM idempotency_keys WHERE created_at < $1")
            .bind(write.now.saturating_sub(age.as_millis() as i64))
            .execute(&mut *write.transaction)
            .await?;
        write.commit().await
    }

    /// Every digest that a row names, with what names it.
    pub async fn named(&self) -> Result<BTreeMap<Digest, String>, CatalogError> {
        use sqlx::Row;
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

#[cfg(test)]
mod tests {
    use crate::catalog::testing;
    use crate::store::Digest;
    use std::time::Duration;

    fn nothing() -> std::future::Ready<Result<(), ()>> {
        std::future::ready(Ok(()))
    }

    #[tokio::test]
    async fn pinned_digests_are_left_alone_until_they_expire() {
        let (catalog, _directory) = testing::catalog().await;
        let digest = Digest::of(b"about to be named");
        assert_eq!(catalog.unless_named(digest, nothing()).await.unwrap(), Ok(true));
        catalog.pin(digest, "a", Duration::from_mins(1)).await.unwrap();
        catalog.pin(digest, "b", Duration::ZERO).await.unwrap();
        assert_eq!(catalog.unless_named(digest, nothing()).await.unwrap(), Ok(false));
        catalog.unpin(digest, "a").await.unwrap();
        assert_eq!(catalog.unless_named(digest, nothing()).await.unwrap(), Ok(true));
    }
}
