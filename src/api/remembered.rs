//! Materials that callers were lately found to be allowed to read, kept for a moment to spare each download a query.

use crate::catalog::Visible;
use crate::store::Digest;
use crate::trust::Tenant;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time for which the right of a tenant to read a material is remembered. Raising it spares queries of the catalog, but
/// a material that another process has deleted, made private or renamed is noticed later.
const TRUSTED: Duration = Duration::from_secs(2);

/// Upper bound on the pairs of a tenant and a material that are remembered at once.
const PAIRS: u64 = 10_000;

/// Memory of the materials that tenants may read. A change by this process is noticed at once, one by another process
/// within [`TRUSTED`].
#[derive(Clone, Debug)]
pub(crate) struct Remembered {
    /// Rights to read a material as the catalog stated them, by reading tenant and material. Each has the value of
    /// `changes` when the catalog was asked.
    found: moka::sync::Cache<(Tenant, Digest), (u64, Arc<Visible>)>,
    /// Number of times that this process has deleted a material or changed who may read one.
    changes: Arc<AtomicU64>,
}

impl Remembered {
    pub(crate) fn new() -> Self {
        let found = moka::sync::Cache::builder().max_capacity(PAIRS).time_to_live(TRUSTED).build();
        Self { found, changes: Arc::default() }
    }

    /// Returns the right of the tenant `reader` to read a material, from memory or from the query `ask`. A refusal is
    /// never remembered.
    pub(crate) async fn visible<E>(
        &self,
        reader: &Tenant,
        id: Digest,
        ask: impl Future<Output = Result<Option<Visible>, E>>,
    ) -> Result<Option<Arc<Visible>>, E> {
        let key = (reader.clone(), id);
        // Read before the catalog is asked: an answer that a change has overtaken is never used again.
        let changes = self.changes.load(Ordering::SeqCst);
        if let Some((then, visible)) = self.found.get(&key)
            && then == changes
        {
            return Ok(Some(visible));
        }
        let Some(visible) = ask.await?.map(Arc::new) else { return Ok(None) };
        self.found.insert(key, (changes, Arc::clone(&visible)));
        Ok(Some(visible))
    }

    /// Forgets all remembered rights to read materials, after a material was deleted or its readers were changed.
    pub(crate) fn forget(&self) {
        self.changes.fetch_add(1, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Sight;
    use std::convert::Infallible;

    type Answer = Result<Option<Visible>, Infallible>;

    fn vase() -> Visible {
        Visible { owner: Tenant::default(), name: Some("Vase".to_owned()), is_public: false, sight: Sight::Own }
    }

    #[tokio::test]
    async fn the_catalog_is_asked_once_until_a_change() {
        let (remembered, id, reader) = (Remembered::new(), Digest::of(b"vase"), Tenant::default());
        let gone = async || -> Answer { Ok(None) };
        assert_eq!(remembered.visible(&reader, id, gone()).await, Ok(None), "no refusal is remembered");
        for answer in [Ok(Some(vase())), gone().await] {
            let found = remembered.visible(&reader, id, async { answer }).await.unwrap();
            assert_eq!(found.as_deref(), Some(&vase()));
        }
        let other: Tenant = "other".parse().unwrap();
        assert_eq!(remembered.visible(&other, id, gone()).await, Ok(None), "another tenant is asked for anew");
        remembered.forget();
        assert_eq!(remembered.visible(&reader, id, gone()).await, Ok(None));
    }

    #[tokio::test]
    async fn a_change_while_the_catalog_answers_is_not_forgotten() {
        let (remembered, id, reader) = (Remembered::new(), Digest::of(b"vase"), Tenant::default());
        let late = async {
            remembered.forget();
            Answer::Ok(Some(vase()))
        };
        assert!(remembered.visible(&reader, id, late).await.unwrap().is_some(), "it was there when it was asked for");
        assert_eq!(remembered.visible(&reader, id, async { Answer::Ok(None) }).await, Ok(None));
    }
}
