//! `wavelume token`: prints a token that stands for a key for a limited time, made offline from the key.

use super::failure::Failure;
use super::key_file::{KeyArgs, TimeArgs, material};
use super::output::print;
use crate::trust::{MaterialId, Method, Methods, Reach, Scope, Scopes, Token};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Scopes of the token, which its key must have: read, write, jobs
    #[arg(long, value_name = "SCOPES", default_value = "read")]
    scopes: Scopes,
    /// HTTP methods of the token: GET, POST, PUT, PATCH, DELETE. GET includes HEAD; batches of queries need POST.
    /// Default: GET for `read` alone, else all
    #[arg(long, value_name = "METHODS")]
    methods: Option<Methods>,
    /// Id of the only material that the token reaches, `b3-…`. Default: all that the key reaches
    #[arg(long, value_name = "ID", value_parser = material)]
    material: Option<MaterialId>,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    key: KeyArgs,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let key = args.key.read()?;
    let (now, seconds) = args.time.since_now();
    let is_reading = args.scopes.is_within([Scope::Read].into_iter().collect());
    let default = || if is_reading { [Method::Get].into_iter().collect() } else { Methods::all() };
    let methods = args.methods.unwrap_or_else(default);
    let reach = args.material.map_or(Reach::All, Reach::One);
    let token = Token::make(&key, args.scopes, methods, reach, now, seconds).map_err(Failure::usage)?;
    print(&format!("{token}\n"))
}
