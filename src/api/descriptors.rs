//! Limit on file descriptors: raised to the hard limit, and connection and request places fitted to it.

use crate::jobs::{Finding, Limits};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// File descriptors reserved for the process itself: listener, catalog, logs, locks, runtime. Raising it leaves fewer
/// for connections and requests.
const OWN: u64 = 128;

/// Number of file descriptors that one upload needs: its staging file, and a file that it is unpacked to.
const UPLOAD: u64 = 2;

/// Raises the soft limit on open file descriptors of this process to its hard limit.
pub(crate) fn raise_descriptor_limit() {
    let limit = getrlimit(Resource::Nofile);
    if limit.current == limit.maximum {
        return;
    }
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, maximum: limit.maximum }) {
        tracing::warn!(%error, limit = limit.current, "the soft limit on open file descriptors could not be raised");
    }
}

/// Returns the soft limit on open file descriptors of this process; `None` means unlimited.
pub(crate) fn limit() -> Option<u64> {
    getrlimit(Resource::Nofile).current
}

/// Checks that the hard limit on open file descriptors of this process suffices for the set limits on connections and
/// requests. `serve` raises the soft limit to the hard one.
pub(crate) fn descriptors_found(limits: &Limits) -> Finding {
    const CHECK: &str = "local descriptors";
    let count = |number: usize| number as u64;
    let needed = held_apart(limits) + count(limits.connections) + count(limits.requests);
    match getrlimit(Resource::Nofile).maximum {
        None => Finding::ok(CHECK, format!("unlimited, {needed} needed")),
        Some(limit) if limit >= needed => Finding::ok(CHECK, format!("{limit} allowed, {needed} needed")),
        Some(limit) => Finding::warning(
            CHECK,
            format!(
                "{limit} descriptors allowed, {needed} needed: serve lowers the limits on connections and requests"
            ),
            "raise the hard limit with `ulimit -Hn` or LimitNOFILE, if this process has the limit of the service",
        ),
    }
}

/// Returns the number of file descriptors that are needed besides those of connections and requests.
fn held_apart(limits: &Limits) -> u64 {
    OWN + UPLOAD * limits.uploads as u64 + limits.health_connections as u64
}

/// Lowers the limits of connections and requests until the file descriptors suffice for all of them. A request needs a
/// descriptor for the file that it sends, besides that of its connection.
pub(crate) fn fit(limits: &mut Limits, descriptors: u64) {
    let count = |number: usize| number as u64;
    let left = descriptors.saturating_sub(held_apart(limits)).max(48);
    if count(limits.connections) + count(limits.requests) <= left {
        return;
    }
    let connections = limits.connections.min((left * 2 / 3) as usize);
    let requests = limits.requests.min((left - count(connections)) as usize);
    tracing::warn!(
        descriptors,
        connections,
        requests,
        "the limit on open file descriptors lowers the limits on connections and requests: raise it with `ulimit -n` \
         or LimitNOFILE"
    );
    limits.connections = connections;
    limits.requests = requests;
    // One address gets at most half of the places, even when there are few.
    limits.connections_each = limits.connections_each.min(connections.div_ceil(2));
    limits.requests_each = limits.requests_each.min(requests.div_ceil(2));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_fitted_to_the_descriptors() {
        let mut limits = Limits::default();
        fit(&mut limits, 1 << 20);
        assert_eq!(limits, Limits::default());
        for descriptors in [1024, 512, 256] {
            let mut limits = Limits::default();
            fit(&mut limits, descriptors);
            let held = limits.connections + limits.requests + limits.health_connections + 2 * limits.uploads;
            assert!(held as u64 + OWN <= descriptors.max(304), "{descriptors}: {held}");
            assert!(limits.connections >= 32 && limits.connections_each * 2 <= limits.connections + 1, "{limits:?}");
        }
    }
}
