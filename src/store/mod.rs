//! Bytes under their digest: publish, verify, sweep; knows nothing of measurements.
//!
//! The naive store writes a file under its name and reads it back. A crash leaves half a file under a whole name, a
//! failing disk gives other bytes back, and two writers race. So: bytes are hashed while they are staged beside the
//! store, made durable, and renamed to their digest in one step; nothing under a digest ever changes; and a reader of
//! a whole blob gets bytes whose digest was computed again.

mod digest;
mod error;
mod interface;
mod local;
mod staging;
mod verified;

pub use digest::{Digest, NotADigest};
pub use error::StoreError;
pub(crate) use interface::Store;
pub(crate) use local::LocalStore;
#[cfg(test)]
pub(crate) use staging::Retired;
pub(crate) use staging::{Staged, StagedWriter, Staging};
pub(crate) use verified::StoreExt;
pub use verified::WHOLE;

#[cfg(test)]
pub(crate) mod contract {
    //! The suite that every store passes.

    use super::*;
    use bytes::Bytes;
    use futures::TryStreamExt;
    use std::sync::Arc;

    pub(crate) async fn holds<S: Store + 'static>(store: Arc<S>, staging: &Staging) {
        let absent = Digest::of(b"never published");
        assert_eq!(store.size(absent).await.unwrap(), None);
        assert!(matches!(store.read(absent, 0..1).await, Err(StoreError::NotFound(_))));
        assert!(matches!(store.get(absent).await, Err(StoreError::NotFound(_))));
        assert_eq!(store.retire(absent).unwrap(), None);

        let large: Vec<u8> = (0..WHOLE as u32 + 70_000).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for bytes in [b"".as_slice(), b"x", &[7; 1000], &large] {
            let staged = staging.stage(bytes).unwrap();
            let (digest, size) = (staged.digest(), bytes.len() as u64);
            assert_eq!(store.size(digest).await.unwrap(), None, "not visible before it is published");
            store.publish(&staged).await.unwrap();
            store.publish(&staging.stage(bytes).unwrap()).await.unwrap();
            drop(staged);
            assert_eq!(store.size(digest).await.unwrap(), Some(size));
            assert_eq!(store.get(digest).await.unwrap(), bytes);
            assert_eq!(Arc::clone(&store).verify(digest).await.unwrap(), size);
            let streamed: Vec<Bytes> = Arc::clone(&store).stream(digest, 0..size, size).try_collect().await.unwrap();
            assert_eq!(streamed.concat(), bytes);
            if size > 0 {
                assert_eq!(store.read(digest, size - 1..size).await.unwrap(), &bytes[bytes.len() - 1..]);
            }
            assert!(matches!(store.read(digest, 0..size + 1).await, Err(StoreError::Range { .. })));
        }
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 4);
        let x = Digest::of(b"x");
        let retired = store.retire(x).unwrap().unwrap();
        assert_eq!(store.size(x).await.unwrap(), None);
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 3);
        store.publish(&staging.stage(b"x").unwrap()).await.unwrap();
        store.discard(retired).await.unwrap();
        assert_eq!(store.get(x).await.unwrap(), b"x".as_slice(), "published after it was retired");
        store.discard(store.retire(x).unwrap().unwrap()).await.unwrap();
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 3);
    }
}
