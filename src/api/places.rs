//! Permits that clients hold (for example, for simultaneous uploads), counted per address, per tenant and in total.

use super::problem::{Kind, Problem};
use crate::jobs::{Client, most_of_tenant};
use crate::trust::Tenant;
use axum::extract::FromRequestParts;
use axum::http::{Extensions, request::Parts};
use std::collections::HashMap;
use std::convert::Infallible;
use std::hash::Hash;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Number of bytes for which one permit of a memory limit stands.
pub(crate) const KIB: usize = 1024;

/// Client to whom limits apply: an IPv4 address, or the /64 of an IPv6 address, which belongs to one subscriber.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Peer(IpAddr);

impl Peer {
    pub(crate) fn of(address: IpAddr) -> Self {
        Self(match address.to_canonical() {
            IpAddr::V6(address) => {
                let [a, b, c, d, ..] = address.segments();
                IpAddr::V6(Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0))
            }
            v4 @ IpAddr::V4(_) => v4,
        })
    }

    /// Builds the client for an address that is already normalised: IPv6 addresses have only their first 64 bits.
    pub(crate) fn at(address: IpAddr) -> Self {
        Self(address)
    }

    /// Returns the client that the listener stored in the request. Requests without a listener share one client.
    pub(crate) fn of_extensions(extensions: &Extensions) -> Self {
        extensions.get().copied().unwrap_or(Self(IpAddr::V4(Ipv4Addr::UNSPECIFIED)))
    }
}

impl std::fmt::Display for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            IpAddr::V4(address) => address.fmt(f),
            IpAddr::V6(address) => write!(f, "{address}/64"),
        }
    }
}

impl<S: Sync> FromRequestParts<S> for Peer {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(Self::of_extensions(&parts.extensions))
    }
}

impl From<Peer> for Client {
    fn from(peer: Peer) -> Self {
        Self::at(peer.0)
    }
}

/// Pool of permits of one kind (for example, simultaneous uploads), limited in total, per address and per tenant. Two
/// tenants at one address are counted apart. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    kind: &'static str,
    all: usize,
    each: usize,
    taken: Mutex<Taken>,
}

/// Numbers of permits of a pool (for example, for simultaneous uploads) that are taken: in total, by client, and by
/// tenant. Whoever has no permit has no entry, so that no map has more entries than there are permits.
#[derive(Debug, Default)]
struct Taken {
    all: usize,
    by: HashMap<Client, usize>,
    tenants: HashMap<Tenant, usize>,
}

/// One or more permits taken from a pool, which are returned when this is dropped.
#[derive(Debug)]
#[must_use]
pub(crate) struct Place {
    shared: Arc<Shared>,
    client: Client,
    count: usize,
}

