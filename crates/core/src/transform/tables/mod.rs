//! The filters of every basis on a line: numbers only, one family a file, each with its source.
#![allow(
    clippy::unreadable_literal,
    clippy::excessive_precision,
    clippy::approx_constant,
    reason = "published numbers stand as published"
)]

pub(super) mod adelson;
pub(super) mod battle_lemarie;
pub(super) mod beylkin;
pub(super) mod biorthogonal;
pub(super) mod brislawn;
pub(super) mod coiflets;
pub(super) mod daubechies;
pub(super) mod meyer;
pub(super) mod odegard;
pub(super) mod symlets;
pub(super) mod vaidyanathan;
pub(super) mod villasenor;
