//! Right to read a material: its owner may, tenants that it is shared with, and, if it is public, everybody.

use super::database::Catalog;
use super::error::{CatalogError, tenant};
use super::lists::Sight;
use super::materials::{MaterialFilter, MaterialRow, PUBLIC, bare};
use super::page::{Cursor, Page};
use crate::store::Digest;
use crate::trust::Tenant;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::collections::HashMap;

/// A material that a tenant may read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Visible {
    /// Tenant that owns the material.
    pub owner: Tenant,
    /// Name of the material given by the owner.
    pub name: Option<String>,
    /// True if everybody may read the material.
    pub is_public: bool,
    /// Reason for which the tenant may read the material.
    pub sight: Sight,
}

/// Change of who may read a material; a field that is `None` changes nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Opening {
    /// True to make the material public, false to make it private.
    pub is_public: Option<bool>,
    /// New list of all tenants that may read the material although it is private.
    pub readers: Option<Vec<Tenant>>,
}

/// Outcome of changing the right to read a material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Opened {
    /// The right to read the material was changed.
    Done,
    /// The tenant owns no material with the given id.
    Absent,
    /// There is no tenant with this id to share the material with, so nothing was changed.
    NoTenant(Tenant),
}

impl Catalog {
    /// Returns the owner of a material that this tenant may read, and the reason: ownership comes before sharing,
    /// sharing before a public material. Takes as long for a material that another tenant keeps private as for one that
    /// exists nowhere.
    pub(crate) async fn sees(&self, id: Digest) -> Result<Option<Visible>, CatalogError> {
        let own = sqlx::query("SELECT tenant, name, visibility FROM materials WHERE tenant = $2 AND id = $1")
            .bind(id.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        if let Some(row) = own {
            return visible(id, &row, Sight::Own).map(Some);
        }
        let others = sqlx::query(
            "SELECT m.tenant AS tenant, m.name, m.visibility, 1 AS kind FROM shares s \
             JOIN materials m ON m.tenant = s.tenant AND m.id = s.material WHERE s.reader = $2 AND s.material = $1 \
             UNION ALL SELECT tenant, name, visibility, 2 FROM materials WHERE id = $1 AND visibility = 'public' \
             ORDER BY kind, tenant LIMIT 1",
        )
        .bind(id.to_string())
        .bind(self.tenant.to_string())
        .fetch_optional(&self.pool)
        .await?;
        let Some(row) = others else { return Ok(None) };
        let sight = if row.try_get::<i64, _>(3)? == 1 { Sight::Shared } else { Sight::Public };
        visible(id, &row, sight).map(Some)
    }

    /// Changes who may read one of this tenant's materials.
    pub(crate) async fn open_material(&self, id: Digest, access: &Opening) -> Result<Opened, CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            let owner = self.tenant.to_string();
            let visibility = access.is_public.map(|public| if public { PUBLIC } else { "private" }.to_owned());
            // Locks the row, so that changes of its readers follow one another.
            let changed =
                sqlx::query("UPDATE materials SET visibility = COALESCE($3, visibility) WHERE tenant = $2 AND id = $1")
                    .bind(id.to_string())
                    .bind(owner.clone())
                    .bind(visibility)
                    .execute(&mut *write.transaction)
                    .await?;
            if changed.rows_affected() == 0 {
                return Ok(Opened::Absent);
            }
            if let Some(readers) = &access.readers {
                sqlx::query("DELETE FROM shares WHERE tenant = $2 AND material = $1")
                    .bind(id.to_string())
                    .bind(owner.clone())
                    .execute(&mut *write.transaction)
                    .await?;
                for reader in readers {
                    let there = sqlx::query("SELECT 1 FROM tenants WHERE id = $1")
                        .bind(reader.to_string())
                        .fetch_optional(&mut *write.transaction)
                        .await?;
                    if there.is_none() {
                        return Ok(Opened::NoTenant(reader.clone()));
                    }
                    sqlx::query(
                        "INSERT INTO shares (tenant, material, reader, created_at) VALUES ($1, $2, $3, $4) \
                         ON CONFLICT DO NOTHING",
                    )
                    .bind(owner.clone())
                    .bind(id.to_string())
                    .bind(reader.to_string())
                    .bind(write.now)
                    .execute(&mut *write.transaction)
                    .await?;
                }
            }
            write.commit().await?;
            Ok(Opened::Done)
        })
        .await
    }

    /// Returns a page of materials that this tenant may read, newest first: its own, those shared with it, or other
    /// tenants' public ones. A public material that several tenants have is listed once. Source measurements and
    /// readers of others' materials are left out, because they are the owners' business.
    pub(crate) async fn visible_materials(
        &self,
        sight: Sight,
        filter: &MaterialFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<MaterialRow>, CatalogError> {
        if sight == Sight::Own {
            return self.materials(filter, after, limit).await;
        }
        let rows = self.material_page(sight, filter, after, limit).await?;
        let materials = self.with_tags(&rows).await?;
        Ok(Page::of(materials, limit, |row| Cursor { created_at: row.created_ms, id: row.id.to_string() }))
    }

    /// Reads rows of materials of any tenants together with their tags, in one further query for any number of rows.
    async fn with_tags(&self, rows: &[AnyRow]) -> Result<Vec<MaterialRow>, CatalogError> {
        let mut materials = Vec::with_capacity(rows.len());
        let (mut pairs, mut places) = (Vec::new(), HashMap::new());
        for row in rows {
            let material = bare(row)?;
            // The id has a fixed length, so that SQL can tell the two apart.
            let pair = format!("{}{}", material.id, row.try_get::<String, _>("tenant")?);
            places.insert(pair.clone(), materials.len());
            pairs.push(pair);
            materials.push(material);
        }
        let tags = self.sql(
            "SELECT pairs.value, t.tag FROM ({each $1}) AS pairs JOIN material_tags t \
             ON t.tenant = SUBSTR(pairs.value, 68) AND t.material = SUBSTR(pairs.value, 1, 67)",
        );
        for row in sqlx::query(tags).bind(serde_json::json!(pairs).to_string()).fetch_all(&self.pool).await? {
            if let Some(&at) = places.get(&row.try_get::<String, _>(0)?) {
                let material: &mut MaterialRow = &mut materials[at];
                material.tags.push(row.try_get(1)?);
            }
        }
        for material in &mut materials {
            material.sort_tags();
        }
        Ok(materials)
    }
}

