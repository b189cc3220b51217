//! Holds: while one is valid, no process deletes stored objects, so that a backup can copy what its catalog names.

use super::database::Catalog;
use super::error::CatalogError;
use std::time::Duration;

impl Catalog {
    /// Begins or prolongs the hold with this name: until it ends, no process deletes stored objects. The hold ends by
    /// itself after `time`. Ended holds are cleared.
    pub(crate) async fn begin_hold(&self, name: &str, time: Duration) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            sqlx::query(self.sql(
                "DELETE FROM facts WHERE CASE WHEN name LIKE 'hold:%' THEN CAST(value AS BIGINT) <= {now} ELSE false END",
            ))
            .execute(&self.pool)
            .await?;
            sqlx::query(self.sql(
                "INSERT INTO facts (name, value) VALUES ($1, CAST({now} + $2 AS TEXT)) \
                 ON CONFLICT (name) DO UPDATE SET value = excluded.value",
            ))
            .bind(format!("hold:{name}"))
            .bind(time.as_millis() as i64)
            .execute(&self.pool)
            .await?;
            Ok(())
        })
        .await
    }

    /// Prolongs a hold, during which no process deletes stored objects. Returns false if the hold has ended: objects
    /// may have been deleted since.
    pub(crate) async fn prolong_hold(&self, name: &str, time: Duration) -> Result<bool, CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            let prolonged = sqlx::query(self.sql(
                "UPDATE facts SET value = CAST({now} + $2 AS TEXT) WHERE name = $1 AND CAST(value AS BIGINT) > {now}",
            ))
            .bind(format!("hold:{name}"))
            .bind(time.as_millis() as i64)
            .execute(&self.pool)
            .await?;
            Ok(prolonged.rows_affected() == 1)
        })
        .await
    }

    /// Ends a hold: as far as it is concerned, processes may delete stored objects again.
    pub(crate) async fn end_hold(&self, name: &str) -> Result<(), CatalogError> {
        self.repeat(|_| async {
            let _turn = self.turn().await;
            sqlx::query("DELETE FROM facts WHERE name = $1").bind(format!("hold:{name}")).execute(&self.pool).await?;
            Ok(())
        })
        .await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Doom, testing};

    const MINUTE: Duration = Duration::from_mins(1);

    #[tokio::test]
    async fn nothing_is_taken_for_deletion_during_a_hold() {
        for (catalog, _guard) in testing::catalogs().await {
            let lamp = testing::measurement("lamp");
            testing::add(&catalog, &lamp).await;
            catalog.delete_measurement(lamp.id).await.unwrap();
            let doomed = catalog.doom_unnamed(lamp.content, Duration::ZERO).await.unwrap();
            assert!(matches!(doomed, Doom::Doomed(_)));
            catalog.begin_hold("ended", Duration::ZERO).await.unwrap();
            assert!(
                !catalog.prolong_hold("ended", MINUTE).await.unwrap()
                    && !catalog.prolong_hold("x", MINUTE).await.unwrap()
            );
            catalog.begin_hold("one", MINUTE).await.unwrap();
            catalog.begin_hold("two", MINUTE).await.unwrap();
            assert!(catalog.prolong_hold("one", MINUTE).await.unwrap());
            assert!(catalog.take_doomed(9, MINUTE).await.unwrap().is_empty());
            catalog.end_hold("one").await.unwrap();
            assert!(catalog.take_doomed(9, MINUTE).await.unwrap().is_empty(), "the other one is still valid");
            catalog.end_hold("two").await.unwrap();
            assert_eq!(catalog.take_doomed(9, MINUTE).await.unwrap().len(), 1);
        }
    }
}
