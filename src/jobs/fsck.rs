//! Check of an archive: every digest computed from its bytes, and rows and objects compared with each other.

use super::archive::{Archive, ArchiveError};
use super::blobs::APART;
use crate::catalog::Blob;
use crate::store::{Digest, Object, PARTS, StoreError, StoreExt};
use futures::TryStreamExt;
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::sleep;

/// Report of a check of the stored files; the output of `wavelume fsck`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FsckReport {
    /// Number of stored files whose digest was recomputed.
    pub checked_blobs: u64,
    /// Total size in bytes of the stored files whose recomputed digest was right.
    pub checked_bytes: u64,
    /// Faults that the check of the stored files found; empty if there are none.
    pub faults: Vec<Fault>,
}

/// One fault found by a check of the stored files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Fault {
    /// The stored bytes do not match their digest.
    Corrupt {
        /// Digest under which the damaged bytes are stored.
        digest: String,
        /// Tenant that owns the stored bytes; absent if it is the default tenant.
        #[serde(skip_serializing_if = "Option::is_none")]
        tenant: Option<String>,
    },
    /// A row of the catalog refers to bytes that are missing from the store.
    Missing {
        /// Digest of the missing bytes.
        digest: String,
        /// Row of the catalog that refers to the missing bytes: `measurement b3-…`, `material b3-…` or `job …`.
        named_by: String,
        /// Tenant that owns the stored bytes; absent if it is the default tenant.
        #[serde(skip_serializing_if = "Option::is_none")]
        tenant: Option<String>,
    },
    /// The store holds an object that the catalog does not list.
    OrphanObject {
        /// Path, below the root of the store, of the object that the catalog does not list.
        object: String,
        /// Size of the object in bytes.
        bytes: u64,
    },
    /// The catalog lists stored bytes to which no other row refers, and which no sweep would find.
    OrphanRow {
        /// Digest of the stored bytes to which no row refers.
        digest: String,
        /// Tenant that owns the stored bytes; absent if it is the default tenant.
        #[serde(skip_serializing_if = "Option::is_none")]
        tenant: Option<String>,
    },
}

/// Extent of a check of the stored files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Check {
    /// Fraction of the stored files whose digest is recomputed, from 0 to 1; every stored file is checked for
    /// existence.
    pub sample: f64,
    /// True to hand unused objects and rows over to the next sweep, which removes them. Damaged and missing files are
    /// marked in any case, so that the next upload of the same bytes replaces them.
    pub repair: bool,
}

impl Default for Check {
    fn default() -> Self {
        Self { sample: 1.0, repair: false }
    }
}

/// Number of rows about stored files that a check reads at once. Raising it needs more memory.
const PAGE: u32 = 10_000;

/// Time for which an object that the catalog does not list is kept before a repair deletes it. Raising it gives more
/// time to find out where the object came from.
const GRACE: Duration = Duration::from_hours(24);

impl Archive {
    /// Recomputes the digest of every stored file, and compares the catalog's rows about stored files with the objects
    /// in the store.
    pub async fn check(&self) -> Result<FsckReport, ArchiveError> {
        self.check_within(Check::default()).await
    }

    /// Compares the stored files of all tenants with the catalog, and recomputes digests to the extent given by
    /// `check`.
    pub async fn check_within(&self, check: Check) -> Result<FsckReport, ArchiveError> {
        if check.repair {
            self.catalog.must_write()?;
        }
        let mut report = FsckReport::default();
        // Counts up to the next blob of the sample.
        let mut due = 1.0;
        for tenant in self.catalog.tenant_ids().await? {
            self.of(&tenant).check_tenant(check, &mut due, &mut report).await?;
        }
        // A restored database may lack tenants that the store has.
        let known = self.catalog.tenant_ids().await?;
        for tenant in self.store.tenants().await?.into_iter().filter(|tenant| !known.contains(tenant)) {
            let Some(folder) = Object::folder_of(&tenant) else { continue };
            let mut listed = self.store.list(&folder);
            while let Some((object, bytes)) = listed.try_next().await? {
                if *object.tenant() == tenant {
                    self.check_stray(&object, bytes, check.repair, &mut report).await?;
                }
            }
        }
        let mut parts = self.store.list(PARTS);
        while let Some((part, bytes)) = parts.try_next().await? {
            self.check_stray(&part, bytes, check.repair, &mut report).await?;
        }
        drop(parts);
        Ok(report)
    }

