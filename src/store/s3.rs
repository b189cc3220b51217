//! Objects under a prefix of an S3 bucket.
//!
//! Credentials, region and endpoint are read from the variables that other S3 clients read: `AWS_ACCESS_KEY_ID`,
//! `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT_URL` and the like.

use super::error::StoreError;
use super::objects::{Objects, Publication};
use object_store::aws::AmazonS3Builder;
use object_store::prefix::PrefixStore;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use std::sync::Arc;
use std::time::Duration;

/// Time for which a failed call to S3 is tried again. Raising it survives longer outages of the store, but delays the
/// error when the store stays away.
const PATIENCE: Duration = Duration::from_mins(1);

/// Longest time that one request to S3 may take. Raising it tolerates slower stores.
const REQUEST: Duration = Duration::from_secs(30);

/// Opens the objects under a prefix of an S3 bucket; the prefix may be empty. Sends no request to the store yet.
pub(super) fn open(bucket: &str, prefix: &str) -> Result<Objects, StoreError> {
    super::tls::provide_tls();
    let retry = RetryConfig {
        backoff: BackoffConfig {
            init_backoff: Duration::from_millis(50),
            max_backoff: Duration::from_secs(2),
            base: 2.0,
        },
        max_retries: 10,
        retry_timeout: PATIENCE,
    };
    let plain = std::env::var("AWS_ENDPOINT_URL").is_ok_and(|endpoint| endpoint.starts_with("http://"));
    let options = ClientOptions::new().with_timeout(REQUEST).with_allow_http(plain);
    let builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retry).with_client_options(options);
    let bucket = builder.build()?;
    let store: Arc<dyn ObjectStore> =
        if prefix.is_empty() { Arc::new(bucket) } else { Arc::new(PrefixStore::new(bucket, prefix)) };
    Ok(Objects::new(store, Publication::Upload))
}

#[cfg(test)]
mod tests {
    use crate::store::contract;

    #[tokio::test]
    async fn a_bucket_holds_the_contract() {
        let scratch = tempfile::tempdir().unwrap();
        let (store, staging) = contract::bucket().open(scratch.path()).unwrap();
        contract::holds(store, &staging).await;
    }
}
