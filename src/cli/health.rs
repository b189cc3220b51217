//! `wavelume health`: checks the health of a running service; exit code 0 or 1.

use super::failure::Failure;
use super::output::print;
use super::runtime::block_on;
use super::serve::DEFAULT_LISTEN;
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
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let base = args.url.clone().unwrap_or_else(|| format!("http://{}", reachable(&args.listen)));
    let url = format!("{}/healthz", base.trim_end_matches('/').trim_end_matches("/healthz"));
    block_on(async {
        let refuse = |error: &reqwest::Error| Failure::failed(format!("{url}: {}", reason(error)));
        let client = reqwest::Client::builder().timeout(PATIENCE).no_proxy().build();
        let answer = client.map_err(|e| refuse(&e))?.get(&url).send().await.map_err(|e| refuse(&e))?;
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

/// Returns the innermost cause of a failed HTTP request, the one that a user can act on.
pub(crate) fn reason(error: &reqwest::Error) -> String {
    if error.is_timeout() {
        return "no answer in time".to_owned();
    }
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
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
