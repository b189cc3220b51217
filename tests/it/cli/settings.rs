//! Settings by file, environment and flag, and the command that shows them.

use super::{at, root};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};

/// Runs the program with these variables in its environment, and none other of its own.
pub(super) fn with(variables: &[(&str, &str)], args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("WAVELUME_")) {
        command.env_remove(name);
    }
    command.args(args).envs(variables.iter().copied()).stdin(Stdio::null()).output().unwrap()
}

fn printed(variables: &[(&str, &str)], args: &[&str]) -> String {
    let output = with(variables, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Returns the one line on stderr of a run that must end with the exit code `code`.
fn told(code: i32, variables: &[(&str, &str)], args: &[&str]) -> String {
    let output = with(variables, args);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(code), 1), "{args:?}: {stderr}");
    stderr
}

/// Returns the settings that `wavelume config` shows: key, value, source.
fn shown(variables: &[(&str, &str)], args: &[&str]) -> Vec<(String, Value, String)> {
    let text = printed(variables, &[&["config", "--json"], args].concat());
    let report: Value = serde_json::from_str(&text).unwrap();
    let settings = report["settings"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    settings.iter().map(|given| (text(&given["key"]), given["value"].clone(), text(&given["source"]))).collect()
}

fn one(settings: &[(String, Value, String)], key: &str) -> (Value, String) {
    let (_, value, source) = settings.iter().find(|(known, _, _)| known == key).unwrap();
    (value.clone(), source.clone())
}

#[test]
fn a_flag_wins_over_the_environment_and_that_over_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let file = at(&dir, "wavelume.toml");
    fs::write(&file, "[work]\nattempts = 7\nlost = 7\nlease = \"7s\"\n[server]\nnames = [\"a\", \"b\"]\n").unwrap();
    let variables = [("WAVELUME_CONFIG", file.as_str()), ("WAVELUME_LOST", "8"), ("WAVELUME_LEASE", "8s")];
    let settings = shown(&variables, &["--lease", "9s"]);
    for (key, value, source) in [
        ("attempts", Value::from(7), "file"),
        ("lost", Value::from(8), "environment"),
        ("lease", Value::from("9s"), "flag"),
        ("backoff", Value::from("2s"), "default"),
        ("names", Value::from(vec!["a", "b"]), "file"),
        ("database", Value::Null, "default"),
    ] {
        assert_eq!(one(&settings, key), (value, source.to_owned()), "{key}");
    }
    // The flag wins over the variable that names a file, too.
    let other = at(&dir, "other.toml");
    fs::write(&other, "work.attempts = 6\n").unwrap();
    let settings = shown(&variables, &["--config", &other]);
    assert_eq!(one(&settings, "attempts"), (Value::from(6), "file".to_owned()));
    let text = printed(&variables, &["config", "--lease", "9s"]);
    for line in [
        format!("attempts = 7 # {file}:2"),
        "lost = 8 # environment WAVELUME_LOST".to_owned(),
        "lease = \"9s\" # flag --lease".to_owned(),
        "# backoff = \"2s\" # default".to_owned(),
        "# drain = \"7s\" # default (worker: 10min)".to_owned(),
        "# database = # not set".to_owned(),
    ] {
        let found = text.lines().any(|shown| shown.split_whitespace().eq(line.split_whitespace()));
        assert!(found, "{line} is missing in\n{text}");
    }
}

