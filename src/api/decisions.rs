//! Decisions about the validity and rights of access keys, each remembered in this process for at most four seconds.

use crate::catalog::{Catalog, CatalogError, Credential};
use crate::trust::{KeyFacts, KeyId, Scopes, SecretHash, Tenant, Verifier};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time for which a decision about the validity of an access key is remembered. Raising it spares the database, but
/// delays the effect of a revocation on other nodes: together with [`LOOK`] it must stay below the promised 5 s.
const BELIEVED: Duration = Duration::from_secs(4);

/// Interval at which the service checks, while a request is under way or its long answer is sent, that the key of the
/// request is still valid. Raising it saves checks, but lets the request go on for longer after a revocation.
const LOOK: Duration = Duration::from_millis(500);

/// Age of a remembered decision about a key at which one request asks the database again, while the others still use
/// the decision. Lowering it asks more often; above [`BELIEVED`] all requests with a key would ask at once when the
/// decision runs out.
const RENEWED: Duration = Duration::from_millis(2500);

/// Upper bound on the number of keys whose validity is remembered. Raising it costs memory, some 200 bytes for each.
const KEYS: usize = 10_000;

/// Part of the remembered keys that is dropped once there are [`KEYS`]: one in this number. Raising it drops fewer at a
/// time, and searches all of them more often.
const DROPPED: usize = 10;

/// Memory of the decisions about the validity and rights of access keys.
#[derive(Debug, Default)]
pub(crate) struct Decisions {
    known: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    by: HashMap<KeyId, Remembered>,
    /// Number of times that a decision about a key was dropped because the key was changed. A database answer that was
    /// requested before the latest drop is not remembered.
    dropped: u64,
}

#[derive(Debug)]
struct Remembered {
    hash: SecretHash,
    decision: Decision,
    renewed: Instant,
    until: Instant,
}

/// Decision about an existing access key, shared by all requests that present the key.
pub(crate) type Decision = Arc<Rights>;

/// Rights of an existing access key, and the state (valid, expired, revoked or closed) on which they depend.
#[derive(Debug)]
pub(crate) struct Rights {
    /// Tenant for which the key acts.
    pub(crate) tenant: Tenant,
    /// Scopes of the key: what it allows.
    pub(crate) scopes: Scopes,
    /// State of the key when the database was asked.
    pub(crate) state: KeyState,
    verifier: Option<Verifier>,
    expires_ms: Option<i64>,
}

/// State of an existing access key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KeyState {
    /// The access key is valid.
    Valid,
    /// The access key has expired.
    Expired,
    /// The access key was revoked.
    Revoked,
    /// The access key is valid, but its tenant is closed.
    Closed,
}

/// Outcome of checking the access key that a request presents.
#[derive(Clone, Debug)]
pub(crate) enum Judged {
    /// An access key with the presented id exists, and its secret is the presented one, if one was presented.
    Known(Decision),
    /// No key has the presented id, or the presented secret is wrong.
    Wrong,
}

/// Outcome of looking for an access key among the remembered ones, before the database is asked.
enum Recalled {
    Fresh(Decision),
    /// The database is to be asked about the key again. If it does not answer, the remembered decision holds until the
    /// given time; `None` if that time is over.
    Due(Option<(Decision, Instant)>),
    Wrong,
    Unknown,
}

impl Decisions {
    /// Judges a key that this process knows, by its id and, unless something else proves that the caller has it, the
    /// hash of its secret. Returns `None` for a key that it does not know: anybody may have made it up.
    pub(crate) async fn remembered(
        &self,
        catalog: &Catalog,
        id: KeyId,
        hash: Option<SecretHash>,
    ) -> Result<Option<Judged>, CatalogError> {
        let before = match self.recall(id, hash, Instant::now()) {
            Recalled::Fresh(decision) => return Ok(Some(Judged::Known(decision))),
            Recalled::Wrong => return Ok(Some(Judged::Wrong)),
            Recalled::Unknown => return Ok(None),
            Recalled::Due(before) => before,
        };
        match (self.look_up(catalog, id, hash).await, before) {
            (Err(_), Some((before, until))) if Instant::now() < until => Ok(Some(Judged::Known(before))),
            (judged, _) => judged.map(Some),
        }
    }

    /// Looks up an access key in the database. Returns that it is wrong if there is no key `id` or its secret does not
    /// have the hash `hash`, otherwise the rights of the key.
    pub(crate) async fn look_up(
        &self,
        catalog: &Catalog,
        id: KeyId,
        hash: Option<SecretHash>,
    ) -> Result<Judged, CatalogError> {
        let found = self.ask(catalog, id).await?;
        let Some(found) = found.filter(|found| hash.is_none_or(|hash| hash == found.hash)) else {
            return Ok(Judged::Wrong);
        };
        let decision = Rights::of(&found);
        if found.is_use_old && decision.state == KeyState::Valid {
            let catalog = catalog.clone();
            tokio::spawn(async move {
                if let Err(error) = catalog.note_use(id).await {
                    tracing::warn!(%error, key = %id, "the time of the last use of a key was not recorded");
                }
            });
        }
        Ok(Judged::Known(decision))
    }