    /// Compares the stored files of one tenant with the catalog. Each file adds the fraction of files to check,
    /// `check.sample`, to `due`; once `due` is at least 1, the digest of the next file is recomputed.
    async fn check_tenant(&self, check: Check, due: &mut f64, report: &mut FsckReport) -> Result<(), ArchiveError> {
        let tenant = self.catalog.tenant();
        // A 256th at a time, so that neither all rows nor all names must fit into memory. Many small tenants would need
        // many listings of nothing.
        let whole = Object::folder_of(tenant);
        let is_small = whole.is_some() && self.catalog.blobs_beginning(None, None, PAGE).await?.len() < PAGE as usize;
        let parts = if is_small { vec![None] } else { (0..=u8::MAX).map(Some).collect() };
        for first in parts {
            let mut objects = HashMap::new();
            let folders = match first {
                Some(first) => Object::folders(tenant, first),
                None => whole.clone().into_iter().collect(),
            };
            for folder in folders {
                let mut listed = self.store.list(&folder);
                while let Some((object, bytes)) = listed.try_next().await? {
                    if object.tenant() == tenant {
                        objects.insert(object, bytes);
                    }
                }
            }
            let mut after = None;
            loop {
                let rows = self.catalog.blobs_beginning(first, after, PAGE).await?;
                let mut doubted = Vec::new();
                for blob in &rows {
                    let there = objects.remove(&blob.object).is_some();
                    *due += check.sample.clamp(0.0, 1.0);
                    let compute = there && *due >= 1.0;
                    if compute {
                        *due -= 1.0;
                    }
                    if (compute || !there) && self.is_doubted(blob, report).await? {
                        doubted.push(blob);
                    }
                }
                if !doubted.is_empty() {
                    sleep(APART).await;
                }
                for blob in doubted {
                    self.check_doubted(blob, report).await?;
                }
                if let Some(last) = rows.last() {
                    for digest in self.catalog.orphans(first, after, last.object.digest()).await? {
                        self.check_named(digest, check.repair, report).await?;
                    }
                }
                match rows.last() {
                    Some(last) if rows.len() == PAGE as usize => after = Some(last.object.digest()),
                    _ => break,
                }
            }
            for (object, bytes) in objects {
                self.check_stray(&object, bytes, check.repair, report).await?;
            }
        }
        Ok(())
    }

    /// Returns the tenant that owns the checked bytes, as a report names it; `None` for the default tenant.
    pub(super) fn told_tenant(&self) -> Option<String> {
        Some(self.catalog.tenant()).filter(|tenant| !tenant.is_default()).map(ToString::to_string)
    }

    /// Checks an object in the store that no row of the catalog lists.
    async fn check_stray(
        &self,
        object: &Object,
        bytes: u64,
        repair: bool,
        report: &mut FsckReport,
    ) -> Result<(), ArchiveError> {
        // Known as being written or deleted, or as a part of an upload; or stored since the rows were read.
        if self.catalog.knows(object).await? || self.store.size(object).await?.is_none() {
            return Ok(());
        }
        if repair {
            self.belongs().await?;
            self.catalog.doom_stray(object, bytes, GRACE).await?;
        }
        report.faults.push(Fault::OrphanObject { object: object.to_string(), bytes });
        Ok(())
    }

    /// Recomputes the digest of a stored file. Returns true if a fault was found, which a second look must confirm.
    async fn is_doubted(&self, blob: &Blob, report: &mut FsckReport) -> Result<bool, ArchiveError> {
        match Arc::clone(&self.store).verify(&blob.object).await {
            Ok(bytes) => self.sound(blob, bytes, report).await.map(|()| false),
            Err(error) if error.damage().is_some() => Ok(true),
            Err(error) => Err(error.into()),
        }
    }

    /// Records a stored file whose digest was recomputed and is right.
    async fn sound(&self, blob: &Blob, bytes: u64, report: &mut FsckReport) -> Result<(), ArchiveError> {
        report.checked_blobs += 1;
        report.checked_bytes += bytes;
        if self.catalog.is_read_only() {
            return Ok(());
        }
        Ok(self.catalog.checked(&blob.object, bytes).await?)
    }

