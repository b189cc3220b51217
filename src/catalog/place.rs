//! Place of a catalog: a file for SQLite, or the URL of a PostgreSQL database.

use super::dialect::Dialect;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Place of the catalog's database; written as `sqlite:PATH` or `postgres://USER@HOST/DATABASE`.
#[derive(Clone, PartialEq, Eq)]
pub enum Database {
    /// Path of a SQLite file.
    File(PathBuf),
    /// URL of a PostgreSQL database, which may hold a password.
    Server(String),
}

/// Text that is neither `sqlite:PATH` nor the URL of a PostgreSQL database.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{0}`, expected sqlite:PATH or postgres://USER@HOST/DATABASE")]
pub struct NotADatabase(String);

impl Database {
    pub(crate) fn dialect(&self) -> Dialect {
        match self {
            Self::File(_) => Dialect::Sqlite,
            Self::Server(_) => Dialect::Postgres,
        }
    }

    /// Returns the path of the SQLite file, or `None` for PostgreSQL.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(file) => Some(file),
            Self::Server(_) => None,
        }
    }
}

impl FromStr for Database {
    type Err = NotADatabase;

    fn from_str(text: &str) -> Result<Self, NotADatabase> {
        if let Some(path) = text.strip_prefix("sqlite:") {
            let path = path.strip_prefix("//").unwrap_or(path);
            return if path.is_empty() { Err(NotADatabase(text.to_owned())) } else { Ok(Self::File(path.into())) };
        }
        if text.starts_with("postgres://") || text.starts_with("postgresql://") {
            return Ok(Self::Server(text.to_owned()));
        }
        // A text with a password must not reach the log, even with a misspelt scheme.
        Err(NotADatabase(if text.contains('@') { "…".to_owned() } else { text.chars().take(80).collect() }))
    }
}

/// Shows the place of the database without its password.
impl fmt::Display for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(file) => write!(f, "sqlite:{}", file.display()),
            Self::Server(url) => {
                let (scheme, rest) = url.split_once("://").unwrap_or(("postgres", url));
                // The password ends at the last `@` before the path.
                let (authority, path) = rest.find('/').map_or((rest, ""), |at| rest.split_at(at));
                let Some((user, host)) = authority.rsplit_once('@') else {
                    return write!(f, "{scheme}://{authority}{}", path.split('?').next().unwrap_or_default());
                };
                let user = user.split(':').next().unwrap_or_default();
                write!(f, "{scheme}://{user}@{host}{}", path.split('?').next().unwrap_or_default())
            }
        }
    }
}

impl fmt::Debug for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_and_shown_without_their_passwords() {
        for (text, shown) in [
            ("sqlite:/var/lib/a b.sqlite", "sqlite:/var/lib/a b.sqlite"),
            ("sqlite:///var/lib/c.sqlite", "sqlite:/var/lib/c.sqlite"),
            ("postgres://wavelume:p%40:ss@db:5433/wavelume?sslmode=require", "postgres://wavelume@db:5433/wavelume"),
            ("postgres://wavelume@db/wavelume", "postgres://wavelume@db/wavelume"),
            ("postgresql://db/wavelume?password=secret", "postgresql://db/wavelume"),
        ] {
            let place: Database = text.parse().unwrap();
            assert_eq!(place.to_string(), shown);
            assert_eq!(format!("{place:?}"), shown);
        }
        for text in ["", "sqlite:", "mysql://root:secret@db", "catalog.sqlite"] {
            let error = text.parse::<Database>().unwrap_err().to_string();
            assert!(error.contains("expected sqlite:PATH") && !error.contains("secret"), "{error}");
        }
    }
}
