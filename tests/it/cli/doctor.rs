//! The examination of a site: healthy ones, new ones, and each fault that can be made here; nothing is changed.

use super::at;
use super::service::Service;
use super::settings::with;
use serde_json::Value;
use sqlx::Connection;
use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Returns the findings of `wavelume doctor` that are not ok, and the names of all checks.
fn judged(code: i32, variables: &[(&str, &str)], args: &[&str]) -> (Vec<Value>, Vec<String>) {
    let output = with(variables, &[&["doctor", "--json"], args].concat());
    let (stdout, stderr) = texts(&output);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {stderr}\n{stdout}");
    let report: Value = serde_json::from_str(&stdout).unwrap();
    let findings = report["findings"].as_array().unwrap();
    let count = |verdict: &str| findings.iter().filter(|finding| finding["verdict"] == verdict).count();
    assert_eq!((&report["faults"], &report["warnings"]), (&count("fault").into(), &count("warning").into()));
    assert_eq!(code == 1, count("fault") > 0);
    for finding in findings {
        assert_eq!(finding["remedy"] == "", finding["verdict"] == "ok", "{finding}");
    }
    let names = findings.iter().map(|finding| finding["check"].as_str().unwrap().to_owned()).collect();
    // The disk of this machine is not the matter here.
    let is_here = |finding: &&Value| {
        let check = finding["check"].as_str().unwrap();
        check.starts_with("local") || check.ends_with("space") || check.ends_with("file system")
    };
    (findings.iter().filter(|finding| finding["verdict"] != "ok" && !is_here(finding)).cloned().collect(), names)
}

/// Returns stdout and stderr, neither of which may show the password of the tests.
fn texts(output: &Output) -> (String, String) {
    let texts = [&output.stdout, &output.stderr].map(|text| String::from_utf8(text.clone()).unwrap());
    assert!(texts.iter().all(|text| !text.contains("topsecret")), "{texts:?}");
    let [stdout, stderr] = texts;
    (stdout, stderr)
}

/// Returns a finding as one text: verdict, check, what was found, what to do.
fn text(finding: &Value) -> String {
    ["verdict", "check", "found", "remedy"].map(|part| finding[part].as_str().unwrap()).join(" ")
}

/// Starts a service and ends it, so that its store and its catalog belong together.
fn served(variables: &[(&str, &str)], args: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    command.args(["serve", "--listen", "127.0.0.1:0"]).args(args).envs(variables.iter().copied()).stderr(Stdio::null());
    assert_eq!(Service::spawn(command).signal("-INT"), Some(0));
}

fn succeeds(variables: &[(&str, &str)], args: &[&str]) {
    let output = with(variables, args);
    assert!(output.status.success(), "{args:?}: {:?}", texts(&output));
}

