//! Materials of which too few directions were measured, over HTTP: the sentences of the command line.

use crate::cli::in_plane_scan;
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
