//! The migrations of `migrations/`, embedded in the order in which they are applied, and the schemas and jobs that this
//! program understands.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// Edition of the program: the schema migrations that it knows, and the highest version of job arguments that it runs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edition {
    /// File names and SQL texts of all schema migrations; the number in a name is the version that the database
    /// records.
    pub(crate) migrations: &'static [(&'static str, &'static str)],
    /// Version of the encoded job arguments. A job with a higher version is left to newer workers.
    pub(crate) level: i64,
}

/// Edition of this program: the schema migrations that it knows, and the highest version of job arguments that it runs.
pub(crate) const EDITION: Edition = Edition {
    migrations: &[
        ("0001_catalog", include_str!("../../migrations/0001_catalog.sql")),
        ("0002_scale", include_str!("../../migrations/0002_scale.sql")),
        ("0003_lists", include_str!("../../migrations/0003_lists.sql")),
        ("0004_trust", include_str!("../../migrations/0004_trust.sql")),
        ("0005_requests", include_str!("../../migrations/0005_requests.sql")),
        ("0006_tag_ages", include_str!("../../migrations/0006_tag_ages.sql")),
        ("0007_tags_by_age", include_str!("../../migrations/0007_tags_by_age.sql")),
    ],
    // 2: jobs of other tenants than the default one, which older workers would look for among the rows of that one.
    level: OTHER_TENANTS,
};

/// Version of the stored job arguments in jobs of tenants other than the default one; workers that only know lower
/// versions leave such jobs alone.
pub(crate) const OTHER_TENANTS: i64 = 2;

/// Version of the database schema that this program works with: the number of the last migration.
pub(crate) const VERSION: i64 = EDITION.migrations.len() as i64;

#[cfg(test)]
tokio::task_local! {
    /// Edition of the program for a test. Catalogs that the current task opens behave as those of a program of this
    /// edition.
    pub(crate) static PROGRAM: Edition;
}

/// Returns the edition of this program (its migrations and version of job arguments), or the one that a test has set.
pub(super) fn edition() -> Edition {
    #[cfg(test)]
    if let Ok(edition) = PROGRAM.try_with(|edition| *edition) {
        return edition;
    }
    EDITION
}

/// Beginning of a line of a migration that adds an index; the definition of the index follows.
const INDEX: &str = "CREATE INDEX IF NOT EXISTS ";

/// Number of the migration that rebuilds the tables of the first version of the schema.
pub(super) const REBUILD: i64 = 2;

impl Edition {
    /// Returns the version of the schema: the number of its last migration.
    pub(super) fn version(self) -> i64 {
        self.migrations.len() as i64
    }

    /// Builds the object that applies the schema migrations. A list of files, instead of sqlx's `migrate!` macro, keeps
    /// a second SQLite and half of tokio out of the build. Migrations that a newer program has applied are left alone.
    pub(super) fn migrator(self) -> Migrator {
        let migrations = self.migrations.iter().filter_map(|(name, text)| migration(name, text));
        let mut migrator = Migrator::with_migrations(migrations.collect());
        migrator.set_ignore_missing(true);
        migrator
    }

    /// Returns the migrations after the rebuild of the tables. Each has its version and the definitions of the indexes
    /// that it adds: the texts between `CREATE INDEX IF NOT EXISTS` and the semicolon.
    pub(super) fn later(self) -> Vec<(i64, Vec<&'static str>)> {
        let index = |line: &'static str| line.strip_prefix(INDEX)?.strip_suffix(';');
        let indexes = |text: &'static str| text.lines().filter_map(index).collect();
        (1..).zip(self.migrations).skip(REBUILD as usize).map(|(version, (_, text))| (version, indexes(text))).collect()
    }
}

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
        for (name, text) in &EDITION.migrations[REBUILD as usize..] {
            let indexes = text.to_lowercase().matches("create index").count()
                + text.to_lowercase().matches("create unique index").count();
            let comments = text.lines().filter(|line| line.starts_with("--")).collect::<String>().to_lowercase();
            let lines = text.lines().filter(|line| line.starts_with(INDEX) && line.ends_with(';')).count();
            assert_eq!(indexes - comments.matches("create index").count(), lines, "{name}");
        }
        assert!(EDITION.later().iter().map(|(_, indexes)| indexes.len()).sum::<usize>() >= 5);
    }

    #[test]
    fn every_file_of_the_folder_is_embedded_under_its_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations");
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().trim_end_matches(".sql").to_owned())
            .collect();
        names.sort();
        let embedded: Vec<_> = EDITION.migrations.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(names, embedded);
        let migrator = EDITION.migrator();
        let versions: Vec<i64> = migrator.iter().map(|migration| migration.version).collect();
        assert_eq!(versions, (1..=EDITION.version()).collect::<Vec<_>>());
    }
}
