//! Rows of materials that were made elsewhere and uploaded.

use super::blobs::{Claim, take};
use super::database::Catalog;
use super::error::{CatalogError, breaks_reference, digest};
use super::materials::{NewMaterial, insert};
use super::usage::{Change, OverQuota, charge};
use crate::store::Digest;
use sqlx::Row;

/// Outcome of storing an uploaded material in the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Uploaded {
    /// The material is stored; true if it is new.
    Stored(bool),
    /// The measurement with this id was deleted meanwhile, so nothing was written.
    NoMeasurement(Digest),
    /// The claim on the stored bytes has expired, so nothing was written. The bytes must be stored again.
    Unpublished,
    /// The material would exceed a limit of the tenant, so nothing was written.
    Over(OverQuota),
}

impl Catalog {
    /// Stores an uploaded material in the catalog. Its file was stored before under `claim`.
    pub(crate) async fn add_material(&self, new: &NewMaterial, claim: &Claim) -> Result<Uploaded, CatalogError> {
        self.repeat(|_| async {
            match self.try_add_material(new, claim).await {
                // The file was deleted since it was looked up; or a measurement, which the next try finds out.
                Err(CatalogError::Sql(error)) if breaks_reference(&error) => Ok(Uploaded::Unpublished),
                added => added,
            }
        })
        .await
    }

    async fn try_add_material(&self, new: &NewMaterial, claim: &Claim) -> Result<Uploaded, CatalogError> {
        let mut write = self.write().await?;
        if !take(&mut write, claim).await? {
            return Ok(Uploaded::Unpublished);
        }
        for measurement in &new.measurements {
            let there = sqlx::query("SELECT 1 FROM measurements WHERE tenant = $2 AND id = $1")
                .bind(measurement.to_string())
                .bind(self.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            if there.is_none() {
                return Ok(Uploaded::NoMeasurement(*measurement));
            }
        }
        let is_new = insert(&mut write, new).await?;
        if is_new && let Some(over) = charge(&mut write, new.id, Change::material(new.bytes)).await? {
            return Ok(Uploaded::Over(over));
        }
        write.commit().await?;
        Ok(Uploaded::Stored(is_new))
    }

    /// Returns the ids of at most `most` measurements with the given content, oldest first. Several differ in the
    /// options with which the content is read.
    pub(crate) async fn measurements_of(&self, content: Digest, most: u32) -> Result<Vec<Digest>, CatalogError> {
        let rows = sqlx::query(
            "SELECT id FROM measurements WHERE tenant = $3 AND content = $1 ORDER BY created_at, id LIMIT $2",
        )
        .bind(content.to_string())
        .bind(i64::from(most))
        .bind(self.tenant.to_string())
        .fetch_all(&self.pool)
        .await?;
        let ids = rows.iter().map(|row| {
            let id: String = row.try_get(0)?;
            digest("measurements", &id, &id)
        });
        ids.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Deleted, testing};
    use crate::domain::Quantity;
    use serde_json::{Value, json};

    fn material(measurements: &[Digest], compared: &Value) -> NewMaterial {
        NewMaterial {
            id: Digest::of(b"file"),
            payload: Digest::of(b"payload"),
            quantity: Quantity::Edf,
            bytes: 4,
            name: None,
            tags: Vec::new(),
            measurements: measurements.to_vec(),
            document: json!({ "measured_again": compared }).as_object().unwrap().clone(),
        }
    }

    #[tokio::test]
    async fn an_upload_is_new_once_and_gains_its_measurements() {
        for (catalog, _guard) in testing::catalogs().await {
            let add = async |new: &NewMaterial| {
                let claim = testing::publish(&catalog, new.id, new.bytes).await;
                catalog.add_material(new, &claim).await.unwrap()
            };
            let bare = material(&[], &json!([]));
            assert_eq!(add(&bare).await, Uploaded::Stored(true));
            assert_eq!(add(&bare).await, Uploaded::Stored(false));
            let lamp = testing::measurement("lamp");
            let compared = json!([{ "measurement": lamp.id, "errors": {} }]);
            assert_eq!(add(&material(&[lamp.id], &compared)).await, Uploaded::NoMeasurement(lamp.id));
            testing::add(&catalog, &lamp).await;
            assert_eq!(catalog.measurements_of(lamp.content, 9).await.unwrap(), [lamp.id]);
            for _ in 0..2 {
                assert_eq!(add(&material(&[lamp.id], &compared)).await, Uploaded::Stored(false));
            }
            let row = catalog.material(bare.id).await.unwrap().unwrap();
            let document: Value = serde_json::from_str(&row.document).unwrap();
            assert_eq!((&row.measurements[..], &document["measured_again"]), (&[lamp.id][..], &compared));
            assert!(matches!(catalog.delete_measurement(lamp.id).await.unwrap(), Deleted::InUse(_)));
            let unknown = Claim::Known(Digest::of(b"never stored"));
            let other = NewMaterial { id: unknown.digest(), ..bare };
            assert_eq!(catalog.add_material(&other, &unknown).await.unwrap(), Uploaded::Unpublished);
        }
    }
}
