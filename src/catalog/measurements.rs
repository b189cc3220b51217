//! Rows of measurements: uploads and their descriptions.

use super::blobs::{Claim, take, unname};
use super::database::Catalog;
use super::error::{CatalogError, breaks_reference, digest};
use super::lists::{Filters, Sight};
use super::page::{Cursor, Page};
use super::search::{Sought, composed, folded};
use super::usage::{Change, OverQuota, charge};
use crate::domain::Quantity;
use crate::store::Digest;
use sqlx::Row;
use sqlx::any::AnyRow;

/// A measurement to store in the catalog.
#[derive(Clone, Debug)]
pub(crate) struct NewMeasurement {
    /// Id of the measurement: the digest of its content, or of its content and reading options.
    pub id: Digest,
    /// BLAKE3 digest of the measurement's content.
    pub content: Digest,
    /// Id of the measurement whose content is the spectrum by which this measurement is multiplied, if any.
    pub spectrum: Option<Digest>,
    /// Name of the measurement given by the user.
    pub name: Option<String>,
    /// Name of the uploaded file.
    pub file_name: Option<String>,
    /// Size of the measurement's content in bytes.
    pub bytes: u64,
    /// Name of the measurement's file format.
    pub format: String,
    /// Radiometric quantity of the measurement, if it is known yet.
    pub quantity: Option<Quantity>,
    /// Description of the measurement as JSON.
    pub document: String,
}

/// A measurement as stored in the catalog.
#[derive(Clone, Debug)]
pub(crate) struct MeasurementRow {
    /// Id of the measurement.
    pub id: Digest,
    /// BLAKE3 digest of the measurement's content.
    pub content: Digest,
    /// Name of the measurement given by the user.
    pub name: Option<String>,
    /// Name of the uploaded file.
    pub file_name: Option<String>,
    /// Size of the measurement's content in bytes.
    pub bytes: u64,
    /// Description of the measurement as JSON.
    pub document: String,
    /// Time at which the measurement was first stored, ms of the Unix epoch.
    pub created_ms: i64,
}

/// Filter of a list of measurements.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeasurementFilter {
    /// Restricts the list to measurements of this radiometric quantity.
    pub quantity: Option<Quantity>,
    /// Restricts the list to measurements of this file format.
    pub format: Option<String>,
    /// Restricts the list to measurements with this text in their name, file name or format.
    pub q: Option<String>,
}

/// Outcome of storing a measurement in the catalog.
#[derive(Clone, Debug)]
pub(crate) enum Added {
    /// The stored row of the measurement, and true if the row is new.
    Row(MeasurementRow, bool),
    /// The spectrum to which the measurement refers was deleted meanwhile, so nothing was written.
    NoSpectrum,
    /// The measurement would exceed a limit of the tenant, so nothing was written.
    Over(OverQuota),
    /// The measurement's stored content was deleted, or the permission to refer to it has expired, so no row was
    /// written. The content must be stored again.
    Unpublished,
}

/// Outcome of deleting a measurement or a material from the catalog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Deleted {
    /// The row was deleted. The next sweep removes its stored bytes, unless another row refers to them.
    Done,
    /// The catalog has no measurement or material with the given id.
    Absent,
    /// The measurement was not deleted, because another row of the catalog depends on it; the text says which row.
    InUse(String),
}

macro_rules! columns {
    () => {
        "id, content, name, file_name, bytes, document, created_at"
    };
}

impl Catalog {
    /// Stores a measurement in the catalog. Its content was stored before under `claim`, which lets a row refer to the
    /// content.
    pub(crate) async fn add_measurement(&self, new: &NewMeasurement, claim: &Claim) -> Result<Added, CatalogError> {
        self.repeat(|_| async {
            match self.try_add(new, claim).await {
                // The content was deleted since it was looked up; or the spectrum, which the next try finds out.
                Err(CatalogError::Sql(error)) if breaks_reference(&error) => Ok(Added::Unpublished),
                added => added,
            }
        })
        .await
    }

