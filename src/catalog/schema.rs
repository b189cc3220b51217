//! The migrations of `migrations/`, embedded in the order in which they are applied, and the schemas that this version
//! can work with.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// File names and SQL texts of all schema migrations; the number in a name is the version that the database records.
const FILES: [(&str, &str); 3] = [
    ("0001_catalog", include_str!("../../migrations/0001_catalog.sql")),
    ("0002_scale", include_str!("../../migrations/0002_scale.sql")),
    ("0003_lists", include_str!("../../migrations/0003_lists.sql")),
];

/// Version of the database schema that this program works with: the number of the last migration.
pub(crate) const VERSION: i64 = FILES.len() as i64;

/// Number of the migration that rebuilds the tables of the first version of the schema.
pub(super) const REBUILD: i64 = 2;

/// Builds the object that applies the schema migrations. A list of files, instead of sqlx's `migrate!` macro, keeps a
/// second SQLite and half of tokio out of the build. Migrations that a newer program has applied are left alone.
pub(super) fn migrator() -> Migrator {
    let mut migrator =
        Migrator::with_migrations(FILES.iter().filter_map(|(name, text)| migration(name, text)).collect());
    migrator.set_ignore_missing(true);
    migrator
}

/// Returns the indexes that the migrations after the rebuild add, as the text between `CREATE INDEX IF NOT EXISTS` and
/// the semicolon.
pub(super) fn online_indexes() -> impl Iterator<Item = &'static str> {
    let texts = FILES.iter().skip(REBUILD as usize);
    texts.flat_map(|(_, text)| text.lines()).filter_map(|line| line.strip_prefix(INDEX)?.strip_suffix(';'))
}

/// Beginning of a line of a migration that adds an index.
const INDEX: &str = "CREATE INDEX IF NOT EXISTS ";

fn migration(name: &'static str, text: &'static str) -> Option<Migration> {
    let (number, description) = name.split_once('_')?;
    let version = number.parse().ok()?;
    Some(Migration::new(version, description.into(), MigrationType::Simple, text.into_sql_str(), false))
}

/// SQL statements that tune often written tables on PostgreSQL: room for updates in place, and early cleaning.
pub(super) const TUNING: [&str; 3] = [
    "ALTER TABLE jobs SET (fillfactor = 70, autovacuum_vacuum_scale_factor = 0.01, autovacuum_analyze_scale_factor = 0.01)",
    "ALTER TABLE intents SET (autovacuum_vacuum_scale_factor = 0.01)",
    "ALTER TABLE doomed SET (autovacuum_vacuum_scale_factor = 0.01)",
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn each_later_index_is_one_line_that_may_be_repeated() {
        for (name, text) in &FILES[REBUILD as usize..] {
            let indexes = text.to_lowercase().matches("create index").count()
                + text.to_lowercase().matches("create unique index").count();
            let comments = text.lines().filter(|line| line.starts_with("--")).collect::<String>().to_lowercase();
            let lines = text.lines().filter(|line| line.starts_with(INDEX) && line.ends_with(';')).count();
            assert_eq!(indexes - comments.matches("create index").count(), lines, "{name}");
        }
        assert!(online_indexes().count() >= 5);
    }

    #[test]
    fn every_file_of_the_folder_is_embedded_under_its_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations");
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().trim_end_matches(".sql").to_owned())
            .collect();
        names.sort();
        assert_eq!(names, FILES.map(|(name, _)| name.to_owned()));
        let migrator = migrator();
        let versions: Vec<i64> = migrator.iter().map(|migration| migration.version).collect();
        assert_eq!(versions, (1..=VERSION).collect::<Vec<_>>());
    }
}