/// Returns the paths and sizes of all files and directories. The files beside that of SQLite are left out: whoever
/// opens it last folds its log into it.
fn everything(root: &Path) -> Vec<String> {
    let (mut found, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let shown = path.display().to_string();
            let is_counted = path.is_file() && !shown.ends_with("catalog.sqlite");
            let size = if is_counted { path.metadata().unwrap().len() } else { 0 };
            if !shown.ends_with("-wal") && !shown.ends_with("-shm") {
                found.push(format!("{shown} {size}"));
            }
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    found.sort();
    found
}

const STEPS: [&str; 6] = ["put", "get", "range", "list", "multipart", "delete"];

#[test]
fn a_data_directory_is_examined_and_not_made() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    let (warnings, names) = judged(0, &[("WAVELUME_DATA", &data)], &[]);
    let warned: Vec<_> = warnings.iter().map(|finding| finding["check"].as_str().unwrap()).collect();
    assert_eq!(warned, ["database", "store"], "{names:?}");
    assert!(everything(dir.path()).is_empty());

    served(&[], &["--data", &data]);
    let before = everything(dir.path());
    let (wrong, names) = judged(0, &[], &["--data", &data]);
    assert!(wrong.is_empty(), "{wrong:?}");
    let steps = STEPS.map(|step| format!("store {step}"));
    let others = [
        "database durability",
        "database schema",
        "database clock",
        "store instance",
        "local scratch",
        "local permissions",
    ];
    for name in others.into_iter().chain(steps.iter().map(String::as_str)) {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
    assert_eq!(everything(dir.path()), before);

    let output = with(&[], &["doctor", "--data", &data]);
    let (stdout, _) = texts(&output);
    let columns: Vec<_> =
        stdout.lines().map(|line| line.find("database").or(line.find("store")).unwrap_or(9)).collect();
    assert!(stdout.lines().count() == names.len() && columns.iter().all(|column| *column == 9), "{stdout}");
    assert!(stdout.starts_with("ok       database  "), "{stdout}");
}

#[test]
fn faults_of_a_data_directory_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    served(&[], &["--data", &data]);
    let instance = dir.path().join("data/wavelume-instance");
    let ours = fs::read_to_string(&instance).unwrap();
    fs::write(&instance, "01a2-another").unwrap();
    let (faults, _) = judged(1, &[], &["--data", &data]);
    assert_eq!(faults.len(), 1, "{faults:?}");
    let told = text(&faults[0]);
    for part in ["fault store instance", "01a2-another", ours.trim(), "--adopt-store 01a2-another"] {
        assert!(told.contains(part), "{told}");
    }
    fs::remove_file(&instance).unwrap();
    let (faults, _) = judged(1, &[], &["--data", &data]);
    assert!(text(&faults[0]).contains("carries no wavelume-instance"), "{faults:?}");
    assert!(!instance.exists());
    fs::write(&instance, ours).unwrap();
    let backup = dir.path().join("data/wavelume-backup");
    fs::write(&backup, "{}").unwrap();
    let (faults, _) = judged(1, &[], &["--data", &data]);
    assert!(faults.len() == 1 && text(&faults[0]).contains("holds a backup"), "{faults:?}");
    fs::remove_file(&backup).unwrap();

    fs::write(dir.path().join("data/catalog.sqlite"), "notes of last week\n".repeat(300)).unwrap();
    let (wrong, _) = judged(1, &[], &["--data", &data]);
    let told: Vec<_> = wrong.iter().map(text).collect();
    assert!(told[0].starts_with("fault database the file") && told[0].contains("restore it from a backup"), "{told:?}");
    assert!(told[1].starts_with("warning store instance") && told[1].contains("not compared"), "{told:?}");
    let output = with(&[], &["doctor", "--data", &data]);
    assert_eq!(texts(&output).1, "wavelume: 1 fault found\n");
}

