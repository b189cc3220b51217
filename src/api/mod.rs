//! HTTP interface: translation only. Each resource has a file of its own, and one module maps errors to problems.

mod access;
mod admit;
mod body;
mod caller;
mod color;
mod connection;
mod content;
mod content_cache;
mod description;
mod descriptors;
mod events;
mod export;
mod export_description;
mod extract;
mod figures;
mod flattened;
mod job;
mod jobs;
mod known;
mod layers;
mod material_upload;
mod materials;
mod measurements;
mod pace;
mod patient;
mod places;
mod preview;
mod problem;
mod query;
mod resumable;
#[cfg(test)]
mod rolling_tests;
mod root;
mod router;
mod schemas;
mod seen;
mod server;
mod state;
#[cfg(test)]
mod tenant_tests;
mod tenants;
mod traffic;
mod upload;
mod upload_query;
mod words;
mod zstd;

pub use crate::jobs::{ArchiveError, Limits, WorkConfig};
pub(crate) use descriptors::{descriptors_found, raise_descriptor_limit};
pub(crate) use figures::show_figures;
pub use router::openapi;
pub use server::{ServeConfig, ServeError, Server, Stop, serve};
