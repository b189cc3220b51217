//! The asynchronous runtime of the commands that need one, and the signals that end them.

use super::failure::Failure;
use crate::api::Stop;
use std::io::IsTerminal;
use std::num::NonZero;
use tokio::runtime::Runtime;
use tokio::signal::unix::{SignalKind, signal};

/// Runs the asynchronous `work` to its end, on a runtime of its own.
pub(crate) fn block_on<T>(work: impl Future<Output = Result<T, Failure>>) -> Result<T, Failure> {
    runtime()?.block_on(work)
}

/// Runs the asynchronous `work` to its end, and leaves behind blocking calls that it has given up waiting for, such as
/// those to a network file system that does not answer.
pub(crate) fn block_on_and_abandon<T>(work: impl Future<Output = Result<T, Failure>>) -> Result<T, Failure> {
    let runtime = runtime()?;
    let done = runtime.block_on(work);
    runtime.shutdown_background();
    done
}

/// Environment variable with the number of threads that wait for the network; set by whoever wants another number than
/// the default.
const THREADS: &str = "TOKIO_WORKER_THREADS";

/// Starts a runtime that leaves one core to the kernel and to compression. Requests are short: on two cores, one thread
/// answers more of them than two, which wake one another for every second request.
fn runtime() -> Result<Runtime, Failure> {
    let mut builder = tokio::runtime::Builder::new_multi_thread();
    if std::env::var_os(THREADS).is_none() {
        let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
        builder.worker_threads(cores.saturating_sub(1).max(1));
    }
    let runtime = builder.enable_all().build();
    runtime.map_err(|error| Failure::failed(format!("cannot start the asynchronous runtime: {error}")))
}

/// Returns a future that resolves at the first signal to stop the service. SIGTERM gives notice first, SIGINT stops at
/// once, and so does SIGHUP if the service has a terminal. The call itself installs the handlers and they stay: a later
/// signal does not cut short the end of running work.
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
