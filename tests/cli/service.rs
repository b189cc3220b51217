//! The service as a user starts it: ready, drained on a signal, its data looked after, the demo.

use super::{at, done, json, refused};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// A service that is stopped with the test.
struct Service {
    child: Child,
    address: String,
}

impl Service {
    fn start(data: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
            .args(["serve", "--data", data, "--listen", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
        Self { child, address }
    }

    fn signal(mut self, name: &str) -> Option<i32> {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        self.child.wait().unwrap().code()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Ended already unless the test failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn serve_listens_is_healthy_and_drains_on_a_signal() {
    let dir = tempfile::tempdir().unwrap();
    let service = Service::start(&at(&dir, "data"));
    done(&["health", "--listen", &service.address]);
    done(&["health", &format!("http://{}", service.address)]);
    let taken = refused(1, &["serve", "--data", &at(&dir, "other"), "--listen", &service.address]);
    assert!(taken.contains("already taken") && taken.contains("--listen"), "{taken}");
    let address = service.address.clone();
    assert_eq!(service.signal("-TERM"), Some(0));
    refused(1, &["health", "--listen", &address]);
    assert_eq!(Service::start(&at(&dir, "data")).signal("-INT"), Some(0));
}

#[test]
fn a_data_directory_is_looked_after() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    refused(1, &["gc", "--data", &data]);
    refused(1, &["fsck", "--data", &data]);
    assert!(done(&["migrate", "--data", &data]).contains("applied"));
    assert_eq!(done(&["migrate", "--data", &data]), "up to date\n");
    assert_eq!(json(&["gc", "--data", &data, "--json"])["removed_blobs"], 0);
    assert_eq!(json(&["fsck", "--data", &data, "--json"])["faults"], serde_json::json!([]));
    done(&["gc", "--data", &data]);
    done(&["fsck", "--data", &data]);
}

#[test]
fn the_demo_compresses_real_measurements_and_uses_them_again() {
    let dir = tempfile::tempdir().unwrap();
    let demo = ["demo", "--once", "--data", &at(&dir, "data"), "--listen", "127.0.0.1:0"].map(str::to_owned);
    let demo: Vec<&str> = demo.iter().map(String::as_str).collect();
    let first = done(&demo);
    assert!(first.contains("er(L2)") && first.contains("curl") && first.contains("/content"), "{first}");
    assert!(!first.contains("used again"), "{first}");
    let second = done(&demo);
    assert!(second.contains("4 of 4 materials were in the data directory already"), "{second}");
}
