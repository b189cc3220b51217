//! Uploads and what is kept of them.

use crate::service::{CHECKER, D65, LAMP, LAMP_SPECTRUM, Service, config, npy, objects, problem, problem_of};
use async_compression::tokio::bufread::GzipEncoder;
use reqwest::{Method, StatusCode};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use serde_json::{Value, json};
use tokio::io::AsyncReadExt;
use wavelume::store::Digest;

async fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    GzipEncoder::new(bytes).read_to_end(&mut out).await.unwrap();
    out
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec(bytes, CompressionLevel::Fastest)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_says_what_was_understood_and_keeps_the_bytes() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let response = service.post("/v1/measurements?filename=lamp.ies&name=Lamp").body(LAMP).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let lamp: Value = response.json().await.unwrap();
    assert_eq!(lamp["id"], Digest::of(LAMP).to_string());
    assert_eq!(lamp["content_digest"], lamp["id"]);
    assert_eq!((lamp["quantity"].as_str(), lamp["name"].as_str()), (Some("edf"), Some("Lamp")));
    assert_eq!(location, lamp["links"]["self"].as_str().unwrap());
    assert!(lamp["range"][1].as_f64().unwrap() > 0.0 && lamp["coverage"]["outside"] == "zero");
    assert!(!lamp["axes"].as_array().unwrap().is_empty() && lamp["warnings"].is_array());

    let again = service.post("/v1/measurements").body(LAMP).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(service.get(&location).send().await.unwrap().json::<Value>().await.unwrap(), lamp);

    let content = service.get(&format!("{location}/content")).send().await.unwrap();
    assert_eq!(content.headers()["content-type"], "application/octet-stream");
    assert!(content.headers()["content-disposition"].to_str().unwrap().contains("lamp.ies"));
    assert_eq!(content.headers()["x-content-type-options"], "nosniff");
    assert_eq!(content.bytes().await.unwrap(), LAMP);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn options_make_another_measurement_of_the_same_content() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let table = service.upload("", CHECKER).await;
    let skin = service.upload("?column=light%20skin&quantity=reflectance", CHECKER).await;
    assert_eq!(skin["content_digest"], table["content_digest"]);
    assert_ne!(skin["id"], table["id"]);
    assert_eq!(
        (skin["quantity"].as_str(), skin["options"]["column"].as_str()),
        (Some("reflectance"), Some("light skin"))
    );

    let spectrum = service.upload("", LAMP_SPECTRUM).await;
    let id = spectrum["id"].as_str().unwrap();
    let joined = service.upload(&format!("?spectrum={id}"), LAMP).await;
    assert!(joined["axes"].as_array().unwrap().iter().any(|axis| axis["kind"] == "wavelength"));
    problem(service.request(Method::DELETE, &format!("/v1/measurements/{id}")), 409, "in-use").await;

    let absent = Digest::of(b"absent");
    problem(service.post(&format!("/v1/measurements?spectrum={absent}")).body(D65), 422, "unreadable-spectrum").await;
    let skin = skin["id"].as_str().unwrap();
    let refused = service.post(&format!("/v1/measurements?spectrum={skin}")).body(LAMP.to_vec());
    problem(refused, 422, "unreadable-spectrum").await;
    let refused = service.post("/v1/measurements?column=no%20such%20column").body(CHECKER);
    problem(refused, 422, "needs-option").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn encoded_bodies_are_decoded_within_limits() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.upload_bytes = 4 << 20;
    let service = Service::start(config).await;
    let post = |encoding: &str, body: Vec<u8>| {
        service.post("/v1/measurements").header("content-encoding", encoding).body(body)
    };
    for (encoding, body) in [("gzip", gzip(D65).await), ("zstd", zstd(D65)), ("identity", D65.to_vec())] {
        let uploaded: Value = post(encoding, body).send().await.unwrap().json().await.unwrap();
        assert_eq!(uploaded["id"], Digest::of(D65).to_string(), "{encoding}: {uploaded}");
    }
    let zeros = vec![0; 3 << 20];
    problem(post("gzip", gzip(&zeros).await), 413, "decompression-ratio").await;
    problem(post("zstd", zstd(&zeros)), 413, "decompression-ratio").await;
    problem(post("identity", vec![b'x'; (4 << 20) + 1]), 413, "too-large").await;
    let noise: Vec<u8> = (0_u32..5 << 20).map(|i| (i.wrapping_mul(2_654_435_761).rotate_left(9) >> 24) as u8).collect();
    problem(post("gzip", gzip(&noise).await), 413, "too-large").await;
    for (encoding, whole) in [("gzip", gzip(D65).await), ("zstd", zstd(D65))] {
        problem(post(encoding, whole[..whole.len() / 2].to_vec()), 400, "bad-body").await;
        problem(post(encoding, D65.to_vec()), 400, "bad-body").await;
        problem(post(encoding, [whole.as_slice(), b"and more"].concat()), 400, "bad-body").await;
    }
    problem(post("br", D65.to_vec()), 415, "unsupported-encoding").await;
    problem(post("gzip, gzip", D65.to_vec()), 415, "unsupported-encoding").await;
    problem(post("identity", Vec::new()), 422, "empty-body").await;
    problem(post("gzip", gzip(b"").await), 422, "empty-body").await;
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0, "refused bytes are not kept");
}

