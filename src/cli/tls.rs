//! Options for the certificate of a service, and for the certificates that its clients trust.

use super::answer::reason;
use super::failure::Failure;
use crate::api::TlsFiles;
use reqwest::{Certificate, Client, ClientBuilder};
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
    /// Returns the files of the certificate and its private key, of which both or none are named.
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

/// Option for the certificates that a client of a service trusts.
#[derive(Debug, clap::Args)]
pub(crate) struct TrustArg {
    /// Certificates in PEM to trust instead of those of the system, for a service whose certificate is issued by a
    /// private authority
    #[arg(long, value_name = "FILE", env = "WAVELUME_CA_CERT", hide_env_values = true)]
    ca_cert: Option<PathBuf>,
}

impl TrustArg {
    /// Builds an HTTP client that trusts the certificates that the option names, or else those of the system.
    pub(crate) fn client(&self, mut builder: ClientBuilder) -> Result<Client, Failure> {
        if let Some(file) = &self.ca_cert {
            let at = |reason: &dyn std::fmt::Display| Failure::failed(format!("{}: {reason}", file.display()));
            let text = std::fs::read(file).map_err(|error| at(&error))?;
            let certificates = Certificate::from_pem_bundle(&text).map_err(|error| at(&reason(&error)))?;
            if certificates.is_empty() {
                return Err(at(&"found no certificate, expected PEM that begins with BEGIN CERTIFICATE"));
            }
            builder = builder.tls_certs_only(certificates);
        }
        builder.build().map_err(|error| Failure::failed(reason(&error)))
    }
}