/// Refusal of a permit from a pool: the bound on all permits, on those of the client's address or on those of its
/// tenant is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Full {
    All { kind: &'static str, limit: usize },
    Each { kind: &'static str, limit: usize, peer: Peer },
    Tenant { kind: &'static str, limit: usize },
}

impl Places {
    /// Creates a pool of `all` permits, of which one address gets at most `each`, and one tenant
    /// [most of them](most_of_tenant). `kind` names the pool in messages and metrics.
    pub(crate) fn new(kind: &'static str, all: usize, each: usize) -> Self {
        Self { shared: Arc::new(Shared { kind, all, each, taken: Mutex::default() }) }
    }

    /// Takes `count` permits of the pool for a client, all together or none.
    pub(crate) fn take(&self, client: impl Into<Client>, count: usize) -> Result<Place, Full> {
        let client = client.into();
        self.shared.take(&client, count)?;
        Ok(Place { shared: Arc::clone(&self.shared), client, count })
    }

    /// Returns the number of permits of this pool (for example, for simultaneous uploads) that all clients together
    /// hold.
    pub(crate) fn taken(&self) -> usize {
        self.shared.taken().all
    }

    /// Returns the name of a pool of permits and the number of permits taken, for metrics.
    pub(crate) fn figure(&self) -> (&'static str, usize) {
        (self.shared.kind, self.taken())
    }
}

impl Place {
    /// Takes `count` permits (for example, for simultaneous uploads) from the pool in addition to those already held:
    /// all of them or none.
    pub(crate) fn grow(&mut self, count: usize) -> Result<(), Full> {
        self.shared.take(&self.client, count)?;
        self.count += count;
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.shared.give_back(&self.client, self.count);
    }
}

impl Shared {
    fn taken(&self) -> MutexGuard<'_, Taken> {
        // The counts are consistent whenever the lock is free, whoever panicked meanwhile.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, client: &Client, count: usize) -> Result<(), Full> {
        let most = most_of_tenant(self.all as u64, self.each as u64) as usize;
        let refused = {
            let mut taken = self.taken();
            let own = taken.by.get(client).copied().unwrap_or(0);
            let tenants = client.tenant.as_ref().map(|tenant| taken.tenants.get(tenant).copied().unwrap_or(0));
            if count > self.all.saturating_sub(taken.all) {
                Full::All { kind: self.kind, limit: self.all }
            } else if count > self.each.saturating_sub(own) {
                Full::Each { kind: self.kind, limit: self.each, peer: Peer(client.address) }
            } else if tenants.is_some_and(|taken| taken > 0 && count > most.saturating_sub(taken)) {
                // A tenant that holds nothing may need more for one request than it could hold for several.
                Full::Tenant { kind: self.kind, limit: most }
            } else {
                taken.all += count;
                if count > 0 {
                    taken.by.insert(client.clone(), own + count);
                    if let Some(tenant) = &client.tenant {
                        *taken.tenants.entry(tenant.clone()).or_default() += count;
                    }
                }
                return Ok(());
            }
        };
        let by = match refused {
            Full::All { .. } => "all",
            Full::Each { .. } => "address",
            Full::Tenant { .. } => "tenant",
        };
        metrics::counter!("wavelume_refused_total", "place" => self.kind, "by" => by).increment(1);
        Err(refused)
    }

    fn give_back(&self, client: &Client, count: usize) {
        let mut taken = self.taken();
        taken.all -= count;
        lower(&mut taken.by, client, count);
        if let Some(tenant) = &client.tenant {
            lower(&mut taken.tenants, tenant, count);
        }
    }
}

/// Lowers by `count` the number of permits that a client or tenant, `key`, holds. Removes its entry at zero.
fn lower<K: Eq + Hash>(numbers: &mut HashMap<K, usize>, key: &K, count: usize) {
    let Some(number) = numbers.get_mut(key) else { return };
    *number = number.saturating_sub(count);
    if *number == 0 {
        numbers.remove(key);
    }
}

impl From<Full> for Problem {
    fn from(full: Full) -> Self {
        match full {
            Full::All { kind, limit } => {
                Self::new(Kind::Overloaded, format!("all {limit} places for {kind} are taken; try again soon"))
            }
            Full::Each { kind, limit, peer } => Self::new(
                Kind::TooManyAtOnce,
                format!("{peer} holds all {limit} places for {kind} that one address may have; end one of them first"),
            ),
            Full::Tenant { kind, limit } => Self::new(
                Kind::TooManyAtOnce,
                format!("the tenant holds all {limit} places for {kind} that one may have; end one of them first"),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::response::IntoResponse;

    fn peer(address: &str) -> Peer {
        Peer::of(address.parse().unwrap())
    }

    #[test]
    fn a_peer_is_an_ipv4_address_or_the_64_of_an_ipv6_address() {
        assert_ne!(peer("127.0.0.1"), peer("127.0.0.2"));
        assert_eq!(peer("::ffff:127.0.0.1"), peer("127.0.0.1"));
        assert_eq!(peer("2001:db8:1:2::1"), peer("2001:db8:1:2:ffff::9"));
        assert_ne!(peer("2001:db8:1:2::1"), peer("2001:db8:1:3::1"));
        assert_eq!(peer("2001:db8:1:2::1").to_string(), "2001:db8:1:2::/64");
    }

    #[test]
    fn one_peer_leaves_places_to_the_others_and_all_together_have_an_end() {
        let places = Places::new("uploads", 5, 2);
        let (a, b, c) = (peer("10.0.0.1"), peer("10.0.0.2"), peer("10.0.0.3"));
        let first = [places.take(a, 1).unwrap(), places.take(a, 1).unwrap()];
        assert_eq!(places.take(a, 1).unwrap_err(), Full::Each { kind: "uploads", limit: 2, peer: a });
        let second = places.take(b, 2).unwrap();
        let third = places.take(c, 1).unwrap();
        assert_eq!(places.take(c, 1).unwrap_err(), Full::All { kind: "uploads", limit: 5 });
        drop(first);
        assert_eq!(places.taken(), 3);
        drop((second, third, places.take(c, 1).unwrap()));
        assert_eq!(places.taken(), 0);
        assert!(places.shared.taken().by.is_empty(), "clients without places are forgotten");
    }

    #[test]
    fn tenants_are_counted_apart_at_one_address_and_together_at_all() {
        let places = Places::new("uploads", 6, 2);
        let client = |tenant: &str, address: &str| Client { tenant: tenant.parse().ok(), ..peer(address).into() };
        let here = places.take(client("lab", "10.0.0.1"), 2).unwrap();
        assert!(matches!(places.take(client("lab", "10.0.0.1"), 1), Err(Full::Each { .. })));
        let theirs = places.take(client("other", "10.0.0.1"), 1).unwrap();
        let there = places.take(client("lab", "10.0.0.2"), 2).unwrap();
        let refused = places.take(client("lab", "10.0.0.3"), 1).unwrap_err();
        assert_eq!(refused, Full::Tenant { kind: "uploads", limit: 4 });
        drop((theirs, places.take(client("other", "10.0.0.1"), 1).unwrap()));
        assert_eq!(places.taken(), 4);
        drop(here);
        drop((there, places.take(client("lab", "10.0.0.3"), 2).unwrap()));
        let taken = places.shared.taken();
        assert!(taken.by.is_empty() && taken.tenants.is_empty());
        // As behind a proxy, whose address may have all.
        let places = Places::new("uploads", 6, 6);
        let _held = places.take(client("lab", "10.0.0.1"), 3).unwrap();
        assert!(matches!(places.take(client("lab", "10.0.0.1"), 1), Err(Full::Tenant { limit: 3, .. })));
        drop(places.take(client("other", "10.0.0.1"), 3).unwrap());
    }

    #[test]
    fn places_that_grow_are_given_back_whole_and_refused_growth_costs_nothing() {
        let places = Places::new("KiB of bodies", 10, 6);
        let mut place = places.take(peer("10.0.0.1"), 0).unwrap();
        place.grow(4).unwrap();
        place.grow(2).unwrap();
        assert!(matches!(place.grow(1), Err(Full::Each { .. })));
        assert!(matches!(places.take(peer("10.0.0.2"), 5), Err(Full::All { .. })));
        assert_eq!(places.taken(), 6);
        drop(place);
        assert_eq!(places.taken(), 0);
        assert!(places.shared.taken().by.is_empty());
    }

    #[test]
    fn the_clients_own_fault_and_the_services_load_are_told_apart() {
        let places = Places::new("streams", 1, 0);
        let refused = places.take(peer("10.0.0.1"), 1).unwrap_err();
        assert_eq!(Problem::from(refused).into_response().status(), 429);
        let places = Places::new("streams", 0, 0);
        let refused = places.take(peer("10.0.0.1"), 1).unwrap_err();
        assert_eq!(Problem::from(refused).into_response().status(), 503);
    }
}
