//! Options that say where a service keeps its data: directory, database, store; and where its settings are.

use super::umask::Umask;
use crate::jobs::{Database, Place, Site};
use std::path::PathBuf;

/// Id of the option for permissions; the commands that have it make what they make with them.
pub(super) const UMASK: &str = "umask";

/// Option for the configuration file. The commands that have it read the file.
#[derive(Debug, clap::Args)]
pub(crate) struct ConfigArg {
    /// Configuration file (TOML) with any of these settings; the environment overrides the file, and flags override the
    /// environment
    #[arg(long, value_name = "FILE", env = "WAVELUME_CONFIG", hide_env_values = true)]
    pub(crate) config: Option<PathBuf>,
}

/// Options for the data directory, the database and the store of a service, and for its configuration file.
#[derive(Debug, clap::Args)]
pub(crate) struct PlaceArgs {
    #[command(flatten)]
    pub(crate) file: ConfigArg,
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
    /// Permissions (octal) that directories and files which the program makes in the data directory, the store or a
    /// backup do not get: 077 leaves them to their owner, 027 lets the group read
    #[arg(
        id = UMASK,
        long,
        value_name = "MASK",
        default_value = "077",
        env = "WAVELUME_UMASK",
        hide_env_values = true,
        hide_short_help = true
    )]
    pub(crate) umask: Umask,
}

/// Options of commands that use the store: its places, and the permission to take it over.
#[derive(Debug, clap::Args)]
pub(crate) struct SiteArgs {
    #[command(flatten)]
    pub(crate) places: PlaceArgs,
    /// Take over the store of the catalog (database) with this id; that catalog must not be used any more
    #[arg(long, value_name = "ID")]
    adopt_store: Option<String>,
}

impl PlaceArgs {
    pub(crate) fn site(&self) -> Site {
        Site { database: self.database.clone(), store: self.store.clone(), ..Site::new(&self.directory) }
    }
}

impl SiteArgs {
    pub(crate) fn site(&self) -> Site {
        Site { adopt: self.adopt_store.clone(), ..self.places.site() }
    }
}
