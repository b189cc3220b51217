//! The asynchronous runtime of the commands that need one, and the signals that end them.

use super::failure::Failure;
use crate::api::Stop;
use std::io::IsTerminal;
use tokio::signal::unix::{SignalKind, signal};

/// Runs `work` to its end.
pub(crate) fn block_on<T>(work: impl Future<Output = Result<T, Failure>>) -> Result<T, Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    runtime.map_err(|error| Failure::failed(format!("cannot start the runtime: {error}")))?.block_on(work)
}

/// Resolves at the first signal that ends the service: SIGTERM with a notice, SIGINT at once. SIGHUP ends a service
/// whose terminal was closed, at once too, and is ignored by one without a terminal. The call installs the handlers,
/// not the first poll, and they stay: a later signal does not end the drain.
pub(crate) fn stop_signal() -> Result<impl Future<Output = Stop> + Send + 'static, Failure> {
    let install = |kind| signal(kind).map_err(|error| Failure::failed(format!("cannot listen for signals: {error}")));
    let mut terminate = install(SignalKind::terminate())?;
    let mut interrupt = install(SignalKind::interrupt())?;
    let mut hangup = install(SignalKind::hangup())?;
    let on_terminal = std::io::stdin().is_terminal() || std::io::stderr().is_terminal();
    Ok(async move {
        loop {
            tokio::select! {
                _ = terminate.recv() => return Stop::Announced,
                _ = interrupt.recv() => return Stop::AtOnce,
                _ = hangup.recv() => {
                    if on_terminal {
                        return Stop::AtOnce;
                    }
                    tracing::info!("SIGHUP is ignored: settings are read at the start; SIGTERM stops the service");
                }
            }
        }
    })
}
