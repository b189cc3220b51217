//! Limits on the request rates of tenants: each tenant with a limit has a token bucket in this process, which fills
//! steadily.

use super::problem::{Kind, Problem};
use crate::catalog::Catalog;
use crate::trust::Tenant;
use axum::http::header;
use moka::future::Cache;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time for which the request limit of a tenant is remembered. Raising it asks the database less often, but applies
/// changes later.
const REMEMBERED: Duration = Duration::from_secs(4);

/// Longest time for which a request waits until the database returns the request limit of its tenant; after that, the
/// last known limit is used. Raising it delays requests further while the database does not answer.
const PATIENCE: Duration = Duration::from_millis(500);

/// Upper bound on the number of tenants whose request limits are remembered. Raising it takes memory in a service with
/// many tenants.
const LIMITS: u64 = 10_000;

/// Time within which the empty token bucket of a tenant fills up to its request limit.
const MINUTE: Duration = Duration::from_mins(1);

/// Request limits of tenants, and the number of requests that each of them may still send now.
#[derive(Debug)]
pub(crate) struct Rates {
    limits: Cache<Tenant, Option<u64>>,
    buckets: Mutex<HashMap<Tenant, Bucket>>,
}

/// Token bucket of a tenant with a request limit: the number of requests that it may still send now.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    /// Upper bound on the requests of the tenant within a minute, which is also the capacity of its bucket.
    limit: u64,
    left: f64,
    at: Instant,
}

impl Rates {
    pub(crate) fn new() -> Self {
        let limits = Cache::builder().max_capacity(LIMITS).time_to_live(REMEMBERED).build();
        Self { limits, buckets: Mutex::default() }
    }

    /// Counts a request of a tenant, or refuses it if the tenant has none left.
    pub(crate) async fn take(&self, catalog: &Catalog, tenant: &Tenant) -> Result<(), Problem> {
        let limit = self.limits.get_with_by_ref(tenant, self.limit(catalog, tenant)).await;
        let Some(limit) = limit else { return Ok(()) };
        let Some(wait) = self.draw(tenant, limit, Instant::now()) else { return Ok(()) };
        metrics::counter!("wavelume_refused_total", "place" => "requests within a minute", "by" => "tenant")
            .increment(1);
        // Rounded up: whoever asks again after this time is answered.
        let seconds = wait.as_secs() + 1;
        let detail = format!("the tenant may send {limit} requests a minute to this node; try again in {seconds} s");
        Err(Problem::new(Kind::TooManyRequests, detail).with(header::RETRY_AFTER, &seconds.to_string()))
    }

    /// Returns the request limit of a tenant, or the last known one if the database does not answer.
    async fn limit(&self, catalog: &Catalog, tenant: &Tenant) -> Option<u64> {
        match tokio::time::timeout(PATIENCE, catalog.most_requests(tenant)).await {
            Ok(Ok(limit)) => {
                if limit.is_none() {
                    self.buckets.lock().unwrap_or_else(PoisonError::into_inner).remove(tenant);
                }
                limit
            }
            _ => self.buckets.lock().unwrap_or_else(PoisonError::into_inner).get(tenant).map(|bucket| bucket.limit),
        }
    }

    /// Takes one request from the token bucket of a tenant. If the bucket is empty, returns the time until the next
    /// one.
    fn draw(&self, tenant: &Tenant, limit: u64, now: Instant) -> Option<Duration> {
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        let bucket = buckets.entry(tenant.clone()).or_insert(Bucket { limit, left: limit as f64, at: now });
        let each = MINUTE.as_secs_f64() / limit as f64;
        let more = now.saturating_duration_since(bucket.at).as_secs_f64() / each;
        *bucket = Bucket { limit, left: (bucket.left + more).min(limit as f64), at: now };
        if bucket.left >= 1.0 {
            bucket.left -= 1.0;
            return None;
        }
        Some(Duration::from_secs_f64(((1.0 - bucket.left) * each).min(MINUTE.as_secs_f64())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Limit, TenantChange, testing};

    #[test]
    fn a_bucket_has_a_minute_of_requests_and_fills_steadily() {
        let (rates, start) = (Rates::new(), Instant::now());
        let (lab, other): (Tenant, Tenant) = ("lab".parse().unwrap(), "other".parse().unwrap());
        let after = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let drawn =
            |tenant, limit, seconds| (0..99).filter(|_| rates.draw(tenant, limit, after(seconds)).is_none()).count();
        assert_eq!(drawn(&lab, 30, 0.0), 30);
        assert!(rates.draw(&lab, 30, after(0.5)).unwrap().abs_diff(Duration::from_millis(1500)).as_millis() < 2);
        assert_eq!(drawn(&lab, 30, 20.1), 10);
        assert_eq!(drawn(&other, 3, 0.0), 3, "another tenant has its own");
        assert_eq!(drawn(&lab, 30, 999.0), 30, "no more than a minute of them");
        assert_eq!(rates.draw(&lab, 0, after(9999.0)), Some(MINUTE));
    }

    #[tokio::test]
    async fn a_tenant_is_held_to_the_limit_in_the_catalog() {
        for (catalog, _guard) in testing::catalogs().await {
            let lab = testing::other(&catalog, "lab").await.tenant().clone();
            let limit = TenantChange { requests: Some(Limit(Some(2))), ..TenantChange::default() };
            catalog.change_tenant(&lab, &limit).await.unwrap();
            let rates = Rates::new();
            for _ in 0..2 {
                rates.take(&catalog, &lab).await.unwrap();
            }
            assert_eq!(rates.take(&catalog, &lab).await.unwrap_err().code(), "too-many-requests");
            rates.take(&catalog, catalog.tenant()).await.unwrap();
            let none = TenantChange { requests: Some(Limit(None)), ..TenantChange::default() };
            catalog.change_tenant(&lab, &none).await.unwrap();
            rates.limits.invalidate(&lab).await;
            rates.take(&catalog, &lab).await.unwrap();
        }
    }
}
