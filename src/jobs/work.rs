//! Contract of a kind of job: its request, its arguments in the queue, and the attempt at it.

use super::attempt::{Failure, Made};
use super::engine::Engine;
use super::hub::Control;
use super::request::RequestError;
use crate::store::Digest;
use std::future::Future;
use std::sync::Arc;

/// Request for a job of one kind.
pub(super) trait Work {
    /// Arguments in the queue. Workers of other versions read them: their form never changes.
    type Arguments;

    /// Checks the request before any data is read.
    fn check(&self) -> Result<(), RequestError>;

    /// Returns the measurement that the job reads, if any.
    fn measurement(&self) -> Option<Digest> {
        None
    }

    /// Returns the arguments for the queue. The error describes the fault in the request.
    fn arguments(&self) -> Result<Self::Arguments, String>;

    /// Runs one attempt. A second run with the same arguments must make the same.
    fn run(
        engine: &Arc<Engine>,
        arguments: Self::Arguments,
        control: &Arc<Control>,
    ) -> impl Future<Output = Result<Made, Failure>> + Send;
}
