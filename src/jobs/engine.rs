//! An opened archive with its threads: state shared by the workers and the HTTP handlers of one process.

use super::archive::{Archive, ArchiveError};
use super::blobs::BlobError;
use super::config::{Limits, WorkConfig};
use super::frame::Queued;
use super::hub::Hub;
use super::isolation::Isolation;
use super::maths::{Maths, MathsError};
use super::presence::{Presence, WORKERS};
use super::turns::Client;
use crate::catalog::{Cancelling, CatalogError, Claimed, Enqueued, JobRow, JobState, NewJob, OTHER_TENANTS, Retried};
use crate::compress::{Decoded, decode};
use crate::domain::Measurement;
use crate::evaluate::{EvaluateError, Material};
use crate::store::Digest;
use crate::trust::Tenant;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// State shared by the workers and the HTTP handlers of one process.
#[derive(Clone, Debug)]
pub(crate) struct Engine {
    pub(crate) archive: Archive,
    pub(crate) limits: Arc<Limits>,
    /// Threads for compression: as many tasks at once as there are workers.
    pub(crate) background: Maths,
    /// Way in which jobs are computed in processes of their own; `None` leaves them to `background`.
    pub(crate) isolation: Option<Isolation>,
    /// Threads that parse uploads and compare uploaded materials with measurements.
    pub(crate) background_light: Maths,
    /// Threads for opening and evaluating materials, separate so that a query never waits behind a compression.
    pub(crate) queries: Maths,
    /// Threads that export materials to other file formats; only a few exports run at the same time.
    pub(crate) exports: Maths,
    /// True if tenants take turns in the queue of jobs, false if client addresses do.
    pub(super) by_tenant: bool,
    pub(crate) hub: Hub,
    pub(crate) presence: Arc<Presence>,
    opened: moka::future::Cache<(Tenant, Digest), Arc<Material>>,
    /// Ids of queued jobs that only a newer version of the program can read.
    newer: Arc<Mutex<Vec<String>>>,
    /// Time at which other processes were last told of a job.
    told: Arc<Mutex<Option<Instant>>>,
}

