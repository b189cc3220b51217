//! Work that outlives a request: queue, leases, workers. Each kind of job has a file of its own.

mod archive;
mod attempt;
mod compress;
mod config;
mod describe;
mod document;
mod engine;
mod frame;
mod hub;
mod ingest;
mod maths;
mod options;
mod paper;
mod presence;
mod problem;
mod publish;
mod request;
mod text;
mod turns;
mod unit;
mod unpack;
mod worker;

pub use crate::catalog::CatalogError;
pub use archive::{Archive, ArchiveError, Fault, FsckReport, SweepReport};
pub use config::{Limits, WorkConfig};

pub(crate) use config::{SETTINGS, Setting};
pub(crate) use describe::Understood;
pub(crate) use document::Manifest;
pub(crate) use engine::{Engine, OpenError};
pub(crate) use ingest::{IngestError, Upload};
pub(crate) use maths::MathsError;
pub(crate) use maths::message as panic_message;
pub(crate) use options::Options;
pub(crate) use problem::{Code, JobProblem};
pub(crate) use request::{JobRequest, Kind, KindOnly, RequestError};
pub(crate) use text::{Text, check_text};
pub(crate) use turns::CLIENT;
pub(crate) use unpack::Ingested;
pub(crate) use worker::run as run_workers;
