//! Answers as the catalog decides them: deletions, second jobs, words to search by.

use crate::service::{CHECKER, D65, LAMP, Service, config, objects, problem};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

async fn json_of(service: &Service, path: &str) -> Value {
    service.get(path).send().await.unwrap().error_for_status().unwrap().json().await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_another_process_deleted_is_answered_by_nobody() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let mut idle = config(data.path());
    idle.work.workers = 0;
    let another = Service::start(idle).await;
    let id = service.material().await;
    let checker = service.upload("?quantity=reflectance", CHECKER).await;
    let job = service.compress(&json!({ "measurement": checker["id"], "target": "lossless" })).await;
    let checker = job["material"].as_str().unwrap();
    let this = format!("/v1/materials/{id}");
    let paths =
        ["", "/spectrum", "/content", "/preview.png", "/color", "/export?format=csv", "/export?format=manifest"];
    let mut paths: Vec<String> = paths.iter().map(|path| format!("{this}{path}")).collect();
    paths.push(format!("/v1/blobs/{id}"));
    // Another material in the light of this one.
    paths.push(format!("/v1/materials/{checker}/color?illuminant={id}"));
    let mut tags = Vec::new();
    for path in &paths {
        // Twice: the second answer comes from memory where one is kept.
        service.get(path).send().await.unwrap().error_for_status().unwrap();
        let kept = service.get(path).send().await.unwrap().error_for_status().unwrap();
        tags.push(kept.headers().get("etag").cloned());
    }
    let body = json!({ "wi": [[30, 0]], "wo": [[1, 1]] });
    let gone = another.request(Method::DELETE, &this).send().await.unwrap();
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    // A decision about a download is remembered for a moment; everything else is asked each time.
    let content = format!("{this}/content");
    within_5_s(async || service.get(&content).send().await.unwrap().status() == StatusCode::NOT_FOUND).await;
    for (path, tag) in paths.iter().zip(tags) {
        problem(service.get(path), 404, "not-found").await;
        problem(service.get(path).header("range", "bytes=0-3"), 404, "not-found").await;
        if let Some(tag) = tag {
            problem(service.get(path).header("if-none-match", tag), 404, "not-found").await;
        }
    }
    problem(service.post(&format!("{this}/evaluate")).json(&body), 404, "not-found").await;
    service.stop().await;
    another.stop().await;
}

/// Waits until a condition holds, for five seconds at most.
async fn within_5_s(holds: impl AsyncFn() -> bool) {
    let begun = std::time::Instant::now();
    while !holds().await {
        assert!(begun.elapsed().as_secs() < 5);
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn deleted_bytes_are_not_served_by_their_digest() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.upload("", D65).await["id"].as_str().unwrap().to_owned();
    let blob = format!("/v1/blobs/{id}");
    let tag = format!("\"{id}\"");
    assert_eq!(service.get(&blob).send().await.unwrap().bytes().await.unwrap(), D65);
    let gone = service.request(Method::DELETE, &format!("/v1/measurements/{id}")).send().await.unwrap();
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    assert_eq!(objects(data.path(), &id).await.len(), 1, "not swept yet");
    problem(service.get(&blob), 404, "not-found").await;
    problem(service.get(&blob).header("if-none-match", &tag), 404, "not-found").await;
    assert_eq!(service.request(Method::HEAD, &blob).send().await.unwrap().status(), StatusCode::NOT_FOUND);
    service.upload("", D65).await;
    assert_eq!(service.get(&blob).send().await.unwrap().bytes().await.unwrap(), D65);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_job_with_equal_bytes_is_found_by_its_own_words() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let lamp = service.upload("", LAMP).await;
    let job = async |extra: Value| -> String {
        let mut request = json!({ "measurement": lamp["id"], "target": { "er_l2": 0.01 } });
        request.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        service.compress(&request).await["material"].as_str().unwrap().to_owned()
    };
    let id = job(json!({ "name": "Far-UVC", "licence": "CC0-1.0", "tags": ["lamp"] })).await;
    let content = format!("/v1/materials/{id}/content");
    let name = |response: reqwest::Response| response.headers()["content-disposition"].to_str().unwrap().to_owned();
    assert!(name(service.get(&content).send().await.unwrap()).contains("Far-UVC.wlm"));
    let second = json!({ "name": "Exhibit 7", "licence": "CC-BY-4.0", "tags": ["Museum"] });
    assert_eq!(job(second).await, id);

    let material = json_of(&service, &format!("/v1/materials/{id}")).await;
    assert_eq!((&material["name"], &material["licence"]), (&json!("Exhibit 7"), &json!("CC-BY-4.0")));
    assert_eq!(material["names"], json!(["Far-UVC", "Exhibit 7"]));
    assert_eq!(material["licences"], json!(["CC0-1.0", "CC-BY-4.0"]));
    assert_eq!(material["tags"], json!(["Museum", "lamp"]));
    for query in ["q=far", "q=exhibit", "q=museum", "tag=Museum", "tag=lamp"] {
        let page = json_of(&service, &format!("/v1/materials?{query}")).await;
        assert_eq!(page["items"][0]["id"], json!(id), "{query}");
    }
    within_5_s(async || name(service.get(&content).send().await.unwrap()).contains("Exhibit%207.wlm")).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn words_to_search_by_have_a_limit() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for list in ["measurements", "materials"] {
        for (q, status) in [("%25".repeat(255), 200), ("x".repeat(256), 400), ("x".repeat(10_000), 400)] {
            let request = service.get(&format!("/v1/{list}?q={q}"));
            if status == 200 {
                request.send().await.unwrap().error_for_status().unwrap();
            } else {
                let refusal = problem(request, status, "bad-query").await;
                assert!(refusal["detail"].as_str().unwrap().contains("expected at most 255"), "{refusal}");
            }
        }
        problem(service.get(&format!("/v1/{list}?q=%00")), 400, "bad-query").await;
        json_of(&service, &format!("/v1/{list}?q=")).await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dense_export_refuses_an_entry() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let brdf = format!("/v1/materials/{}", service.brdf().await);
    problem(service.get(&format!("{brdf}/spectrum?wi=0,0&wo=0,0&index=99")), 422, "unfit-query").await;
    let checker = service.upload("?quantity=reflectance", CHECKER).await;
    let job = service.compress(&json!({ "measurement": checker["id"], "target": "lossless" })).await;
    let checker = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    for format in ["npy", "manifest"] {
        problem(service.get(&format!("{brdf}/export?format={format}&index=99")), 422, "unfit-query").await;
        problem(service.get(&format!("{checker}/export?format={format}&index=0")), 422, "bad-setting").await;
        problem(service.get(&format!("{brdf}/export?format={format}&step=5")), 422, "bad-setting").await;
        service.get(&format!("{checker}/export?format={format}")).send().await.unwrap().error_for_status().unwrap();
    }
    service.stop().await;
}