    /// Resolves when the key of a request under way is no longer valid, or at `end`, when the token or link made from
    /// it expires, and returns why. A valid key counts as valid while the database does not answer.
    pub(crate) async fn lost(&self, catalog: &Catalog, key: KeyId, end: Option<Instant>) -> KeyState {
        loop {
            let next = Instant::now() + LOOK;
            tokio::time::sleep_until(end.map_or(next, |end| end.min(next)).into()).await;
            if end.is_some_and(|end| Instant::now() >= end) {
                return KeyState::Expired;
            }
            match self.state(catalog, key).await {
                KeyState::Valid => {}
                lost => return lost,
            }
        }
    }

    /// Returns the state of a key, as far as the process knows or the database says. A key that is gone was revoked.
    async fn state(&self, catalog: &Catalog, id: KeyId) -> KeyState {
        let judged = match self.remembered(catalog, id, None).await {
            Ok(None) => self.look_up(catalog, id, None).await,
            Ok(Some(judged)) => Ok(judged),
            Err(error) => Err(error),
        };
        match judged {
            Ok(Judged::Known(rights)) => rights.state,
            Ok(Judged::Wrong) => KeyState::Revoked,
            Err(_) => KeyState::Valid,
        }
    }

    /// Drops the remembered decision about a key, because the key was changed in this process.
    pub(crate) fn forget(&self, id: KeyId) {
        let mut known = self.known();
        known.dropped += 1;
        known.by.remove(&id);
    }

    fn recall(&self, id: KeyId, hash: Option<SecretHash>, now: Instant) -> Recalled {
        let mut known = self.known();
        let Some(entry) = known.by.get_mut(&id) else { return Recalled::Unknown };
        if hash.is_some_and(|hash| hash != entry.hash) {
            return Recalled::Wrong;
        }
        if now < entry.renewed {
            return Recalled::Fresh(entry.decision.clone());
        }
        if now >= entry.until {
            return Recalled::Due(None);
        }
        // The others go on with what is remembered.
        entry.renewed = entry.until;
        Recalled::Due(Some((entry.decision.clone(), entry.until)))
    }

