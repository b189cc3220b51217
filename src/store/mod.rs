//! Bytes under their digest: staged, published, verified; knows nothing of measurements.
//!
//! The naive store writes a file under its name and reads it back. A crash leaves half a file under a whole name, a
//! failing disk gives other bytes back, and two writers race. So: bytes are hashed while they are staged, made durable,
//! and become an object in one step; an object never changes, and its name is never used again; and a reader of a whole
//! object gets bytes whose digest was computed again. Which object holds the bytes of a digest is for the catalog to
//! say.

mod digest;
mod disk;
mod error;
mod interface;
mod local;
mod object;
mod objects;
mod owner;
mod place;
mod probe;
mod s3;
mod staging;
mod tls;
mod upload;
mod verified;

pub use digest::{Digest, NotADigest};
pub use error::StoreError;
pub use place::Place;
pub use tls::provide_tls;
pub use verified::WHOLE;

pub(crate) use disk::Disk;
pub(crate) use interface::Store;
pub(crate) use object::{FOLDER, Object, PARTS};
pub(crate) use owner::{give, give_all};
pub(crate) use probe::{Probe, Step};
#[cfg(test)]
pub(crate) use s3::tests::at as s3_at;
pub(crate) use staging::{Staged, StagedWriter, Staging};
pub(crate) use verified::StoreExt;

#[cfg(test)]
pub(crate) mod contract {
    //! The suite that every store passes.

    use super::*;
    use crate::trust::Tenant;
    use bytes::Bytes;
    use futures::TryStreamExt;
    use std::sync::Arc;

    /// Returns a new prefix in the bucket of the S3 server that the tests use.
    pub(crate) fn bucket() -> Place {
        let bucket = std::env::var("WAVELUME_TEST_STORE").expect(
            "WAVELUME_TEST_STORE is not set: run the tests as `tests/servers cargo test …`, which starts an S3 server",
        );
        format!("{bucket}/{}", uuid::Uuid::now_v7().simple()).parse().unwrap()
    }

    pub(crate) async fn holds<S: Store + ?Sized + 'static>(store: Arc<S>, staging: &Staging) {
        let tenant = Tenant::default();
        let absent = Object::fresh(&tenant, Digest::of(b"never published"));
        assert_eq!(store.size(&absent).await.unwrap(), None);
        assert!(matches!(store.read(&absent, 0..1).await, Err(StoreError::NotFound(_))));
        assert!(matches!(store.get(&absent, None).await, Err(StoreError::NotFound(_))));
        assert!(matches!(store.get(&absent, Some(3)).await, Err(StoreError::NotFound(_))));
        assert!(store.remove(std::slice::from_ref(&absent)).await.iter().all(Result::is_ok));

        let large: Vec<u8> =
            (0..(17 << 20) + 70_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let mut objects = Vec::new();
        for bytes in [b"".as_slice(), b"x", &[7; 1000], &large] {
            let staged = staging.stage(bytes).unwrap();
            let (object, size) = (Object::fresh(&tenant, staged.digest()), bytes.len() as u64);
            assert_eq!(store.size(&object).await.unwrap(), None, "not visible before it is published");
            store.publish(&staged, &object).await.unwrap();
            store.publish(&staging.stage(bytes).unwrap(), &object).await.unwrap();
            drop(staged);
            assert_eq!(store.size(&object).await.unwrap(), Some(size));
            for known in [None, Some(size), Some(size + 1)] {
                assert_eq!(store.get(&object, known).await.unwrap(), bytes);
            }
            assert_eq!(Arc::clone(&store).verify(&object).await.unwrap(), size);
            let streamed: Vec<Bytes> =
                Arc::clone(&store).stream(object.clone(), 0..size, size).try_collect().await.unwrap();
            assert_eq!(streamed.concat(), bytes);
            if size > 0 {
                assert_eq!(store.read(&object, size - 1..size).await.unwrap(), &bytes[bytes.len() - 1..]);
            }
            assert_eq!(store.read(&object, size..size).await.unwrap(), Bytes::new());
            for outside in [0..size + 1, size + 1..size + 2] {
                assert!(matches!(store.read(&object, outside).await, Err(StoreError::Range { .. })));
            }
            objects.push(object);
        }
        let mut listed = Vec::new();
        for first in 0..=u8::MAX {
            for folder in Object::folders(&tenant, first) {
                listed.extend(store.list(&folder).try_collect::<Vec<_>>().await.unwrap());
            }
        }
        listed.sort();
        let mut expected: Vec<_> = objects.iter().cloned().zip([0, 1, 1000, large.len() as u64]).collect();
        expected.sort();
        assert_eq!(listed, expected);

        // Another generation of the same bytes is another object.
        let (first, second) = (&objects[1], Object::fresh(&tenant, objects[1].digest()));
        store.publish(&staging.stage(b"x").unwrap(), &second).await.unwrap();
        assert!(store.remove(std::slice::from_ref(first)).await.iter().all(Result::is_ok));
        assert_eq!(store.size(first).await.unwrap(), None);
        assert_eq!(store.get(&second, Some(1)).await.unwrap(), b"x".as_slice());
        objects.push(second);
        assert_eq!(store.remove(&objects).await.len(), objects.len());
        for object in &objects {
            assert_eq!(store.size(object).await.unwrap(), None);
        }

        assert_eq!(store.note("wavelume-test").await.unwrap(), None);
        store.set_note("wavelume-test", "one".to_owned()).await.unwrap();
        store.set_note("wavelume-test", "two".to_owned()).await.unwrap();
        assert_eq!(store.note("wavelume-test").await.unwrap().as_deref(), Some("two"));
    }
}