/// Reason why a material was not opened.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// The store of uploaded and computed files failed.
    #[error(transparent)]
    Blob(#[from] BlobError),
    /// The work that opens the material panicked, or was refused because too much other work was waiting.
    #[error(transparent)]
    Maths(#[from] MathsError),
    /// The bytes are not a material: damaged before they were stored, or of another version.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
}

/// Longest wait of a query for its turn. Raising it answers more queries under load, later.
const PATIENCE: Duration = Duration::from_secs(10);

/// Upper bound on the notifications of new jobs per second. Raising it wakes workers sooner while many jobs are queued,
/// and loads the database, which sends one at a time.
const TOLD: u32 = 20;

impl Engine {
    /// Opens the data directory and starts the threads. No job runs yet.
    pub(crate) async fn open(config: &WorkConfig) -> Result<Arc<Self>, ArchiveError> {
        let limits = config.limits.clone();
        Archive::make_room(&config.site, limits.disk_reserve);
        let mut archive = Archive::serve(&config.site).await?.keeping(limits.disk_reserve);
        let presence = Presence::enter(&archive.data.join(WORKERS))
            .map_err(|source| ArchiveError::Directory { directory: archive.data.clone(), source })?;
        archive.staging = archive.staging.owned_by(presence.id());
        let workers = config.workers.max(1);
        let opened = moka::future::Cache::builder()
            .max_capacity(limits.opened_bytes / 1024)
            .weigher(|_, material: &Arc<Material>| (material.memory() / 1024 + 1).try_into().unwrap_or(u32::MAX))
            .build();
        let background = Maths::new("compress", config.threads, workers, workers, Duration::from_hours(1))?;
        Ok(Arc::new(Self {
            isolation: Isolation::of(config, background.threads()),
            background,
            background_light: Maths::new("read", config.threads, 0, limits.uploads, PATIENCE)?,
            queries: Maths::new("query", config.threads, 0, limits.queries_waiting, PATIENCE)?,
            // One more than one address can fill, so that another address need not wait.
            exports: Maths::new("export", config.threads, limits.exports_each + 1, limits.exports, PATIENCE)?,
            archive,
            by_tenant: config.by_tenant,
            limits: Arc::new(limits),
            hub: Hub::new(),
            presence: Arc::new(presence),
            opened,
            newer: Arc::default(),
            told: Arc::default(),
        }))
    }

    /// Returns an engine that reads and changes the data of `tenant` alone, and shares threads, limits and caches with
    /// this one.
    pub(crate) fn of(self: &Arc<Self>, tenant: &Tenant) -> Arc<Self> {
        if self.archive.catalog.tenant() == tenant {
            return Arc::clone(self);
        }
        Arc::new(Self { archive: self.archive.of(tenant), ..(**self).clone() })
    }

    /// Claims the next job, of any tenant, that this version may be able to read.
    pub(crate) async fn claim(&self) -> Result<Option<Claimed>, CatalogError> {
        let newer = self.newer.lock().unwrap_or_else(PoisonError::into_inner).clone();
        self.archive.catalog.claim(self.presence.id(), self.limits.lease, &newer).await
    }

    /// Excludes a job from later claims of this process: it is of a newer version, and a newer worker may take it at
    /// once.
    pub(crate) fn leave_to_newer(&self, job: &str) {
        let mut newer = self.newer.lock().unwrap_or_else(PoisonError::into_inner);
        // Listed jobs end elsewhere, so the list restarts when it is longer than the queue can be.
        if newer.len() as u64 >= self.limits.queued_jobs {
            newer.clear();
        }
        newer.push(job.to_owned());
    }

    /// Queues a job for the client whose request the current task serves. `idempotency` is the client's key and the
    /// digest of its request.
    pub(crate) async fn enqueue(
        &self,
        request: &impl Queued,
        idempotency: Option<(String, Digest)>,
    ) -> Result<Enqueued, CatalogError> {
        self.archive.takes_job().await?;
        let id = uuid::Uuid::now_v7().to_string();
        let refused = |reason: String| CatalogError::Row { table: "jobs", id: id.clone(), reason };
        let frame = request.frame().map_err(refused)?;
        let share = if self.by_tenant {
            self.archive.catalog.tenant().to_string()
        } else {
            Client::current().map(|client| client.address.to_string()).unwrap_or_default()
        };
        let (measurement, priority) = (request.measurement(), request.priority());
        let is_other = !self.archive.catalog.tenant().is_default();
        let level = request.level().max(if is_other { OTHER_TENANTS } else { 1 });
        let new = NewJob { id: id.clone(), frame, level, measurement, priority, share, idempotency };
        let enqueued = self.archive.catalog.enqueue(&new, self.limits.queued_jobs).await?;
        if matches!(enqueued, Enqueued::New(_)) {
            self.queued().await;
        }
        Ok(enqueued)
    }

    /// Returns a job with its current progress.
    pub(crate) async fn job(&self, id: &str) -> Result<Option<JobRow>, CatalogError> {
        let mut row = self.archive.catalog.job(id).await?;
        if let Some(row) = &mut row
            && row.state == JobState::Running
            && let Some(progress) = self.hub.progress(id)
        {
            row.progress = progress;
        }
        Ok(row)
    }

    /// Asks a job to stop. Returns the job afterwards, if it exists.
    pub(crate) async fn cancel(&self, id: &str) -> Result<Option<Cancelling>, CatalogError> {
        // Another tenant's job is not stopped.
        let Some(cancelling) = self.archive.catalog.cancel(id).await? else { return Ok(None) };
        self.hub.stop(id);
        if cancelling.job.state == JobState::Running && self.hub.progress(id).is_none() {
            // The worker of the job finds the request by itself, only later.
            if let Err(error) = self.archive.catalog.tell_stop(id).await {
                tracing::warn!(job = id, %error, "the job's worker was not told to stop");
            }
        }
        self.hub.changed(id);
        Ok(Some(cancelling))
    }

    /// Puts a job that has failed, died or was cancelled back to the queue.
    pub(crate) async fn retry(&self, id: &str) -> Result<Retried, CatalogError> {
        let retried = self.archive.catalog.retry(id, self.limits.queued_jobs).await?;
        if matches!(retried, Retried::Queued(_)) {
            self.hub.changed(id);
            self.queued().await;
        }
        Ok(retried)
    }

    /// Tells the workers of this process and of others that a job is queued. Other processes are told at most [`TOLD`]
    /// times a second, because their workers also look for jobs from time to time.
    async fn queued(&self) {
        self.hub.queued();
        let due = {
            let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
            let due = told.is_none_or(|told| told.elapsed() > Duration::from_secs(1) / TOLD);
            if due {
                *told = Some(Instant::now());
            }
            due
        };
        if due && let Err(error) = self.archive.catalog.tell_queued().await {
            tracing::warn!(%error, "other processes were not told that a job is queued");
        }
    }

    /// Returns the opened form of a material. Requests at the same time share one opening; a material larger than the
    /// whole cache is opened for each request. The caller must have checked the catalog: the cache does not know of
    /// deletions.
    pub(crate) async fn material(&self, id: Digest) -> Result<Arc<Material>, Arc<OpenError>> {
        let key = (self.archive.catalog.tenant().clone(), id);
        let opened = self.opened.entry_by_ref(&key).or_try_insert_with(async move {
            let bytes = self.archive.get(id).await?;
            let material = self.queries.run(move || Material::open(&bytes)).await??;
            metrics::counter!("wavelume_materials_opened_total").increment(1);
            Ok(Arc::new(material))
        });
        let opened = opened.await?;
        // Evict again: a deletion evicts what is open, but this material may have been deleted while it was being
        // opened.
        if opened.is_fresh() && !matches!(self.archive.catalog.material_name(id).await, Ok(Some(_))) {
            self.opened.invalidate(&key).await;
        }
        Ok(opened.into_value())
    }

    /// Returns the number of open materials and the bytes of memory they take.
    pub(crate) async fn open_materials(&self) -> (u64, u64) {
        self.opened.run_pending_tasks().await;
        (self.opened.entry_count(), self.opened.weighted_size() * 1024)
    }

    /// Decodes a material to all its samples, without caching them.
    pub(crate) async fn decoded(&self, id: Digest) -> Result<Measurement, OpenError> {
        let bytes = self.archive.get(id).await?;
        Ok(self.queries.run(move || decode(&bytes).and_then(Decoded::whole)).await?.map_err(EvaluateError::from)?)
    }

    /// Returns the content of the compressed file of a material.
    pub(crate) async fn bytes(&self, id: Digest) -> Result<bytes::Bytes, OpenError> {
        Ok(self.archive.get(id).await?)
    }

    /// Removes a deleted material from the cache of materials that are decoded for queries.
    pub(crate) async fn close_material(&self, id: Digest) {
        self.opened.invalidate(&(self.archive.catalog.tenant().clone(), id)).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::{Settings, compress};
    use crate::domain::{Axis, Measurement, Quantity, Sampling, Silent, Tensor, Unit, WavelengthGrid};

    #[tokio::test]
    async fn a_material_is_opened_once_however_many_ask_and_not_kept_when_nobody_knows_it() {
        let data = tempfile::tempdir().unwrap();
        let engine = Engine::open(&WorkConfig::new(data.path())).await.unwrap();
        let grid = WavelengthGrid::even(400.0, 10.0, 8).unwrap();
        let tensor = Tensor::new(vec![Axis::Wavelength(grid)], vec![0.5; 8]).unwrap();
        let measurement = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Average, tensor).unwrap();
        let bytes = compress(&measurement, &Settings::default(), &Silent).unwrap().bytes;
        let id = crate::jobs::publish::tests::stored(&engine.archive, &bytes).await;

        let opened = futures::future::join_all((0..16).map(|_| engine.material(id))).await;
        let first = opened[0].as_ref().unwrap();
        assert!(opened.iter().all(|material| Arc::ptr_eq(material.as_ref().unwrap(), first)));
        // As if it had been deleted while it was opened.
        assert!(engine.opened.get(&(Tenant::default(), id)).await.is_none());
        assert_eq!(engine.open_materials().await, (0, 0));
        assert!(engine.material(Digest::of(b"absent")).await.is_err());
    }
}
