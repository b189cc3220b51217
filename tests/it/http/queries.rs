//! Questions to a material, one by one and as JSON.

use crate::service::{Service, config, problem};
use reqwest::StatusCode;
use serde_json::{Value, json};
use wavelume::store::Digest;

#[tokio::test(flavor = "multi_thread")]
async fn spectra_are_answered_in_the_materials_unit() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.material().await;
    let path = format!("/v1/materials/{id}/spectrum");
    let whole: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!(whole["wavelengths"].as_array().unwrap().len(), whole["values"].as_array().unwrap().len());
    assert_eq!(whole["unit"], "relative");
    let some: Value =
        service.get(&format!("{path}?wavelengths=560:600:20")).send().await.unwrap().json().await.unwrap();
    assert_eq!(some["wavelengths"], json!([560.0, 580.0, 600.0]));
    assert!((some["values"][0].as_f64().unwrap() - 100.0).abs() < 3.0, "{some}");
    problem(service.get(&format!("{path}?wi=30,0")), 422, "unfit-query").await;
    for bad in ["?wi=30", "?wavelengths=x", "?index=-1", "?interpolation=cubic", "?nonsense=1"] {
        problem(service.get(&format!("{path}{bad}")), 400, "bad-query").await;
    }
    let absent = Digest::of(b"absent");
    problem(service.get(&format!("/v1/materials/{absent}/spectrum")), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn batches_evaluate_and_sample() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.batch = 1000;
    let service = Service::start(config).await;
    let path = format!("/v1/materials/{}", service.brdf().await);
    let post = |what: &str, body: &Value| service.post(&format!("{path}/{what}")).json(body);
    let ask = async |what: &str, body: Value| -> Value {
        let response = post(what, &body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{}", response.text().await.unwrap());
        response.json().await.unwrap()
    };
    let pairs = json!({ "wi": [[30, 0], [60, 45]], "wo": [[10, 20], [40, 200]] });
    let spectra = ask("evaluate", pairs).await;
    assert_eq!((spectra["values"].as_array().unwrap().len(), spectra["values"][0].as_array().unwrap().len()), (2, 3));
    assert_eq!(spectra["unit"], "1/sr");
    let one: Value =
        service.get(&format!("{path}/spectrum?wi=60,45&wo=40,200")).send().await.unwrap().json().await.unwrap();
    assert_eq!(one["values"], spectra["values"][1], "a batch answers as one question does");
    let below = ask("evaluate", json!({ "wi": [[30, 0]], "wo": [[10, 20], [20, 20]], "wavelengths": [450.0] })).await;
    assert_eq!(below["values"].as_array().unwrap().len(), 2);

    let drawn = ask("sample", json!({ "wi": [30, 0], "count": 5, "seed": 7 })).await;
    assert_eq!(drawn["directions"].as_array().unwrap().len(), 5);
    assert_eq!(drawn, ask("sample", json!({ "wi": [30, 0], "count": 5, "seed": 7 })).await);
    assert_ne!(drawn, ask("sample", json!({ "wi": [30, 0], "count": 5 })).await);
    let density = ask("pdf", json!({ "wi": [[30, 0]], "wo": drawn["directions"] })).await;
    for (a, b) in density["pdf"].as_array().unwrap().iter().zip(drawn["pdf"].as_array().unwrap()) {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        assert!((a - b).abs() <= 1e-6 * b, "the density of a drawn direction is the one it was drawn with: {a} {b}");
    }

    problem(
        post("evaluate", &json!({ "wi": [[30, 0], [1, 1]], "wo": [[1, 1], [2, 2], [3, 3]] })),
        422,
        "invalid-request",
    )
    .await;
    problem(post("evaluate", &json!({ "wi": [[300, 0]], "wo": [[1, 1]] })), 422, "invalid-request").await;
    problem(post("evaluate", &json!({ "wo": [[1, 1]] })), 422, "unfit-query").await;
    problem(post("evaluate", &json!({ "w": 1 })), 422, "invalid-request").await;
    problem(post("evaluate", &json!({ "wi": vec![[1, 1]; 1001], "wo": [[1, 1]] })), 422, "invalid-request").await;
    problem(post("sample", &json!({ "wi": [30, 0], "count": 1001 })), 422, "invalid-request").await;
    problem(post("sample", &json!({ "wi": [30, 0], "count": 0 })), 422, "invalid-request").await;
    let far = json!({ "wi": [[30, 0]], "wo": [[10, 20]], "wavelengths": [300.0, 400.0], "beyond": "nearest" });
    let far = ask("evaluate", far).await;
    assert_eq!(far["values"][0][0], far["values"][0][1]);
    for (beyond, expected) in [("masked", Value::Null), ("zero", json!(0.0))] {
        let query = format!("{path}/spectrum?wi=30,0&wo=10,20&wavelengths=300&beyond={beyond}");
        let one: Value = service.get(&query).send().await.unwrap().json().await.unwrap();
        assert_eq!(one["values"], json!([expected]));
    }
    let albedo: Value = service.get(&format!("{path}/albedo?wi=30,0")).send().await.unwrap().json().await.unwrap();
    let albedos = ask("albedo", json!({ "wi": [[60, 0], [30, 0]] })).await;
    assert_eq!((&albedo["values"], &albedo["wavelengths"]), (&albedos["values"][1], &albedos["wavelengths"]));
    // The samples lie about 0.2 / sr, and the cosine integrates to pi.
    assert!((albedo["values"][0].as_f64().unwrap() - 0.63).abs() < 0.1, "{albedo}");
    problem(service.get(&format!("{path}/albedo")), 422, "unfit-query").await;
    problem(service.get(&format!("{path}/albedo?wo=1,1")), 400, "bad-query").await;
    let several = ask("sample", json!({ "wi": [[30, 0], [50, 0]], "count": 3 })).await;
    assert_eq!(several["weight"].as_array().unwrap().len(), 6);
    let refusal = problem(post("evaluate", &json!({ "wi": [[30, 0], [120, 0]], "wo": [[1, 1]] })), 422, "unfit-query");
    assert!(refusal.await["detail"].as_str().unwrap().starts_with("pair 2: wi has theta = 120"));
    problem(post("evaluate?interpolation=smooth", &json!({ "wi": [[1, 1]], "wo": [[1, 1]] })), 400, "bad-query").await;
    problem(service.post(&format!("{path}/pdf")).body("{}"), 415, "unsupported-media-type").await;

    let exported = service.get(&format!("{path}/export?format=npy")).send().await.unwrap().bytes().await.unwrap();
    assert!(exported.starts_with(b"\x93NUMPY") && exported.len() > 4 * 64 * 3 * 4);
    let manifest: Value =
        service.get(&format!("{path}/export?format=manifest")).send().await.unwrap().json().await.unwrap();
    assert_eq!((&manifest["quantity"], manifest["axes"].as_array().unwrap().len()), (&json!("brdf"), 3));
    let refusal = problem(service.get(&format!("{path}/export?format=merl")), 422, "not-available").await;
    assert!(refusal["detail"].as_str().unwrap().contains("npy"));
    service.stop().await;
}
