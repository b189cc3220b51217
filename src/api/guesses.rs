//! Counts of the wrong keys of each client address within a minute, so that guessing is slow and leaves a trace.

use super::places::Peer;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// Time within which the wrong keys of a client address are counted, and after which the address may try again. Raising
/// it slows guessing.
const WINDOW: Duration = Duration::from_mins(1);

/// Upper bound on the number of client addresses whose wrong keys are counted. Raising it costs memory, about 100 bytes
/// for each.
const ADDRESSES: usize = 50_000;

/// Shortest time between two records of wrong keys of one address in the audit trail, and period to which the bound
/// [`RECORDS`] over all addresses applies. Raising it records fewer of them.
const RECORDED: Duration = Duration::from_secs(1);

/// Upper bound on the records of wrong keys of all addresses within [`RECORDED`]. Raising it lets a flood from many
/// addresses write more.
const RECORDS: u32 = 10;

/// Period to which the bound [`HOURLY`] on the records of wrong keys in the audit trail applies, over all addresses.
const HOUR: Duration = Duration::from_hours(1);

/// Upper bound on the records of wrong keys of all addresses within [`HOUR`]. Raising it lets a flood that lasts fill
/// more of the database: with this bound 432,000 records of one node within the 30 days for which they are kept.
const HOURLY: u32 = 600;

/// Shortest time between two searches for addresses whose minute of counted wrong keys is over. Raising it forgets more
/// addresses too early in a flood from more addresses than are remembered.
const SEARCHED: Duration = Duration::from_secs(1);

/// Counts of wrong keys by client address.
#[derive(Debug)]
pub(crate) struct Guesses {
    most: u32,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    by: HashMap<Peer, Window>,
    /// Start of the current second, and number of wrong keys of all addresses that the audit trail records within it.
    second: Option<(Instant, u32)>,
    /// Start of the current hour, and number of wrong keys of all addresses that the audit trail records within it.
    hour: Option<(Instant, u32)>,
    /// Number of wrong keys left out of the audit trail since its last record of one.
    left_out: u64,
    /// Time of the last search for addresses whose minute of counted wrong keys is over.
    searched: Option<Instant>,
}

/// Counts of the wrong keys that one client address has sent within the current minute.
#[derive(Clone, Debug)]
struct Window {
    since: Instant,
    wrong: u32,
    recorded: Option<Instant>,
    /// Number of look-ups of keys in the database that are under way for one client address.
    asking: u32,
    /// Signal that wakes the waiting requests of one client address: a look-up of a key for this address has ended.
    ended: Arc<Notify>,
}

/// Outcome of counting a wrong key against its client address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counted {
    /// Number of wrong keys left out of the audit trail since its last record of one. The record of the key just
    /// counted states this number; `None` if this key is left out, too.
    pub(crate) recorded: Option<u64>,
    /// Time for which unknown keys from the client address are refused from now on; `None` if the address has sent
    /// fewer wrong keys than it may.
    pub(crate) wait: Option<Duration>,
}

/// Permit of a client address to look up a key that this process does not know; dropping the permit returns it. A wrong
/// key is to be counted before the permit is dropped.
#[derive(Debug)]
#[must_use]
pub(crate) struct Turn {
    guesses: Arc<Guesses>,
    peer: Peer,
}

impl Drop for Turn {
    fn drop(&mut self) {
        let mut state = self.guesses.state();
        let Some(window) = state.by.get_mut(&self.peer) else { return };
        window.asking = window.asking.saturating_sub(1);
        // All of them look again: one alone might find a new window, whose end would not reach the others.
        window.ended.notify_waiters();
        if window.asking == 0 && window.wrong == 0 {
            state.by.remove(&self.peer);
        }
    }
}

impl Guesses {
    /// Builds counters that allow each client address `most` wrong keys within a minute.
    pub(crate) fn new(most: u32) -> Arc<Self> {
        Arc::new(Self { most, state: Mutex::default() })
    }

    /// Returns the time for which a client address must wait before the service looks up unknown keys from it again;
    /// `None` if it has not sent too many wrong keys.
    pub(crate) fn wait(&self, peer: Peer, now: Instant) -> Option<Duration> {
        self.state().by.get(&peer)?.wait(self.most, now)
    }

    /// Waits for the permit of an address to look up a key. If the address has sent too many wrong keys, returns the
    /// time after which it may try again. Look-ups under way count as wrong keys until they have ended, so that a
    /// further one may have to wait.
    pub(crate) async fn turn(self: &Arc<Self>, peer: Peer) -> Result<Turn, Duration> {
        loop {
            let now = Instant::now();
            let ended = {
                let mut state = self.state();
                let window = state.window(peer, now);
                if let Some(wait) = window.wait(self.most, now) {
                    return Err(wait);
                }
                if window.wrong + window.asking < self.most {
                    window.asking += 1;
                    return Ok(Turn { guesses: Arc::clone(self), peer });
                }
                // Registered under the lock, so that the end of a look-up is not missed.
                let mut ended = Box::pin(Arc::clone(&window.ended).notified_owned());
                ended.as_mut().enable();
                ended
            };
            ended.await;
        }
    }

