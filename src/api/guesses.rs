//! Wrong keys of each client address within a minute, so that guessing is slow and leaves a trace.

use super::places::Peer;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time within which wrong keys are counted, and after which their address may try again. Raising it slows guessing.
const WINDOW: Duration = Duration::from_mins(1);

/// Upper bound on the addresses that are remembered. Raising it costs memory, about 100 bytes for each.
const ADDRESSES: usize = 50_000;

/// Shortest time between two records of one address, and of a few at once of all addresses, in the audit trail.
const RECORDED: Duration = Duration::from_secs(1);

/// Upper bound on the records of wrong keys of all addresses within [`RECORDED`]. Raising it lets a flood from many
/// addresses write more.
const RECORDS: u32 = 10;

/// Counts of wrong keys by client address.
#[derive(Debug)]
pub(crate) struct Guesses {
    most: u32,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    by: HashMap<Peer, Window>,
    /// Start of the current second of records, and the records within it.
    recorded: Option<(Instant, u32)>,
}

/// Wrong keys of one address since the first of them.
#[derive(Clone, Copy, Debug)]
struct Window {
    since: Instant,
    wrong: u32,
    recorded: Option<Instant>,
}

/// Outcome of counting a wrong key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counted {
    /// True if the wrong key is to be recorded in the audit trail; some are left out.
    pub(crate) is_recorded: bool,
    /// Time for which the address is refused from now on, if it has sent as many wrong keys as it may.
    pub(crate) wait: Option<Duration>,
}

impl Guesses {
    /// Allows `most` wrong keys of one address within a minute.
    pub(crate) fn new(most: u32) -> Arc<Self> {
        Arc::new(Self { most, state: Mutex::default() })
    }

    /// Returns the time for which an address must wait because it has sent too many wrong keys.
    pub(crate) fn wait(&self, peer: Peer, now: Instant) -> Option<Duration> {
        let window = *self.state().by.get(&peer)?;
        if window.wrong < self.most {
            return None;
        }
        (window.since + WINDOW).checked_duration_since(now).filter(|left| !left.is_zero())
    }

    /// Counts a wrong key of an address.
    pub(crate) fn count(&self, peer: Peer, now: Instant) -> Counted {
        let mut state = self.state();
        if state.by.len() >= ADDRESSES && !state.by.contains_key(&peer) {
            state.by.retain(|_, window| now < window.since + WINDOW);
            // A flood from more addresses than are remembered: the list begins anew.
            if state.by.len() >= ADDRESSES {
                state.by.clear();
            }
        }
        let (begun, records) = state.recorded.filter(|(begun, _)| now < *begun + RECORDED).unwrap_or((now, 0));
        let new = Window { since: now, wrong: 0, recorded: None };
        let window = state.by.entry(peer).or_insert(new);
        if now >= window.since + WINDOW {
            *window = Window { recorded: window.recorded, ..new };
        }
        window.wrong = window.wrong.saturating_add(1);
        let is_last = window.wrong == self.most;
        let is_recorded =
            records < RECORDS && (is_last || window.recorded.is_none_or(|recorded| now >= recorded + RECORDED));
        if is_recorded {
            window.recorded = Some(now);
        }
        let wait = (window.wrong >= self.most).then(|| (window.since + WINDOW).saturating_duration_since(now));
        state.recorded = Some((begun, records + u32::from(is_recorded)));
        Counted { is_recorded, wait }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{IpAddr, Ipv6Addr};

    fn peer(address: &str) -> Peer {
        Peer::of(address.parse().unwrap())
    }

    #[test]
    fn an_address_has_ten_wrong_keys_a_minute_and_others_are_not_touched() {
        let guesses = Guesses::new(10);
        let (start, one) = (Instant::now(), peer("10.0.0.1"));
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        for second in 0..9 {
            assert_eq!(guesses.count(one, at(second)), Counted { is_recorded: true, wait: None });
            assert_eq!(guesses.wait(one, at(second)), None);
        }
        assert_eq!(guesses.count(one, at(10)).wait, Some(Duration::from_secs(50)));
        assert_eq!(guesses.wait(one, at(59)), Some(Duration::from_secs(1)));
        assert_eq!(guesses.wait(peer("10.0.0.2"), at(59)), None);
        assert_eq!(guesses.wait(one, at(60)), None, "the minute is over");
        assert_eq!(guesses.count(one, at(61)).wait, None, "and counting begins anew");
        let (near, far) = (peer("2001:db8::1"), peer("2001:db8:0:1::1"));
        for _ in 0..10 {
            guesses.count(near, at(0));
        }
        assert!(guesses.wait(peer("2001:db8::ffff:1"), at(1)).is_some() && guesses.wait(far, at(1)).is_none());
    }

    #[test]
    fn records_are_few_but_the_last_wrong_key_is_among_them() {
        let guesses = Guesses::new(10);
        let (start, one) = (Instant::now(), peer("10.0.0.1"));
        let recorded: Vec<bool> = (0..12).map(|_| guesses.count(one, start).is_recorded).collect();
        assert_eq!(recorded.iter().filter(|recorded| **recorded).count(), 2);
        assert!(recorded[0] && recorded[9]);
        let many = (0..100_u8).filter(|i| guesses.count(peer(&format!("10.0.1.{i}")), start).is_recorded);
        assert_eq!(many.count(), 8, "10 a second of all addresses");
    }

    #[test]
    fn memory_is_bounded_whoever_guesses() {
        let guesses = Guesses::new(10);
        let start = Instant::now();
        for i in 0..2 * ADDRESSES as u64 {
            guesses.count(Peer::of(IpAddr::V6(Ipv6Addr::from(u128::from(i) << 64))), start);
            assert!(i % 1000 > 0 || guesses.state().by.len() <= ADDRESSES);
        }
    }
}
