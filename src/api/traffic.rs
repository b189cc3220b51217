//! Running requests of one connection: since when there are none, and whether the client has stopped reading an answer.

use super::body::Passed;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::Instant;

/// Running requests of one connection, from which an idle or stalled connection is detected.
#[derive(Debug)]
pub(crate) struct Traffic {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    next: u64,
    /// For each running request, the time since which a piece of its answer waits to be sent; `None` if no piece waits.
    running: HashMap<u64, Option<Instant>>,
    /// Time at which a request of the connection last began or ended.
    last: Instant,
}

/// One running request, which counts until its answer is sent or dropped.
#[derive(Debug)]
pub(crate) struct Running {
    traffic: Arc<Traffic>,
    id: u64,
}

/// Reason to close a connection on which nothing moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Silence {
    /// No request of the connection is running, and none has begun or ended for the idle time.
    Idle,
    /// The client has not taken a waiting piece of an answer for twice the idle time.
    Unread,
}

impl Traffic {
    pub(crate) fn new() -> Arc<Self> {
        let state = State { next: 0, running: HashMap::new(), last: Instant::now() };
        Arc::new(Self { state: Mutex::new(state) })
    }

    pub(crate) fn enter(self: &Arc<Self>) -> Running {
        let mut state = self.state();
        let id = state.next;
        state.next += 1;
        state.running.insert(id, None);
        state.last = Instant::now();
        Running { traffic: Arc::clone(self), id }
    }

    /// Returns a reason to close the connection at time `now`: no request for `idle`, or a piece of an answer that
    /// waits for twice as long. The doubled time spares slow connections, which take pieces in bursts.
    pub(crate) fn silence(&self, idle: Duration, now: Instant) -> Option<Silence> {
        let state = self.state();
        if state.running.is_empty() {
            return (now.duration_since(state.last) >= idle).then_some(Silence::Idle);
        }
        let unread = |since: &Option<Instant>| since.is_some_and(|since| now.duration_since(since) >= 2 * idle);
        state.running.values().any(unread).then_some(Silence::Unread)
    }

    /// Returns the number of requests that have begun on the connection.
    pub(crate) fn begun(&self) -> u64 {
        self.state().next
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Passed for Running {
    fn asked(&mut self) {
        self.traffic.state().running.insert(self.id, None);
    }

    fn gave(&mut self) {
        self.traffic.state().running.insert(self.id, Some(Instant::now()));
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let mut state = self.traffic.state();
        state.running.remove(&self.id);
        state.last = Instant::now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_without_requests_and_answers_that_nobody_takes_are_told_apart() {
        let idle = Duration::from_secs(30);
        let later = |times: u32| Instant::now() + times * idle;
        let traffic = Traffic::new();
        assert_eq!(traffic.silence(idle, Instant::now()), None);
        assert_eq!(traffic.silence(idle, later(1)), Some(Silence::Idle));
        // A handler may take long, and an event stream may be quiet.
        let mut running = traffic.enter();
        assert_eq!(traffic.silence(idle, later(10)), None);
        running.gave();
        running.asked();
        assert_eq!(traffic.silence(idle, later(10)), None);
        running.gave();
        assert_eq!(traffic.silence(idle, later(1)), None);
        assert_eq!(traffic.silence(idle, later(2)), Some(Silence::Unread));
        drop(running);
        assert_eq!((traffic.silence(idle, Instant::now()), traffic.begun()), (None, 1));
    }
}