#[test]
fn what_config_prints_is_a_configuration_file_with_the_same_values() {
    let dir = tempfile::tempdir().unwrap();
    let example = root().join("ops/wavelume.toml").display().to_string();
    let variables = [
        ("WAVELUME_DATABASE", "postgres://w:topsecret@db/w?sslmode=require&password=topsecret"),
        ("WAVELUME_URL", "http://me:topsecret@host"),
        ("WAVELUME_ORIGINS", "https://a.example,https://b.example"),
        ("WAVELUME_DATA", "odd \"name\" \\ é #"),
    ];
    let flags = ["--config", &example, "--upload-bytes", "3MiB", "--workers", "0", "--metrics", "[::1]:9100"];
    let first = shown(&variables, &flags);
    let text = printed(&variables, &[&["config"], &flags[..]].concat());
    assert!(!text.contains("topsecret") && text.contains("password left out"), "{text}");
    let saved = at(&dir, "saved.toml");
    fs::write(&saved, &text).unwrap();
    let second = shown(&[], &["--config", &saved]);
    assert_eq!(first.len(), second.len());
    for ((key, value, source), (_, again, source_again)) in first.iter().zip(&second) {
        assert_eq!(value, again, "{key}");
        assert_eq!(source == "default", source_again == "default", "{key}");
    }
    assert_eq!(one(&second, "database").0, "postgres://w@db/w?sslmode=require");
    let json = printed(&variables, &["config", "--json"]);
    assert!(!json.contains("topsecret") && json.contains("left out"), "{json}");
}

#[test]
fn commands_use_the_file_and_refuse_a_wrong_one() {
    let dir = tempfile::tempdir().unwrap();
    let (file, data) = (at(&dir, "wavelume.toml"), at(&dir, "data"));
    fs::write(&file, format!("data = {data:?}\n[server]\nlisten = \"127.0.0.1:0\"\nnames = [\"x.example\"]\n"))
        .unwrap();
    let all = fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/migrations")).unwrap().count();
    assert_eq!(printed(&[], &["migrate", "--config", &file]), format!("{all} migrations applied\n"));
    assert!(dir.path().join("data/catalog.sqlite").exists());
    assert!(printed(&[("WAVELUME_CONFIG", &file)], &["gc"]).starts_with("removed  0 blobs"));
    let mut service = Command::new(env!("CARGO_BIN_EXE_wavelume"))
        .args(["serve", "--config", &file])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(service.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let port: u16 = line.trim().rsplit(':').next().unwrap().parse().unwrap();
    service.kill().unwrap();
    service.wait().unwrap();
    assert!(port != 0 && port != 8080, "{line}");

    fs::write(&file, "[work]\nlesae = 3\n").unwrap();
    for command in [&["serve"][..], &["worker"], &["fsck"], &["gc"], &["migrate"], &["config"], &["jobs", "list"]] {
        let message = told(2, &[("WAVELUME_CONFIG", &file)], command);
        assert!(message.contains("wavelume.toml: line 2, column 1: found the key `lesae` in [work]"), "{message}");
        assert!(message.contains("did you mean `lease`?"), "{message}");
    }
    // Commands without settings read no file.
    assert!(printed(&[("WAVELUME_CONFIG", &file)], &["bases"]).contains("haar"));
    let message = told(1, &[], &["config", "--config", &at(&dir, "none.toml")]);
    assert!(message.contains("none.toml: no such file or directory"), "{message}");
    fs::write(&file, "#".repeat(300 << 10)).unwrap();
    let message = told(1, &[], &["config", "--config", &file]);
    assert!(message.contains("bytes are more than the limit of 262144"), "{message}");
    for url in ["postgers://w:topsecret@db/w", "postgres:/w:topsecret@db/w"] {
        for (variables, args) in [
            (&[("WAVELUME_DATABASE", url)][..], &["fsck"][..]),
            (&[][..], &["fsck", "--database", url][..]),
            (&[][..], &["fsck", &format!("--database={url}")][..]),
        ] {
            let message = told(2, variables, args);
            assert!(message.contains("expected sqlite:PATH") && !message.contains("topsecret"), "{message}");
        }
    }
    fs::write(&file, "database = \"postgers://w:topsecret@db/w\"\n").unwrap();
    let message = told(2, &[], &["fsck", "--config", &file]);
    assert!(message.contains("line 1, column 12: `database`: found") && !message.contains("topsecret"), "{message}");
}
