//! Rows of materials: manifests, the measurements they were made of, and tags.

use super::blobs::unname;
use super::database::{Catalog, Write};
use super::error::{CatalogError, digest, tenant};
use super::lists::{Filters, Sight};
use super::measurements::Deleted;
use super::page::{Cursor, Page};
use super::search::{Sought, composed, folded};
use super::usage::{Change, charge};
use crate::domain::Quantity;
use crate::store::Digest;
use crate::trust::Tenant;
use serde_json::{Map, Value, json};
use sqlx::Row;
use sqlx::any::AnyRow;
use std::collections::HashMap;

/// A material (a compressed measurement) to store in the catalog.
#[derive(Clone, Debug)]
pub(crate) struct NewMaterial {
    /// BLAKE3 digest of the material's file.
    pub id: Digest,
    /// BLAKE3 digest of the material's file without its metadata chunk.
    pub payload: Digest,
    /// Radiometric quantity that the material holds.
    pub quantity: Quantity,
    /// Size of the material's file in bytes.
    pub bytes: u64,
    /// Name of the material given by the user.
    pub name: Option<String>,
    /// Tags of the material given by the user.
    pub tags: Vec<String>,
    /// Ids of the stored measurements from which the material was made; empty if none is known.
    pub measurements: Vec<Digest>,
    /// Description of the material as a JSON object: report of its compression, names, licences and origin.
    pub document: Map<String, Value>,
}

/// A material (a compressed measurement) as stored in the catalog.
#[derive(Clone, Debug)]
pub(crate) struct MaterialRow {
    /// Id of the material: the BLAKE3 digest of its file.
    pub id: Digest,
    /// Latest name that a job gave to the material.
    pub name: Option<String>,
    /// Tags of the material, sorted by their bytes.
    pub tags: Vec<String>,
    /// Ids of the measurements from which the material was made, in ascending order.
    pub measurements: Vec<Digest>,
    /// Manifest of the material as JSON.
    pub document: String,
    /// Time at which the material was first stored, ms of the Unix epoch.
    pub created_ms: i64,
    /// True if everybody may read the material.
    pub is_public: bool,
    /// Tenants with which the material is shared, sorted by id.
    pub readers: Vec<Tenant>,
}

/// Filter of a list of materials.
#[derive(Clone, Debug, Default)]
pub(crate) struct MaterialFilter {
    /// Restricts the list to materials of this radiometric quantity.
    pub quantity: Option<Quantity>,
    /// Restricts the list to materials made from the measurement with this id.
    pub measurement: Option<Digest>,
    /// Restricts the list to materials with this tag.
    pub tag: Option<String>,
    /// Restricts the list to materials with this text in one of their names or tags.
    pub q: Option<String>,
}

impl MaterialFilter {
    /// Returns the filters as the statements of lists take them.
    pub(super) fn sought(&self) -> Filters {
        Filters {
            quantity: self.quantity,
            measurement: self.measurement.map(|digest| digest.to_string()),
            format: None,
            tag: self.tag.as_deref().map(Sought::exactly),
            text: self.q.as_deref().map(Sought::within),
        }
    }
}

impl MaterialRow {
    /// Sorts the tags, each once, in the composed form: programs before kept them as they were typed.
    pub(super) fn sort_tags(&mut self) {
        for tag in &mut self.tags {
            *tag = composed(tag);
        }
        self.tags.sort_unstable();
        self.tags.dedup();
    }
}

macro_rules! columns {
    () => {
        "id, name, document, created_at, visibility"
    };
}

