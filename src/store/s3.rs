//! Objects under a prefix of an S3 bucket.
//!
//! Credentials, region and endpoint are read from the variables that other S3 clients read: `AWS_ACCESS_KEY_ID`,
//! `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT_URL` and the like.

use super::error::StoreError;
use super::objects::{Objects, Publication};
use object_store::aws::AmazonS3Builder;
use object_store::prefix::PrefixStore;
use object_store::signer::Signer;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use std::sync::Arc;
use std::time::Duration;

/// Seconds for which a failed call to S3 is tried again. Raising it survives longer outages of the store, but delays
/// the error when the store stays away: with [`REQUEST`] it stays below the minute after which proxies give up.
const PATIENCE: Duration = Duration::from_secs(20);

/// Seconds that one request to S3 may take. Raising it tolerates slower stores.
const REQUEST: Duration = Duration::from_secs(30);

/// Upper bound on the repetitions of a failed call. It must not end them before [`PATIENCE`] does: a store that refuses
/// at once uses up ten in two seconds.
const REPETITIONS: usize = 10_000;

/// Opens the objects under a prefix of an S3 bucket; the prefix may be empty. Sends no request to the store yet.
pub(super) fn open(bucket: &str, prefix: &str) -> Result<Objects, StoreError> {
    let (client, signer) = client(bucket, prefix, PATIENCE, REQUEST)?;
    Ok(Objects::new(client, Publication::Upload).with_signer(signer))
}

/// Client for a prefix of an S3 bucket, and the maker of URLs that read single objects there.
pub(super) type Client = (Arc<dyn ObjectStore>, Arc<dyn Signer>);

/// Builds the client for a prefix of an S3 bucket. A failed call is tried again for the time `patience`; one request
/// may take the time `request`.
pub(super) fn client(bucket: &str, prefix: &str, patience: Duration, request: Duration) -> Result<Client, StoreError> {
    let plain = std::env::var("AWS_ENDPOINT_URL").is_ok_and(|endpoint| endpoint.starts_with("http://"));
    with(AmazonS3Builder::from_env(), plain, bucket, prefix, patience, request)
}

/// Builds the client for a prefix of a bucket with the credentials and the endpoint of `builder`. If `plain`, the
/// endpoint may be without TLS.
fn with(
    builder: AmazonS3Builder,
    plain: bool,
    bucket: &str,
    prefix: &str,
    patience: Duration,
    request: Duration,
) -> Result<Client, StoreError> {
    super::tls::provide_tls();
    let retry = RetryConfig {
        backoff: BackoffConfig {
            init_backoff: Duration::from_millis(50),
            max_backoff: Duration::from_secs(2),
            base: 2.0,
        },
        max_retries: REPETITIONS,
        retry_timeout: patience,
    };
    let options = ClientOptions::new().with_timeout(request).with_allow_http(plain);
    let bucket = builder.with_bucket_name(bucket).with_retry(retry).with_client_options(options).build()?;
    // An empty prefix changes no path.
    let client = Arc::new(PrefixStore::new(bucket, prefix));
    Ok((client.clone(), client))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::store::{Store, contract};
    use std::io::{Read, Write};
    use std::net::{SocketAddr, TcpListener};

    /// Returns an S3 store whose requests go to a test server at `address`.
    pub(crate) fn at(address: SocketAddr) -> Arc<dyn Store> {
        let builder = AmazonS3Builder::new()
            .with_endpoint(format!("http://{address}"))
            .with_region("us-east-1")
            .with_access_key_id("test")
            .with_secret_access_key("test");
        let (client, signer) = with(builder, true, "bucket", "", PATIENCE, REQUEST).unwrap();
        Arc::new(Objects::new(client, Publication::Upload).with_signer(signer))
    }

    /// Answers each request to an S3 store with the next text of `answers`, and then ends. Returns the store.
    fn answering(answers: Vec<String>) -> Arc<dyn Store> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let store = at(listener.local_addr().unwrap());
        std::thread::spawn(move || {
            for answer in answers {
                let (mut connection, _) = listener.accept().unwrap();
                let (mut head, mut byte) = (Vec::new(), [0]);
                while !head.ends_with(b"\r\n\r\n") && connection.read(&mut byte).unwrap() == 1 {
                    head.push(byte[0]);
                }
                connection.write_all(answer.as_bytes()).unwrap();
            }
        });
        store
    }

    #[tokio::test]
    async fn a_store_that_refuses_at_once_is_asked_for_longer_than_a_few_times() {
        let mut answers =
            vec!["HTTP/1.1 503 SlowDown\r\nconnection: close\r\ncontent-length: 0\r\n\r\n".to_owned(); 14];
        answers.push(
            "HTTP/1.1 200 OK\r\nconnection: close\r\nlast-modified: Thu, 01 Jan 2026 00:00:00 GMT\r\netag: \"1\"\r\n\
             content-length: 3\r\n\r\none"
                .to_owned(),
        );
        let store = answering(answers);
        assert_eq!(store.note("wavelume-test").await.unwrap().as_deref(), Some("one"));
    }

    #[tokio::test]
    async fn a_bucket_holds_the_contract() {
        let scratch = tempfile::tempdir().unwrap();
        let (store, staging) = contract::bucket().open(scratch.path()).unwrap();
        contract::holds(store, &staging).await;
    }
}
