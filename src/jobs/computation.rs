//! Computation of a job, apart from catalog, store and network: in this process, or in one of its own.

use super::attempt::Failure;
use super::engine::Engine;
use super::hub::Control;
use super::process::{self, Written};
use crate::domain::Progress;
use crate::pipeline::Report;
use crate::store::StoreError;
use bytes::Bytes;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;

/// Computation of one kind of job. Its value, written as JSON, is what a process of its own gets.
pub(super) trait Computation: Serialize + DeserializeOwned + Send + Sync + 'static {
    /// Name of the computation, by which the process of a job chooses its code.
    const NAME: &'static str;

    /// Computes the result of a job from files. Uses processor and memory only.
    fn compute(self, files: Vec<Bytes>, progress: &dyn Progress) -> Result<Computed, Failure>;
}

/// Result of a computation, in memory.
pub(super) struct Computed {
    pub(super) bytes: Vec<u8>,
    /// Report of a compression; `None` for other computations.
    pub(super) report: Option<Box<Report>>,
}

/// Computes the result of a job from `files`, in a process of its own if the configuration says so.
pub(super) async fn compute<C: Computation>(
    engine: &Engine,
    computation: C,
    files: Vec<Bytes>,
    control: &Arc<Control>,
) -> Result<Written, Failure> {
    if let Some(isolation) = &engine.isolation {
        let named = (C::NAME, &computation);
        return process::compute(&engine.archive.staging, isolation, named, files, control).await;
    }
    let (staging, progress) = (engine.archive.staging.clone(), Arc::clone(control));
    let computed = engine.background.run(move || computation.compute(files, &*progress)).await??;
    let Computed { bytes, report } = computed;
    let staged = tokio::task::spawn_blocking(move || staging.stage(&bytes)).await;
    let staged = staged.map_err(|error| StoreError::Io(error.into()))??;
    Ok(Written { staged, report })
}
