//! Every call of the HTTP contract against a real server, and every refusal by its problem.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

#[path = "../service/mod.rs"]
mod service;

mod access;
mod content;
mod crowd;
mod exports;
mod frames;
mod hostile;
mod jobs;
mod queries;
mod state;
mod streams;
mod uploads;
mod views;
mod whole;
