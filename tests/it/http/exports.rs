//! Materials in exchange formats over HTTP: a header states the error that the file adds, and no other request waits
//! for it.

use crate::service::{CHECKER, LAMP, Service, config, problem};
use reqwest::StatusCode;
use serde_json::json;

fn header<'a>(response: &'a reqwest::Response, name: &str) -> &'a str {
    response.headers().get(name).unwrap_or_else(|| panic!("no {name}")).to_str().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn files_state_what_they_add() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let path = format!("/v1/materials/{}/export", service.brdf().await);
    let rgl = format!("{path}?format=rgl&side=8&step=45");
    let response = service.get(&rgl).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    let stated = header(&response, "wavelume-export-error").to_owned();
    assert!(stated.starts_with("er_l2=0.") && stated.contains("pairs=10000, of=\"the spectrum\""), "{stated}");
    assert!(header(&response, "content-disposition").ends_with(".bsdf\""));
    let (length, etag) = (header(&response, "content-length").to_owned(), header(&response, "etag").to_owned());
    let bytes = response.bytes().await.unwrap();
    assert!(bytes.starts_with(b"tensor_file\0") && length == bytes.len().to_string());
    let again = service.get(&rgl).header("if-none-match", &etag).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
    // The exported file can be uploaded as a measurement.
    let measurement = service.upload("?filename=m.bsdf", bytes.to_vec()).await;
    assert_eq!((&measurement["format"], &measurement["quantity"]), (&json!("rgl"), &json!("brdf")));

    let array = service.get(&format!("{path}?format=npy")).send().await.unwrap();
    assert!(header(&array, "wavelume-export-error").starts_with("er_l2=0.000000, "));
    for (query, status, code, word) in [
        ("format=merl", 422, "not-available", "it can be written as rgl or npy"),
        ("format=axf", 422, "not-available", "expected one of manifest, rgl"),
        ("format=rgl&side=1", 422, "bad-setting", "expected 2 to 1024"),
        ("format=rgl&wavelength=500", 422, "bad-setting", "does nothing for rgl"),
        ("format=rgl&side=1024&step=1", 422, "over-limit", "expected at most"),
        ("format=rgl&index=x", 400, "bad-query", "index"),
        ("format=rgl&index=0", 422, "unfit-query", "the option index: found 1 numbers, expected 0"),
        ("format=rgl&nonsense=1", 400, "bad-query", "nonsense"),
    ] {
        let refusal = problem(service.get(&format!("{path}?{query}")), status, code).await;
        assert!(refusal["detail"].as_str().unwrap().contains(word), "{query}: {refusal}");
    }

    let lamp = service.upload("?filename=lamp.ies", LAMP).await;
    let grid = json!({ "measurement": lamp["id"], "domain": "grid", "target": "lossless" });
    let exact = service.compress(&grid).await["material"].as_str().unwrap().to_owned();
    let response = service.get(&format!("/v1/materials/{exact}/export?format=lm63")).send().await.unwrap();
    let stated = header(&response, "wavelume-export-error").to_owned();
    assert!(stated.starts_with("er_l2=0.000000") && stated.contains("of=\"every sample\""), "{stated}");
    assert!(stated.contains("peak=0.000000, flux=0.000000, rms_of_peak=0.000000, er_l2_bright=0.000000"), "{stated}");
    // The exported file holds the measurement that was uploaded.
    let again = service.upload("?filename=again.ies", response.bytes().await.unwrap().to_vec()).await;
    let grid = json!({ "measurement": again["id"], "domain": "grid", "target": "lossless" });
    let again = service.compress(&grid).await["material"].as_str().unwrap().to_owned();
    let array = |id: &str| format!("/v1/materials/{id}/export?format=npy");
    let [a, b] = [service.get(&array(&exact)).send().await.unwrap(), service.get(&array(&again)).send().await.unwrap()];
    assert_eq!(a.bytes().await.unwrap(), b.bytes().await.unwrap());
    let axes = json!({ "measurement": lamp["id"], "outgoing_level": 3, "target": { "er_l2": 0.01 } });
    let lamp = service.compress(&axes).await["material"].as_str().unwrap().to_owned();
    let response = service.get(&format!("/v1/materials/{lamp}/export?format=lm63")).send().await.unwrap();
    assert!(header(&response, "wavelume-export-error").contains(", rms_of_peak=0."));
    assert_eq!(header(&response, "content-type"), "text/plain");
    assert!(response.text().await.unwrap().starts_with("IESNA:LM-63-2002\r\n"));
    let checker = service.upload("?quantity=reflectance", CHECKER).await;
    let job = service.compress(&json!({ "measurement": checker["id"], "target": "lossless" })).await;
    let csv = format!("/v1/materials/{}/export?format=csv", job["material"].as_str().unwrap());
    let response = service.get(&csv).send().await.unwrap();
    assert_eq!(header(&response, "content-type"), "text/csv");
    assert!(response.text().await.unwrap().starts_with("wavelength_nm,dark skin,"));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn more_exports_than_may_be_are_refused() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.exports = 0;
    let service = Service::start(config).await;
    let path = format!("/v1/materials/{}/export", service.brdf().await);
    problem(service.get(&format!("{path}?format=rgl")), 503, "overloaded").await;
    let manifest = service.get(&format!("{path}?format=manifest")).send().await.unwrap();
    assert_eq!(manifest.status(), StatusCode::OK);
    service.stop().await;
}
