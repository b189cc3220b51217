//! Appearance of a material over HTTP: colours under named and stored lights, pictures with their conditions.

use crate::service::{CHECKER, D65, LAMP, LAMP_SPECTRUM, Service, config, problem};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use wavelume::store::Digest;

const FUNCTIONS: &[u8] = include_bytes!("../../../data/cmfs_CIE_1964_10_Degree_Standard_Observer.csv");
const PANEL: &[u8] = include_bytes!("../../fixtures/ldt/example.ldt");
const VELVET: &[u8] = include_bytes!("../../../data/virtual/velvet.json");

/// Compresses a measurement without loss; returns the id of the material.
async fn stored(service: &Service, query: &str, bytes: &'static [u8]) -> String {
    let measurement = service.upload(query, bytes).await;
    let job = service.compress(&json!({ "measurement": measurement["id"], "target": "lossless" })).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    job["material"].as_str().unwrap().to_owned()
}

async fn json_of(service: &Service, path: &str) -> Value {
    let response = service.get(path).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::OK, "{path}: {}", response.text().await.unwrap());
    response.json().await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn colours_are_told_under_named_and_stored_lights() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let checker = stored(&service, "?quantity=reflectance", CHECKER).await;
    let path = format!("/v1/materials/{checker}/color");
    let all = json_of(&service, &path).await;
    assert_eq!((all["of"].as_str(), all["illuminant"].as_str()), (Some("reflectance"), Some("D65")));
    let colours = all["colours"].as_array().unwrap();
    assert_eq!((colours.len(), colours[14]["label"].as_str()), (24, Some("red")));
    // colour-science: `patches` of tests/golden.
    let golden: Value = serde_json::from_str(include_str!("../../golden/colour_science.json")).unwrap();
    for (name, observer, wanted) in [
        ("D65", "1931", &golden["patches"]["D65"][14]["xyz"]),
        ("A", "1931", &golden["patches"]["A"][14]["xyz"]),
        ("D65", "1964", &golden["observer_1964"][14]),
    ] {
        let one = json_of(&service, &format!("{path}?index=14&illuminant={name}&observer={observer}")).await;
        let xyz = one["colours"][0]["xyz"].as_array().unwrap();
        for (found, wanted) in xyz.iter().zip(wanted.as_array().unwrap()) {
            let (found, wanted) = (found.as_f64().unwrap(), wanted.as_f64().unwrap());
            assert!((found - wanted).abs() < 1e-6 * wanted, "{name} {observer}: {found} {wanted}");
        }
    }
    let light = stored(&service, "", D65).await;
    let under = json_of(&service, &format!("{path}?index=14&illuminant={light}")).await;
    let named = json_of(&service, &format!("{path}?index=14")).await;
    let lab = |answer: &Value| answer["colours"][0]["lab"][0].as_f64().unwrap();
    assert!((lab(&under) - lab(&named)).abs() < 1e-3 && under["illuminant"] == *light);
    let eye = stored(&service, "", FUNCTIONS).await;
    let seen = json_of(&service, &format!("{path}?index=14&observer={eye}")).await;
    let named = json_of(&service, &format!("{path}?index=14&observer=1964")).await;
    assert!((lab(&seen) - lab(&named)).abs() < 1e-3 && seen["observer"] == *eye);
    let lamp = json_of(&service, &format!("/v1/materials/{light}/color")).await;
    let kelvin = lamp["colours"][0]["cct"].as_f64().unwrap();
    assert!((kelvin - 6504.0).abs() < 2.0, "{lamp}");

    for bad in ["?illuminant=D93", "?observer=1932", "?illuminant_column=1", "?wi=30", "?index=x", "?nonsense=1"] {
        problem(service.get(&format!("{path}{bad}")), 400, "bad-query").await;
    }
    for unfit in [
        "?index=24".to_owned(),
        "?wi=30,0".to_owned(),
        format!("?illuminant={checker}"),
        format!("?observer={light}"),
        format!("?illuminant={light}&illuminant_column=none"),
    ] {
        problem(service.get(&format!("{path}{unfit}")), 422, "unfit-query").await;
    }
    let absent = Digest::of(b"absent");
    problem(service.get(&format!("/v1/materials/{absent}/color")), 404, "not-found").await;
    problem(service.get(&format!("{path}?illuminant={absent}")), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lamp_without_visible_light_has_a_picture_and_no_colour() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let lamp = stored(&service, "", LAMP_SPECTRUM).await;
    let refusal = problem(service.get(&format!("/v1/materials/{lamp}/color")), 422, "unfit-query").await;
    assert!(refusal["detail"].as_str().unwrap().contains("400 to 700 nm"), "{refusal}");
    let goniometry = stored(&service, "", LAMP).await;
    for id in [lamp, goniometry] {
        let response = service.get(&format!("/v1/materials/{id}/preview.png")).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        assert!(response.bytes().await.unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_are_immutable_and_have_conditions() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let measurement = service.upload("", VELVET).await;
    let job = service.compress(&json!({ "measurement": measurement["id"], "target": { "er_l2": 0.05 } })).await;
    let id = job["material"].as_str().unwrap();
    let path = format!("/v1/materials/{id}/preview.png");
    let response = service.get(&path).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    assert_eq!(response.headers()["content-type"], "image/png");
    assert_eq!(response.headers()["cache-control"], "public, max-age=31536000, immutable");
    let etag = response.headers()["etag"].to_str().unwrap().to_owned();
    let bytes = response.bytes().await.unwrap();
    // IHDR: width and height.
    assert_eq!(&bytes[16..24], &[0, 0, 1, 0, 0, 0, 1, 0]);
    let again = service.get(&path).header("if-none-match", &etag).send().await.unwrap();
    assert_eq!((again.status(), again.headers()["etag"].to_str().unwrap()), (StatusCode::NOT_MODIFIED, etag.as_str()));
    assert!(again.bytes().await.unwrap().is_empty());
    let head = service.request(Method::HEAD, &path).send().await.unwrap();
    assert_eq!((head.status(), head.headers()["etag"].to_str().unwrap()), (StatusCode::OK, etag.as_str()));
    assert_eq!(service.get(&format!("{path}?size=256&illuminant=D65")).send().await.unwrap().headers()["etag"], etag);
    for other in ["?size=64", "?illuminant=A", "?observer=1964"] {
        let response = service.get(&format!("{path}{other}")).header("if-none-match", &etag).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{other}");
        assert_ne!(response.headers()["etag"], etag, "{other}");
    }
    for bad in ["?size=63", "?size=513", "?size=x", "?size=-1", "?illuminant=D93", "?index=a", "?nonsense=1"] {
        problem(service.get(&format!("{path}{bad}")), 400, "bad-query").await;
    }
    problem(service.get(&format!("{path}?index=0")), 422, "unfit-query").await;
    let absent = Digest::of(b"absent");
    let unknown = service.get(&format!("/v1/materials/{absent}/preview.png")).header("if-none-match", "*");
    problem(unknown, 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_figures_of_the_trade_are_those_of_the_command_line() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let lamp = stored(&service, "", PANEL).await;
    let path = format!("/v1/materials/{lamp}");
    let report = json_of(&service, &format!("{path}/physics")).await;
    let figures = &report["luminaire"][0];
    assert!((figures["flux"].as_f64().unwrap() / 5136.1 - 1.0).abs() < 0.01, "{report}");
    assert_eq!((figures["watts"].as_f64(), figures["planes"][1]["plane"].as_str()), (Some(60.22), Some("C90-C270")));
    assert_eq!((&report["reciprocity"], report["surface"].as_array().unwrap().len()), (&Value::Null, 0));
    let peak = &figures["peak"];
    let [c, gamma] = ["c", "gamma"].map(|angle| peak[angle].as_f64().unwrap());
    let asked = json_of(&service, &format!("{path}/spectrum?c={c}&gamma={gamma}")).await;
    assert!((asked["values"][0].as_f64().unwrap() / peak["value"].as_f64().unwrap() - 1.0).abs() < 0.02, "{asked}");
    let same = json_of(&service, &format!("{path}/spectrum?wo={},{c}", 180.0 - gamma)).await;
    assert!((same["values"][0].as_f64().unwrap() / asked["values"][0].as_f64().unwrap() - 1.0).abs() < 1e-5, "{same}");
    for bad in ["c=0", "gamma=0", "c=0&gamma=0&wo=0,0", "c=x&gamma=0"] {
        problem(service.get(&format!("{path}/spectrum?{bad}")), 400, "bad-query").await;
    }
    problem(service.get(&format!("{path}/spectrum?c=0&gamma=181")), 422, "unfit-query").await;
    let batch = json!({ "c_gamma": [[c, gamma], [0, 0]] });
    let answer: Value =
        service.post(&format!("{path}/evaluate")).json(&batch).send().await.unwrap().json().await.unwrap();
    assert_eq!(answer["extrapolated"], json!([false, false]));
    assert!((answer["values"][0][0].as_f64().unwrap() / asked["values"][0].as_f64().unwrap() - 1.0).abs() < 1e-4);
    let drawn = service.post(&format!("{path}/sample")).json(&json!({ "count": 3 }));
    let drawn: Value = drawn.send().await.unwrap().json().await.unwrap();
    for (direction, angles) in drawn["directions"].as_array().unwrap().iter().zip(drawn["c_gamma"].as_array().unwrap())
    {
        let [theta, gamma] = [&direction[0], &angles[1]].map(|angle| angle.as_f64().unwrap());
        assert!((theta + gamma - 180.0).abs() < 1e-9, "{drawn}");
    }
    let surface = service.brdf().await;
    let refusal = service.post(&format!("/v1/materials/{surface}/evaluate"));
    let refusal = problem(refusal.json(&json!({ "wi": [[0, 0]], "c_gamma": [[0, 0]] })), 422, "unfit-query").await;
    assert!(refusal["detail"].as_str().unwrap().contains("angles of a luminaire"), "{refusal}");
    service.stop().await;
}
