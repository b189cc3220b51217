//! Materials of which too few directions were measured, and strict requests, over HTTP: the same sentences as on the
//! command line.

use crate::cli::{diffuser, in_plane_scan};
use crate::service::{Service, config, problem};
use reqwest::StatusCode;
use serde_json::{Value, json};

#[tokio::test(flavor = "multi_thread")]
async fn a_scan_in_one_plane_has_no_albedo_ball_or_rgl_file() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let scan = service.upload("?filename=scan.csv", in_plane_scan()).await;
    let request = json!({ "measurement": scan["id"], "target": { "er_l2": 0.01 } });
    let job = service.compress(&request).await;
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    let notes = material["notes"].as_array().unwrap();
    let about = notes.iter().find(|note| note["code"] == "material-partly-measured").unwrap();
    assert!(about["message"].as_str().unwrap().starts_with("measured in the plane of incidence only: "), "{about}");
    assert!(material["light"].is_null(), "{material}");
    for (query, asked) in
        [("preview.png", "no picture of a ball"), ("export?format=rgl", "no rgl file"), ("albedo?wi=30,0", "no albedo")]
    {
        let refusal = problem(service.get(&format!("{path}/{query}")), 422, "unfit-query").await;
        let detail = refusal["detail"].as_str().unwrap();
        assert!(detail.contains(&format!("{asked}: measured in the plane of incidence only: ")), "{query}: {detail}");
    }
    for (query, body) in
        [("sample", json!({ "wi": [30, 0], "count": 1 })), ("pdf", json!({ "wi": [[30, 0]], "wo": [[40, 180]] }))]
    {
        let refusal = problem(service.post(&format!("{path}/{query}")).json(&body), 422, "unfit-query").await;
        let detail = refusal["detail"].as_str().unwrap();
        assert!(detail.contains("no sample and no density (pdf): measured in the plane"), "{query}: {detail}");
    }
    let pairs = json!({ "wi": [[20, 0], [20, 0]], "wo": [[30, 90], [30, 180]] });
    let answer = service.post(&format!("{path}/evaluate")).json(&pairs).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let answer: Value = answer.json().await.unwrap();
    assert!(answer["values"][0][0].is_null() && answer["values"][1][0].is_number(), "{answer}");
    let mut bounded = request;
    bounded["albedo_error"] = json!(0.01);
    let job = service.compress(&bounded).await;
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:bad-setting", "{job}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn strict_requests_refuse_what_is_warned_of() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let bright = service.upload("?filename=bright.csv", diffuser(90.0)).await;
    let request =
        |strict: bool| json!({ "measurement": bright["id"], "target": { "er_l2": 0.0001 }, "strict": strict });
    let job = service.compress(&request(true)).await;
    assert_eq!((job["state"].as_str(), job["material"].is_null()), (Some("failed"), true), "{job}");
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:unreachable-target", "{job}");
    assert!(
        job["problem"]["detail"].as_str().unwrap().contains("refused by the option `strict`: albedo above 1"),
        "{job}"
    );
    let job = service.compress(&request(false)).await;
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    let notes = material["notes"].as_array().unwrap();
    assert!(
        notes.iter().any(|note| note["code"] == "check-albedo-above-one" && note["kind"] == "warning"),
        "{material}"
    );
    let rough = format!("{path}/export?format=rgl&side=2&step=45");
    let response = service.get(&rough).send().await.unwrap();
    let stated = response.headers()["wavelume-export-error"].to_str().unwrap().to_owned();
    assert!(stated.ends_with(", promise=\"broken\""), "{stated}");
    let refusal = problem(service.get(&format!("{rough}&strict=true")), 422, "not-available").await;
    let detail = refusal["detail"].as_str().unwrap();
    assert!(detail.starts_with("refused by the option `strict`: the file adds er(L2) "), "{detail}");
    let array = service.get(&format!("{path}/export?format=npy&strict=true")).send().await.unwrap();
    assert_eq!(array.status(), StatusCode::OK);
    service.stop().await;
}
