//! The migrations of `migrations/`, embedded in the order in which they are applied.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// File names and texts of all migrations; the name's number is the version that the database records.
const FILES: [(&str, &str); 1] = [("0001_catalog", include_str!("../../migrations/0001_catalog.sql"))];

/// Builds the migrator of [`FILES`]. Listing them here, instead of sqlx's `migrate!`, keeps a second SQLite and half of
/// tokio out of the build: the macro would compile both for the host.
pub(super) fn migrator() -> Migrator {
    Migrator::with_migrations(FILES.iter().filter_map(|(name, text)| migration(name, text)).collect())
}

fn migration(name: &'static str, text: &'static str) -> Option<Migration> {
    let (number, description) = name.split_once('_')?;
    let version = number.parse().ok()?;
    Some(Migration::new(version, description.into(), MigrationType::Simple, text.into_sql_str(), false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

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
        assert_eq!(versions, (1..=FILES.len() as i64).collect::<Vec<_>>());
    }
}
