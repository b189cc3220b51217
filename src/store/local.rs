//! Objects in a local directory, published by a rename that is on stable storage when it returns.

use super::error::StoreError;
use super::object::FOLDER;
use super::objects::{Objects, Publication};
use object_store::local::LocalFileSystem;
use std::path::Path;
use std::sync::Arc;

/// Name of the folder for staged (temporary) files. It lies on the file system of the store, so that publishing a file
/// is a rename.
pub(super) const STAGING: &str = "staging";

/// Opens the store in the directory `root`, which must exist. Blocks the thread.
pub(super) fn open(root: &Path) -> Result<Objects, StoreError> {
    std::fs::create_dir_all(root.join(FOLDER))?;
    let files = LocalFileSystem::new_with_prefix(root)?.with_fsync(true);
    Ok(Objects::new(Arc::new(files), Publication::Rename(STAGING)))
}

/// Opens the store in the directory `root` for reading alone; `None` if there is no such directory.
pub(super) fn open_to_read(root: &Path) -> Result<Option<Objects>, StoreError> {
    if !root.is_dir() {
        return Ok(None);
    }
    let files = LocalFileSystem::new_with_prefix(root)?;
    Ok(Some(Objects::new(Arc::new(files), Publication::Rename(STAGING))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{Object, Place, Store, StoreExt, contract};
    use crate::trust::Tenant;
    use futures::StreamExt;

    #[tokio::test]
    async fn a_local_directory_holds_the_contract() {
        let root = tempfile::tempdir().unwrap();
        let (store, staging) = Place::Directory(root.path().to_owned()).open(root.path()).unwrap();
        contract::holds(store, &staging).await;
        assert_eq!(std::fs::read_dir(root.path().join(STAGING)).unwrap().count(), 0);
    }

    #[tokio::test]
    async fn other_bytes_under_a_digest_are_corrupt() {
        let root = tempfile::tempdir().unwrap();
        let (store, staging) = Place::Directory(root.path().to_owned()).open(root.path()).unwrap();
        let staged = staging.stage(b"the truth").unwrap();
        let object = Object::fresh(&Tenant::default(), staged.digest());
        store.publish(&staged, &object).await.unwrap();
        std::fs::write(root.path().join(object.to_string()), b"a lie   ").unwrap();
        assert!(matches!(store.get(&object, Some(8)).await, Err(StoreError::Corrupt { .. })));
        assert!(matches!(Arc::clone(&store).verify(&object).await, Err(StoreError::Corrupt { .. })));
    }

    #[tokio::test]
    async fn files_that_are_no_objects_are_not_listed() {
        let root = tempfile::tempdir().unwrap();
        let store = open(root.path()).unwrap();
        std::fs::write(root.path().join(FOLDER).join("notes.txt"), b"?").unwrap();
        assert_eq!(store.list(FOLDER).count().await, 0);
    }
}