    async fn ask(&self, catalog: &Catalog, id: KeyId) -> Result<Option<Credential>, CatalogError> {
        let (start, dropped) = (Instant::now(), self.known().dropped);
        metrics::counter!("wavelume_key_lookups_total").increment(1);
        let found = catalog.credential(id).await?;
        let mut known = self.known();
        let Some(credential) = &found else {
            known.by.remove(&id);
            return Ok(None);
        };
        if known.dropped != dropped {
            return Ok(found);
        }
        let (hash, decision) = (credential.hash, Rights::of(credential));
        let left = if decision.state == KeyState::Valid { credential.left } else { BELIEVED };
        let (renewed, until) = (start + RENEWED.min(left), start + BELIEVED.min(left));
        if known.by.len() >= KEYS && !known.by.contains_key(&id) {
            known.by.retain(|_, entry| start < entry.until);
            // Keys of one tenant may fill the list: most keys of the others stay.
            let mut number = 0;
            let is_full = known.by.len() >= KEYS;
            known.by.retain(|_, _| {
                number += 1;
                !is_full || number % DROPPED != 0
            });
        }
        known.by.insert(id, Remembered { hash, decision, renewed, until });
        Ok(found)
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Rights {
    fn of(credential: &Credential) -> Decision {
        let row = &credential.row;
        let state = match row.revoked_ms {
            Some(_) => KeyState::Revoked,
            None if credential.left.is_zero() => KeyState::Expired,
            None if credential.is_closed => KeyState::Closed,
            None => KeyState::Valid,
        };
        Arc::new(Self {
            tenant: row.tenant.clone(),
            scopes: row.scopes,
            state,
            verifier: credential.verifier,
            expires_ms: row.expires_ms,
        })
    }

    /// Returns the time at which the key expires, in Unix seconds; `None` if it does not expire.
    pub(crate) fn until(&self) -> Option<u64> {
        self.expires_ms.map(|ms| ms.max(0) as u64 / 1000)
    }

    /// Returns the data of an access key by which tokens and links made from it are verified: scopes, verifier, end and
    /// revocation. `None` if no token or link can be made from the key.
    pub(crate) fn facts(&self) -> Option<KeyFacts> {
        Some(KeyFacts {
            scopes: self.scopes,
            verifier: self.verifier?,
            expires: self.until(),
            is_revoked: self.state == KeyState::Revoked,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Act, Revoked, testing};
    use crate::trust::Key;

    async fn judged(decisions: &Decisions, catalog: &Catalog, key: &Key) -> &'static str {
        match judge(decisions, catalog, key.id(), Some(key.secret().hash())).await {
            Judged::Known(rights) => match rights.state {
                KeyState::Valid => "valid",
                KeyState::Expired => "expired",
                KeyState::Revoked => "revoked",
                KeyState::Closed => "closed",
            },
            Judged::Wrong => "wrong",
        }
    }

    async fn judge(decisions: &Decisions, catalog: &Catalog, id: KeyId, hash: Option<SecretHash>) -> Judged {
        match decisions.remembered(catalog, id, hash).await.unwrap() {
            Some(judged) => judged,
            None => decisions.look_up(catalog, id, hash).await.unwrap(),
        }
    }

    #[tokio::test]
    async fn a_decision_is_remembered_and_dropped_at_once_in_the_process_that_revokes() {
        for (catalog, _guard) in testing::catalogs().await {
            let (here, elsewhere) = (Decisions::default(), Decisions::default());
            let key = testing::key(&catalog, Duration::from_hours(1)).await;
            for decisions in [&here, &elsewhere] {
                assert_eq!(judged(decisions, &catalog, &key).await, "valid");
            }
            assert_eq!(catalog.revoke_key(key.id(), None, &Act::default()).await.unwrap(), Revoked::Done);
            here.forget(key.id());
            assert_eq!(judged(&here, &catalog, &key).await, "revoked");
            assert_eq!(here.state(&catalog, key.id()).await, KeyState::Revoked);
            assert_eq!(judged(&elsewhere, &catalog, &key).await, "valid", "remembered for a moment");
            let until = elsewhere.known().by[&key.id()].until;
            assert!(until <= Instant::now() + BELIEVED);
            assert!(matches!(elsewhere.recall(key.id(), None, until), Recalled::Due(None)));
        }
    }

    #[tokio::test]
    async fn wrong_secrets_and_unknown_keys_are_wrong_and_a_wrong_one_of_a_known_key_asks_nobody() {
        for (catalog, _guard) in testing::catalogs().await {
            let decisions = Decisions::default();
            let (key, other) = (testing::key(&catalog, Duration::from_hours(1)).await, Key::generate().unwrap());
            assert_eq!(judged(&decisions, &catalog, &other).await, "wrong");
            let wrong = Some(other.secret().hash());
            for _ in 0..2 {
                let judged = judge(&decisions, &catalog, key.id(), wrong).await;
                assert!(matches!(judged, Judged::Wrong));
            }
            let unasked = decisions.remembered(&catalog, other.id(), wrong).await.unwrap();
            assert!(unasked.is_none());
            // The right one is known meanwhile.
            let right = Some(key.secret().hash());
            let known = decisions.remembered(&catalog, key.id(), right).await.unwrap();
            assert!(matches!(known, Some(Judged::Known(_))));
            catalog.close().await;
            let known = decisions.remembered(&catalog, key.id(), right).await.unwrap();
            assert!(matches!(known, Some(Judged::Known(_))), "without the database");
        }
    }

    #[tokio::test]
    async fn an_expired_key_is_not_remembered_beyond_its_time() {
        for (catalog, _guard) in testing::catalogs().await {
            let decisions = Decisions::default();
            let key = testing::key(&catalog, Duration::from_millis(700)).await;
            assert_eq!(judged(&decisions, &catalog, &key).await, "valid");
            assert!(decisions.known().by[&key.id()].until <= Instant::now() + Duration::from_millis(700));
            tokio::time::sleep(Duration::from_millis(800)).await;
            assert_eq!(judged(&decisions, &catalog, &key).await, "expired");
        }
    }

    #[tokio::test]
    async fn one_request_renews_a_decision_while_the_others_use_it() {
        let (catalog, _guard) = testing::catalogs().await.remove(0);
        let decisions = Decisions::default();
        let key = testing::key(&catalog, Duration::from_hours(1)).await;
        judged(&decisions, &catalog, &key).await;
        let due = decisions.known().by[&key.id()].renewed;
        assert!(matches!(decisions.recall(key.id(), None, due), Recalled::Due(Some(_))));
        assert!(matches!(decisions.recall(key.id(), None, due), Recalled::Fresh(_)));
    }

    #[tokio::test]
    async fn many_keys_of_one_tenant_displace_few_of_the_others() {
        let (catalog, _guard) = testing::catalogs().await.remove(0);
        let decisions = Decisions::default();
        let key = testing::key(&catalog, Duration::from_hours(1)).await;
        judged(&decisions, &catalog, &key).await;
        {
            let mut known = decisions.known();
            let Remembered { hash, decision, renewed, until } = known.by.remove(&key.id()).unwrap();
            while known.by.len() < KEYS {
                let decision = decision.clone();
                known.by.insert(Key::generate().unwrap().id(), Remembered { hash, decision, renewed, until });
            }
        }
        judged(&decisions, &catalog, &key).await;
        assert_eq!(decisions.known().by.len(), KEYS - KEYS / DROPPED + 1);
    }
}
