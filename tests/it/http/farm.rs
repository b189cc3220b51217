//! Links and tokens of a render farm: what they reach, where they are seen, and redirects to the store.

use super::keys::{Filled, guarded};
use crate::service::{Service, config, is_shared, problem, problem_of};
use reqwest::redirect::Policy;
use reqwest::{Client, Method, StatusCode};
use std::process::Command;
use std::time::Duration;
use wavelume::store::Digest;

/// Returns what the program prints with a key in its environment.
fn printed(key: &str, args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_wavelume")).args(args).env("WAVELUME_KEY", key).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_reads_headers_and_parts_of_one_file_and_nothing_else() {
    let data = tempfile::tempdir().unwrap();
    let (config, key) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &key).await;
    let absent = Digest::of(b"absent").to_string();
    let lines = printed(&key, &["link", "--url", &service.base, "--material", &material, "--material", &absent]);
    let (link, dead) = lines.split_once('\n').unwrap();
    let client = &service.client;

    let whole = client.get(link).send().await.unwrap();
    assert_eq!(whole.headers()["cache-control"], "private, max-age=31536000, immutable");
    let whole = whole.bytes().await.unwrap();
    assert_eq!(Digest::of(&whole).to_string(), material);
    let head = client.head(link).send().await.unwrap();
    assert_eq!(head.status(), StatusCode::OK);
    assert_eq!(head.headers()["content-length"], whole.len().to_string());
    let part = client.get(link).header("range", "bytes=3-9").send().await.unwrap();
    assert_eq!((part.status(), part.bytes().await.unwrap()), (StatusCode::PARTIAL_CONTENT, whole.slice(3..10)));
    let same = client.get(link).header("if-none-match", format!("\"{material}\"")).send().await.unwrap();
    assert_eq!(same.status(), StatusCode::NOT_MODIFIED);

    problem(client.get(dead), 404, "not-found").await;
    problem(client.get(link.replace(&material, &absent)), 401, "unauthorized").await;
    problem(client.get(format!("{link}&x=1")), 401, "unauthorized").await;
    problem(client.get(link.replace("/content?", "/export?format=manifest&")), 401, "unauthorized").await;
    problem(client.get(link).bearer_auth("wlm_x"), 401, "unauthorized").await;
    for refused in
        [client.get(link.replace("signature=", "signature=A")), client.get(link.replace("expires=1", "expires=2"))]
    {
        let refusal = problem_of(refused.send().await.unwrap(), 401, "unauthorized").await;
        assert!(!refusal.to_string().contains(&link[link.len() - 20..]), "{refusal}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_is_for_its_methods_scopes_and_material() {
    let data = tempfile::tempdir().unwrap();
    let (config, key) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &key).await;
    let status = async |token: &str, method: Method, path: &str| {
        let request = service.request(method.clone(), path).bearer_auth(token);
        let request =
            if method == Method::POST { request.json(&serde_json::json!({ "wo": [[0, 0]] })) } else { request };
        request.send().await.unwrap().status().as_u16()
    };
    let (file, evaluate) = (format!("/v1/materials/{material}/content"), format!("/v1/materials/{material}/evaluate"));
    let all = printed(&key, &["token"]);
    for path in ["/v1/materials", "/v1/measurements", "/v1/jobs", &file] {
        assert_eq!(status(&all, Method::GET, path).await, 200, "{path}");
        assert_eq!(status(&all, Method::HEAD, path).await, 200, "{path}");
    }
    assert_eq!(status(&all, Method::POST, &evaluate).await, 403, "GET alone");
    assert_eq!(status(&all, Method::GET, "/v1/keys").await, 403, "no administration");
    let posts = printed(&key, &["token", "--methods", "GET,POST", "--material", &material]);
    assert_ne!(status(&posts, Method::POST, &evaluate).await, 403);
    assert_eq!(status(&posts, Method::POST, "/v1/jobs").await, 403);
    let writes = printed(&key, &["token", "--scopes", "write", "--expires", "7d"]);
    assert_eq!(status(&writes, Method::GET, &file).await, 403);
    assert_eq!(status(&writes, Method::DELETE, &format!("/v1/materials/{}", Digest::of(b""))).await, 404);
    // A request that carries out another method needs that one.
    let instead = async |methods: &str, method: &str| {
        let token = printed(&key, &["token", "--scopes", "write", "--methods", methods]);
        let upload = service.post("/v1/uploads/00000000000000000000000000000000").bearer_auth(token);
        let upload = upload.header("tus-resumable", "1.0.0").header("x-http-method-override", method);
        upload.body("").send().await.unwrap().status().as_u16()
    };
    assert_eq!(instead("POST", "DELETE").await, 403);
    assert_eq!(instead("POST", "PATCH").await, 403);
    assert_eq!(instead("DELETE", "DELETE").await, 404);
    assert_eq!(instead("DELETE", "PATCH").await, 403);
    assert_eq!(instead("POST", "GET").await, 400);

    // A stored table is another resource, even if it is the material itself.
    let color = format!("/v1/materials/{material}/color?illuminant={material}");
    let preview = format!("/v1/materials/{material}/preview.png?observer={material}");
    for path in [&color, &preview] {
        problem(service.get(path).bearer_auth(&posts), 403, "missing-scope").await;
        assert_ne!(status(&all, Method::GET, path).await, 403, "{path}");
    }
    assert_eq!(status(&posts, Method::GET, color.split_once('?').unwrap().0).await, 200);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn downloads_are_redirected_to_a_store_that_can_while_time_is_left() {
    let data = tempfile::tempdir().unwrap();
    let (mut config, key) = guarded(data.path());
    config.work.limits.store_redirect.0 = Duration::from_mins(15);
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &key).await;
    let client = Client::builder().no_proxy().redirect(Policy::none()).build().unwrap();
    let link =
        |time: &str| printed(&key, &["link", "--url", &service.base, "--material", &material, "--expires", time]);
    let (long, short, over) = (link("1h"), link("40s"), link("1s"));
    let life = async |url: &str| {
        let answer = client.get(url).send().await.unwrap();
        if answer.status() == StatusCode::OK {
            assert_eq!(Digest::of(&answer.bytes().await.unwrap()).to_string(), material);
            return 0;
        }
        assert_eq!(answer.status(), StatusCode::TEMPORARY_REDIRECT);
        assert_eq!(answer.headers()["cache-control"], "no-store");
        let location = answer.headers()["location"].to_str().unwrap().to_owned();
        let stored = client.get(&location).send().await.unwrap();
        assert_eq!(stored.headers()["content-type"], "application/vnd.wavelume.material");
        assert!(stored.headers()["content-disposition"].to_str().unwrap().starts_with("attachment"));
        assert_eq!(Digest::of(&stored.bytes().await.unwrap()).to_string(), material);
        let (_, rest) = location.split_once("X-Amz-Expires=").unwrap();
        rest.split('&').next().unwrap().parse::<u64>().unwrap()
    };
    // A directory has no URLs.
    let (most, brief) = if is_shared() { (900, 1..=40) } else { (0, 0..=0) };
    assert_eq!(life(&long).await, most);
    assert!(brief.contains(&life(&short).await));
    tokio::time::sleep(Duration::from_millis(1100)).await;
    assert_eq!(life(&over).await, 0, "within the allowed difference of the clocks, but without time for a redirect");
    assert_eq!(client.head(&long).send().await.unwrap().status(), StatusCode::OK);
    let same = client.get(&long).header("if-none-match", format!("\"{material}\"")).send().await.unwrap();
    assert_eq!(same.status(), StatusCode::NOT_MODIFIED);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_the_setting_no_download_is_redirected() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.material().await;
    let client = Client::builder().no_proxy().redirect(Policy::none()).build().unwrap();
    let answer = client.get(format!("{}/v1/materials/{id}/content", service.base)).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    service.stop().await;
}