/// Media type of a form, and a form with these parts: the parameters of its disposition, and its bytes.
fn form(parts: &[(&str, &[u8])]) -> (&'static str, Vec<u8>) {
    let mut body = Vec::new();
    for (disposition, bytes) in parts {
        body.extend(format!("--d74496d66958873e\r\nContent-Disposition: form-data; {disposition}\r\n\r\n").as_bytes());
        body.extend(*bytes);
        body.extend(b"\r\n");
    }
    body.extend(b"--d74496d66958873e--\r\n");
    ("multipart/form-data; boundary=d74496d66958873e", body)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_form_with_one_file_is_that_file() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.upload_bytes = 1 << 20;
    let service = Service::start(config).await;
    let post = |query: &str, (kind, body): (&str, Vec<u8>)| {
        service.post(&format!("/v1/measurements{query}")).header("content-type", kind).body(body)
    };
    let lamp = form(&[("name=\"file\"; filename=\"lamp.ies\"", LAMP)]);
    let response = post("", lamp.clone()).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let uploaded: Value = response.json().await.unwrap();
    assert_eq!(uploaded["id"], Digest::of(LAMP).to_string(), "the bytes of the file alone");
    assert_eq!((&uploaded["file_name"], &uploaded["bytes"]), (&json!("lamp.ies"), &json!(LAMP.len())));
    let path = format!("/v1/measurements/{}/content", uploaded["id"].as_str().unwrap());
    assert_eq!(service.get(&path).send().await.unwrap().bytes().await.unwrap(), LAMP);
    assert_eq!(post("", lamp).send().await.unwrap().status(), StatusCode::OK, "the same measurement");

    // The query counts before the form, and options are there.
    let checker = form(&[("name=\"file\"; filename=\"checker.csv\"", CHECKER)]);
    let skin =
        post("?filename=skin.csv&column=light%20skin&quantity=reflectance", checker.clone()).send().await.unwrap();
    let skin: Value = skin.json().await.unwrap();
    assert_eq!((&skin["file_name"], &skin["quantity"]), (&json!("skin.csv"), &json!("reflectance")), "{skin}");
    let (kind, body) = form(&[("name=\"file\"; filename=\"d65.csv\"", D65)]);
    for (encoding, body) in [("gzip", gzip(&body).await), ("zstd", zstd(&body))] {
        let coded = post("", (kind, body)).header("content-encoding", encoding).send().await.unwrap();
        assert_eq!(coded.json::<Value>().await.unwrap()["id"], Digest::of(D65).to_string());
    }

    let refused =
        async |body, status, code| problem(post("", body), status, code).await["detail"].as_str().unwrap().to_owned();
    let several = form(&[("name=\"a\"; filename=\"a.csv\"", D65), ("name=\"a\"; filename=\"b.csv\"", CHECKER)]);
    let detail = refused(several, 400, "bad-body").await;
    assert!(detail.contains("found the files `a.csv` and `b.csv`") && detail.contains("zip archive"), "{detail}");
    let field = form(&[("name=\"quantity\"", b"brdf"), ("name=\"a\"; filename=\"a.csv\"", D65)]);
    assert!(refused(field, 400, "bad-body").await.contains("options are parameters of the URL"));
    assert!(refused(form(&[]), 400, "bad-body").await.contains("found no file in the form"));
    refused(form(&[("name=\"a\"; filename=\"a.csv\"", b"")]), 422, "empty-body").await;
    refused(("multipart/form-data", D65.to_vec()), 400, "bad-body").await;
    let (kind, whole) = form(&[("name=\"a\"; filename=\"a.csv\"", D65)]);
    refused((kind, whole[..whole.len() - 20].to_vec()), 400, "bad-body").await;

    // The limit counts the file, not what the form adds.
    let text = "# quantity: spectrum\n400,1\n500,2\n600,3\n";
    let padded = |length: usize| [text.as_bytes(), &vec![b'\n'; length - text.len()]].concat();
    let large = |length: usize| form(&[("name=\"a\"; filename=\"a.csv\"", &padded(length))]);
    let answer = post("", large(1 << 20)).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::CREATED, "{}", answer.text().await.unwrap());
    refused(large((1 << 20) + 1), 413, "too-large").await;
    refused(large((1 << 20) + (64 << 10)), 413, "too-large").await;
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0, "refused bytes are not kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_without_its_line_breaks_is_explained() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    // As `curl --data @FILE` sends a file, and `curl --data-binary @FILE`.
    let post = |path: &str, body: Vec<u8>| {
        service.post(path).header("content-type", "application/x-www-form-urlencoded").body(body)
    };
    let stripped =
        |file: &[u8]| file.iter().copied().filter(|byte| !matches!(byte, b'\n' | b'\r' | 0)).collect::<Vec<_>>();
    for file in [LAMP, D65, CHECKER, LAMP_SPECTRUM] {
        let refusal = problem(post("/v1/measurements", stripped(file)), 400, "bad-body").await;
        let detail = refusal["detail"].as_str().unwrap();
        assert!(detail.contains("use `curl --data-binary @FILE`"), "{detail}");
        let kept = post("/v1/measurements", file.to_vec()).send().await.unwrap();
        assert_eq!(kept.status(), StatusCode::CREATED);
    }
    let refusal = problem(post("/v1/materials", b"no material".to_vec()), 400, "bad-body").await;
    assert!(refusal["detail"].as_str().unwrap().contains("--data-binary"), "{refusal}");
    // Numbers in one line may be others than the file has: 0.17 and 0.08 are 0.170.08.
    let refusal = problem(post("/v1/measurements", b"0.5 0.17 0.08 0.04".to_vec()), 400, "bad-body").await;
    assert!(refusal["detail"].as_str().unwrap().contains("-H 'content-type: text/plain'"), "{refusal}");
    // JSON needs no line breaks, and other media types are not those of curl.
    let model = br#"{"wavelume": "virtual", "quantity": "edf", "model": "isotropic", "axes": ["sphere:1"]}"#;
    assert_eq!(post("/v1/measurements", model.to_vec()).send().await.unwrap().status(), StatusCode::CREATED);
    problem(service.post("/v1/measurements").body("no measurement"), 422, "unrecognised-format").await;
    problem(post("/v1/measurements", b"no\nmeasurement".to_vec()), 422, "unrecognised-format").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn refused_measurements_say_where_and_leave_nothing() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let post = |body: &'static [u8]| service.post("/v1/measurements").body(body);
    problem(post(b"\x00\x01\x02 what is this"), 422, "unrecognised-format").await;
    let broken = &include_bytes!("../../fixtures/ies/test_file_format_error.ies")[..];
    let refusal = problem(post(broken), 422, "malformed-measurement").await;
    assert!(refusal["detail"].as_str().unwrap().contains("line "), "{refusal}");
    let absent = Digest::of(broken);
    problem(service.get(&format!("/v1/blobs/{absent}")), 404, "not-found").await;
    let page: Value = service.get("/v1/measurements").send().await.unwrap().json().await.unwrap();
    assert_eq!(page, json!({ "items": [], "next": null }));
    service.stop().await;
    assert!(objects(data.path(), "").await.is_empty());
}

