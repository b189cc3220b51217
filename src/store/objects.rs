//! Objects in a directory or in an S3 bucket, through one interface.

use super::error::StoreError;
use super::interface::Store;
use super::object::{FOLDER, Object};
use super::staging::Staged;
use crate::trust::Tenant;
use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::{BoxStream, StreamExt};
use object_store::path::Path;
use object_store::signer::{Method, SignedUrlOptions, Signer};
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Way in which a staged (temporary) file becomes an object of the store.
#[derive(Clone, Debug)]
pub(super) enum Publication {
    /// The staged file lies in this folder of the store and is renamed to the path of the object.
    Rename(&'static str),
    /// The store is sent the bytes of the staged file.
    Upload,
}

/// Store of objects, reached through the interface of the `object_store` crate.
#[derive(Clone, Debug)]
pub(crate) struct Objects {
    store: Arc<dyn ObjectStore>,
    publication: Publication,
    /// Maker of URLs from which clients read objects without credentials of their own; `None` for a directory.
    signer: Option<Arc<dyn Signer>>,
}

impl Objects {
    pub(super) fn new(store: Arc<dyn ObjectStore>, publication: Publication) -> Self {
        Self { store, publication, signer: None }
    }

    /// Adds the maker of URLs from which clients read objects.
    pub(super) fn with_signer(self, signer: Arc<dyn Signer>) -> Self {
        Self { signer: Some(signer), ..self }
    }
}

fn path(object: &Object) -> Path {
    Path::from(object.to_string())
}

fn is_absent(error: &object_store::Error) -> bool {
    matches!(error, object_store::Error::NotFound { .. })
}

impl Store for Objects {
    fn publish<'a>(&'a self, staged: &'a Staged, object: &'a Object) -> BoxFuture<'a, Result<(), StoreError>> {
        Box::pin(async move {
            match self.publication {
                Publication::Rename(folder) => {
                    staged.sync().await?;
                    let from = Path::from_iter([folder, staged.name()]);
                    Ok(self.store.rename(&from, &path(object)).await?)
                }
                Publication::Upload => super::upload::upload(&*self.store, &path(object), staged).await,
            }
        })
    }

    fn size<'a>(&'a self, object: &'a Object) -> BoxFuture<'a, Result<Option<u64>, StoreError>> {
        Box::pin(async move {
            match self.store.head(&path(object)).await {
                Ok(meta) => Ok(Some(meta.size)),
                Err(error) if is_absent(&error) => Ok(None),
                Err(error) => Err(error.into()),
            }
        })
    }

    fn read<'a>(&'a self, object: &'a Object, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>> {
        Box::pin(async move {
            let size = || async { self.size(object).await?.ok_or(StoreError::NotFound(object.digest())) };
            if range.start >= range.end {
                let size = size().await?;
                let fits = range.start == range.end && range.end <= size;
                return if fits { Ok(Bytes::new()) } else { Err(StoreError::Range { range, size }) };
            }
            match self.store.get_range(&path(object), range.clone()).await {
                Ok(bytes) if bytes.len() as u64 == range.end - range.start => Ok(bytes),
                Err(error) if is_absent(&error) => Err(StoreError::NotFound(object.digest())),
                // A range beyond the end is cut short by some stores and refused by others.
                read => match (size().await?, read) {
                    (size, _) if range.end > size => Err(StoreError::Range { range, size }),
                    (size, Ok(_)) => Err(StoreError::Range { range, size }),
                    (_, Err(error)) => Err(error.into()),
                },
            }
        })
    }

    fn presigned<'a>(
        &'a self,
        object: &'a Object,
        life: Duration,
        media_type: &'a str,
        disposition: &'a str,
    ) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
        Box::pin(async move {
            let Some(signer) = &self.signer else { return Ok(None) };
            let labels = [("response-content-type", media_type), ("response-content-disposition", disposition)];
            let options = SignedUrlOptions::new().with_query(labels);
            let url = signer.signed_url_opts(Method::GET, &path(object), life, &options).await?;
            Ok(Some(url.into()))
        })
    }

    fn list<'a>(&'a self, folder: &'a str) -> BoxStream<'a, Result<(Object, u64), StoreError>> {
        self.store
            .list(Some(&Path::from(folder)))
            .filter_map(|found| async move {
                match found {
                    // A file that is not named like an object is skipped.
                    Ok(meta) => meta.location.as_ref().parse().ok().map(|object| Ok((object, meta.size))),
                    Err(error) if is_absent(&error) => None,
                    Err(error) => Some(Err(error.into())),
                }
            })
            .boxed()
    }

    fn tenants(&self) -> BoxFuture<'_, Result<Vec<Tenant>, StoreError>> {
        Box::pin(async move {
            let found = match self.store.list_with_delimiter(Some(&Path::from(FOLDER))).await {
                Err(error) if is_absent(&error) => return Ok(Vec::new()),
                found => found?,
            };
            let names = found.common_prefixes.iter().filter_map(|folder| folder.filename()?.parse().ok());
            Ok(names.collect())
        })
    }

    fn remove<'a>(&'a self, objects: &'a [Object]) -> BoxFuture<'a, Vec<Result<(), StoreError>>> {
        Box::pin(async move {
            let paths: Vec<_> = objects.iter().map(|object| Ok(path(object))).collect();
            let paths = futures::stream::iter(paths).boxed();
            let removed = self.store.delete_stream(paths).map(|removed| match removed {
                Err(error) if !is_absent(&error) => Err(error.into()),
                _ => Ok(()),
            });
            removed.collect().await
        })
    }

    fn note<'a>(&'a self, name: &'a str) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
        Box::pin(async move {
            match self.store.get(&Path::from(name)).await {
                Ok(found) => Ok(Some(String::from_utf8_lossy(&found.bytes().await?).trim().to_owned())),
                Err(error) if is_absent(&error) => Ok(None),
                Err(error) => Err(error.into()),
            }
        })
    }

    fn set_note<'a>(&'a self, name: &'a str, text: String) -> BoxFuture<'a, Result<(), StoreError>> {
        Box::pin(async move {
            self.store.put(&Path::from(name), PutPayload::from(text.into_bytes())).await?;
            Ok(())
        })
    }
}
