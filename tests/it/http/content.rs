//! Bytes under their digest.

use crate::service::{D65, Service, config, damage, npy, objects, problem, problem_of};
use reqwest::{Method, StatusCode};
use serde_json::json;
use std::time::Duration;

#[tokio::test(flavor = "multi_thread")]
async fn content_has_conditions_and_ranges() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.material().await;
    let tag = format!("\"{id}\"");
    for path in [format!("/v1/materials/{id}/content"), format!("/v1/blobs/{id}")] {
        let whole = service.get(&path).send().await.unwrap();
        assert_eq!(whole.headers()["etag"], tag.as_str());
        assert_eq!(whole.headers()["cache-control"], "public, max-age=31536000, immutable");
        assert_eq!(whole.headers()["content-type"], "application/vnd.wavelume.material");
        let bytes = whole.bytes().await.unwrap();

        let head = service.request(Method::HEAD, &path).send().await.unwrap();
        assert_eq!(head.headers()["content-length"], bytes.len().to_string().as_str());
        assert_eq!(head.headers()["etag"], tag.as_str());
        let head = service.request(Method::HEAD, &path).header("range", "bytes=3-9").send().await.unwrap();
        assert_eq!(head.status(), StatusCode::OK, "only GET asks for a range");
        assert_eq!(head.headers()["content-length"], bytes.len().to_string().as_str());
        let same = service.get(&path).header("if-none-match", &tag).send().await.unwrap();
        assert_eq!((same.status(), same.bytes().await.unwrap().len()), (StatusCode::NOT_MODIFIED, 0));

        let part = service.get(&path).header("range", "bytes=3-9").send().await.unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        assert_eq!(part.headers()["content-range"], format!("bytes 3-9/{}", bytes.len()).as_str());
        assert_eq!(part.bytes().await.unwrap(), bytes[3..10]);
        let tail = service.get(&path).header("range", "bytes=-4").header("if-range", &tag).send().await.unwrap();
        assert_eq!(tail.bytes().await.unwrap(), bytes[bytes.len() - 4..]);
        let stale =
            service.get(&path).header("range", "bytes=-4").header("if-range", "\"other\"").send().await.unwrap();
        assert_eq!((stale.status(), stale.bytes().await.unwrap().len()), (StatusCode::OK, bytes.len()));
        let outside = service.get(&path).header("range", "bytes=999999999-").send().await.unwrap();
        assert_eq!(outside.headers()["content-range"], format!("bytes */{}", bytes.len()).as_str());
        problem_of(outside, 416, "range-not-satisfiable").await;
    }
    problem(service.get("/v1/blobs/b3-xyz"), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn large_content_is_streamed_whole_and_in_part() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let array = npy(&[40, 1024, 75]);
    assert!(array.len() as u64 > wavelume::store::WHOLE);
    let uploaded = service.upload("", array.clone()).await;
    let path = uploaded["links"]["content"].as_str().unwrap();
    assert_eq!(service.get(path).send().await.unwrap().bytes().await.unwrap(), array);
    let part = service.get(path).header("range", "bytes=5000000-9999999").send().await.unwrap();
    assert_eq!(part.bytes().await.unwrap(), array[5_000_000..10_000_000]);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_blob_is_a_problem_until_it_is_uploaded_again() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    // The job fails once all attempts agree.
    (config.work.limits.attempts, config.work.limits.backoff) = (2, Duration::from_millis(100));
    let service = Service::start(config).await;
    let id = service.upload("", D65).await["id"].as_str().unwrap().to_owned();
    damage(&objects(data.path(), &id).await[0], Some(b"bit rot")).await;
    problem(service.get(&format!("/v1/blobs/{id}")), 500, "corrupt").await;
    let job = service.compress(&json!({ "measurement": id, "target": { "er_l2": 0.01 } })).await;
    assert_eq!((&job["state"], &job["attempts"]), (&json!("dead"), &json!(2)), "{job}");
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:corrupt", "{job}");
    service.upload("", D65).await;
    assert_eq!(service.get(&format!("/v1/blobs/{id}")).send().await.unwrap().bytes().await.unwrap(), D65);
    // Both the damaged object, until a sweep, and the one that replaced it.
    for object in objects(data.path(), &id).await {
        damage(&object, None).await;
    }
    problem(service.get(&format!("/v1/measurements/{id}/content")), 500, "corrupt").await;
    problem(service.get(&format!("/v1/blobs/{id}")), 404, "not-found").await;
    service.stop().await;
}
