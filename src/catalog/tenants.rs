//! Rows of tenants: the owners of everything else.

use super::database::Catalog;
use super::error::{CatalogError, tenant};
use crate::trust::Tenant;
use sqlx::Row;

impl Catalog {
    /// Returns the ids of all tenants, in their order.
    pub(crate) async fn tenant_ids(&self) -> Result<Vec<Tenant>, CatalogError> {
        let rows = sqlx::query("SELECT id FROM tenants ORDER BY id").fetch_all(&self.pool).await?;
        let ids = rows.iter().map(|row| {
            let id: String = row.try_get(0)?;
            tenant("tenants", &id, &id)
        });
        ids.collect()
    }
}
