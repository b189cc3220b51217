//! Staged bytes sent to an object store: in one request, or in parts.

use super::error::StoreError;
use super::staging::Staged;
use bytes::Bytes;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Size in bytes up to which an object is sent in one request. Raising it needs more memory for each upload.
const WHOLE: u64 = 16 << 20;

/// Size in bytes of each part of an object that is sent in parts; the last part may be shorter. Some servers accept
/// only parts of equal length, and none accepts parts under 5 MiB.
const PART: u64 = 8 << 20;

/// Sends a staged (temporary) file to the object store, as the object with the path `to`.
pub(super) async fn upload(store: &dyn ObjectStore, to: &Path, staged: &Staged) -> Result<(), StoreError> {
    let size = staged.bytes();
    if size <= WHOLE {
        store.put(to, PutPayload::from(piece(staged, 0, size).await?)).await?;
        return Ok(());
    }
    let mut parts = store.put_multipart(to).await?;
    let mut at = 0;
    while at < size {
        let bytes = piece(staged, at, PART.min(size - at)).await?;
        at += bytes.len() as u64;
        if let Err(error) = parts.put_part(PutPayload::from(bytes)).await {
            // The parts are freed as far as possible; the store's own rule for unfinished uploads frees the rest.
            let _ = parts.abort().await;
            return Err(error.into());
        }
    }
    if let Err(error) = parts.complete().await {
        // The first answer may have been lost, and a repetition then finds no upload: the object itself decides.
        return match store.head(to).await {
            Ok(meta) if meta.size == size => Ok(()),
            _ => Err(error.into()),
        };
    }
    Ok(())
}

async fn piece(staged: &Staged, at: u64, length: u64) -> Result<Bytes, StoreError> {
    let path = staged.path().to_owned();
    let read = move || -> std::io::Result<Bytes> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(at))?;
        let mut bytes = Vec::with_capacity(length as usize);
        file.take(length).read_to_end(&mut bytes)?;
        if bytes.len() as u64 == length { Ok(bytes.into()) } else { Err(std::io::ErrorKind::UnexpectedEof.into()) }
    };
    Ok(tokio::task::spawn_blocking(read).await.map_err(std::io::Error::other)??)
}