    /// Counts a wrong key against the client address that sent it.
    pub(crate) fn count(&self, peer: Peer, now: Instant) -> Counted {
        let mut state = self.state();
        let within = |counted: Option<(Instant, u32)>, time| {
            counted.filter(|(begun, _)| now < *begun + time).unwrap_or((now, 0))
        };
        let (second, hour) = (within(state.second, RECORDED), within(state.hour, HOUR));
        let window = state.window(peer, now);
        window.wrong = window.wrong.saturating_add(1);
        let is_last = window.wrong == self.most;
        let is_due = is_last || window.recorded.is_none_or(|recorded| now >= recorded + RECORDED);
        let is_recorded = is_due && second.1 < RECORDS && hour.1 < HOURLY;
        if is_recorded {
            window.recorded = Some(now);
        }
        let wait = (window.wrong >= self.most).then(|| (window.since + WINDOW).saturating_duration_since(now));
        if wait.is_some() {
            window.ended.notify_waiters();
        }
        let more = u32::from(is_recorded);
        (state.second, state.hour) = (Some((second.0, second.1 + more)), Some((hour.0, hour.1 + more)));
        let left_out = if is_recorded { 0 } else { state.left_out.saturating_add(1) };
        let before = std::mem::replace(&mut state.left_out, left_out);
        Counted { recorded: is_recorded.then_some(before), wait }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Returns the counts of wrong keys that a client address has sent in its current minute.
    fn window(&mut self, peer: Peer, now: Instant) -> &mut Window {
        if self.by.len() >= ADDRESSES && !self.by.contains_key(&peer) {
            if self.searched.is_none_or(|searched| now >= searched + SEARCHED) {
                self.searched = Some(now);
                self.by.retain(|_, window| window.asking > 0 || now < window.since + WINDOW);
            }
            // A flood from more addresses than are remembered: the list begins anew.
            if self.by.len() >= ADDRESSES {
                self.by.retain(|_, window| window.asking > 0);
            }
        }
        let window = self.by.entry(peer).or_insert_with(|| Window {
            since: now,
            wrong: 0,
            recorded: None,
            asking: 0,
            ended: Arc::default(),
        });
        if now >= window.since + WINDOW {
            (window.since, window.wrong) = (now, 0);
        }
        window
    }
}

impl Window {
    /// Returns the time for which a client address must wait before the service looks up unknown keys from it again;
    /// `None` if it has sent fewer than `most` wrong keys within the minute.
    fn wait(&self, most: u32, now: Instant) -> Option<Duration> {
        let left = (self.since + WINDOW).checked_duration_since(now).filter(|left| !left.is_zero());
        left.filter(|_| self.wrong >= most)
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
            assert_eq!(guesses.count(one, at(second)), Counted { recorded: Some(0), wait: None });
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

    #[tokio::test]
    async fn requests_that_wait_for_a_turn_all_get_one() {
        for most in [1, 2, 10] {
            let guesses = Guesses::new(most);
            let turns = (0..50).map(|_| async {
                let turn = guesses.turn(peer("10.0.0.1")).await.unwrap();
                tokio::task::yield_now().await;
                drop(turn);
            });
            let all = tokio::time::timeout(Duration::from_mins(1), futures::future::join_all(turns)).await;
            assert_eq!(all.unwrap().len(), 50);
            assert!(guesses.state().by.is_empty());
        }
    }

    #[test]
    fn records_are_few_but_the_last_wrong_key_is_among_them() {
        let guesses = Guesses::new(10);
        let (start, one) = (Instant::now(), peer("10.0.0.1"));
        let recorded: Vec<bool> = (0..12).map(|_| guesses.count(one, start).recorded.is_some()).collect();
        assert_eq!(recorded.iter().filter(|recorded| **recorded).count(), 2);
        assert!(recorded[0] && recorded[9]);
        let many = (0..100_u8).filter(|i| guesses.count(peer(&format!("10.0.1.{i}")), start).recorded.is_some());
        assert_eq!(many.count(), 8, "10 a second of all addresses");
        let next = guesses.count(one, start + RECORDED);
        assert_eq!(next.recorded, Some(92), "those left out since the last record are counted");
    }

    #[test]
    fn a_flood_from_many_addresses_writes_600_records_an_hour() {
        let guesses = Guesses::new(10);
        let (start, mut records) = (Instant::now(), 0);
        for second in 0..3600_u32 {
            for i in 0..20_u128 {
                let peer = Peer::of(IpAddr::V6(Ipv6Addr::from((u128::from(second) * 20 + i) << 64)));
                let counted = guesses.count(peer, start + Duration::from_secs(u64::from(second)));
                records += u32::from(counted.recorded.is_some());
            }
        }
        assert_eq!(records, HOURLY);
        assert!(guesses.count(peer("10.0.0.1"), start + HOUR).recorded.is_some_and(|left_out| left_out > 70_000));
    }

    #[tokio::test]
    async fn look_ups_at_once_are_as_many_as_wrong_keys_are_left_and_the_others_wait() {
        let guesses = Guesses::new(3);
        let one = peer("10.0.0.1");
        guesses.count(one, Instant::now());
        let (first, second) = (guesses.turn(one).await.unwrap(), guesses.turn(one).await.unwrap());
        let waiting = || {
            let guesses = Arc::clone(&guesses);
            tokio::spawn(async move { guesses.turn(one).await.is_ok() })
        };
        let (third, fourth) = (waiting(), waiting());
        tokio::task::yield_now().await;
        assert!(!third.is_finished() && guesses.turn(peer("10.0.0.2")).await.is_ok());
        drop(first);
        assert!(third.await.unwrap() && fourth.await.unwrap(), "one after the other, as each was right");
        let (last, refused) = (guesses.turn(one).await.unwrap(), waiting());
        tokio::task::yield_now().await;
        for turn in [second, last] {
            guesses.count(one, Instant::now());
            drop(turn);
        }
        assert!(!refused.await.unwrap() && guesses.turn(one).await.is_err());
        assert_eq!(guesses.state().by.len(), 1, "an address without a wrong key is forgotten");
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
