//! Trust in the clock of the database: what the catalog knows of earlier times, compared with what the clock says now.

use super::database::Catalog;
use super::error::CatalogError;
use sqlx::Row;

/// Time that a machine has counted since its start, whatever its clock was set to meanwhile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Counted {
    /// Id of this start of the machine.
    pub start: String,
    /// Milliseconds since this start.
    pub elapsed_ms: i64,
}

/// Reason to doubt the clock of the database. Times are in ms of the Unix epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Doubt {
    /// Bytes or acts that the catalog knows are dated later than the clock says it is.
    Behind {
        /// Time by the clock of the database.
        now: i64,
        /// Time of the newest row.
        newest: i64,
    },
    /// The clock has advanced by another time than this machine has counted since the catalog was last used on it.
    Jumped {
        /// Time by the clock of the database.
        now: i64,
        /// Time of the start of this machine, and what it has counted since: what its clock should show.
        counted: i64,
    },
    /// The clock of the database and that of this machine differ.
    Apart {
        /// Time by the clock of the database.
        now: i64,
        /// Time by the clock of this machine.
        here: i64,
    },
}

/// Difference of two clocks in ms above which neither is believed. Raising it overlooks larger jumps; by default
/// nothing is kept for less than a day.
const DAY: i64 = 86_400_000;

/// Time in ms for which the start of a machine is remembered. Raising it keeps more rows where machines come and go.
const LONGEST: i64 = 90 * DAY;

/// Beginning of the names of facts that say when a machine was started, by the clock of the database.
const STARTED: &str = "started:";

/// Name of the fact that states the time of the newest row when somebody last vouched for the clock.
const VOUCHED: &str = "vouched_until";

impl Catalog {
    /// Returns the reason to doubt the clock of the database, if there is one. Otherwise notes when this machine was
    /// started, for later comparisons. `here` is the time of this machine's clock.
    pub(crate) async fn doubt(&self, counted: Option<&Counted>, here: i64) -> Result<Option<Doubt>, CatalogError> {
        let now = self.time().await?;
        if (now - here).abs() > DAY {
            return Ok(Some(Doubt::Apart { now, here }));
        }
        let newest = self.newest().await?;
        if newest - now > DAY && self.number(VOUCHED).await?.is_none_or(|vouched| newest > vouched) {
            return Ok(Some(Doubt::Behind { now, newest }));
        }
        let Some(Counted { start, elapsed_ms }) = counted else { return Ok(None) };
        let name = format!("{STARTED}{start}");
        match self.number(&name).await? {
            Some(started) if (now - started - elapsed_ms).abs() > DAY => {
                Ok(Some(Doubt::Jumped { now, counted: started + elapsed_ms }))
            }
            Some(_) => Ok(None),
            None => {
                self.state(&name, (now - elapsed_ms).to_string(), false).await?;
                self.forget_starts(now - LONGEST).await?;
                Ok(None)
            }
        }
    }

    /// Takes the clock of the database for right from now on, because somebody says so.
    pub(crate) async fn vouch(&self, counted: Option<&Counted>) -> Result<(), CatalogError> {
        let (now, newest) = (self.time().await?, self.newest().await?);
        self.state(VOUCHED, newest.to_string(), true).await?;
        // Other machines note theirs again, by the clock as it is now.
        self.forget_starts(i64::MAX).await?;
        if let Some(Counted { start, elapsed_ms }) = counted {
            self.state(&format!("{STARTED}{start}"), (now - elapsed_ms).to_string(), true).await?;
        }
        Ok(())
    }

    /// Returns the time of the newest stored bytes or recorded act, in ms of the Unix epoch; 0 if there are none.
    async fn newest(&self) -> Result<i64, CatalogError> {
        let newest = sqlx::query(self.sql(
            "SELECT {greater}(COALESCE((SELECT MAX(checked_at) FROM blobs), 0), \
             COALESCE((SELECT MAX(at) FROM audit), 0))",
        ));
        Ok(newest.fetch_one(&self.pool).await?.try_get(0)?)
    }

