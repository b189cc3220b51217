//! Options that say where a service keeps its data: directory, database, store.

use crate::jobs::{Database, Place, Site};
use std::path::PathBuf;

/// Options for the data directory, the database and the store of a service.
#[derive(Debug, clap::Args)]
pub(crate) struct SiteArgs {
    /// Data directory; created if it is missing
    #[arg(
        long = "data",
        value_name = "DIR",
        default_value = "./wavelume-data",
        env = "WAVELUME_DATA",
        hide_env_values = true
    )]
    pub(crate) directory: PathBuf,
    /// Database of the catalog: `sqlite:FILE` or `postgres://USER@HOST/NAME`; by default catalog.sqlite in the data
    /// directory. A password is best given by the environment or by PGPASSFILE
    #[arg(long, value_name = "URL", env = "WAVELUME_DATABASE", hide_env_values = true)]
    database: Option<Database>,
    /// Store of the uploaded and compressed files: `dir:DIR` or `s3://BUCKET/PREFIX`, with credentials and endpoint in
    /// the usual AWS_ variables; by default the data directory
    #[arg(long, value_name = "URL", env = "WAVELUME_STORE", hide_env_values = true)]
    store: Option<Place>,
    /// Take over the store of the catalog (database) with this id; that catalog must not be used any more
    #[arg(long, value_name = "ID")]
    adopt_store: Option<String>,
}

impl SiteArgs {
    pub(crate) fn site(&self) -> Site {
        Site {
            data: self.directory.clone(),
            database: self.database.clone(),
            store: self.store.clone(),
            adopt: self.adopt_store.clone(),
        }
    }
}
