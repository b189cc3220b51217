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

mod content;
mod exports;
mod jobs;
mod queries;
mod streams;
mod uploads;
mod views;
mod whole;
