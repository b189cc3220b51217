//! Rows of materials: manifests, the measurements they were made of, and tags.

use super::page::pattern;
use super::{Catalog, CatalogError, Cursor, Deleted, Page, Write};
use crate::domain::Quantity;
use crate::store::Digest;
use sqlx::Row;
use sqlx::any::AnyRow;

/// A material to remember.
#[derive(Clone, Debug)]
pub struct NewMaterial {
    /// The digest of the file.
    pub id: Digest,
    /// The digest without the metadata chunk.
    pub payload: Digest,
    /// The quantity.
    pub quantity: Quantity,
    /// The size of the file.
    pub bytes: u64,
    /// What the user calls it.
    pub name: Option<String>,
    /// The user's tags.
    pub tags: Vec<String>,
    /// What it was made of.
    pub measurement: Digest,
    /// JSON: the manifest.
    pub document: String,
}

/// A material remembered.
#[derive(Clone, Debug)]
pub struct MaterialRow {
    /// Its id.
    pub id: Digest,
    /// What the user calls it.
    pub name: Option<String>,
    /// The tags, in alphabetical order.
    pub tags: Vec<String>,
    /// The measurements it was made of, in order.
    pub measurements: Vec<Digest>,
    /// JSON: the manifest.
    pub document: String,
    /// When it came, ms of the Unix epoch.
    pub created_ms: i64,
}

/// Which materials to list.
#[derive(Clone, Debug, Default)]
pub struct MaterialFilter {
    /// Of this quantity.
    pub quantity: Option<Quantity>,
    /// Made of this measurement.
    pub measurement: Option<Digest>,
    /// With this tag.
    pub tag: Option<String>,
    /// With this in name or tags.
    pub q: Option<String>,
}

macro_rules! columns {
    () => {
        "id, name, document, created_at"
    };
}

impl Catalog {
    /// One material.
    pub async fn material(&self, id: Digest) -> Result<Option<MaterialRow>, CatalogError> {
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM materials WHERE id = $1"))
            .bind(id.to_string())
            .fetch_optional(&self.pool)
            .await?;
        match row {
            Some(row) => Ok(Some(self.read_material(&row).await?)),
            None => Ok(None),
        }
    }

    /// Materials, newest first.
    pub async fn materials(
        &self,
        filter: &MaterialFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<MaterialRow>, CatalogError> {
        let after = after.unwrap_or_else(Cursor::newest);
        let rows = sqlx::query(concat!(
            "SELECT ",
            columns!(),
            " FROM materials WHERE (created_at < $1 OR (created_at = $1 AND id < $2)) \
             AND ($3 IS NULL OR quantity = $3) \
             AND ($4 IS NULL OR EXISTS (SELECT 1 FROM material_sources s WHERE s.material = id AND s.measurement = $4)) \
             AND ($5 IS NULL OR EXISTS (SELECT 1 FROM material_tags t WHERE t.material = id AND t.tag = $5)) \
             AND ($6 IS NULL OR search LIKE $6 ESCAPE '\\') ORDER BY created_at DESC, id DESC LIMIT $7"
        ))
        .bind(after.created_at)
        .bind(after.id)
        .bind(filter.quantity.map(Quantity::name).map(str::to_owned))
        .bind(filter.measurement.map(|digest| digest.to_string()))
        .bind(filter.tag.clone())
        .bind(filter.q.as_deref().map(pattern))
        .bind(limit as i64 + 1)
        .fetch_all(&self.pool)
        .await?;
        let mut materials = Vec::with_capacity(rows.len());
        for row in &rows {
            materials.push(self.read_material(row).await?);
        }
        Ok(Page::of(materials, limit, |row| Cursor { created_at: row.created_ms, id: row.id.to_string() }))
    }

    /// Forgets a material; nothing stands on one.
    pub async fn delete_material(&self, id: Digest) -> Result<Deleted, CatalogError> {
        let mut write = self.write().await?;
        let id = id.to_string();
        for statement in
            ["DELETE FROM material_tags WHERE material = $1", "DELETE FROM material_sources WHERE material = $1"]
        {
            sqlx::query(statement).bind(id.clone()).execute(&mut *write.transaction).await?;
        }
        let gone = sqlx::query("DELETE FROM materials WHERE id = $1").bind(id).execute(&mut *write.transaction).await?;
        write.commit().await?;
        Ok(if gone.rows_affected() == 1 { Deleted::Done } else { Deleted::Absent })
    }

    async fn read_material(&self, row: &AnyRow) -> Result<MaterialRow, CatalogError> {
        let id: String = row.try_get("id")?;
        let digest = |text: &str| {
            text.parse::<Digest>().map_err(|e| CatalogError::Row {
                table: "materials",
                id: id.clone(),
                reason: e.to_string(),
            })
        };
        let tags = sqlx::query("SELECT tag FROM material_tags WHERE material = $1 ORDER BY tag")
            .bind(id.clone())
            .fetch_all(&self.pool)
            .await?;
        let sources = sqlx::query("SELECT measurement FROM material_sources WHERE material = $1 ORDER BY measurement")
            .bind(id.clone())
            .fetch_all(&self.pool)
            .await?;
        Ok(MaterialRow {
            id: digest(&id)?,
            name: row.try_get("name")?,
            tags: tags.iter().map(|row| row.try_get(0)).collect::<Result<_, _>>()?,
            measurements: sources.iter().map(|row| digest(row.try_get::<&str, _>(0)?)).collect::<Result<_, _>>()?,
            document: row.try_get("document")?,
            created_ms: row.try_get("created_at")?,
        })
    }
}

/// Remembers a material within a transaction. Of equal bytes the first manifest stays; tags and sources add up.
pub(super) async fn insert(write: &mut Write, new: &NewMaterial) -> Result<(), CatalogError> {
    let id = new.id.to_string();
    let search = new.name.iter().chain(&new.tags).cloned().collect::<Vec<_>>().join("\n").to_lowercase();
    sqlx::query(
        "INSERT INTO materials (id, payload, quantity, bytes, name, search, document, created_at) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT (id) DO NOTHING",
    )
    .bind(id.clone())
    .bind(new.payload.to_string())
    .bind(new.quantity.name().to_owned())
    .bind(new.bytes as i64)
    .bind(new.name.clone())
    .bind(search)
    .bind(new.document.clone())
    .bind(write.now)
    .execute(&mut *write.transaction)
    .await?;
    sqlx::query("INSERT INTO material_sources (material, measurement) VALUES ($1, $2) ON CONFLICT DO NOTHING")
        .bind(id.clone())
        .bind(new.measurement.to_string())
        .execute(&mut *write.transaction)
        .await?;
    for tag in &new.tags {
        sqlx::query("INSERT INTO material_tags (material, tag) VALUES ($1, $2) ON CONFLICT DO NOTHING")
            .bind(id.clone())
            .bind(tag.clone())
            .execute(&mut *write.transaction)
            .await?;
    }
    Ok(())
}
