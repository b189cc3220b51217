//! `wavelume compute-job`: the process of one job, started by a worker. Not for users.

use super::failure::Failure;
use crate::jobs::compute_job;

pub(crate) fn run() -> Result<(), Failure> {
    compute_job()
        .map_err(|error| Failure::failed(format!("expected a job from the worker that starts this command: {error}")))
}
