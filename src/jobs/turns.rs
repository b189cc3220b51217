//! Turns at a scarce resource, assigned client by client: a client with many requests delays itself, not others.

use crate::trust::Tenant;
use std::collections::{HashMap, VecDeque};
use std::hash::Hash;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

tokio::task_local! {
    /// Client that the running task works for; all tasks without a client count as one client.
    static CLIENT: Client;
}

/// Client to whom limits apply and who takes turns with others: an address, and in a service with keys the tenant whose
/// key it has sent.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Client {
    /// IP address of the client.
    pub address: IpAddr,
    /// Tenant whose key the client has sent, or the tenant that owns nothing if it has sent none; `None` in a service
    /// without keys.
    pub tenant: Option<Tenant>,
}

/// Permits to use a scarce resource. Tenants that wait get one in rotation, and so do the addresses of one tenant; the
/// requests of one address are served in order of arrival.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    shared: Arc<Mutex<Waiting>>,
}

/// Waiting requests of one address.
type Requests = VecDeque<oneshot::Sender<Turn>>;

#[derive(Debug)]
struct Waiting {
    free: usize,
    /// Requests that wait for a permit to use a scarce resource, by tenant and then by address.
    tenants: Rotation<Option<Tenant>, Rotation<IpAddr, Requests>>,
}

/// Set of queues that are served in rotation.
#[derive(Debug)]
struct Rotation<K, Q> {
    /// Keys of the queues in the order in which the queues are served, the next one first.
    order: VecDeque<K>,
    queues: HashMap<K, Q>,
}

/// Permit to use a scarce resource; dropping it passes it to the next waiting request.
#[derive(Debug)]
pub(super) struct Turn {
    /// Pool from which this permit to use a scarce resource was taken; `None` once the permit was passed to another
    /// request.
    turns: Option<Turns>,
}

impl Client {
    /// Returns the client that the running task works for, if it works for one.
    pub(super) fn current() -> Option<Self> {
        CLIENT.try_with(Self::clone).ok()
    }

    /// Returns a client of a service without keys.
    pub(crate) fn at(address: IpAddr) -> Self {
        Self { address, tenant: None }
    }

    /// Runs `work` on behalf of this client, so that its computations take turns with those of other clients.
    pub(crate) fn on_behalf<T>(self, work: impl Future<Output = T>) -> impl Future<Output = T> {
        CLIENT.scope(self, work)
    }
}

/// Returns the amount of `all`, the limit over all addresses, that one tenant may use. It leaves the limit of one
/// address, `each`, to other tenants, but at most half of `all`.
pub(crate) fn most_of_tenant(all: u64, each: u64) -> u64 {
    all - each.min(all / 2)
}

impl<K, Q> Default for Rotation<K, Q> {
    fn default() -> Self {
        Self { order: VecDeque::new(), queues: HashMap::new() }
    }
}

impl<K: Clone + Eq + Hash, Q: Default> Rotation<K, Q> {
    /// Returns the queue of `key`. A new queue is served after all others.
    fn queue(&mut self, key: &K) -> &mut Q {
        if !self.queues.contains_key(key) {
            self.order.push_back(key.clone());
        }
        self.queues.entry(key.clone()).or_default()
    }

    /// Returns the first value that `take` gets from a queue, in the order of the rotation, and moves this queue to its
    /// end. Removes the queues before it, from which `take` gets nothing.
    fn next<T>(&mut self, take: impl Fn(&mut Q) -> Option<T>) -> Option<T> {
        while let Some(key) = self.order.pop_front() {
            if let Some(next) = self.queues.get_mut(&key).and_then(&take) {
                self.order.push_back(key);
                return Some(next);
            }
            self.queues.remove(&key);
        }
        None
    }
}

impl Turns {
    pub(super) fn new(count: usize) -> Self {
        Self { shared: Arc::new(Mutex::new(Waiting { free: count, tenants: Rotation::default() })) }
    }

