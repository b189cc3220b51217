//! `wavelume health`: checks the health of a running service; exit code 0 or 1.

use super::answer::reason;
use super::failure::Failure;
use super::output::print;
use super::pinned;
use super::runtime::block_on;
use super::serve::DEFAULT_LISTEN;
use super::tls::TrustArg;
use std::path::PathBuf;
use std::time::Duration;

/// Longest wait for the answer to a health check. Raising it tolerates slower services.
const PATIENCE: Duration = Duration::from_secs(5);

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Address on which the running service listens
    #[arg(long, value_name = "ADDR", default_value = DEFAULT_LISTEN, conflicts_with = "url")]
    listen: String,
    /// URL at which to reach the running service, in place of --listen
    #[arg(value_name = "URL")]
    url: Option<String>,
    /// Certificate of the service in PEM: it is asked over HTTPS and must show this certificate, under any name
    #[arg(long, value_name = "FILE", env = "WAVELUME_TLS_CERT", hide_env_values = true)]
    tls_cert: Option<PathBuf>,
    #[command(flatten)]
    trust: TrustArg,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let scheme = if args.tls_cert.is_some() { "https" } else { "http" };
    let base = args.url.clone().unwrap_or_else(|| format!("{scheme}://{}", reachable(&args.listen)));
    let url = format!("{}/healthz", base.trim_end_matches('/').trim_end_matches("/healthz"));
    block_on(async {
        let refuse = |error: &reqwest::Error| Failure::failed(format!("{url}: {}", reason(error)));
        let mut builder = reqwest::Client::builder().timeout(PATIENCE).no_proxy();
        if let Some(file) = &args.tls_cert {
            builder = builder.tls_backend_preconfigured(pinned::trusting(file)?);
        }
        let client = args.trust.client(builder)?;
        let answer = client.get(&url).send().await.map_err(|e| refuse(&e))?;
        match answer.status() {
            status if status.is_success() => print("ok\n"),
            status => Err(Failure::failed(format!("{url}: answered {status}"))),
        }
    })
}

/// Returns the address at which to reach a service that listens on `listen`. An unspecified address (`0.0.0.0`, `[::]`)
/// becomes a loopback address.
pub(crate) fn reachable(listen: &str) -> String {
    let listen = listen.strip_prefix("http://").unwrap_or(listen);
    match listen.parse::<std::net::SocketAddr>() {
        Ok(address) if address.ip().is_unspecified() && address.is_ipv6() => format!("[::1]:{}", address.port()),
        Ok(address) if address.ip().is_unspecified() => format!("127.0.0.1:{}", address.port()),
        _ => listen.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_address_is_asked_on_the_machine_itself() {
        assert_eq!(reachable("0.0.0.0:8080"), "127.0.0.1:8080");
        assert_eq!(reachable("[::]:8080"), "[::1]:8080");
        assert_eq!(reachable("http://example.org:1"), "example.org:1");
    }
}
