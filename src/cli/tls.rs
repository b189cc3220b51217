//! Options for the certificate of a service.

use super::failure::Failure;
use crate::api::TlsFiles;
use std::path::PathBuf;

/// Options for the certificate with which a service encrypts its connections.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Server")]
pub(crate) struct TlsArgs {
    /// Certificate of the service in PEM, followed by the certificates that lead to a known one: connections are
    /// encrypted (HTTPS). It is read again when it changes
    #[arg(long, value_name = "FILE", env = "WAVELUME_TLS_CERT", hide_env_values = true)]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate in PEM, without a passphrase
    #[arg(long, value_name = "FILE", env = "WAVELUME_TLS_KEY", hide_env_values = true)]
    tls_key: Option<PathBuf>,
}

impl TlsArgs {
    /// Returns the files of the certificate, of which there are both or none.
    pub(crate) fn files(&self) -> Result<Option<TlsFiles>, Failure> {
        let lacks = |given, other| Err(Failure::usage(format!("{given} needs {other}: give both, or none for HTTP")));
        match (&self.tls_cert, &self.tls_key) {
            (Some(chain), Some(key)) => Ok(Some(TlsFiles { chain: chain.clone(), key: key.clone() })),
            (None, None) => Ok(None),
            (Some(_), None) => lacks("--tls-cert", "--tls-key"),
            (None, Some(_)) => lacks("--tls-key", "--tls-cert"),
        }
    }
}
