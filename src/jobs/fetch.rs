//! Stored bytes copied from one store towards another: read, verified and staged, several at once.

use super::archive::{ArchiveError, BACKUP, INSTANCE};
use super::blobs::APART;
use super::dump::{Rows, blocking};
use crate::catalog::Catalog;
use crate::store::{Digest, Object, Staged, Staging, Store, StoreError, StoreExt, WHOLE};
use crate::trust::Tenant;
use futures::future::Either;
use futures::{StreamExt, TryStreamExt, stream};
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;
use tokio::time::sleep;

/// Number of files that are copied at once. Raising it needs more memory, up to 8 MiB each.
const AT_ONCE: usize = 8;

/// Kind of the fault of a file that the store has and cannot read.
pub(super) const UNREADABLE: &str = "unreadable";

/// Row about stored bytes in a copied catalog.
#[derive(Clone, Debug)]
pub(super) struct Stored {
    /// Object that held the bytes in the store of the copied catalog.
    pub object: Object,
    /// Size in bytes; `None` if the original did not know it.
    pub bytes: Option<u64>,
    /// Time at which the original's row about the bytes was made, in ms of the Unix epoch.
    pub created_at: i64,
}

/// Fault of one stored file that could not be copied.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Lost {
    /// Tenant that owns the stored bytes; left out of a report if it is the default tenant.
    #[serde(skip_serializing_if = "Tenant::is_default")]
    pub tenant: Tenant,
    /// Digest under which the bytes were stored.
    pub digest: Digest,
    /// Kind of the fault: `corrupt`, `missing` or `unreadable`.
    pub kind: &'static str,
}

/// Outcome for the files of a copy: counts of copied files and of those that an earlier copy has left, and the files
/// that could not be copied.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Tally {
    /// Number of files that were copied.
    pub copied_blobs: u64,
    /// Total size in bytes of the copied files.
    pub copied_bytes: u64,
    /// Number of files that an earlier copy has left.
    pub there_blobs: u64,
    /// Total size in bytes of the files that an earlier copy has left.
    pub there_bytes: u64,
    /// Files that are missing or damaged.
    pub lost: Vec<Lost>,
}

impl Tally {
    /// Adds a file of `bytes` bytes to the count of copied files.
    pub(super) fn copied(&mut self, bytes: u64) {
        self.copied_blobs += 1;
        self.copied_bytes += bytes;
    }

    /// Adds a file of `bytes` bytes to the count of those that were not copied, because an earlier copy has left them.
    pub(super) fn there(&mut self, bytes: u64) {
        self.there_blobs += 1;
        self.there_bytes += bytes;
    }
}

/// Returns the next rows about stored bytes of a copied catalog: tenant by tenant, in the order of their digests.
pub(super) async fn stored(rows: &mut Rows) -> Result<Vec<Stored>, ArchiveError> {
    let mut at = [0; 5];
    for (at, name) in at.iter_mut().zip(["tenant", "digest", "generation", "bytes", "created_at"]) {
        *at = rows.column(name)?;
    }
    let parse = |row: &serde_json::Value| {
        let text = |at: usize| row[at].as_str();
        let (tenant, digest) = (text(at[0])?.parse().ok()?, text(at[1])?.parse().ok()?);
        let object = Object::of(&tenant, digest, text(at[2])?.to_owned());
        // A generation that makes another path is nobody's.
        let parsed = object.to_string().parse::<Object>().ok()?;
        let created_at = row[at[4]].as_i64()?;
        (parsed == object).then_some(Stored { object, bytes: row[at[3]].as_u64(), created_at })
    };
    let invalid = |row: &serde_json::Value| ArchiveError::Copy(format!("the copied row {row} of blobs is invalid"));
    let batch = rows.next().await?;
    batch.iter().map(|row| parse(row).ok_or_else(|| invalid(row))).collect()
}

/// Reads an object of a store into a temporary file, and checks its digest.
pub(super) async fn fetch(store: &Arc<dyn Store>, object: &Object, staging: &Staging) -> Result<Staged, StoreError> {
    let size = store.size(object).await?.ok_or(StoreError::NotFound(object.digest()))?;
    let staging = staging.clone();
    if size <= WHOLE {
        let bytes = store.get(object, Some(size)).await?;
        return blocking(move || staging.stage(&bytes)).await;
    }
    let mut writer = blocking(move || staging.begin()).await?;
    let mut pieces = Arc::clone(store).stream(object.clone(), 0..size, size);
    while let Some(piece) = pieces.try_next().await? {
        writer = blocking(move || writer.write(&piece).map(|()| writer)).await?;
    }
    blocking(move || writer.finish()).await
}

