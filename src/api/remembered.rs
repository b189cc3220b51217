//! Names of materials that the catalog has lately shown to exist, kept for a moment to spare each download a query.

use crate::store::Digest;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time for which an answer of the catalog is trusted. Raising it spares queries, but a material that another process
/// has deleted, or a new name, is noticed later.
const TRUSTED: Duration = Duration::from_secs(2);

/// Upper bound on the materials that are remembered at once.
const MATERIALS: u64 = 10_000;

/// Memory of the materials that exist, with their names. A deletion by this process is noticed at once, one by another
/// process within [`TRUSTED`].
#[derive(Clone, Debug)]
pub(crate) struct Remembered {
    names: moka::sync::Cache<Digest, Option<Arc<str>>>,
    /// Number of deletions by this process.
    deletions: Arc<AtomicU64>,
}

impl Remembered {
    pub(crate) fn new() -> Self {
        let names = moka::sync::Cache::builder().max_capacity(MATERIALS).time_to_live(TRUSTED).build();
        Self { names, deletions: Arc::default() }
    }

    /// Returns the name of a material that exists, from memory or as `ask` finds it. `None` if there is no such
    /// material, which is never remembered.
    pub(crate) async fn name<E>(
        &self,
        id: Digest,
        ask: impl Future<Output = Result<Option<Option<String>>, E>>,
    ) -> Result<Option<Option<Arc<str>>>, E> {
        if let Some(name) = self.names.get(&id) {
            return Ok(Some(name));
        }
        let deletions = self.deletions.load(Ordering::SeqCst);
        let Some(name) = ask.await? else { return Ok(None) };
        let name = name.map(Arc::from);
        self.names.insert(id, name.clone());
        // A deletion while the catalog was asked may have come before the insertion.
        if self.deletions.load(Ordering::SeqCst) != deletions {
            self.names.invalidate(&id);
        }
        Ok(Some(name))
    }

    /// Forgets a material that was deleted from the catalog.
    pub(crate) fn forget(&self, id: Digest) {
        self.deletions.fetch_add(1, Ordering::SeqCst);
        self.names.invalidate(&id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    type Answer = Result<Option<Option<String>>, Infallible>;

    #[tokio::test]
    async fn the_catalog_is_asked_once_until_a_deletion() {
        let (remembered, id) = (Remembered::new(), Digest::of(b"vase"));
        let there = async || -> Answer { Ok(Some(Some("Vase".to_owned()))) };
        let gone = async || -> Answer { Ok(None) };
        assert_eq!(remembered.name(id, gone()).await, Ok(None), "nothing is remembered of what is not there");
        for answer in [there().await, gone().await] {
            let name = remembered.name(id, async { answer }).await.unwrap();
            assert_eq!(name.flatten().as_deref(), Some("Vase"));
        }
        remembered.forget(id);
        assert_eq!(remembered.name(id, gone()).await, Ok(None));
    }

    #[tokio::test]
    async fn a_deletion_while_the_catalog_answers_is_not_forgotten() {
        let (remembered, id) = (Remembered::new(), Digest::of(b"vase"));
        let late = async {
            remembered.forget(id);
            Answer::Ok(Some(None))
        };
        assert_eq!(remembered.name(id, late).await, Ok(Some(None)), "it was there when the catalog was asked");
        assert_eq!(remembered.name(id, async { Answer::Ok(None) }).await, Ok(None));
    }
}