    /// Recomputes the digest of a stored file in which a fault was found before, and reports a fault that is still
    /// there.
    async fn check_doubted(&self, blob: &Blob, report: &mut FsckReport) -> Result<(), ArchiveError> {
        let digest = blob.object.digest();
        let fault = match self.confirm(blob, Arc::clone(&self.store).verify(&blob.object)).await {
            Ok(bytes) => return self.sound(blob, bytes, report).await,
            Err(ArchiveError::Store(fault)) => fault,
            Err(away) => return Err(away),
        };
        match fault {
            StoreError::Corrupt { .. } | StoreError::Range { .. } => {
                report.checked_blobs += 1;
                report.faults.push(Fault::Corrupt { digest: digest.to_string(), tenant: self.told_tenant() });
            }
            StoreError::NotFound(_) => {
                // Told only if the row still refers to this object: it may have been swept or replaced meanwhile.
                if self.catalog.blob(digest).await?.is_some_and(|now| now.object == blob.object) {
                    let named_by = self.catalog.named_by(digest).await?.unwrap_or_else(|| "no row".to_owned());
                    report.faults.push(Fault::Missing {
                        digest: digest.to_string(),
                        named_by,
                        tenant: self.told_tenant(),
                    });
                }
            }
            other => return Err(other.into()),
        }
        Ok(())
    }

    async fn check_named(&self, digest: Digest, repair: bool, report: &mut FsckReport) -> Result<(), ArchiveError> {
        if self.catalog.namer(digest).await?.is_some() || self.catalog.is_unnamed(digest).await? {
            return Ok(());
        }
        // It may have lost its name, and then its row, between the two looks.
        if self.catalog.blob(digest).await?.is_none() || self.catalog.is_unnamed(digest).await? {
            return Ok(());
        }
        if repair {
            self.catalog.list_unnamed(digest).await?;
        }
        report.faults.push(Fault::OrphanRow { digest: digest.to_string(), tenant: self.told_tenant() });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::publish::tests::stored;
    use crate::jobs::site::tests::sites;

    #[tokio::test]
    async fn a_check_finds_each_fault_and_repairs_what_it_can() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let [lie, gone, stray, lost] = [b"lie".as_slice(), b"gone", b"stray", b"lost"];
            let (damaged, missing) = (stored(&archive, lie).await, stored(&archive, gone).await);
            let object = async |digest| archive.catalog.blob(digest).await.unwrap().unwrap().object;
            let other = archive.staging.stage(b"LIE").unwrap();
            archive.store.publish(&other, &object(damaged).await).await.unwrap();
            archive.store.remove(&[object(missing).await]).await;
            let unknown = Object::fresh(archive.catalog.tenant(), Digest::of(stray));
            archive.store.publish(&archive.staging.stage(stray).unwrap(), &unknown).await.unwrap();
            let part = Object::part("0a", 0, Digest::of(stray));
            archive.store.publish(&archive.staging.stage(stray).unwrap(), &part).await.unwrap();
            // As a row that was deleted by hand leaves it.
            let orphan = stored(&archive, lost).await;
            archive.catalog.delete_measurement(orphan).await.unwrap();
            archive.catalog.forget_unnamed().await;

            let mut expected = vec![
                Fault::Corrupt { digest: damaged.to_string(), tenant: None },
                Fault::Missing {
                    digest: missing.to_string(),
                    named_by: format!("measurement {missing}"),
                    tenant: None,
                },
                Fault::OrphanObject { object: unknown.to_string(), bytes: 5 },
                Fault::OrphanObject { object: part.to_string(), bytes: 5 },
                Fault::OrphanRow { digest: orphan.to_string(), tenant: None },
            ];
            let mut check = archive.check_within(Check { repair: true, ..Check::default() }).await.unwrap();
            let key = |fault: &Fault| format!("{fault:?}");
            expected.sort_by_key(key);
            check.faults.sort_by_key(key);
            assert_eq!((check.checked_blobs, check.faults), (2, expected));

            // Uploads heal the damage, and a sweep takes the orphans.
            stored(&archive, lie).await;
            stored(&archive, gone).await;
            archive.sweep_now().await.unwrap();
            assert_eq!(archive.check().await.unwrap().faults, []);
            assert_eq!(archive.store.size(&unknown).await.unwrap(), None);
        }
    }

    #[tokio::test]
    async fn a_sample_computes_a_part_of_the_digests() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        for number in 0..20 {
            stored(&archive, format!("{number}").as_bytes()).await;
        }
        for (sample, expected) in [(0.0, 1), (0.25, 5), (1.0, 20)] {
            let report = archive.check_within(Check { sample, repair: false }).await.unwrap();
            assert!(report.checked_blobs.abs_diff(expected) <= 1, "{sample}: {report:?}");
        }
    }
}
