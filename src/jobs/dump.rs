//! Tables of a catalog as files: one JSON array a row and line, compressed with gzip, in a staging directory.

use super::archive::ArchiveError;
use crate::catalog::{Catalog, SCHEMA, TABLES};
use crate::store::{Digest, Staged, StagedWriter, Staging, StoreError};
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use futures::TryStreamExt;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};

/// Number of bytes of catalog rows that are collected before they are compressed. Raising it needs more memory.
const PIECE: usize = 1 << 20;

/// Upper bounds on the number of rows of a copied catalog, and on their bytes, that are read from a file at once.
/// Raising them writes larger statements to the database, and needs more memory.
const BATCH: (usize, u64) = (500, 4 << 20);

/// Upper bound on the bytes of one row in the file of a copied table. Raising it lets a damaged file take more memory.
const LONGEST: u64 = 64 << 20;

/// A table of a copied catalog, as a backup describes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Table {
    /// Name of the table in the database.
    pub name: String,
    /// Names of the columns, in the order of the values of a row.
    pub columns: Vec<String>,
    /// Number of rows in the copied table.
    pub rows: u64,
    /// Digest of the compressed file that holds the rows.
    pub digest: Digest,
    /// Size of the compressed file in bytes.
    pub bytes: u64,
}

/// Temporary files with all tables of a catalog as it was at one moment.
#[derive(Debug)]
pub(super) struct Dump(pub Vec<(Table, Staged)>);

/// Rows of one table of a copied catalog, read batch by batch.
pub(super) struct Rows {
    lines: Option<BufReader<MultiGzDecoder<File>>>,
    table: Table,
    read: u64,
}

/// Writer that passes compressed bytes on to a staged (temporary) file.
struct Sink(StagedWriter);

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map_err(io::Error::other)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Runs work that blocks the thread, away from the threads that serve requests.
pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::task::spawn_blocking(work).await.map_err(|error| StoreError::Io(error.into()))?
}

impl Dump {
    /// Writes all tables of a catalog, as it is now, to temporary files. Refuses a catalog whose schema a newer program
    /// has made, as it may have more tables.
    pub(super) async fn of(catalog: &Catalog, staging: &Staging) -> Result<Self, ArchiveError> {
        let schema = catalog.version().await?;
        if schema > SCHEMA {
            return Err(ArchiveError::Copy(format!(
                "the catalog has the schema {schema}, and this program knows {SCHEMA}: use a newer program"
            )));
        }
        let mut snapshot = catalog.snapshot().await?;
        let mut tables = Vec::with_capacity(TABLES.len());
        for table in TABLES {
            let columns = snapshot.columns(table.0).await?;
            let begin = staging.clone();
            let mut writer = blocking(move || Ok(GzEncoder::new(Sink(begin.begin()?), Compression::fast()))).await?;
            let (mut rows, mut piece) = (0, Vec::new());
            let mut lines = snapshot.rows(table, &columns);
            while let Some(line) = lines.try_next().await? {
                rows += 1;
                piece.extend_from_slice(line.as_bytes());
                piece.push(b'\n');
                if piece.len() >= PIECE {
                    let full = std::mem::take(&mut piece);
                    writer = blocking(move || writer.write_all(&full).map(|()| writer).map_err(StoreError::Io)).await?;
                }
            }
            drop(lines);
            let staged = blocking(move || {
                writer.write_all(&piece)?;
                writer.finish()?.0.finish()
            });
            let staged = staged.await?;
            let (digest, bytes) = (staged.digest(), staged.bytes());
            tables.push((Table { name: table.0.to_owned(), columns, rows, digest, bytes }, staged));
        }
        snapshot.end().await?;
        Ok(Self(tables))
    }

    /// Returns true if both copies of a catalog have equal tables: names, columns, numbers of rows, and digests of the
    /// rows.
    pub(super) fn equals(&self, other: &Self) -> bool {
        self.0.iter().map(|(table, _)| table).eq(other.0.iter().map(|(table, _)| table))
    }

    /// Returns the number of rows of all tables of the copied catalog.
    pub(super) fn rows(&self) -> u64 {
        self.0.iter().map(|(table, _)| table.rows).sum()
    }

    /// Returns true if the copied catalog has a table with this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(table, _)| table.name == name)
    }

    /// Begins to read the rows of the table called `name` in the copied catalog.
    pub(super) fn read(&self, name: &str) -> Result<Rows, ArchiveError> {
        let found = self.0.iter().find(|(table, _)| table.name == name);
        let (table, staged) =
            found.ok_or_else(|| ArchiveError::Copy(format!("the copy of the catalog has no table {name}")))?;
        let file = staged.open()?;
        Ok(Rows { lines: Some(BufReader::new(MultiGzDecoder::new(file))), table: table.clone(), read: 0 })
    }
}

impl Rows {
    /// Returns the position, from 0, of the column called `name` among the values of a row.
    pub(super) fn column(&self, name: &str) -> Result<usize, ArchiveError> {
        let found = self.table.columns.iter().position(|column| column == name);
        found.ok_or_else(|| ArchiveError::Copy(format!("the copied table {} has no column {name}", self.table.name)))
    }

    /// Returns the names of the columns of the table, in the order of the values of a row.
    pub(super) fn columns(&self) -> &[String] {
        &self.table.columns
    }

    /// Returns the next batch of rows of the table, each an array of values; empty at the end.
    pub(super) async fn next(&mut self) -> Result<Vec<Value>, ArchiveError> {
        let Some(mut lines) = self.lines.take() else { return Ok(Vec::new()) };
        let columns = self.table.columns.len();
        let reading = move || {
            let (mut rows, mut bytes, mut line) = (Vec::new(), 0, Vec::new());
            while rows.len() < BATCH.0 && bytes < BATCH.1 {
                line.clear();
                if lines.by_ref().take(LONGEST).read_until(b'\n', &mut line)? == 0 {
                    break;
                }
                bytes += line.len() as u64;
                let row: Vec<Value> = serde_json::from_slice(&line).map_err(io::Error::other)?;
                if row.len() != columns {
                    return Err(StoreError::Io(io::Error::other(format!(
                        "found {} values in a row of the table, expected {columns}",
                        row.len()
                    ))));
                }
                rows.push(Value::Array(row));
            }
            Ok((rows, lines))
        };
        let name = self.table.name.clone();
        let wrong = |reason: String| ArchiveError::Copy(format!("the copied table {name} cannot be read: {reason}"));
        let (rows, lines) = blocking(reading).await.map_err(|error| wrong(error.to_string()))?;
        self.read += rows.len() as u64;
        if rows.is_empty() && self.read != self.table.rows {
            return Err(wrong(format!("found {} rows, expected {}", self.read, self.table.rows)));
        }
        self.lines = Some(lines);
        Ok(rows)
    }
}
