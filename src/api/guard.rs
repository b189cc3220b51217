//! Mode of access of a service, and the state by which requests are admitted or refused.

use super::decisions::{Decisions, Judged};
use super::guesses::{Guesses, Turn};
use super::places::{Full, Peer, Place, Places};
use crate::catalog::{Catalog, CatalogError};
use crate::jobs::Limits;
use crate::trust::{KeyId, SecretHash};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// Rule by which a service admits requests: from everybody, or only with an access key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AuthMode {
    /// Everybody who reaches the service may do everything; meant for a loopback address.
    #[default]
    Off,
    /// Requests need a key.
    Keys,
    /// Requests need a key, except those that only read public materials.
    KeysAndAnonymousRead,
}

impl fmt::Display for AuthMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::Keys => "keys",
            Self::KeysAndAnonymousRead => "keys+anonymous-read",
        })
    }
}

/// Access mode of a service, with the remembered decisions about keys and the counts of wrong keys, by which requests
/// are admitted or refused.
#[derive(Debug)]
pub(crate) struct Guard {
    /// Rule by which the service admits requests: from everybody, or only with an access key.
    pub(crate) mode: AuthMode,
    /// True if a service without keys may be reached from other machines and through proxies.
    pub(crate) is_insecure: bool,
    /// Remembered decisions about the validity of access keys.
    pub(crate) decisions: Decisions,
    /// Counts of the wrong keys that each client address has sent.
    pub(crate) guesses: Arc<Guesses>,
    /// Pool of permits for requests that are being refused, or whose key this process does not know yet.
    strangers: Places,
}

/// Longest time for which a request waits until its client address may look up a key. Raising it lets requests wait for
/// longer while the database does not answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// Outcome of checking the key of a request, with the permits that the request holds until its answer is decided.
#[derive(Debug)]
pub(crate) enum Verdict {
    /// The key was checked. Holds the result and, if the database had to be asked, the permits of the request.
    Judged(Judged, Option<(Turn, Place)>),
    /// The key was not looked up, because it is not a remembered one and its client address has sent too many wrong
    /// keys. Holds the time after which the address may try again.
    Unasked(Duration),
    /// The key was not looked up, because look-ups for its client address have not ended in time.
    Late,
    /// The key was not looked up, because too many requests with unknown keys are under way.
    Full(Full),
}

impl Guard {
    pub(crate) fn new(mode: AuthMode, is_insecure: bool, limits: &Limits) -> Arc<Self> {
        let guesses = Guesses::new(limits.wrong_keys);
        let strangers = Places::new("requests with unknown keys", limits.requests, limits.requests_each);
        Arc::new(Self { mode, is_insecure, decisions: Decisions::default(), guesses, strangers })
    }

    /// Takes a permit for a request that is being refused, or whose key this process does not know.
    pub(crate) fn stranger(&self, peer: Peer) -> Result<Place, Full> {
        self.strangers.take(peer, 1)
    }

