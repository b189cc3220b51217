//! A lobe that cells cannot hold: found in the samples of all incidences together, and carried beside the cells.
//!
//! 1. Samples about a centre ([`near`]) of a [`scan`] are compared with a base continued from around ([`candidates`]): a scan
//!    without high samples there has no lobe.
//! 2. A lobe ([`shape`]) and a base under each incidence are fitted together ([`solve`]), about each centre; withheld samples
//!    choose between these, and against no lobe ([`choose`]).

mod candidates;
mod choose;
mod near;
mod scan;
mod shape;
mod solve;
#[cfg(test)]
mod tests;
