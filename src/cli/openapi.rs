//! `wavelume openapi`: the description of the HTTP interface, generated from the router.

use super::failure::Failure;
use super::output::print;
use crate::api;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {}

pub(crate) fn run(_: &Args) -> Result<(), Failure> {
    print(&api::openapi().to_yaml().map_err(Failure::failed)?)
}
