//! Pools that compute: a bounded number of threads, results through a oneshot channel, and a limit on waiting work.

use super::turns::Turns;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Semaphore, oneshot};

/// Thread pool with a bounded queue, for computations that must not block the threads of the asynchronous runtime.
#[derive(Clone, Debug)]
pub(crate) struct Maths {
    pool: Arc<ThreadPool>,
    /// Permits for work to run on the thread pool, handed to waiting clients in rotation.
    running: Turns,
    /// Permits for work on the thread pool, running or waiting to run. Without a free permit, further work is refused.
    admitted: Arc<Semaphore>,
    patience: Duration,
}

/// Reason why work on a thread pool, such as a query or a compression, gave no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum MathsError {
    /// Too much other work is waiting for the thread pool already.
    #[error("too many computations are waiting already; try again later")]
    Busy,
    /// Work on a thread pool, such as a query or a compression, panicked because of a bug of the service.
    #[error("a computation of the service, such as a query or a compression, panicked: {0}")]
    Panicked(String),
}

impl Maths {
    /// Creates a pool of `threads` threads (0: one per core). It runs `at_once` computations at a time (0: one per
    /// thread), and `waiting` more may wait for up to `patience`.
    pub(crate) fn new(
        name: &'static str,
        threads: usize,
        at_once: usize,
        waiting: usize,
        patience: Duration,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(move |i| format!("{name}-{i}")).build()?;
        let at_once = if at_once == 0 { pool.current_num_threads() } else { at_once };
        Ok(Self {
            pool: Arc::new(pool),
            running: Turns::new(at_once),
            admitted: Arc::new(Semaphore::new(at_once.saturating_add(waiting).min(Semaphore::MAX_PERMITS))),
            patience,
        })
    }

    /// Returns the number of threads of the pool.
    pub(crate) fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs `work` on the thread pool. If the caller stops waiting, the work still runs to its end and counts as
    /// running until then.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, MathsError> {
        let admission = Arc::clone(&self.admitted).try_acquire_owned().map_err(|_| MathsError::Busy)?;
        let turn = tokio::time::timeout(self.patience, self.running.take()).await.map_err(|_| MathsError::Busy)?;
        self.spawn((turn, admission), work).await
    }

    /// Runs `work` on the thread pool when its turn comes, and waits for the turn without a time limit. Callers bound
    /// the number of waiting computations themselves. The caller must keep polling, because a turn that has come is
    /// held until it is taken.
    pub(crate) async fn run_in_turn<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, MathsError> {
        let turn = self.running.take().await;
        self.spawn(turn, work).await
    }

    /// Runs `work` on the thread pool, and keeps the permit `place` to use the pool until the work ends.
    async fn spawn<T: Send + 'static>(
        &self,
        place: impl Send + 'static,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, MathsError> {
        let (send, receive) = oneshot::channel();
        self.pool.spawn(move || {
            let result = catch_unwind(AssertUnwindSafe(work));
            drop(place);
            // The caller is gone: the result is dropped.
            let _ = send.send(result);
        });
        match receive.await {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(panic)) => Err(MathsError::Panicked(message(panic.as_ref()))),
            Err(_) => Err(MathsError::Panicked("the pool ended".to_owned())),
        }
    }
}

/// Returns the message of a panic.
pub(crate) fn message(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_is_an_answer_and_the_pool_goes_on() {
        let maths = Maths::new("test", 1, 1, 1, Duration::from_secs(9)).unwrap();
        let panicked: Result<(), _> = maths.run(|| panic!("out of cheese")).await;
        assert_eq!(panicked, Err(MathsError::Panicked("out of cheese".to_owned())));
        assert_eq!(maths.run(|| 2 + 2).await, Ok(4));
    }

    #[tokio::test]
    async fn more_than_may_wait_is_busy() {
        let maths = Maths::new("test", 1, 1, 0, Duration::from_secs(9)).unwrap();
        let (release, released) = std::sync::mpsc::channel::<()>();
        let slow = tokio::spawn({
            let maths = maths.clone();
            async move { maths.run(move || released.recv()).await }
        });
        while maths.admitted.available_permits() > 0 {
            tokio::task::yield_now().await;
        }
        assert_eq!(maths.run(|| ()).await, Err(MathsError::Busy));
        release.send(()).unwrap();
        slow.await.unwrap().unwrap().unwrap();
        assert_eq!(maths.run(|| ()).await, Ok(()));
    }
}
