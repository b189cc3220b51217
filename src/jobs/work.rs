//! Contract of a kind of job: its request, its arguments in the queue, and the attempt at it.

use super::attempt::{Failure, Made};
use super::computation::Computation;
use super::engine::Engine;
use super::hub::Control;
use super::request::RequestError;
use crate::catalog::Priority;
use crate::store::Digest;
use std::future::Future;
use std::sync::Arc;

/// Request for a job of one particular kind, such as compression: its checks, its arguments in the job queue, and the
/// attempt to run it.
pub(super) trait Work {
    /// Lowest version of the arguments that a worker must understand. A kind of job, or a form of its arguments, that
    /// older programs do not know has the next number, which is then the level of [`EDITION`](crate::catalog::EDITION).
    const LEVEL: i64 = 1;

    /// Arguments of a job as the job queue stores them. Workers of other versions of the program read them: their form
    /// never changes.
    type Arguments;

    /// Computation of the job: the part of an attempt that takes processor time and memory, and may run in a process of
    /// its own.
    type Computation: Computation;

    /// Checks the content of a job request, such as its texts and options, before the job is queued.
    fn check(&self) -> Result<(), RequestError>;

    /// Returns the measurement that the job reads, if any.
    fn measurement(&self) -> Option<Digest> {
        None
    }

    /// Returns the priority of the job.
    fn priority(&self) -> Priority;

    /// Returns the arguments of this job in the form that the job queue stores. The error describes the fault in the
    /// request.
    fn arguments(&self) -> Result<Self::Arguments, String>;

    /// Runs one attempt at a job. A second attempt with the same arguments must produce the same result.
    fn run(
        engine: &Arc<Engine>,
        arguments: Self::Arguments,
        control: &Arc<Control>,
    ) -> impl Future<Output = Result<Made, Failure>> + Send;
}
