//! Backup of a service under load by the real program, killed and repeated, and its restore elsewhere.

use crate::service::{D65, Service, config, make_schema};
use reqwest::Method;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use wavelume::Database;
use wavelume::api::ServeConfig;
use wavelume::store::Digest;

/// The program with the database and the store of a service.
fn program(config: &ServeConfig, words: &[&str]) -> Command {
    let site = &config.work.site;
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    command.args(words).arg("--data").arg(&site.data).stdin(Stdio::null());
    if let Some(Database::Server(url)) = &site.database {
        command.args(["--database", url]);
    }
    if let Some(store) = &site.store {
        command.args(["--store", &store.to_string()]);
    }
    command
}

/// Runs a command to its end after it was killed at a few earlier moments. Returns its output, which must be a success.
fn killed_and_repeated(command: impl Fn() -> Command) -> String {
    for time in [30, 120, 300] {
        let mut running = command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(time));
        running.kill().unwrap();
        let ended = running.wait().unwrap();
        // A restore that was quicker than its end must not be repeated.
        if ended.success() {
            return String::new();
        }
    }
    text(command().output().unwrap())
}

fn text(output: Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn spectrum(number: u64) -> Vec<u8> {
    let rows: Vec<String> = (0..40).map(|i| format!("{},{}.5", 400 + 5 * i, (number * 31 + i * 7) % 997 + 1)).collect();
    format!("wavelength,{number}\n{}\n", rows.join("\n")).into_bytes()
}

/// Returns the configuration of a service whose collector looks each second and leaves no time of grace.
fn eager(data: &Path) -> ServeConfig {
    let mut config = config(data);
    config.work.limits.sweep = Duration::from_secs(1);
    config.work.limits.grace = Duration::ZERO;
    config
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_under_load_has_every_upload_that_was_answered_before_it() {
    let (data, other, backups) =
        (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let config = eager(data.path());
    let service = Arc::new(Service::start(config.clone()).await);
    let mut files = BTreeMap::new();
    for number in 0..20 {
        let answer = service.upload("", spectrum(number)).await;
        files.insert(answer["id"].as_str().unwrap().to_owned(), spectrum(number));
    }
    files.insert(service.upload("?filename=d65.csv", D65).await["id"].as_str().unwrap().to_owned(), D65.to_vec());
    let material = service.material().await;
    let stop = Arc::new(AtomicBool::new(false));
    let loads = [1000, 2000].map(|first| {
        let (service, stop) = (Arc::clone(&service), Arc::clone(&stop));
        tokio::spawn(async move {
            for number in first.. {
                let id = service.upload("", spectrum(number)).await["id"].as_str().unwrap().to_owned();
                if number % 2 == 0 {
                    let path = format!("/v1/measurements/{id}");
                    service.request(Method::DELETE, &path).send().await.unwrap().error_for_status().unwrap();
                }
                if stop.load(Ordering::Relaxed) {
                    return number - first;
                }
            }
            0
        })
    });
    let dest = backups.path().join("backup").display().to_string();
    let (site, to) = (config.clone(), dest.clone());
    let backing_up = move || {
        killed_and_repeated(|| program(&site, &["backup", &to]));
        text(program(&site, &["backup", &to, "--check"]).output().unwrap())
    };
    let said = tokio::task::spawn_blocking(backing_up).await.unwrap();
    let last = said.lines().last().unwrap();
    assert!(last.starts_with("copied ") && last.ends_with("; 0 are missing or damaged"), "{said}");
    stop.store(true, Ordering::Relaxed);
    for load in loads {
        assert!(load.await.unwrap() > 0);
    }
    let Ok(service) = Arc::try_unwrap(service) else { panic!("a load still runs") };
    service.stop().await;

    let target = eager(other.path());
    make_schema(&target).await;
    let (site, from) = (target.clone(), dest.clone());
    let restoring = move || killed_and_repeated(|| program(&site, &["restore", &from]));
    tokio::task::spawn_blocking(restoring).await.unwrap();
    let again = program(&target, &["restore", &dest]).output().unwrap();
    let refusal = String::from_utf8(again.stderr).unwrap();
    assert!(!again.status.success() && refusal.contains("expected an empty database"), "{refusal}");
    let checked = text(program(&target, &["fsck"]).output().unwrap());
    assert!(checked.starts_with("checked "), "{checked}");

    let restored = Service::start(target.clone()).await;
    for (id, bytes) in &files {
        let content = restored.get(&format!("/v1/measurements/{id}/content")).send().await.unwrap();
        assert_eq!(content.error_for_status().unwrap().bytes().await.unwrap(), bytes);
    }
    let content = restored.get(&format!("/v1/materials/{material}/content")).send().await.unwrap();
    assert_eq!(Digest::of(&content.bytes().await.unwrap()).to_string(), material);
    assert_eq!(restored.material().await, material, "jobs run in the copy");
    restored.stop().await;

    // From this kind of service to a directory.
    let single = tempfile::tempdir().unwrap();
    let mut moving = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    moving.arg("move").arg("--data").arg(single.path().join("data")).arg("--from-data").arg(&target.work.site.data);
    if let (Some(Database::Server(url)), Some(store)) = (&target.work.site.database, &target.work.site.store) {
        moving.args(["--from-database", url, "--from-store", &store.to_string()]);
    }
    let said = text(moving.output().unwrap());
    assert!(said.contains("; 0 are missing or damaged; the new catalog is "), "{said}");
    let mut alone = ServeConfig::new(single.path().join("data"), ([127, 0, 0, 1], 0).into());
    alone.work.workers = 0;
    let moved = Service::start(alone).await;
    for (id, bytes) in &files {
        let content = moved.get(&format!("/v1/measurements/{id}/content")).send().await.unwrap();
        assert_eq!(content.error_for_status().unwrap().bytes().await.unwrap(), bytes);
    }
    moved.stop().await;
}
