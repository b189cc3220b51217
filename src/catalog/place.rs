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

/// Returns a URL without its passwords: the one before the host, and those among the parameters. Another text stays as
/// it is.
pub(crate) fn without_password(url: &str) -> String {
    let Some((scheme, rest)) = url.split_once("://") else { return url.to_owned() };
    let ends = |from: usize| rest[from..].find(['/', '?', '#']).map_or(rest.len(), |at| from + at);
    let (authority, after) = rest.split_at(ends(0));
    // A password with a slash makes the URL invalid, and must not be shown either.
    let is_port = authority.rsplit(':').next().is_some_and(|port| port.bytes().all(|byte| byte.is_ascii_digit()));
    let path = after.split('?').next().unwrap_or_default();
    let is_cut = !authority.contains('@') && (path.contains('@') || authority.contains(':') && !is_port);
    let end = if is_cut { rest.rfind('@').map_or(authority.len(), |at| ends(at + 1)) } else { authority.len() };
    let (authority, after) = rest.split_at(end);
    let place = match authority.rsplit_once('@') {
        Some((user, host)) => format!("{}@{host}", user.split(':').next().unwrap_or_default()),
        None => authority.to_owned(),
    };
    let Some((path, parameters)) = after.split_once('?') else { return format!("{scheme}://{place}{after}") };
    let is_secret = |parameter: &&str| {
        let name = decoded(parameter.split('=').next().unwrap_or_default()).to_lowercase();
        ["password", "secret", "token"].iter().any(|word| name.contains(word))
    };
    let kept: Vec<&str> = parameters.split('&').filter(|parameter| !is_secret(parameter)).collect();
    let mark = if kept.is_empty() { "" } else { "?" };
    format!("{scheme}://{place}{path}{mark}{}", kept.join("&"))
}

/// Decodes the percent-encoding of a parameter's name.
fn decoded(name: &str) -> String {
    let mut pieces = name.split('%');
    let mut bytes = pieces.next().unwrap_or_default().as_bytes().to_vec();
    for piece in pieces {
        match piece.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                bytes.extend(&piece.as_bytes()[2..]);
            }
            None => bytes.extend(piece.as_bytes()),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Shows the place of the database without its password.
impl fmt::Display for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(file) => write!(f, "sqlite:{}", file.display()),
            Self::Server(url) => f.write_str(without_password(url).split('?').next().unwrap_or_default()),
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
    fn a_url_keeps_everything_but_its_passwords() {
        for (text, shown) in [
            ("postgres://w:p%40:ss@db:5433/w?sslmode=require", "postgres://w@db:5433/w?sslmode=require"),
            ("postgres://w:a/b@db/w", "postgres://w@db/w"),
            ("postgres://w:1/b@db/w", "postgres://w@db/w"),
            ("postgres://w:a?b@db/w?x=1", "postgres://w@db/w?x=1"),
            ("postgres://w@db/w?p%61ssword=s&options[search_path]=t", "postgres://w@db/w?options[search_path]=t"),
            ("postgres://db/w?password=s", "postgres://db/w"),
            ("postgres://db:5432/w?application_name=a@b", "postgres://db:5432/w?application_name=a@b"),
            ("postgres://w@[::1]/w", "postgres://w@[::1]/w"),
            ("http://user:s@host:8080", "http://user@host:8080"),
            ("s3://bucket/prefix", "s3://bucket/prefix"),
            ("sqlite:/a@b:c", "sqlite:/a@b:c"),
            ("30s", "30s"),
        ] {
            assert_eq!(without_password(text), shown);
        }
    }

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
