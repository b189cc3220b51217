//! SQL statements that read one page of a list. The ids of the page are found in an index, in the order of the list;
//! only the rows of the page, which are wide, are read from the table.
//!
//! Parameters: 1 and 2 the time and id of the row before the page, 3 quantity, 4 measurement or format, 5 and 6 the
//! forms of a tag, 7 number of rows, 8 tenant, 9 and 10 the patterns of a text, 11 the condition of SQLite's search
//! index, 12 the place there that all rows of the page are before. SQLite has no statistics of its tables: `CROSS JOIN`
//! makes it read tables from left to right.

use super::dialect::Dialect;
use super::page::{Cursor, and};
use super::search::Sought;
use super::texts;
use crate::domain::Quantity;
use sqlx::any::AnyArguments;
use sqlx::query::Query;
use sqlx::{Any, AssertSqlSafe, SqlSafeStr, SqlStr};

/// Reason for which a tenant may read a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// The tenant owns the material.
    Own,
    /// The owner shares the material with the tenant.
    Shared,
    /// The material is public.
    Public,
}

/// Filters of a list of materials or measurements.
#[derive(Clone, Debug, Default)]
pub(super) struct Filters {
    pub(super) quantity: Option<Quantity>,
    /// Id of the measurement that materials are made from.
    pub(super) measurement: Option<String>,
    pub(super) format: Option<String>,
    pub(super) tag: Option<Sought>,
    pub(super) text: Option<Sought>,
}

/// Condition that a row of a list comes after the row before the page.
const AFTER: &str = "(m.created_at, m.id) < ($1, $2)";

/// Order of a list: newest first.
const ORDER: &str = "ORDER BY m.created_at DESC, m.id DESC";

