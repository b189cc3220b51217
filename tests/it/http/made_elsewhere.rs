//! Materials that were made elsewhere and uploaded: decoded, compared with their measurement, and used like any other.

use crate::service::{D65, LAMP, LAMP_SPECTRUM, Service, config, npy, problem};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use wavelume::formats::Interpretation;
use wavelume::pipeline::{Input, Request, read};
use wavelume::store::Digest;

/// Compresses a file as `wavelume compress` does, without a service.
fn made(bytes: &[u8], spectrum: Option<&[u8]>, request: &Request) -> Vec<u8> {
    let interpretation = Interpretation::default();
    read(&Input { bytes, spectrum, interpretation: &interpretation }).unwrap().compress(request).unwrap().bytes
}

async fn uploaded(service: &Service, query: &str, bytes: Vec<u8>, status: StatusCode) -> Value {
    let response = service.post(&format!("/v1/materials{query}")).body(bytes).send().await.unwrap();
    let (found, location) = (response.status(), response.headers().get("location").cloned());
    let material: Value = response.json().await.unwrap();
    assert_eq!(found, status, "{material}");
    assert_eq!(location.unwrap().to_str().unwrap(), material["links"]["self"].as_str().unwrap());
    material
}

#[tokio::test(flavor = "multi_thread")]
async fn a_material_of_elsewhere_is_used_like_any_other() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let file = made(LAMP, None, &Request::er_l2(0.02));
    let id = Digest::of(&file).to_string();
    let lamp =
        uploaded(&service, "?name=Lamp&tags=office&tags=a,b&licence=CC0-1.0", file.clone(), StatusCode::CREATED).await;
    assert_eq!((lamp["id"].as_str(), lamp["name"].as_str()), (Some(id.as_str()), Some("Lamp")));
    assert_eq!((&lamp["tags"], &lamp["measurements"]), (&json!(["a,b", "office"]), &json!([])));
    assert_eq!(
        (&lamp["quantity"], &lamp["licence"], &lamp["format"]),
        (&json!("edf"), &json!("CC0-1.0"), &json!("lm-63"))
    );
    let provenance = &lamp["provenance"];
    assert_eq!((&provenance["origin"], &provenance["measurement"]), (&json!("upload"), &json!(null)));
    assert!(provenance["generator"].as_str().unwrap().starts_with("wavelume "), "{provenance}");
    assert_eq!(provenance["content_digest"], Digest::of(LAMP).to_string());
    assert!(lamp["er_l2"].as_f64().unwrap() <= 0.02 && lamp.get("measured_again").is_none());

    let boundary = "--d74496d66958873e";
    let head = format!("{boundary}\r\nContent-Disposition: form-data; name=\"file\"; filename=\"lamp.wlm\"\r\n\r\n");
    let form = [head.as_bytes(), &file, format!("\r\n{boundary}--\r\n").as_bytes()].concat();
    let form = service
        .post("/v1/materials")
        .header("content-type", "multipart/form-data; boundary=d74496d66958873e")
        .body(form);
    let form: Value = form.send().await.unwrap().json().await.unwrap();
    assert_eq!(form["id"], lamp["id"], "a form is the file in it");

    let path = lamp["links"]["self"].as_str().unwrap();
    assert_eq!(service.get(path).send().await.unwrap().json::<Value>().await.unwrap(), lamp);
    assert_eq!(service.get(&format!("{path}/content")).send().await.unwrap().bytes().await.unwrap(), file);
    let listed: Value = service.get("/v1/materials?q=office").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"][0], lamp);
    let values: Value = service.get(&format!("{path}/spectrum?wo=150,0")).send().await.unwrap().json().await.unwrap();
    assert!(values["values"].is_array(), "{values}");
    assert_eq!(service.get(&format!("{path}/preview.png")).send().await.unwrap().status(), StatusCode::OK);

    // The measurement comes later: the next upload of the same bytes is compared with it.
    let measurement = service.upload("", LAMP).await["id"].clone();
    let again = uploaded(&service, "?tags=hall", file.clone(), StatusCode::OK).await;
    assert_eq!((&again["measurements"], &again["tags"]), (&json!([measurement]), &json!(["a,b", "hall", "office"])));
    let compared = &again["measured_again"][0];
    assert_eq!(compared["measurement"], measurement);
    let (stated, found) = (again["er_l2"].as_f64().unwrap(), compared["errors"]["er_l2"].as_f64().unwrap());
    assert!(found <= stated && found > 0.99 * stated, "{found} {stated}");
    problem(
        service.request(Method::DELETE, &format!("/v1/measurements/{}", measurement.as_str().unwrap())),
        409,
        "in-use",
    )
    .await;
    // A job that makes the same bytes finds the material, with the manifest of the upload.
    let job = service.compress(&json!({ "measurement": measurement, "target": { "er_l2": 0.02 } })).await;
    assert_eq!(job["material"], id.as_str());

    assert_eq!(service.request(Method::DELETE, path).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    problem(service.get(path), 404, "not-found").await;
    let new =
        uploaded(&service, &format!("?measurement={}", measurement.as_str().unwrap()), file, StatusCode::CREATED).await;
    assert_eq!((&new["provenance"]["measurement"], &new["name"]), (&measurement, &json!(null)));
    assert_eq!(new["provenance"]["request"]["target"]["er_l2"], 0.02);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_are_measured_again_at_cells_and_samples() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let spectrum = service.upload("", LAMP_SPECTRUM).await["id"].clone();
    let joined = service.upload(&format!("?spectrum={}", spectrum.as_str().unwrap()), LAMP).await["id"].clone();
    // Equal bytes without the spectrum are another measurement than the one of the material.
    service.upload("", LAMP).await;
    let request =
        Request { outgoing_level: Some(3), wavelengths: Some("400:700:50".to_owned()), ..Request::er_l2(0.02) };
    let file = made(LAMP, Some(LAMP_SPECTRUM), &request);
    let material = uploaded(&service, "", file, StatusCode::CREATED).await;
    assert_eq!(material["measurements"], json!([joined]));
    let compared = &material["measured_again"][0];
    assert!(compared["errors_at_samples"]["er_l2"].as_f64().unwrap() > 0.0, "{compared}");
    let job = json!({
        "measurement": joined, "target": { "er_l2": 0.02 }, "outgoing_level": 3, "wavelengths": "400:700:50", "basis": "haar"
    });
    let job = service.compress(&job).await;
    let here = service.get(&format!("/v1/materials/{}", job["material"].as_str().unwrap())).send().await.unwrap();
    let here: Value = here.json().await.unwrap();
    assert_eq!((&here["provenance"]["origin"], here.get("measured_again")), (&json!("job"), None));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_files_and_those_of_another_measurement_are_refused_with_where_and_by_how_much() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let file = made(D65, None, &Request::er_l2(0.01));
    let post = |query: &str, body: Vec<u8>| service.post(&format!("/v1/materials{query}")).body(body);
    for length in [1, 7, file.len() / 4, file.len() / 2, file.len() - 1] {
        let refusal = problem(post("", file[..length].to_vec()), 422, "malformed-material").await;
        assert!(refusal["detail"].as_str().unwrap().contains("byte"), "{refusal}");
    }
    for at in (0..file.len()).step_by(1 + file.len() / 40) {
        let mut flipped = file.clone();
        flipped[at] ^= 0x10;
        problem(post("", flipped), 422, "malformed-material").await;
    }
    problem(post("", D65.to_vec()), 422, "malformed-material").await;
    problem(post("", Vec::new()), 422, "empty-body").await;
    problem(post("?tag=x", file.clone()), 400, "bad-query").await;
    let absent = Digest::of(b"absent");
    let refusal = problem(post(&format!("?measurement={absent}"), file.clone()), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().contains("there is no measurement"), "{refusal}");

    // Another light on the same wavelengths, and a lamp.
    let text = String::from_utf8(D65.to_vec()).unwrap();
    let other: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(i, line)| match line.split_once(',') {
            Some((wavelength, _)) if i > 0 => format!("{wavelength},{}\n", 50 + i % 7),
            _ => format!("{line}\n"),
        })
        .collect();
    let other = other.concat();
    let other = service.upload("", other).await["id"].clone();
    let lamp = service.upload("", LAMP).await["id"].clone();
    let named = |id: &Value| format!("?measurement={}", id.as_str().unwrap());
    let refusal = problem(post(&named(&other), file.clone()), 422, "not-of-measurement").await;
    let detail = refusal["detail"].as_str().unwrap();
    assert!(detail.contains("er_l2 is 0.") && detail.contains("the file states 0.0"), "{detail}");
    let refusal = problem(post(&named(&lamp), file.clone()), 422, "not-of-measurement").await;
    assert!(refusal["detail"].as_str().unwrap().contains("the measurement gives"), "{refusal}");
    let none: Value = service.get("/v1/materials").send().await.unwrap().json().await.unwrap();
    assert_eq!(none["items"], json!([]));
    // Without its provenance it is taken, and nothing is known about its origin.
    let whole = Request { metadata: false, ..Request::er_l2(0.01) };
    let bare = uploaded(&service, "", made(D65, None, &whole), StatusCode::CREATED).await;
    assert_eq!((&bare["provenance"]["generator"], &bare["provenance"]["content_digest"]), (&json!(""), &json!(null)));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_at_the_same_time_makes_one_material() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let file = made(D65, None, &Request::er_l2(0.02));
    service.upload("", D65).await;
    let posts = (0..6).map(|i| service.post(&format!("/v1/materials?tags=t{i}")).body(file.clone()).send());
    let answers = futures::future::join_all(posts).await;
    let mut statuses: Vec<u16> = answers.into_iter().map(|answer| answer.unwrap().status().as_u16()).collect();
    statuses.sort_unstable();
    assert_eq!(statuses, [200, 200, 200, 200, 200, 201]);
    let listed: Value = service.get("/v1/materials").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    assert_eq!(listed["items"][0]["tags"].as_array().unwrap().len(), 6);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sizes_are_checked_before_anything_is_decoded() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.checking_bytes_each = 64 << 10;
    config.work.limits.upload_bytes = 64 << 10;
    let service = Service::start(config).await;
    let axes = json!({ "quantity": "brdf", "axes": ["hemi:0", "hemi:3", "lambda:400:10:20"] });
    let interpretation = Interpretation { axes: Some(axes), ..Interpretation::default() };
    let array = npy(&[4, 256, 20]);
    let source = read(&Input { bytes: &array, spectrum: None, interpretation: &interpretation }).unwrap();
    let file = source.compress(&Request::er_l2(0.1)).unwrap().bytes;
    assert!(file.len() < 32 << 10, "{}", file.len());
    let refusal = problem(service.post("/v1/materials").body(file), 422, "over-limit").await;
    assert!(refusal["detail"].as_str().unwrap().contains("the limit is 65536"), "{refusal}");
    problem(service.post("/v1/materials").body(vec![0x89; 65 << 10]), 413, "too-large").await;
    uploaded(&service, "", made(D65, None, &Request::er_l2(0.02)), StatusCode::CREATED).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_measurement_read_with_other_options_does_not_refuse_a_material() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let rows = (0..40).map(|i| format!("{},{},{}\n", 400 + 5 * i, 20 + i % 9, 90 - i));
    let table = "wavelength_nm,first,second\n".to_owned() + &rows.collect::<String>();
    let interpretation = Interpretation { column: Some("first".to_owned()), ..Interpretation::default() };
    let input = Input { bytes: table.as_bytes(), spectrum: None, interpretation: &interpretation };
    let file = read(&input).unwrap().compress(&Request::er_l2(0.01)).unwrap().bytes;
    let other = service.upload("?column=second", table.clone()).await["id"].clone();
    let material = uploaded(&service, "", file.clone(), StatusCode::CREATED).await;
    assert_eq!(material["measurements"], json!([]));
    let named = service.post(&format!("/v1/materials?measurement={}", other.as_str().unwrap())).body(file.clone());
    problem(named, 422, "not-of-measurement").await;
    let right = service.upload("?column=first", table).await["id"].clone();
    let material = uploaded(&service, "", file, StatusCode::OK).await;
    assert_eq!(material["measurements"], json!([right]));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_bytes_of_the_measurement_count_as_memory_for_checking() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.checking_bytes_each = 40 << 10;
    let service = Service::start(config).await;
    let rows = (0..1000).map(|i| format!("{:.20},{:.20}\n", 400.0 + 0.25 * f64::from(i), 1.0 + 0.001 * f64::from(i)));
    let table = "wavelength_nm,first\n".to_owned() + &rows.collect::<String>();
    let file = made(table.as_bytes(), None, &Request::er_l2(0.01));
    assert!(24 * 1000 + file.len() < 40 << 10 && table.len() > 40 << 10, "{} {}", file.len(), table.len());
    service.upload("", table).await;
    let refusal = problem(service.post("/v1/materials").body(file), 422, "over-limit").await;
    assert!(refusal["detail"].as_str().unwrap().contains("the limit is 40960"), "{refusal}");
    service.stop().await;
}
