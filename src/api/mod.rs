//! HTTP: translation only; one file a resource, one place that maps errors to problems.

mod access;
mod admit;
mod body;
mod color;
mod connection;
mod content;
mod content_cache;
mod description;
mod descriptors;
mod events;
mod export;
mod extract;
mod job;
mod jobs;
mod known;
mod layers;
mod materials;
mod measurements;
mod pace;
mod patient;
mod places;
mod preview;
mod problem;
mod query;
mod root;
mod router;
mod schemas;
mod server;
mod state;
mod traffic;
mod upload;
mod words;
mod zstd;

pub use descriptors::raise_descriptor_limit;
pub use router::openapi;
pub use server::{ServeConfig, ServeError, Server, Stop, serve};