    /// Judges a key by its id and, unless something else proves that the caller has it, the hash of its secret. One
    /// address may have as many look-ups of unknown keys under way as it may still send wrong keys, so that parallel
    /// guesses are as limited as successive ones.
    pub(crate) async fn judge(
        &self,
        catalog: &Catalog,
        peer: Peer,
        id: KeyId,
        hash: Option<SecretHash>,
    ) -> Result<Verdict, CatalogError> {
        if let Some(judged) = self.decisions.remembered(catalog, id, hash).await? {
            return Ok(Verdict::Judged(judged, None));
        }
        let place = match self.stranger(peer) {
            Ok(place) => place,
            Err(full) => return Ok(Verdict::Full(full)),
        };
        let turn = match tokio::time::timeout(PATIENCE, self.guesses.turn(peer)).await {
            Ok(Ok(turn)) => turn,
            Ok(Err(wait)) => return Ok(Verdict::Unasked(wait)),
            Err(_) => return Ok(Verdict::Late),
        };
        // Another request with this key may have asked meanwhile.
        let judged = match self.decisions.remembered(catalog, id, hash).await? {
            Some(judged) => judged,
            None => self.decisions.look_up(catalog, id, hash).await?,
        };
        Ok(Verdict::Judged(judged, Some((turn, place))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;
    use crate::trust::Key;
    use metrics_exporter_prometheus::PrometheusBuilder;
    use std::time::Instant;

    /// Judges the access keys `keys` at once, as requests of one client address would. Returns how many are right, how
    /// many wrong, and how many are not looked up because the address has sent too many wrong ones.
    async fn judged(guard: &Guard, catalog: &Catalog, peer: Peer, keys: &[Key]) -> [usize; 3] {
        let judged = futures::future::join_all(keys.iter().map(async |key| {
            match guard.judge(catalog, peer, key.id(), Some(key.secret().hash())).await.unwrap() {
                Verdict::Judged(Judged::Known(_), _) => 0,
                Verdict::Judged(Judged::Wrong, held) => {
                    guard.guesses.count(peer, Instant::now());
                    drop(held);
                    1
                }
                Verdict::Unasked(wait) => {
                    assert!(!wait.is_zero());
                    2
                }
                other => panic!("{other:?}"),
            }
        }));
        let mut counts = [0; 3];
        judged.await.into_iter().for_each(|kind| counts[kind] += 1);
        counts
    }

    #[test]
    fn guesses_that_come_at_once_ask_the_database_no_more_often_than_ten_and_nobody_else_waits() {
        let recorder = PrometheusBuilder::new().build_recorder();
        let look_ups = || {
            let text = recorder.handle().render();
            let line = text.lines().find_map(|line| line.strip_prefix("wavelume_key_lookups_total "));
            line.map_or(0, |number| number.parse::<u64>().unwrap())
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let peer = |last: u8| Peer::of([10, 0, 0, last].into());
        metrics::with_local_recorder(&recorder, || {
            runtime.block_on(async {
                for (catalog, _guard) in testing::catalogs().await {
                    let guard = Guard::new(AuthMode::Keys, false, &Limits::default());
                    let right = testing::key(&catalog, Duration::from_hours(1)).await;
                    let wrong: Vec<Key> = (0..200).map(|_| Key::generate().unwrap()).collect();
                    let before = look_ups();
                    assert_eq!(judged(&guard, &catalog, peer(1), &wrong).await, [0, 10, 190]);
                    assert_eq!(look_ups() - before, 10);
                    assert_eq!(judged(&guard, &catalog, peer(1), &wrong).await, [0, 0, 200]);
                    assert_eq!(look_ups() - before, 10, "and no more within the minute");
                    // A key that is not known yet asks from another address, once for all its requests at once.
                    let same: Vec<Key> = (0..200).map(|_| right.reveal().parse().unwrap()).collect();
                    assert_eq!(judged(&guard, &catalog, peer(2), &same).await, [200, 0, 0]);
                    assert!((11..=20).contains(&(look_ups() - before)), "{}", look_ups() - before);
                    assert_eq!(judged(&guard, &catalog, peer(1), &same).await, [200, 0, 0], "it is known now");
                    assert_eq!(guard.strangers.taken(), 0);
                }
            });
        });
    }

    #[tokio::test]
    async fn many_right_keys_of_one_address_take_turns_and_none_is_refused() {
        for (catalog, _guard) in testing::catalogs().await {
            let guard = Guard::new(AuthMode::Keys, false, &Limits::default());
            let mut keys = Vec::new();
            for _ in 0..40 {
                keys.push(testing::key(&catalog, Duration::from_hours(1)).await);
            }
            assert_eq!(judged(&guard, &catalog, Peer::of([10, 0, 0, 1].into()), &keys).await, [40, 0, 0]);
        }
    }
}
