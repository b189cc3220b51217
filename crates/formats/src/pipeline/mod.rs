//! The whole pipeline: from the bytes of a measurement and a request to a compressed material and its report.

mod as_planes;
mod auto;
mod digest;
mod error;
mod fit;
mod incidences;
mod light;
mod on_grid;
mod origin;
mod outcome;
mod provenance;
mod refinement;
mod relabelled;
mod report;
mod request;
mod restated;
mod sample_light;
mod source;
mod sparse;
mod uncertainty;

pub use auto::{AutoReport, StoppedAt};
pub use digest::digest;
pub use error::PipelineError;
pub use fit::FitReport;
pub use incidences::IncidenceReport;
pub use on_grid::{OnGrid, export_on_grid};
pub use origin::Origin;
pub use outcome::{Outcome, compress, project};
pub use provenance::runs;
pub use report::{CellErrors, Report};
pub use request::{Curve, OptionError, Request};
pub use restated::{Restated, restate};
pub use sample_light::{IncidenceLight, SampleLight};
pub use source::{Input, Source, read};
pub use sparse::{sparse, sparse_measurement};