    /// Returns the value of a fact that is a number; `None` if it is not set.
    async fn number(&self, name: &str) -> Result<Option<i64>, CatalogError> {
        Ok(self.fact(name).await?.and_then(|value| value.parse().ok()))
    }

    /// Deletes the facts about machines that were started before a time. Those that still run note it again.
    async fn forget_starts(&self, before: i64) -> Result<(), CatalogError> {
        let _turn = self.turn().await;
        sqlx::query(
            "DELETE FROM facts WHERE CASE WHEN name LIKE 'started:%' THEN CAST(value AS BIGINT) < $1 ELSE false END",
        )
        .bind(before)
        .execute(&self.pool)
        .await?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    fn since(start: &str, elapsed_ms: i64) -> Counted {
        Counted { start: start.to_owned(), elapsed_ms }
    }

    #[tokio::test]
    async fn a_clock_that_jumped_is_doubted_until_somebody_vouches_for_it() {
        for (catalog, _guard) in testing::catalogs().await {
            let here = catalog.time().await.unwrap();
            let early = since("a", 5 * DAY);
            assert_eq!(catalog.doubt(Some(&early), here).await.unwrap(), None);
            assert_eq!(catalog.doubt(Some(&since("a", 5 * DAY + 1000)), here).await.unwrap(), None);
            // As if the clock had been set ahead or back, seen from the machine.
            for elapsed in [3 * DAY, 7 * DAY] {
                let doubt = catalog.doubt(Some(&since("a", elapsed)), here).await.unwrap();
                assert!(matches!(doubt, Some(Doubt::Jumped { .. })), "{doubt:?}");
            }
            // After a restart, or on another machine, nothing is known of the time in between.
            assert_eq!(catalog.doubt(Some(&since("b", 1000)), here).await.unwrap(), None);
            assert_eq!(catalog.doubt(None, here).await.unwrap(), None);
            catalog.vouch(Some(&since("a", 7 * DAY))).await.unwrap();
            assert_eq!(catalog.doubt(Some(&since("a", 7 * DAY)), here).await.unwrap(), None);
            let apart = catalog.doubt(None, here + 2 * DAY).await.unwrap();
            assert!(matches!(apart, Some(Doubt::Apart { .. })), "{apart:?}");
        }
    }

    #[tokio::test]
    async fn rows_of_the_future_are_doubted_and_old_ones_are_not() {
        for (catalog, _guard) in testing::catalogs().await {
            testing::add(&catalog, &testing::measurement("lamp")).await;
            let here = catalog.time().await.unwrap();
            let dated = async |ms: i64| {
                sqlx::query("UPDATE blobs SET checked_at = $1").bind(ms).execute(&catalog.pool).await.unwrap();
                catalog.doubt(None, here).await.unwrap()
            };
            assert_eq!(dated(here - 400 * DAY).await, None, "a service that nobody has used for a year");
            assert!(matches!(dated(here + 2 * DAY).await, Some(Doubt::Behind { .. })));
            catalog.vouch(None).await.unwrap();
            assert_eq!(dated(here + 2 * DAY).await, None);
            assert!(matches!(dated(here + 3 * DAY).await, Some(Doubt::Behind { .. })), "a newer row");
        }
    }

    #[tokio::test]
    async fn starts_of_long_ago_are_forgotten() {
        for (catalog, _guard) in testing::catalogs().await {
            let here = catalog.time().await.unwrap();
            for (start, days) in [("old", 80), ("older", 400), ("young", 1)] {
                catalog.doubt(Some(&since(start, days * DAY)), here).await.unwrap();
            }
            assert_eq!(catalog.fact("started:older").await.unwrap(), None);
            assert!(catalog.fact("started:old").await.unwrap().is_some());
            catalog.vouch(Some(&since("young", DAY))).await.unwrap();
            assert_eq!(catalog.fact("started:old").await.unwrap(), None);
            assert!(catalog.fact("started:young").await.unwrap().is_some());
        }
    }
}