#[tokio::test]
async fn postgresql_and_s3_are_examined() {
    let server = |name: &str| {
        std::env::var(name)
            .unwrap_or_else(|_| panic!("{name} is not set: run the tests as `tests/servers cargo test …`"))
    };
    let (database, store) = (server("WAVELUME_TEST_DATABASE"), server("WAVELUME_TEST_STORE"));
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    let name = format!("d{}", dir.path().file_name().unwrap().to_str().unwrap().replace('.', "").to_lowercase());
    sqlx::any::install_default_drivers();
    let mut connection = sqlx::AnyConnection::connect(&database).await.unwrap();
    let statement = sqlx::AssertSqlSafe(format!("CREATE SCHEMA {name}"));
    sqlx::query(statement).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    // The server of the tests lets everybody in.
    let database = database.replacen("wavelume@", "wavelume:topsecret@", 1);
    let mark = if database.contains('?') { '&' } else { '?' };
    let url = format!("{database}{mark}options[search_path]={name}");
    let bucket = format!("{store}/{name}");
    let site = [("WAVELUME_DATABASE", url.as_str()), ("WAVELUME_STORE", &bucket), ("WAVELUME_DATA", &data)];

    // The tests run PostgreSQL without syncs, which is a fault of a real site.
    let durability = "fault database durability fsync off, full_page_writes off, synchronous_commit off";
    let (faults, names) = judged(1, &site, &[]);
    let told: Vec<_> = faults.iter().map(text).collect();
    assert!(told.len() == 2 && told[0].starts_with(durability), "{told:?}");
    assert!(told[1].contains("database schema none") && told[1].ends_with("run `wavelume migrate`"), "{told:?}");
    for step in STEPS {
        assert!(names.contains(&format!("store {step}")), "{names:?}");
    }
    assert!(!dir.path().join("data").exists());

    succeeds(&site, &["migrate"]);
    served(&site, &[]);
    let (faults, names) = judged(1, &site, &[]);
    assert!(faults.len() == 1 && text(&faults[0]).starts_with(durability), "{faults:?}");
    for name in ["version", "encoding", "role", "clock", "connections"] {
        assert!(names.contains(&format!("database {name}")), "{names:?}");
    }
    let file = at(&dir, "wavelume.toml");
    fs::write(&file, format!("database = {url:?}\n")).unwrap();
    for (mode, is_warned) in [(0o644, true), (0o640, false)] {
        fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
        let output = with(&site[1..], &["doctor", "--config", &file]);
        let told = texts(&output).0;
        let line = told.lines().find(|line| line.contains("local configuration")).unwrap();
        assert_eq!(line.starts_with("warning"), is_warned, "{line}");
    }

    let (faults, _) = judged(1, &site, &["--processes", "1000"]);
    assert!(faults.iter().any(|fault| text(fault).contains("1000 processes need up to 9000")), "{faults:?}");

    // As after a dump that was restored elsewhere.
    let mut connection = sqlx::AnyConnection::connect(&url).await.unwrap();
    let moved = sqlx::query("UPDATE facts SET value = 'elsewhere' WHERE name = 'home'");
    assert_eq!(moved.execute(&mut connection).await.unwrap().rows_affected(), 1);
    connection.close().await.unwrap();
    let (faults, _) = judged(1, &site, &[]);
    let told: Vec<_> = faults.iter().map(text).collect();
    assert!(told[1].starts_with("fault store instance") && told[1].contains("is a copy of the catalog"), "{told:?}");
}

#[test]
fn servers_that_are_away_or_silent_are_told_in_bounded_time() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    // Nothing listens on port 1, and nobody answers behind the listener, which accepts and stays silent.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap();
    let quiet = format!("postgres://w:topsecret@{address}/w");
    let endpoint = format!("http://{address}");
    for (database, endpoint, words) in [
        (
            "postgres://w:topsecret@127.0.0.1:1/w",
            "http://127.0.0.1:1",
            "cannot connect to the database postgres://w@127.0.0.1:1/w",
        ),
        (quiet.as_str(), endpoint.as_str(), "gave no answer within 10 s"),
    ] {
        let variables = [
            ("WAVELUME_DATABASE", database),
            ("WAVELUME_STORE", "s3://bucket/prefix"),
            ("WAVELUME_DATA", &data),
            ("AWS_ENDPOINT_URL", endpoint),
            ("AWS_ACCESS_KEY_ID", "key"),
            ("AWS_SECRET_ACCESS_KEY", "topsecret"),
            ("AWS_REGION", "us-east-1"),
        ];
        let (faults, names) = judged(1, &variables, &[]);
        let told: Vec<_> = faults.iter().map(text).collect();
        assert!(told.len() == 2 && told[0].starts_with("fault database ") && told[0].contains(words), "{told:?}");
        assert!(
            told[1].starts_with("fault store s3://bucket/prefix: ") && told[1].contains("AWS_ENDPOINT_URL"),
            "{told:?}"
        );
        assert!(names.contains(&"local scratch".to_owned()), "{names:?}");
        assert!(!dir.path().join("data").exists());
    }
}