impl Filters {
    /// Binds the parameters of a statement of this module.
    pub(super) fn bind<'q>(
        &self,
        statement: SqlStr,
        tenant: &str,
        sight: Sight,
        after: Cursor,
        limit: usize,
    ) -> Query<'q, Any, AnyArguments> {
        let (composed, decomposed) = self.text.as_ref().map(Sought::patterns).unzip();
        sqlx::query(statement)
            .bind(after.created_at)
            .bind(after.id)
            .bind(self.quantity.map(|quantity| quantity.name().to_owned()))
            .bind(self.measurement.clone().or_else(|| self.format.clone()))
            .bind(self.tag.as_ref().map(|tag| tag.composed.clone()))
            .bind(self.tag.as_ref().and_then(|tag| tag.decomposed.clone()))
            .bind(limit as i64 + 1)
            .bind(tenant.to_owned())
            .bind(composed)
            .bind(decomposed.flatten())
            .bind(self.matching(tenant, sight))
            .bind(texts::after(after.created_at))
    }

    /// Returns the condition for SQLite's search index, which holds what the index can tell of all filters.
    pub(super) fn matching(&self, tenant: &str, sight: Sight) -> String {
        let own = if sight == Sight::Own { Sought::exactly(tenant).matching("tenant") } else { None };
        let public = if sight == Sight::Public { Sought::exactly("public").matching("visibility") } else { None };
        let matching = [
            own,
            public,
            self.quantity.and_then(|quantity| Sought::exactly(quantity.name()).matching("quantity")),
            self.format.as_ref().and_then(|format| Sought::exactly(format).matching("format")),
            // Tags are among the texts that are searched.
            self.tag.as_ref().and_then(|tag| Sought::within(&tag.composed).matching("search")),
            self.text.as_ref().and_then(|text| text.matching("search")),
        ];
        matching.into_iter().flatten().collect::<Vec<_>>().join(" AND ")
    }

    /// Returns the statement for a page of materials that a tenant may read for this reason.
    pub(super) fn materials(&self, dialect: Dialect, sight: Sight) -> SqlStr {
        let ids = match sight {
            Sight::Own if self.is_found_in_texts(dialect) => {
                self.texts("materials", &format!(" AND m.tenant = $8{}{}", self.plain(), self.tagged()))
            }
            Sight::Own if self.measurement.is_some() => {
                let condition = "s.tenant = $8 AND s.measurement = $4 AND m.tenant = s.tenant AND m.id = s.material";
                match dialect {
                    // SQLite would read all rows of the tenant in the primary key, which has all columns.
                    Dialect::Sqlite => self.along(
                        "material_sources AS s INDEXED BY material_sources_by_measurement CROSS JOIN materials m",
                        condition,
                    ),
                    Dialect::Postgres => self.along("material_sources s CROSS JOIN materials m", condition),
                }
            }
            Sight::Own if self.tag.is_some() => self.of_tag(),
            Sight::Own => self.along("materials m", "m.tenant = $8"),
            // Shares have no order by time, so that all of them are sorted: by ids and times, without the documents.
            Sight::Shared => self.along(
                "shares s CROSS JOIN materials m",
                "s.reader = $8 AND m.tenant = s.tenant AND m.id = s.material",
            ),
            Sight::Public => {
                let public = "m.visibility = 'public' AND m.tenant <> $8 AND NOT EXISTS (SELECT 1 FROM materials o \
                              WHERE o.id = m.id AND o.visibility = 'public' AND o.tenant <> $8 AND o.tenant < m.tenant)";
                if self.is_found_in_texts(dialect) {
                    self.texts("materials", &format!(" AND {public}{}{}", self.plain(), self.tagged()))
                } else {
                    self.along("materials m", public)
                }
            }
        };
        rows("materials", "m.tenant, m.id, m.name, m.document, m.created_at, m.visibility", &ids)
    }

    /// Returns the statement for a page of a tenant's measurements.
    pub(super) fn measurements(&self, dialect: Dialect) -> SqlStr {
        let ids = if self.is_found_in_texts(dialect) {
            self.texts("measurements", &format!(" AND m.tenant = $8{}", self.plain()))
        } else {
            self.along("measurements m", "m.tenant = $8")
        };
        rows("measurements", "m.id, m.content, m.name, m.file_name, m.bytes, m.document, m.created_at", &ids)
    }

    /// Returns true if the page is found among the texts of SQLite's search index: always if the index finds the text,
    /// and for shorter texts if no other filter leaves fewer rows.
    fn is_found_in_texts(&self, dialect: Dialect) -> bool {
        let others = self.quantity.is_some() || self.tag.is_some() || self.format.is_some();
        dialect == Dialect::Sqlite
            && self.measurement.is_none()
            && self.text.as_ref().is_some_and(|text| text.is_indexed() || !others)
    }

    /// Returns the query for the ids of a page, found among the texts of SQLite's search index.
    fn texts(&self, table: &str, conditions: &str) -> String {
        if self.text.as_ref().is_some_and(Sought::is_indexed) {
            texts::page(table, true, conditions)
        } else {
            texts::page(table, false, &format!("{conditions}{}", self.like()))
        }
    }

    /// Returns the query for the ids of a page, found along the tables `from` under a condition.
    fn along(&self, from: &str, condition: &str) -> String {
        let (plain, tagged, like) = (self.plain(), self.tagged(), self.like());
        format!("SELECT m.tenant, m.id FROM {from} WHERE {condition} AND {AFTER}{plain}{tagged}{like} {ORDER} LIMIT $7")
    }

    /// Returns the query for the ids of a page of a tag's materials. Tags are in the order of time, but for the few
    /// that wait for the time of their material, and have two forms at most.
    fn of_tag(&self) -> String {
        let (plain, like) = (self.plain(), self.like());
        let joined = "material_tags t CROSS JOIN materials m";
        let join = "AND m.tenant = t.tenant AND m.id = t.material";
        let (dated, and) = if plain.is_empty() && like.is_empty() { ("material_tags t", "") } else { (joined, join) };
        let mut parts = Vec::new();
        let forms = if self.tag.as_ref().is_some_and(|tag| tag.decomposed.is_some()) { 6 } else { 5 };
        for form in 5..=forms {
            let of = format!("t.tenant = $8 AND t.tag = ${form}");
            parts.push(format!(
                "SELECT t.tenant, t.material AS id, t.created_at FROM {dated} WHERE {of} {and} \
                 AND (t.created_at, t.material) < ($1, $2){plain}{like} \
                 ORDER BY t.created_at DESC, t.material DESC LIMIT $7"
            ));
            parts.push(format!(
                "SELECT m.tenant, m.id, m.created_at FROM {joined} WHERE {of} {join} AND t.created_at IS NULL \
                 AND {AFTER}{plain}{like} {ORDER} LIMIT $7"
            ));
        }
        let parts = (0..).zip(parts).map(|(at, part)| format!("SELECT * FROM ({part}) AS part{at}"));
        let all = parts.collect::<Vec<_>>().join(" UNION ");
        format!("SELECT tenant, id FROM ({all}) AS tagged ORDER BY created_at DESC, id DESC LIMIT $7")
    }

    fn plain(&self) -> String {
        and(&[(self.quantity.is_some(), "m.quantity = $3"), (self.format.is_some(), "m.format = $4")])
    }

    fn tagged(&self) -> &'static str {
        match &self.tag {
            None => "",
            Some(Sought { decomposed: None, .. }) => {
                " AND EXISTS (SELECT 1 FROM material_tags t WHERE t.tenant = m.tenant AND t.material = m.id \
                 AND t.tag = $5)"
            }
            Some(_) => {
                " AND EXISTS (SELECT 1 FROM material_tags t WHERE t.tenant = m.tenant AND t.material = m.id \
                 AND t.tag IN ($5, $6))"
            }
        }
    }

    fn like(&self) -> &'static str {
        match &self.text {
            None => "",
            Some(Sought { decomposed: None, .. }) => " AND m.search LIKE $9 ESCAPE '\\'",
            Some(_) => " AND (m.search LIKE $9 ESCAPE '\\' OR m.search LIKE $10 ESCAPE '\\')",
        }
    }
}

/// Returns the statement that reads the rows of a page, given the query for their ids.
fn rows(table: &str, columns: &str, ids: &str) -> SqlStr {
    let statement = format!(
        "SELECT {columns} FROM ({ids}) AS page CROSS JOIN {table} m WHERE m.tenant = page.tenant AND m.id = page.id {ORDER}"
    );
    AssertSqlSafe(statement).into_sql_str()
}
