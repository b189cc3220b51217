//! In-memory cache of small material files, by tenant and digest.

use super::problem::Problem;
use crate::jobs::Archive;
use crate::store::Digest;
use crate::trust::Tenant;
use bytes::Bytes;
use std::time::Duration;

/// Size in bytes of the largest material file that is cached in memory.
const SMALL: u64 = 1 << 20;

/// Minutes for which a file stays in the memory cache. Raising it saves reads of the store.
const KEPT: Duration = Duration::from_mins(1);

/// Memory cache of small material files, keyed by tenant and digest, so that nobody learns from the duration of an
/// answer that another tenant has the same bytes. Check the catalog before answering from it: the material may have
/// been deleted.
#[derive(Clone, Debug)]
pub(crate) struct Contents {
    files: moka::future::Cache<(Tenant, Digest), Bytes>,
}

impl Contents {
    pub(crate) fn new(bytes: u64) -> Self {
        let weigh = |_: &(Tenant, Digest), bytes: &Bytes| (bytes.len() + 512).try_into().unwrap_or(u32::MAX);
        let files = moka::future::Cache::builder().max_capacity(bytes).weigher(weigh).time_to_live(KEPT).build();
        Self { files }
    }

    /// Returns the verified bytes of a file that the catalog knows; `None` if it is too large to cache. Concurrent
    /// requests share one read.
    pub(crate) async fn get(&self, archive: &Archive, digest: Digest) -> Result<Option<Bytes>, Problem> {
        let key = (archive.catalog.tenant().clone(), digest);
        if let Some(bytes) = self.files.get(&key).await {
            return Ok(Some(bytes));
        }
        let (blob, size) = archive.blob(digest).await.map_err(|error| Problem::of_named(digest, error))?;
        if size > SMALL {
            return Ok(None);
        }
        let read = self
            .files
            .try_get_with(key, async { archive.read(&blob).await.map_err(|error| Problem::of_named(digest, error)) });
        read.await.map(Some).map_err(|problem| (*problem).clone())
    }

    /// Evicts the file of a deleted material from the memory cache.
    pub(crate) async fn forget(&self, tenant: &Tenant, digest: Digest) {
        self.files.invalidate(&(tenant.clone(), digest)).await;
    }
}