    async fn try_add(&self, new: &NewMeasurement, claim: &Claim) -> Result<Added, CatalogError> {
        let mut write = self.write().await?;
        if !take(&mut write, claim).await? {
            return Ok(Added::Unpublished);
        }
        if let Some(spectrum) = new.spectrum {
            let there = sqlx::query("SELECT 1 FROM measurements WHERE tenant = $2 AND id = $1")
                .bind(spectrum.to_string())
                .bind(self.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            if there.is_none() {
                return Ok(Added::NoSpectrum);
            }
        }
        let (name, file_name) = (new.name.as_deref().map(composed), new.file_name.as_deref().map(composed));
        let search = folded([name.as_deref(), file_name.as_deref(), Some(&new.format)].into_iter().flatten());
        let inserted = sqlx::query(
            "INSERT INTO measurements \
             (tenant, id, content, spectrum, name, file_name, bytes, format, quantity, search, document, created_at) \
             VALUES ($12, $1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) ON CONFLICT (tenant, id) DO NOTHING",
        )
        .bind(new.id.to_string())
        .bind(new.content.to_string())
        .bind(new.spectrum.map(|digest| digest.to_string()))
        .bind(name)
        .bind(file_name)
        .bind(new.bytes as i64)
        .bind(new.format.clone())
        .bind(new.quantity.map(Quantity::name).map(str::to_owned))
        .bind(search)
        .bind(new.document.clone())
        .bind(write.now)
        .bind(self.tenant.to_string())
        .execute(&mut *write.transaction)
        .await?
        .rows_affected();
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM measurements WHERE tenant = $2 AND id = $1"))
            .bind(new.id.to_string())
            .bind(self.tenant.to_string())
            .fetch_one(&mut *write.transaction)
            .await?;
        let row = read(&row)?;
        if inserted == 1
            && let Some(over) = charge(&mut write, new.id, Change::measurement(row.bytes)).await?
        {
            return Ok(Added::Over(over));
        }
        write.commit().await?;
        Ok(Added::Row(row, inserted == 1))
    }

    /// Returns the measurement with the given id, if it exists.
    pub(crate) async fn measurement(&self, id: Digest) -> Result<Option<MeasurementRow>, CatalogError> {
        sqlx::query(concat!("SELECT ", columns!(), " FROM measurements WHERE tenant = $2 AND id = $1"))
            .bind(id.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?
            .map(|row| read(&row))
            .transpose()
    }

    /// Returns a page of measurements, newest first.
    pub(crate) async fn measurements(
        &self,
        filter: &MeasurementFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<MeasurementRow>, CatalogError> {
        let filters = Filters {
            quantity: filter.quantity,
            format: filter.format.clone(),
            text: filter.q.as_deref().map(Sought::within),
            ..Filters::default()
        };
        let after = after.unwrap_or_else(Cursor::newest);
        let mut list = self.list().await?;
        let statement = filters.measurements(self.dialect);
        let page = filters.bind(statement, self.tenant.as_str(), Sight::Own, after, limit);
        let rows = page.fetch_all(&mut *list).await?;
        list.commit().await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::of(rows, limit, |row| Cursor { created_at: row.created_ms, id: row.id.to_string() }))
    }

    /// Deletes a measurement, unless a material, another measurement or an unfinished job depends on it.
    pub(crate) async fn delete_measurement(&self, id: Digest) -> Result<Deleted, CatalogError> {
        self.repeat(|again| async move {
            // A row that begins to depend on it between the look and the deletion is seen by the second look.
            for _ in 0..3 {
                match self.try_delete(id, again).await {
                    Err(CatalogError::Sql(error)) if breaks_reference(&error) => {}
                    deleted => return deleted,
                }
            }
            Ok(Deleted::InUse(format!("a material, measurement or job has just begun to depend on measurement {id}")))
        })
        .await
    }

    async fn try_delete(&self, id: Digest, again: bool) -> Result<Deleted, CatalogError> {
        let mut write = self.write().await?;
        let used = sqlx::query(
            "SELECT 'material ' || material FROM material_sources WHERE tenant = $2 AND measurement = $1 \
             UNION ALL SELECT 'measurement ' || id FROM measurements WHERE tenant = $2 AND spectrum = $1 \
             UNION ALL SELECT 'job ' || id FROM jobs WHERE tenant = $2 AND needs = $1 LIMIT 1",
        )
        .bind(id.to_string())
        .bind(self.tenant.to_string())
        .fetch_optional(&mut *write.transaction)
        .await?;
        if let Some(row) = used {
            let by: String = row.try_get(0)?;
            return Ok(Deleted::InUse(format!("{by} depends on measurement {id}")));
        }
        let gone = sqlx::query("DELETE FROM measurements WHERE tenant = $2 AND id = $1 RETURNING content, bytes")
            .bind(id.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&mut *write.transaction)
            .await?;
        // A repeated deletion has found its own work.
        let Some(row) = gone else { return Ok(if again { Deleted::Done } else { Deleted::Absent }) };
        unname(&mut write, self.tenant.to_string(), row.try_get(0)?).await?;
        let bytes = row.try_get::<i64, _>(1)?.max(0) as u64;
        charge(&mut write, id, Change::measurement(bytes).undone()).await?;
        write.commit().await?;
        Ok(Deleted::Done)
    }
}

fn read(row: &AnyRow) -> Result<MeasurementRow, CatalogError> {
    let id: String = row.try_get("id")?;
    let digest = |text: String| digest("measurements", &id, &text);
    Ok(MeasurementRow {
        id: digest(id.clone())?,
        content: digest(row.try_get("content")?)?,
        name: row.try_get("name")?,
        file_name: row.try_get("file_name")?,
        bytes: row.try_get::<i64, _>("bytes")?.max(0) as u64,
        document: row.try_get("document")?,
        created_ms: row.try_get("created_at")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing::{self, add, measurement};

    #[tokio::test]
    async fn the_same_measurement_is_known_the_second_time() {
        for (catalog, _guard) in testing::catalogs().await {
            let (row, fresh) = add(&catalog, &measurement("lamp")).await;
            assert!(fresh && row.bytes == 4 && row.name.as_deref() == Some("lamp"));
            assert!(!add(&catalog, &measurement("lamp")).await.1);
            assert_eq!(catalog.measurement(row.id).await.unwrap().unwrap().content, row.content);
            assert_eq!(catalog.delete_measurement(row.id).await.unwrap(), Deleted::Done);
            assert_eq!(catalog.delete_measurement(row.id).await.unwrap(), Deleted::Absent);
        }
    }

    #[tokio::test]
    async fn pages_cover_the_list_without_repetition() {
        for (catalog, _guard) in testing::catalogs().await {
            for i in 0..7 {
                add(&catalog, &measurement(&format!("lamp {i} 50%"))).await;
            }
            let (mut seen, mut cursor) = (Vec::new(), None);
            loop {
                let page = catalog.measurements(&MeasurementFilter::default(), cursor, 3).await.unwrap();
                seen.extend(page.items.into_iter().map(|row| row.id));
                cursor = page.next;
                if cursor.is_none() {
                    break;
                }
            }
            assert_eq!(seen.len(), 7);
            seen.sort();
            seen.dedup();
            assert_eq!(seen.len(), 7);
            for (q, expected) in [("LAMP 3", 1), ("50%", 7), ("%lamp", 0), ("5_%", 0)] {
                let filter = MeasurementFilter { q: Some(q.to_owned()), ..MeasurementFilter::default() };
                assert_eq!(catalog.measurements(&filter, None, 9).await.unwrap().items.len(), expected, "{q}");
            }
            let brdfs = MeasurementFilter { quantity: Some(Quantity::Brdf), ..MeasurementFilter::default() };
            assert!(catalog.measurements(&brdfs, None, 9).await.unwrap().items.is_empty());
        }
    }

    #[tokio::test]
    async fn a_spectrum_in_use_stays() {
        for (catalog, _guard) in testing::catalogs().await {
            let (spectrum, _) = add(&catalog, &measurement("spd")).await;
            add(&catalog, &NewMeasurement { spectrum: Some(spectrum.id), ..measurement("lamp") }).await;
            assert!(matches!(catalog.delete_measurement(spectrum.id).await.unwrap(), Deleted::InUse(_)));
            let orphan = NewMeasurement { spectrum: Some(Digest::of(b"gone")), ..measurement("other") };
            let claim = testing::publish(&catalog, orphan.content, 5).await;
            assert!(matches!(catalog.add_measurement(&orphan, &claim).await.unwrap(), Added::NoSpectrum));
        }
    }
}