    /// Waits for a permit to use a scarce resource, in the queue of the client on whose behalf the current async task
    /// runs.
    pub(super) async fn take(&self) -> Turn {
        let unknown = || Client::at(IpAddr::V4(Ipv4Addr::UNSPECIFIED));
        let Client { address, tenant } = Client::current().unwrap_or_else(unknown);
        let receive = {
            let mut waiting = self.waiting();
            if waiting.free > 0 {
                waiting.free -= 1;
                return Turn { turns: Some(self.clone()) };
            }
            let (send, receive) = oneshot::channel();
            waiting.tenants.queue(&tenant).queue(&address).push_back(send);
            receive
        };
        // The sender is kept until it is used.
        receive.await.unwrap_or(Turn { turns: None })
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the waiting request that gets the next permit. If none is waiting, the permit becomes free.
    fn next(&self) -> Option<oneshot::Sender<Turn>> {
        let mut waiting = self.waiting();
        // Requests whose task has gone are skipped.
        let first =
            |requests: &mut Requests| std::iter::from_fn(|| requests.pop_front()).find(|request| !request.is_closed());
        let next = waiting.tenants.next(|addresses| addresses.next(first));
        if next.is_some() {
            return next;
        }
        waiting.free += 1;
        None
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let Some(turns) = self.turns.take() else { return };
        while let Some(next) = turns.next() {
            // A receiver dropped at this moment returns the turn unused.
            let Err(mut turn) = next.send(Turn { turns: Some(turns.clone()) }) else { return };
            turn.turns = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_client_that_asks_for_much_waits_behind_itself() {
        let turns = Turns::new(1);
        let held = turns.take().await;
        let (send, mut order) = tokio::sync::mpsc::unbounded_channel();
        let ask = |last: u8| {
            let (turns, send) = (turns.clone(), send.clone());
            tokio::spawn(Client::at(IpAddr::from([10, 0, 0, last])).on_behalf(async move {
                let turn = turns.take().await;
                send.send(last).unwrap();
                drop(turn);
            }))
        };
        let mut asked = Vec::new();
        for last in [1, 1, 1, 1, 2, 3, 2] {
            asked.push(ask(last));
            tokio::task::yield_now().await;
        }
        // One that leaves is passed over.
        asked[1].abort();
        while !asked[1].is_finished() {
            tokio::task::yield_now().await;
        }
        drop(held);
        let mut got = Vec::new();
        for _ in 0..6 {
            got.push(order.recv().await.unwrap());
        }
        assert_eq!(got, [1, 2, 3, 1, 2, 1]);
        for ended in asked {
            let _ = ended.await;
        }
        let waiting = turns.waiting();
        assert_eq!((waiting.free, waiting.tenants.order.len(), waiting.tenants.queues.len()), (1, 0, 0));
    }

    #[tokio::test]
    async fn a_tenant_with_many_addresses_takes_no_more_turns_than_another() {
        let turns = Turns::new(1);
        let held = turns.take().await;
        let (send, mut order) = tokio::sync::mpsc::unbounded_channel();
        let mut asked = Vec::new();
        for (tenant, last) in [("many", 1), ("many", 1), ("many", 2), ("many", 3), ("few", 9), ("few", 9), ("few", 9)] {
            let client = Client { tenant: tenant.parse().ok(), ..Client::at(IpAddr::from([10, 0, 0, last])) };
            let (turns, send) = (turns.clone(), send.clone());
            asked.push(tokio::spawn(client.on_behalf(async move {
                let turn = turns.take().await;
                send.send(last).unwrap();
                drop(turn);
            })));
            tokio::task::yield_now().await;
        }
        drop(held);
        let mut got = Vec::new();
        for _ in 0..7 {
            got.push(order.recv().await.unwrap());
        }
        assert_eq!(got, [1, 9, 2, 9, 3, 9, 1]);
        for ended in asked {
            ended.await.unwrap();
        }
    }
}