/// A table with uncertainties of 5 %, an albedo above 1, one negative value, and a lobe about 11° wide; `header` are
/// further lines.
fn implausible(header: &str) -> String {
    let mut text = format!(
        "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
         # isotropic: true\n{header}theta_i,theta_o,phi_o,v550,s550\n"
    );
    for theta_i in [0, 30, 60] {
        for theta_o in (0..=80).step_by(10) {
            for phi_o in (0..360).step_by(30) {
                let value = match (theta_o == theta_i, phi_o) {
                    (true, 180) if theta_i > 0 => 5.0,
                    (_, 90) if theta_o == 80 && theta_i == 0 => -0.05,
                    _ => 0.4,
                };
                let line = format!("{theta_i},{theta_o},{phi_o},{value},{}\n", 0.05 * f64::abs(value));
                text.push_str(&line);
            }
        }
    }
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_is_checked_against_physics_and_its_instrument() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let table = implausible("# detector_aperture: 12\n# source_divergence: 0.5\n");
    let answer = service.post("/v1/measurements").body(table).send().await.unwrap().json::<Value>().await.unwrap();
    assert_eq!(answer["instrument"], json!({ "detector_aperture": 12.0, "source_divergence": 0.5 }), "{answer}");
    assert_eq!(answer["coverage"]["stated_uncertainties"], true);
    let checked = |answer: &Value| -> Vec<String> {
        let warnings = answer["warnings"].as_array().unwrap().iter().filter(|note| note["kind"] == "checked");
        warnings.map(|note| note["message"].as_str().unwrap().to_owned()).collect()
    };
    let lines = checked(&answer);
    assert_eq!(lines.len(), 4, "{lines:?}");
    assert!(lines[0].starts_with("albedo above 1 under 3 of 3 incoming directions") && lines[0].contains("at 550 nm"));
    assert!(lines[1].starts_with("f(wi, wo) and f(wo, wi), equal by reciprocity, differ by"), "{lines:?}");
    assert!(lines[2].starts_with("1 of 324 values (0.31 %) are negative; the largest has 1.00 %"), "{lines:?}");
    assert!(
        lines[3].ends_with("is no wider than the detector's aperture of 12°: its true width is unknown"),
        "{lines:?}"
    );
    let silent = service.upload("", D65).await;
    assert_eq!((checked(&silent), &silent["instrument"]), (vec![], &json!({})), "{silent}");

    let job = service.compress(&json!({ "measurement": answer["id"], "target": "auto" })).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!(material["auto"]["stopped_at"], "uncertainty", "{material}");
    assert!((material["auto"]["uncertainty"].as_f64().unwrap() - 0.05).abs() < 1e-6, "{material}");
    let within = material["within_2u"].as_f64().unwrap();
    assert!((0.9..=1.0).contains(&within), "{material}");
    let notes = material["notes"].as_array().unwrap();
    assert!(notes.iter().any(|note| note["message"].as_str().unwrap().contains("is no wider than")), "{material}");
    let of_axes = material["coverage"]["notes"].as_array().unwrap();
    let is_whole = |note: &Value| ["kind", "message", "code"].iter().all(|name| note[name].is_string());
    assert!(!of_axes.is_empty() && of_axes.iter().all(is_whole), "{material}");

    for bad in ["", "wide", "-1", "180.5", "1 deg", "NaN", "1e999", "\u{0}", "12,5", "0x10"] {
        let table = implausible(&format!("# source_divergence: 1\n# detector_aperture: {bad}\n"));
        let refused = service.post("/v1/measurements").body(table.into_bytes());
        let refusal = problem(refused, 422, "malformed-measurement").await;
        let detail = refusal["detail"].as_str().unwrap();
        assert!(detail.contains("line 8, column 1") && detail.contains("detector_aperture"), "{bad}: {detail}");
        assert!(detail.contains("expected a full angle in degrees, from 0 to 180"), "{bad}: {detail}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_filter_and_page() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for (query, bytes) in [("?name=lamp", LAMP), ("?name=daylight", D65), ("?name=checker", CHECKER)] {
        service.upload(query, bytes).await;
    }
    let list = async |query: &str| -> Value {
        service.get(&format!("/v1/measurements{query}")).send().await.unwrap().json().await.unwrap()
    };
    assert_eq!(list("").await["items"].as_array().unwrap().len(), 3);
    assert_eq!(list("?quantity=edf").await["items"][0]["name"], "lamp");
    assert_eq!(list("?q=DAYL").await["items"][0]["name"], "daylight");
    assert_eq!(list("?format=nothing").await["items"], json!([]));
    let first = list("?limit=2").await;
    let rest = list(&format!("?limit=2&cursor={}", first["next"].as_str().unwrap())).await;
    assert_eq!((first["items"].as_array().unwrap().len(), rest["items"].as_array().unwrap().len()), (2, 1));
    assert_eq!(rest["next"], Value::Null);
    for bad in ["?limit=0", "?limit=1001", "?limit=x", "?cursor=x", "?quantity=brd", "?unknown=1"] {
        problem(service.get(&format!("/v1/measurements{bad}")), 400, "bad-query").await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn too_many_uploads_are_told_to_come_again() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.uploads = 0;
    let service = Service::start(config).await;
    let busy = service.post("/v1/measurements").body(D65).send().await.unwrap();
    assert!(busy.headers().contains_key("retry-after"));
    problem_of(busy, 503, "overloaded").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_file_of_an_archive_becomes_a_measurement() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let zipped = |files: &[(&str, &[u8])]| {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, bytes) in files {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut writer, bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    };
    let archive = zipped(&[("ies/lamp.ies", LAMP), ("d65.csv", D65), ("read me.pdf", b"%PDF-1.7")]);
    let response = service.post("/v1/measurements?name=All").body(archive.clone()).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let answer: Value = response.json().await.unwrap();
    let items = answer["items"].as_array().unwrap();
    assert_eq!((items.len(), items[0]["file_name"].as_str()), (2, Some("d65.csv")));
    assert_eq!(items[1]["id"], Digest::of(LAMP).to_string());
    assert_eq!(items[1]["name"], "All: ies/lamp.ies");
    assert_eq!(answer["skipped"][0]["file_name"], "read me.pdf");
    assert!(answer["skipped"][0]["reason"].as_str().unwrap().contains("PDF"));
    let again = service.post("/v1/measurements").body(archive).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::OK);

    // An array is read with the manifest beside it; a broken manifest is reported.
    let array = npy(&[3]);
    let manifest = br#"{"quantity": "reflectance", "value_unit": "1", "axes": ["lambda:400:100:3"]}"#;
    let arrays = zipped(&[
        ("scan/a.npy", &array),
        ("scan/a.axes.json", manifest),
        ("b.npy", &array),
        ("b.axes.json", b"{\"quantity\": "),
    ]);
    let answer: Value = service.post("/v1/measurements").body(arrays).send().await.unwrap().json().await.unwrap();
    let items = answer["items"].as_array().unwrap();
    assert_eq!((items.len(), items[0]["file_name"].as_str()), (1, Some("scan/a.npy")), "{answer}");
    assert_eq!(items[0]["quantity"], "reflectance", "{answer}");
    assert_eq!(answer["skipped"].as_array().unwrap().len(), 1, "{answer}");
    assert!(answer["skipped"][0]["reason"].as_str().unwrap().contains("b.axes.json"), "{answer}");
    let job = service.compress(&json!({ "measurement": items[0]["id"], "target": { "er_l2": 0.01 } })).await;
    assert_eq!(job["state"], "succeeded", "{job}");

    let nested = zipped(&[("a.zip", &zipped(&[("lamp.ies", LAMP)]))]);
    problem(service.post("/v1/measurements").body(nested), 422, "unsupported-measurement").await;
    let bomb = zipped(&[("zeros.npy", &vec![0; 20 << 20])]);
    problem(service.post("/v1/measurements").body(bomb), 422, "over-limit").await;
    problem(service.post("/v1/measurements").body(zipped(&[("a.pdf", b"%PDF-1.7")])), 422, "invalid-request").await;
    service.stop().await;
}