fn visible(id: Digest, row: &AnyRow, sight: Sight) -> Result<Visible, CatalogError> {
    let (owner, visibility): (String, String) = (row.try_get(0)?, row.try_get(2)?);
    let owner = tenant("materials", &id.to_string(), &owner)?;
    Ok(Visible { owner, name: row.try_get(1)?, is_public: visibility == PUBLIC, sight })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Deleted, NewMaterial, testing};
    use crate::domain::Quantity;
    use std::collections::BTreeSet;

    fn material(text: &str) -> NewMaterial {
        NewMaterial { name: Some(text.to_owned()), tags: vec!["office".to_owned()], ..testing::material(text) }
    }

    async fn add(catalog: &Catalog, new: &NewMaterial) {
        let claim = testing::publish(catalog, new.id, new.bytes).await;
        catalog.add_material(new, &claim).await.unwrap();
    }

    #[tokio::test]
    async fn a_material_is_seen_by_its_owner_its_readers_and_if_public_by_all() {
        for (mine, _guard) in testing::catalogs().await {
            let (reader, third) = (testing::other(&mine, "lab").await, testing::other(&mine, "third").await);
            let new = material("lamp");
            add(&mine, &new).await;
            let sight =
                async |catalog: &Catalog| catalog.sees(new.id).await.unwrap().map(|seen| (seen.owner, seen.sight));
            let owner = mine.tenant().clone();
            assert_eq!(sight(&mine).await, Some((owner.clone(), Sight::Own)));
            assert_eq!((sight(&reader).await, sight(&third).await), (None, None));

            let share = Opening { readers: Some(vec![reader.tenant().clone()]), ..Opening::default() };
            assert_eq!(reader.open_material(new.id, &share).await.unwrap(), Opened::Absent);
            assert_eq!(mine.open_material(new.id, &share).await.unwrap(), Opened::Done);
            assert_eq!(sight(&reader).await, Some((owner.clone(), Sight::Shared)));
            assert_eq!(sight(&third).await, None);
            assert_eq!(mine.material(new.id).await.unwrap().unwrap().readers, [reader.tenant().clone()]);
            let nobody: Tenant = "nobody".parse().unwrap();
            let wrong = Opening { is_public: Some(true), readers: Some(vec![nobody.clone()]) };
            assert_eq!(mine.open_material(new.id, &wrong).await.unwrap(), Opened::NoTenant(nobody));
            assert_eq!(sight(&third).await, None, "nothing of a refused change is kept");

            let public = Opening { is_public: Some(true), ..Opening::default() };
            assert_eq!(mine.open_material(new.id, &public).await.unwrap(), Opened::Done);
            assert_eq!(sight(&third).await, Some((owner.clone(), Sight::Public)));
            assert_eq!(sight(&reader).await, Some((owner.clone(), Sight::Shared)));
            add(&third, &new).await;
            assert_eq!(sight(&third).await, Some((third.tenant().clone(), Sight::Own)));
            assert_eq!(third.delete_material(new.id).await.unwrap(), Deleted::Done);
            assert_eq!(sight(&third).await, Some((owner, Sight::Public)));

            let private = Opening { is_public: Some(false), readers: Some(Vec::new()) };
            assert_eq!(mine.open_material(new.id, &private).await.unwrap(), Opened::Done);
            assert_eq!((sight(&reader).await, sight(&third).await), (None, None));
        }
    }

    #[tokio::test]
    async fn lists_have_what_is_shared_and_what_is_public_once() {
        for (mine, _guard) in testing::catalogs().await {
            let (reader, third) = (testing::other(&mine, "lab").await, testing::other(&mine, "third").await);
            for text in ["a", "b", "c", "private"] {
                add(&mine, &material(text)).await;
            }
            add(&third, &material("a")).await;
            let share = Opening { readers: Some(vec![reader.tenant().clone()]), ..Opening::default() };
            let public = Opening { is_public: Some(true), ..Opening::default() };
            mine.open_material(Digest::of(b"c"), &share).await.unwrap();
            for text in ["a", "b"] {
                mine.open_material(Digest::of(text.as_bytes()), &public).await.unwrap();
            }
            third.open_material(Digest::of(b"a"), &public).await.unwrap();
            add(&third, &NewMaterial { tags: vec!["z".to_owned(), "b".to_owned()], ..material("c") }).await;
            third.open_material(Digest::of(b"c"), &share).await.unwrap();
            let shared = reader.visible_materials(Sight::Shared, &MaterialFilter::default(), None, 9).await.unwrap();
            let tags: BTreeSet<Vec<String>> = shared.items.into_iter().map(|row| row.tags).collect();
            let expected = [vec!["b".to_owned(), "z".to_owned()], vec!["office".to_owned()]];
            assert_eq!(tags, expected.into_iter().collect(), "each owner's own");
            assert_eq!(third.delete_material(Digest::of(b"c")).await.unwrap(), Deleted::Done);
            let names = async |sight, filter: &MaterialFilter| {
                let (mut names, mut cursor) = (Vec::new(), None);
                loop {
                    let page = reader.visible_materials(sight, filter, cursor, 1).await.unwrap();
                    names.extend(page.items.into_iter().map(|row| row.name.unwrap()));
                    cursor = page.next;
                    if cursor.is_none() {
                        names.sort();
                        return names;
                    }
                }
            };
            let all = MaterialFilter::default();
            assert_eq!(names(Sight::Own, &all).await, Vec::<String>::new());
            assert_eq!(names(Sight::Shared, &all).await, ["c"]);
            assert_eq!(names(Sight::Public, &all).await, ["a", "b"]);
            let b = MaterialFilter { q: Some("b".to_owned()), tag: Some("office".to_owned()), ..all.clone() };
            assert_eq!(names(Sight::Public, &b).await, ["b"]);
            let none = MaterialFilter { quantity: Some(Quantity::Brdf), ..all };
            assert_eq!(names(Sight::Public, &none).await, Vec::<String>::new());
        }
    }
}
