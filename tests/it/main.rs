//! The finished program and its service as users meet them, the structure of the code, and its sentences.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking, its helpers too"
)]

mod cli;
mod crash;
mod http;
mod labs;
mod layering;
mod pages;
mod prose;
mod restored;
mod service;