/// Fetches objects, several at once, and hands each with what belongs to it to `then`, whose results it returns in no
/// particular order. Objects in which a first look finds a fault are looked at again together, [`APART`] later, so that
/// many of them wait no longer than one. Fails if the store itself is away.
pub(super) async fn fetch_each<T, O, F>(
    (store, catalog): (&Arc<dyn Store>, Option<&Catalog>),
    files: Vec<(Object, T)>,
    staging: &Staging,
    then: impl Fn(T, Result<Staged, Lost>) -> F,
) -> Result<Vec<O>, ArchiveError>
where
    F: Future<Output = Result<O, ArchiveError>>,
{
    let then = &then;
    let again = &async |object: Object, file| then(file, fetch_again(store, catalog, &object, staging).await?).await;
    let looks = stream::iter(files).map(|(object, file)| async move {
        match fetch(store, &object, staging).await {
            Ok(staged) => then(file, Ok(staged)).await.map(Either::Left),
            Err(fault) if fault.damage().is_some() => Ok(Either::Right((object, file))),
            Err(_) => again(object, file).await.map(Either::Left),
        }
    });
    let (mut done, mut doubted) = (Vec::new(), Vec::new());
    let mut looks = pin!(looks.buffer_unordered(AT_ONCE));
    while let Some(look) = looks.try_next().await? {
        match look {
            Either::Left(result) => done.push(result),
            Either::Right(file) => doubted.push(file),
        }
    }
    if !doubted.is_empty() {
        sleep(APART).await;
    }
    let looks = stream::iter(doubted).map(|(object, file)| again(object, file));
    done.extend(looks.buffer_unordered(AT_ONCE).try_collect::<Vec<_>>().await?);
    Ok(done)
}

/// Takes a second look at an object in which a first one has found a fault, and returns the fault if it finds one, too.
/// Reads the object that now holds the same bytes according to the catalog of the original, if this catalog is at hand.
async fn fetch_again(
    store: &Arc<dyn Store>,
    catalog: Option<&Catalog>,
    object: &Object,
    staging: &Staging,
) -> Result<Result<Staged, Lost>, ArchiveError> {
    let digest = object.digest();
    let now = match catalog {
        Some(catalog) => catalog.of(object.tenant()).blob(digest).await?.map(|blob| blob.object),
        None => None,
    };
    let kind = match fetch(store, now.as_ref().unwrap_or(object), staging).await {
        Ok(staged) => return Ok(Ok(staged)),
        // The disk cannot read this one file, while the store answers.
        Err(StoreError::Objects(_)) if is_there(store).await? => UNREADABLE,
        Err(fault) => match fault.damage() {
            Some(kind) => kind,
            None => return Err(fault.into()),
        },
    };
    // A directory whose disk was unmounted lacks all files, and one that is being filled again has parts of them.
    if !is_there(store).await? {
        return Err(ArchiveError::Copy(format!(
            "the store to copy from lacks the bytes {digest}, and carries neither {INSTANCE} nor {BACKUP} any more: check \
             that its disk is mounted, and start again"
        )));
    }
    let tenant = object.tenant().clone();
    tracing::warn!(%tenant, %digest, kind, "stored bytes cannot be copied");
    Ok(Err(Lost { tenant, digest, kind }))
}

/// Returns true if a store carries the text that makes it the store of a catalog or the place of a backup.
async fn is_there(store: &Arc<dyn Store>) -> Result<bool, StoreError> {
    Ok(store.note(INSTANCE).await?.is_some() || store.note(BACKUP).await?.is_some())
}

#[cfg(test)]
mod tests {
    use super::super::archive::Archive;
    use super::super::publish::tests::stored;
    use super::*;
    use std::sync::Mutex;

    #[tokio::test]
    async fn the_faults_of_many_files_wait_together_and_keep_no_sound_file_back() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let sound = stored(&archive, b"the truth").await;
        let sound = archive.catalog.blob(sound).await.unwrap().unwrap().object;
        let absent = |at: usize| Object::fresh(&Tenant::default(), Digest::of(&at.to_le_bytes()));
        let count = 3 * AT_ONCE;
        let files = (0..count).map(|at| (if at < count / 2 { absent(at) } else { sound.clone() }, at)).collect();
        let seen = Mutex::new(Vec::new());
        let fetched = fetch_each((&archive.store, None), files, &archive.staging, async |at, fetched| {
            seen.lock().unwrap().push((fetched.is_ok(), at));
            Ok(fetched.map(|_| at).map_err(|lost| lost.kind))
        });
        let fetched = fetched.await.unwrap();
        assert_eq!(fetched.iter().filter(|file| **file == Err("missing")).count(), count / 2);
        let seen = seen.into_inner().unwrap();
        assert_eq!(
            seen.iter().map(|(is_sound, _)| *is_sound).collect::<Vec<_>>(),
            [vec![true; count / 2], vec![false; count / 2]].concat()
        );
    }
}
