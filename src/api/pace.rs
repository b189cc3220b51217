//! Lower bound on the rate at which a body arrives, so that a client that trickles bytes does not hold its place.

use super::problem::{Kind, Problem};
use crate::jobs::Limits;
use std::collections::VecDeque;
use std::time::Duration;
use tokio::time::Instant;

/// Number of history entries in the time window over which the rate of an upload is measured. Raising it measures the
/// rate more exactly, at the cost of memory.
const STEPS: u32 = 30;

/// Measures how fast a request body arrives. Only the time spent waiting for the client counts, not the time that the
/// service needs to write, decode or compute.
#[derive(Debug)]
pub(crate) struct Pace {
    rate: u64,
    window: Duration,
    grace: Duration,
    idle: Duration,
    waited: Duration,
    bytes: u64,
    /// History of the arrival of a request body over one time window, an entry about every thirtieth of it. An entry is
    /// the time waited for the client, without the grace time, and the bytes received, both since the start of the
    /// body.
    history: VecDeque<(Duration, u64)>,
}

impl Pace {
    pub(crate) fn new(limits: &Limits) -> Self {
        Self {
            rate: limits.body_rate,
            window: limits.body_window,
            grace: limits.body_grace,
            idle: limits.idle,
            waited: Duration::ZERO,
            bytes: 0,
            history: VecDeque::new(),
        }
    }

    /// Waits for the next piece of a request body; `None` at its end. `size` returns the number of bytes of a piece.
    pub(crate) async fn next<T>(
        &mut self,
        next: impl Future<Output = Option<T>>,
        size: impl FnOnce(&T) -> usize,
    ) -> Result<Option<T>, Slow> {
        let start = Instant::now();
        let piece = tokio::time::timeout(self.idle, next).await.map_err(|_| Slow::Idle(self.idle))?;
        if let Some(piece) = &piece {
            self.received(start.elapsed(), size(piece) as u64)?;
        }
        Ok(piece)
    }

    /// Counts `bytes` of a request body that arrived after a wait of `waited`; fails if the body arrives too slowly.
    fn received(&mut self, waited: Duration, bytes: u64) -> Result<(), Slow> {
        self.waited += waited;
        self.bytes += bytes;
        let Some(counted) = self.waited.checked_sub(self.grace) else { return Ok(()) };
        if self.history.is_empty() {
            self.history.push_back((Duration::ZERO, self.bytes - bytes));
        }
        // The youngest entry that is at least one window old becomes the first.
        while self.history.get(1).is_some_and(|(then, _)| counted >= *then + self.window) {
            self.history.pop_front();
        }
        if let Some((then, before)) = self.history.front()
            && let Some(over) = counted.checked_sub(*then).filter(|over| *over >= self.window)
        {
            let expected = self.rate as f64 * over.as_secs_f64();
            let arrived = self.bytes - before;
            if (arrived as f64) < expected {
                return Err(Slow::Rate { arrived, over, rate: self.rate });
            }
        }
        if self.history.back().is_none_or(|(then, _)| counted >= *then + self.window / STEPS) {
            self.history.push_back((counted, self.bytes));
        }
        Ok(())
    }
}

/// Reason to stop waiting for a request body.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Slow {
    #[error("no bytes of the request body arrived for {0:?}; send without such pauses")]
    Idle(Duration),
    #[error(
        "{arrived} bytes of the request body arrived within {over:.1?}, expected at least {rate} a second; send \
         faster or in parts"
    )]
    Rate { arrived: u64, over: Duration, rate: u64 },
}

impl From<Slow> for Problem {
    fn from(slow: Slow) -> Self {
        Self::new(Kind::TooSlow, slow.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// Returns after how many seconds a request body is refused as too slow, if a piece of `bytes` arrives at intervals
    /// of `every`; `None` if it is accepted for 600 s.
    fn refused_after(every: Duration, bytes: u64) -> Option<u64> {
        let mut pace = Pace::new(&Limits::default());
        let mut waited = Duration::ZERO;
        while waited < 600 * SECOND {
            waited += every;
            if pace.received(every, bytes).is_err() {
                return Some(waited.as_secs());
            }
            assert!(pace.history.len() < 70);
        }
        None
    }

    #[test]
    fn a_body_must_come_at_16_kib_a_second_over_any_30_seconds_after_the_first_10() {
        assert_eq!(refused_after(SECOND, 16 << 10), None);
        assert_eq!(refused_after(20 * SECOND, 400 << 10), None);
        assert_eq!(refused_after(SECOND / 100, 200), None);
        // The piece that ends the grace time counts for the client.
        assert_eq!(refused_after(SECOND, (16 << 10) - 1), Some(41));
        assert_eq!(refused_after(SECOND / 100, 100), Some(40));
        assert_eq!(refused_after(29 * SECOND, 1), Some(58));
    }

    #[test]
    fn a_fast_beginning_does_not_pay_for_a_slow_rest() {
        let mut pace = Pace::new(&Limits::default());
        pace.received(SECOND, 1 << 30).unwrap();
        let slow = (0..120).find_map(|i| pace.received(SECOND, 1).err().map(|_| i));
        assert!(slow.is_some_and(|seconds| seconds <= 40), "{slow:?}");
    }

    #[test]
    fn time_that_the_service_takes_is_not_the_clients() {
        let mut pace = Pace::new(&Limits::default());
        for _ in 0..10_000 {
            pace.received(Duration::ZERO, 1).unwrap();
        }
    }
}
