//! Turns at a scarce resource, assigned client by client: a client with many requests delays itself, not others.

use std::collections::{HashMap, VecDeque};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

tokio::task_local! {
    /// Address of the client that the running task works for; all tasks without a client count as one client.
    pub(crate) static CLIENT: IpAddr;
}

/// Permits to use a scarce resource. Waiting clients get one in rotation; the requests of one client are served in
/// order of arrival.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    shared: Arc<Mutex<Waiting>>,
}

#[derive(Debug)]
struct Waiting {
    free: usize,
    /// IP addresses of the clients that wait for a permit to use a scarce resource, the next one first. `queues` has
    /// the waiting requests of each.
    order: VecDeque<IpAddr>,
    queues: HashMap<IpAddr, VecDeque<oneshot::Sender<Turn>>>,
}

/// Permit to use a scarce resource; dropping it passes it to the next waiting request.
#[derive(Debug)]
pub(super) struct Turn {
    /// Pool from which this permit to use a scarce resource was taken; `None` once the permit was passed to another
    /// request.
    turns: Option<Turns>,
}

impl Turns {
    pub(super) fn new(count: usize) -> Self {
        Self { shared: Arc::new(Mutex::new(Waiting { free: count, order: VecDeque::new(), queues: HashMap::new() })) }
    }

    /// Waits for a permit to use a scarce resource, in the queue of the client on whose behalf the current async task
    /// runs.
    pub(super) async fn take(&self) -> Turn {
        let client = CLIENT.try_with(|client| *client).unwrap_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED));
        let receive = {
            let mut waiting = self.waiting();
            if waiting.free > 0 {
                waiting.free -= 1;
                return Turn { turns: Some(self.clone()) };
            }
            let (send, receive) = oneshot::channel();
            let queue = waiting.queues.entry(client).or_default();
            let is_first = queue.is_empty();
            queue.push_back(send);
            if is_first {
                waiting.order.push_back(client);
            }
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
        while let Some(client) = waiting.order.pop_front() {
            let Some(mut queue) = waiting.queues.remove(&client) else { continue };
            // Requests whose task has gone are skipped.
            queue.retain(|send| !send.is_closed());
            let Some(next) = queue.pop_front() else { continue };
            if !queue.is_empty() {
                waiting.queues.insert(client, queue);
                waiting.order.push_back(client);
            }
            return Some(next);
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
            tokio::spawn(CLIENT.scope(IpAddr::from([10, 0, 0, last]), async move {
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
        assert_eq!((waiting.free, waiting.order.len(), waiting.queues.len()), (1, 0, 0));
    }
}