impl Catalog {
    /// Returns the material with the given id, if it exists.
    pub(crate) async fn material(&self, id: Digest) -> Result<Option<MaterialRow>, CatalogError> {
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM materials WHERE tenant = $2 AND id = $1"))
            .bind(id.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        let rows: Vec<AnyRow> = row.into_iter().collect();
        Ok(self.read_materials(&rows).await?.pop())
    }

    /// Returns the name of the material with the given id, if the material exists. This is checked before a cached
    /// answer about the material is used.
    pub(crate) async fn material_name(&self, id: Digest) -> Result<Option<Option<String>>, CatalogError> {
        let row = sqlx::query("SELECT name FROM materials WHERE tenant = $2 AND id = $1")
            .bind(id.to_string())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        Ok(row.map(|row| row.try_get(0)).transpose()?)
    }

    /// Returns a page of this tenant's materials, newest first.
    pub(crate) async fn materials(
        &self,
        filter: &MaterialFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<MaterialRow>, CatalogError> {
        let rows = self.material_page(Sight::Own, filter, after, limit).await?;
        let materials = self.read_materials(&rows).await?;
        Ok(Page::of(materials, limit, |row| Cursor { created_at: row.created_ms, id: row.id.to_string() }))
    }

    /// Returns the rows of a page of materials that this tenant may read for the reason `sight`, newest first, and one
    /// row more if there is a next page.
    pub(super) async fn material_page(
        &self,
        sight: Sight,
        filter: &MaterialFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Vec<AnyRow>, CatalogError> {
        let filters = filter.sought();
        let after = after.unwrap_or_else(Cursor::newest);
        let mut list = self.list().await?;
        let statement = filters.materials(self.dialect, sight);
        let page = filters.bind(statement, self.tenant.as_str(), sight, after, limit);
        let rows = page.fetch_all(&mut *list).await?;
        list.commit().await?;
        Ok(rows)
    }

    /// Deletes a material from the catalog. No other row depends on a material, so that the deletion is never refused.
    pub(crate) async fn delete_material(&self, id: Digest) -> Result<Deleted, CatalogError> {
        self.repeat(|again| async move {
            let mut write = self.write().await?;
            let gone = sqlx::query("DELETE FROM materials WHERE tenant = $2 AND id = $1 RETURNING bytes")
                .bind(id.to_string())
                .bind(self.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            // A repeated deletion has found its own work.
            let Some(row) = gone else { return Ok(if again { Deleted::Done } else { Deleted::Absent }) };
            unname(&mut write, self.tenant.to_string(), id.to_string()).await?;
            let bytes = row.try_get::<i64, _>(0)?.max(0) as u64;
            charge(&mut write, id, Change::material(bytes).undone()).await?;
            write.commit().await?;
            Ok(Deleted::Done)
        })
        .await
    }

    /// Writes beside at most `limit` tags, of all tenants, the time of their material, which programs of the fifth
    /// schema leave out. Returns the number of tags that got theirs.
    pub(crate) async fn date_tags(&self, limit: u32) -> Result<u64, CatalogError> {
        let _turn = self.turn().await;
        let dated = sqlx::query(self.sql(
            "WITH undated AS MATERIALIZED (SELECT tenant, material, tag FROM material_tags WHERE created_at IS NULL \
             ORDER BY tenant, material, tag LIMIT $1{skip}) \
             UPDATE material_tags SET created_at = (SELECT m.created_at FROM materials m \
             WHERE m.tenant = material_tags.tenant AND m.id = material_tags.material) FROM undated \
             WHERE material_tags.tenant = undated.tenant AND material_tags.material = undated.material \
             AND material_tags.tag = undated.tag",
        ))
        .bind(i64::from(limit))
        .execute(&self.pool)
        .await?;
        Ok(dated.rows_affected())
    }

    /// Reads rows of this tenant's materials together with their tags, source measurements and readers, in three
    /// further queries for any number of rows.
    pub(super) async fn read_materials(&self, rows: &[AnyRow]) -> Result<Vec<MaterialRow>, CatalogError> {
        let mut materials = rows.iter().map(bare).collect::<Result<Vec<_>, _>>()?;
        let ids = json!(materials.iter().map(|material| material.id.to_string()).collect::<Vec<_>>()).to_string();
        let at: HashMap<Digest, usize> = materials.iter().enumerate().map(|(at, material)| (material.id, at)).collect();
        let owner = self.tenant.to_string();
        let tags = self.sql("SELECT material, tag FROM material_tags WHERE tenant = $2 AND material {among $1}");
        for row in sqlx::query(tags).bind(ids.clone()).bind(owner.clone()).fetch_all(&self.pool).await? {
            let id: String = row.try_get(0)?;
            if let Some(&at) = at.get(&digest("materials", &id, &id)?) {
                materials[at].tags.push(row.try_get(1)?);
            }
        }
        let sources =
            self.sql("SELECT material, measurement FROM material_sources WHERE tenant = $2 AND material {among $1}");
        for row in sqlx::query(sources).bind(ids.clone()).bind(owner.clone()).fetch_all(&self.pool).await? {
            let (id, source): (String, String) = (row.try_get(0)?, row.try_get(1)?);
            if let Some(&at) = at.get(&digest("materials", &id, &id)?) {
                materials[at].measurements.push(digest("materials", &id, &source)?);
            }
        }
        let shares =
            self.sql("SELECT material, reader FROM shares WHERE tenant = $2 AND material {among $1} ORDER BY reader");
        for row in sqlx::query(shares).bind(ids).bind(owner).fetch_all(&self.pool).await? {
            let (id, reader): (String, String) = (row.try_get(0)?, row.try_get(1)?);
            if let Some(&at) = at.get(&digest("materials", &id, &id)?) {
                materials[at].readers.push(tenant("shares", &id, &reader)?);
            }
        }
        for material in &mut materials {
            material.sort_tags();
            material.measurements.sort_unstable();
        }
        Ok(materials)
    }
}

/// Reads the row of a material without its tags, source measurements and readers.
pub(super) fn bare(row: &AnyRow) -> Result<MaterialRow, CatalogError> {
    let id: String = row.try_get("id")?;
    Ok(MaterialRow {
        id: digest("materials", &id, &id)?,
        name: row.try_get("name")?,
        tags: Vec::new(),
        measurements: Vec::new(),
        document: row.try_get("document")?,
        created_ms: row.try_get("created_at")?,
        is_public: row.try_get::<String, _>("visibility")? == PUBLIC,
        readers: Vec::new(),
    })
}

/// Value of the database column `visibility` for a material that everybody may read.
pub(super) const PUBLIC: &str = "public";

/// Key of a manifest under which the errors of an uploaded material against stored measurements are.
pub(crate) const COMPARED: &str = "measured_again";

/// Upper bound on the number of names, and of licences, that a material keeps; the oldest are dropped first. Raising it
/// lengthens the manifests of materials that many jobs have named differently.
const MOST_NAMES: usize = 32;

/// Value of the database column `visibility` for a material that everybody may read.
const UNFILLED: &str = "\u{1}";

/// Stores a material in the catalog, within the given transaction. Returns true if it is new.
///
/// Jobs and uploads that give equal bytes share one row. Its manifest, with provenance and time, stays that of the
/// first one. Name and licence are the latest given. All names, licences, tags, sources and comparisons with sources
/// accumulate, and names and tags stay searchable.
///
/// The claim on the material's file must be taken before, in the same transaction.
pub(super) async fn insert(write: &mut Write, new: &NewMaterial) -> Result<bool, CatalogError> {
    let (id, owner) = (new.id.to_string(), write.tenant.to_string());
    // Written first and filled below: of two jobs that end at once the second waits here and then sees the first's row.
    // The update of nothing locks a row that is there already, so that it cannot be deleted before it is filled.
    let row = sqlx::query(
        "INSERT INTO materials (tenant, id, payload, quantity, bytes, name, search, document, created_at) \
         VALUES ($8, $1, $2, $3, $4, NULL, $7, $5, $6) \
         ON CONFLICT (tenant, id) DO UPDATE SET payload = excluded.payload RETURNING name, document, search, created_at",
    )
    .bind(id.clone())
    .bind(new.payload.to_string())
    .bind(new.quantity.name().to_owned())
    .bind(new.bytes as i64)
    .bind(Value::Object(new.document.clone()).to_string())
    .bind(write.now)
    .bind(UNFILLED.to_owned())
    .bind(owner.clone())
    .fetch_one(&mut *write.transaction)
    .await?;
    let is_new = row.try_get::<String, _>("search")? == UNFILLED;
    let created_at: i64 = row.try_get("created_at")?;
    let text: String = row.try_get("document")?;
    let mut document: Map<String, Value> = serde_json::from_str(&text).map_err(|e| CatalogError::Row {
        table: "materials",
        id: id.clone(),
        reason: e.to_string(),
    })?;
    let names = added(&mut document, "names", row.try_get("name")?, new.name.as_deref().map(composed));
    let name = names.last().cloned();
    let licence = document.get("licence").and_then(Value::as_str).map(str::to_owned);
    let given = new.document.get("licence").and_then(Value::as_str).map(composed);
    let licences = added(&mut document, "licences", licence, given);
    document.insert("licence".to_owned(), json!(licences.last()));
    compared(&mut document, &new.document);

    for measurement in &new.measurements {
        sqlx::query(
            "INSERT INTO material_sources (tenant, material, measurement) VALUES ($3, $1, $2) ON CONFLICT DO NOTHING",
        )
        .bind(id.clone())
        .bind(measurement.to_string())
        .bind(owner.clone())
        .execute(&mut *write.transaction)
        .await?;
    }
    for tag in &new.tags {
        sqlx::query(
            "INSERT INTO material_tags (tenant, material, tag, created_at) VALUES ($3, $1, $2, $4) \
             ON CONFLICT DO NOTHING",
        )
        .bind(id.clone())
        .bind(composed(tag))
        .bind(owner.clone())
        .bind(created_at)
        .execute(&mut *write.transaction)
        .await?;
    }
    let tags = sqlx::query("SELECT tag FROM material_tags WHERE tenant = $2 AND material = $1 ORDER BY tag")
        .bind(id.clone())
        .bind(owner.clone())
        .fetch_all(&mut *write.transaction)
        .await?;
    let mut words = names;
    for row in &tags {
        words.push(row.try_get(0)?);
    }
    sqlx::query("UPDATE materials SET name = $2, search = $3, document = $4 WHERE tenant = $5 AND id = $1")
        .bind(id)
        .bind(name)
        .bind(folded(words.iter().map(String::as_str)))
        .bind(Value::Object(document).to_string())
        .bind(owner)
        .execute(&mut *write.transaction)
        .await?;
    Ok(is_new)
}

/// Copies the comparisons with measurements from the manifest `new` to the manifest `document`. A measurement that
/// `document` already lists keeps its first comparison.
fn compared(document: &mut Map<String, Value>, new: &Map<String, Value>) {
    let Some(Value::Array(added)) = new.get(COMPARED) else { return };
    let Value::Array(listed) = document.entry(COMPARED).or_insert_with(|| json!([])) else { return };
    for comparison in added {
        if listed.len() < MOST_NAMES && listed.iter().all(|known| known["measurement"] != comparison["measurement"]) {
            listed.push(comparison.clone());
        }
    }
}

/// Appends `given`, in the composed form, to the list of names or licences under `key` of a material's manifest, and
/// returns the list: each text once, the latest last. A list that the manifest lacks begins with `current`, the
/// material's present name or licence.
fn added(document: &mut Map<String, Value>, key: &str, current: Option<String>, given: Option<String>) -> Vec<String> {
    let listed = document.get(key).and_then(Value::as_array);
    let mut texts: Vec<String> = match listed {
        Some(listed) => listed.iter().filter_map(Value::as_str).map(str::to_owned).collect(),
        None => current.into_iter().collect(),
    };
    if let Some(given) = given {
        texts.retain(|text| composed(text) != given);
        texts.push(given);
    }
    texts.drain(..texts.len().saturating_sub(MOST_NAMES));
    document.insert(key.to_owned(), json!(texts));
    texts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::blobs::take;
    use crate::catalog::testing;

    fn material(name: Option<&str>, licence: Option<&str>, tags: &[&str]) -> NewMaterial {
        let document = json!({ "licence": licence, "format": "ies" });
        NewMaterial {
            id: Digest::of(b"file"),
            payload: Digest::of(b"payload"),
            quantity: Quantity::Edf,
            bytes: 10,
            name: name.map(str::to_owned),
            tags: tags.iter().map(|tag| (*tag).to_owned()).collect(),
            measurements: vec![Digest::of(b"lamp")],
            document: document.as_object().unwrap().clone(),
        }
    }

    async fn remember(catalog: &Catalog, new: &NewMaterial) -> (MaterialRow, Value) {
        testing::add(catalog, &testing::measurement("lamp")).await;
        let claim = testing::publish(catalog, new.id, new.bytes).await;
        let mut write = catalog.write().await.unwrap();
        assert!(take(&mut write, &claim).await.unwrap());
        insert(&mut write, new).await.unwrap();
        write.commit().await.unwrap();
        let row = catalog.material(new.id).await.unwrap().unwrap();
        let document = serde_json::from_str(&row.document).unwrap();
        (row, document)
    }

    #[tokio::test]
    async fn a_second_job_with_equal_bytes_adds_what_it_says() {
        for (catalog, _guard) in testing::catalogs().await {
            let (first, _) = remember(&catalog, &material(Some("Vase"), Some("CC0-1.0"), &["clay"])).await;
            let (second, document) = remember(&catalog, &material(Some("Büste"), Some("CC-BY-4.0"), &["Museum"])).await;
            assert_eq!((second.created_ms, second.id), (first.created_ms, first.id));
            assert_eq!((second.name.as_deref(), &document["licence"]), (Some("Büste"), &json!("CC-BY-4.0")));
            assert_eq!(document["names"], json!(["Vase", "Büste"]));
            assert_eq!(document["licences"], json!(["CC0-1.0", "CC-BY-4.0"]));
            assert_eq!(second.tags, ["Museum", "clay"]);
            let found = async |q: &str| {
                let filter = MaterialFilter { q: Some(q.to_owned()), ..MaterialFilter::default() };
                catalog.materials(&filter, None, 9).await.unwrap().items.len()
            };
            for q in ["vase", "BÜSTE", "clay", "museum"] {
                assert_eq!(found(q).await, 1, "{q}");
            }
            // A job that says nothing changes nothing; one that repeats an earlier name makes it the last again.
            let (third, document) = remember(&catalog, &material(None, None, &[])).await;
            assert_eq!((third.name.as_deref(), &document["licence"]), (Some("Büste"), &json!("CC-BY-4.0")));
            let (fourth, document) = remember(&catalog, &material(Some("Vase"), None, &[])).await;
            assert_eq!((fourth.name.as_deref(), &document["names"]), (Some("Vase"), &json!(["Büste", "Vase"])));
            assert_eq!(catalog.material_name(first.id).await.unwrap(), Some(Some("Vase".to_owned())));
            assert_eq!(catalog.material_name(Digest::of(b"other")).await.unwrap(), None);
        }
    }

    /// Returns the ids of all materials that a filter leaves, read in pages of two.
    async fn paged(catalog: &Catalog, filter: &MaterialFilter) -> Vec<Digest> {
        let (mut ids, mut next) = (Vec::new(), None);
        loop {
            let page = catalog.materials(filter, next, 2).await.unwrap();
            ids.extend(page.items.iter().map(|row| row.id));
            next = page.next;
            if next.is_none() {
                return ids;
            }
        }
    }

    #[tokio::test]
    async fn a_tag_lists_its_materials_in_order_also_those_of_an_older_program() {
        for (catalog, _guard) in testing::catalogs().await {
            for number in 0..12_i64 {
                let tags: &[&str] = if number % 3 == 0 { &["wood"] } else { &["clay", "wood"] };
                let quantity = if number % 2 == 0 { Quantity::Edf } else { Quantity::Brdf };
                let id = Digest::of(&number.to_le_bytes());
                remember(&catalog, &NewMaterial { id, quantity, ..material(None, None, tags) }).await;
                // Pairs of one time, so that ids decide.
                for statement in [
                    "UPDATE materials SET created_at = $2 WHERE id = $1",
                    "UPDATE material_tags SET created_at = $2 WHERE material = $1",
                ] {
                    let aged = sqlx::query(statement).bind(id.to_string()).bind(number / 2);
                    aged.execute(&catalog.pool).await.unwrap();
                }
                // As a program of the schema before writes it.
                if number % 4 == 1 {
                    let undated = sqlx::query("UPDATE material_tags SET created_at = NULL WHERE material = $1");
                    undated.bind(id.to_string()).execute(&catalog.pool).await.unwrap();
                }
            }
            let all = paged(&catalog, &MaterialFilter::default()).await;
            assert_eq!(all.len(), 12);
            for undated in [5, 0] {
                let rows = testing::count(&catalog, "material_tags WHERE created_at IS NULL").await;
                assert_eq!(rows, undated);
                for quantity in [None, Some(Quantity::Edf), Some(Quantity::Brdf)] {
                    let filter = MaterialFilter { quantity, ..MaterialFilter::default() };
                    let some = paged(&catalog, &filter).await;
                    let tagged = |tag: &str| MaterialFilter { tag: Some(tag.to_owned()), ..filter.clone() };
                    assert_eq!(paged(&catalog, &tagged("wood")).await, some);
                    let mut clay = some.clone();
                    clay.retain(|id| (0..12_i64).any(|n| n % 3 != 0 && Digest::of(&n.to_le_bytes()) == *id));
                    assert_eq!(paged(&catalog, &tagged("clay")).await, clay);
                    for (q, expected) in [("wood", &some), ("clay", &clay), ("w", &some), ("y", &clay)] {
                        let filter = MaterialFilter { q: Some(q.to_owned()), ..filter.clone() };
                        assert_eq!(&paged(&catalog, &filter).await, expected, "{q}");
                    }
                }
                while catalog.date_tags(2).await.unwrap() == 2 {}
            }
            let joined = "material_tags t JOIN materials m ON t.material = m.id AND t.created_at = m.created_at";
            assert_eq!(testing::count(&catalog, joined).await, 20);
        }
    }

    #[tokio::test]
    async fn both_ways_to_write_a_letter_are_one_name_and_one_tag() {
        let (composed, decomposed) = ("Dämmerung", "Da\u{308}mmerung");
        for (catalog, _guard) in testing::catalogs().await {
            let (row, document) =
                remember(&catalog, &material(Some(decomposed), None, &[decomposed, composed, decomposed])).await;
            assert_eq!((row.name.as_deref(), row.tags), (Some(composed), vec![composed.to_owned()]));
            assert_eq!(document["names"], json!([composed]));
            // As a program of before keeps it.
            let old = NewMaterial { id: Digest::of(b"old"), ..material(Some("x"), None, &["y"]) };
            remember(&catalog, &old).await;
            for (statement, text) in [
                (
                    "UPDATE materials SET search = $2 WHERE id = $1",
                    format!("{decomposed}\n{decomposed}").to_lowercase(),
                ),
                ("UPDATE material_tags SET tag = $2 WHERE material = $1", decomposed.to_owned()),
            ] {
                sqlx::query(statement).bind(old.id.to_string()).bind(text).execute(&catalog.pool).await.unwrap();
            }
            for _ in 0..2 {
                for text in [composed, decomposed] {
                    let by_tag = MaterialFilter { tag: Some(text.to_owned()), ..MaterialFilter::default() };
                    let by_text = MaterialFilter { q: Some(text.to_owned()), ..MaterialFilter::default() };
                    let both = MaterialFilter { q: Some("mmer".to_owned()), ..by_tag.clone() };
                    for filter in [by_tag, by_text, both] {
                        assert_eq!(paged(&catalog, &filter).await.len(), 2, "{filter:?}");
                    }
                }
                let (row, _) =
                    remember(&catalog, &NewMaterial { tags: vec![composed.to_owned()], ..old.clone() }).await;
                assert_eq!(row.tags, [composed], "both forms are kept now, and shown once");
            }
        }
    }

    #[tokio::test]
    async fn a_row_of_before_keeps_its_name_and_lists_are_bounded() {
        for (catalog, _guard) in testing::catalogs().await {
            remember(&catalog, &material(Some("Vase"), Some("CC0-1.0"), &[])).await;
            let old = r#"{"licence":"CC0-1.0","format":"ies"}"#;
            let update = sqlx::query("UPDATE materials SET document = $1").bind(old).execute(&catalog.pool);
            update.await.unwrap();
            let (_, document) = remember(&catalog, &material(Some("Bust"), None, &[])).await;
            assert_eq!((&document["names"], &document["licences"]), (&json!(["Vase", "Bust"]), &json!(["CC0-1.0"])));
            for i in 0..2 * MOST_NAMES {
                remember(&catalog, &material(Some(&format!("name {i}")), None, &[])).await;
            }
            let row = catalog.material(Digest::of(b"file")).await.unwrap().unwrap();
            let document: Value = serde_json::from_str(&row.document).unwrap();
            assert_eq!(document["names"].as_array().unwrap().len(), MOST_NAMES);
            assert_eq!(row.name.as_deref(), Some("name 63"));
        }
    }
}
