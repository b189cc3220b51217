//! The service as a user starts it: ready, drained on a signal, its data looked after, the demo.

use super::{at, done, json, refused};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};

/// A service that is stopped with the test.
pub(super) struct Service {
    child: Child,
    pub(super) address: String,
}

impl Service {
    fn start(data: &str) -> Self {
        Self::start_with("", data, &[], Stdio::null())
    }

    /// Starts a service under `limits` (shell commands), with further `options`.
    pub(super) fn start_with(limits: &str, data: &str, options: &[&str], log: Stdio) -> Self {
        let mut command = Command::new("sh");
        command
            .args(["-c", &format!("{limits}\nexec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_wavelume")])
            .args(["serve", "--data", data])
            .args(["--listen", "127.0.0.1:0"].iter().filter(|_| !options.contains(&"--listen")))
            .args(options)
            .stderr(log);
        Self::spawn(command)
    }

    /// Starts a service by a command that runs the program in this process or one that it becomes.
    pub(super) fn spawn(mut command: Command) -> Self {
        // A terminal would make the service end with it.
        let command = command.stdin(Stdio::null()).env_remove("RUST_LOG").stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
        Self { child, address }
    }

    fn send(&self, name: &str) {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }

    /// Returns the whole answer to `GET path`, or the error of the connection.
    fn get(&self, path: &str) -> std::io::Result<String> {
        let mut stream = TcpStream::connect(&self.address)?;
        write!(stream, "GET {path} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n", self.address)?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).map(|_| answer)
    }

    pub(super) fn signal(mut self, name: &str) -> Option<i32> {
        self.send(name);
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
    // The name of this machine, without a key because it is a loopback address.
    let named = Service::start_with("", &at(&dir, "data"), &["--listen", "localhost:0"], Stdio::null());
    assert!(named.address.parse::<SocketAddr>().unwrap().ip().is_loopback(), "{}", named.address);
    let port = named.address.rsplit(':').next().unwrap().to_owned();
    done(&["health", "--listen", &format!("localhost:{port}")]);
    drop(named);
    let unknown = refused(1, &["serve", "--data", &at(&dir, "data"), "--listen", "nowhere.invalid:8080"]);
    assert!(unknown.contains("nowhere.invalid") && unknown.contains("--listen"), "{unknown}");
}

#[test]
fn a_log_in_a_file_has_bounded_lines_without_colours() {
    for format in ["human", "json"] {
        let dir = tempfile::tempdir().unwrap();
        let log = at(&dir, "log");
        let file = std::fs::File::create(&log).unwrap();
        let service = Service::start_with("", &at(&dir, "data"), &["--log-format", format], file.into());
        let path = format!("/{}", "p".repeat(9_000));
        let id = "i".repeat(9_000);
        let words = format!(
            "{} {path} HTTP/1.1\r\nhost: localhost\r\nrequest-id: {id}\r\nconnection: close\r\n\r\n",
            "M".repeat(9_000)
        );
        let mut stream = TcpStream::connect(&service.address).unwrap();
        stream.write_all(words.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 404") && answer.len() < 5_000, "{}", &answer[..answer.len().min(300)]);
        assert_eq!(service.signal("-TERM"), Some(0));
        let log = std::fs::read_to_string(&log).unwrap();
        assert!(log.contains("request answered") && log.contains("ppp") && log.contains("MMM"), "{log}");
        for line in log.lines() {
            assert!(line.len() < 2_000 && !line.contains(char::is_control), "{line:?}");
        }
    }
}

#[test]
fn links_and_tokens_are_in_no_log() {
    let dir = tempfile::tempdir().unwrap();
    let log = at(&dir, "log");
    let key = done(&["keys", "generate"]);
    let key = key.trim();
    let shell = format!("export RUST_LOG=trace WAVELUME_BOOTSTRAP_KEY={key}");
    let file = std::fs::File::create(&log).unwrap();
    let service = Service::start_with(&shell, &at(&dir, "data"), &["--auth", "keys"], file.into());
    let held = at(&dir, "key");
    std::fs::write(&held, key).unwrap();
    let id = format!("b3-{}", "0".repeat(64));
    let link = done(&["link", "--key-file", &held, "--url", "http://x", "--material", &id]);
    let token = done(&["token", "--key-file", &held]);
    let (target, token) = (link.trim().strip_prefix("http://x").unwrap(), token.trim());
    for (target, status) in [(target.to_owned(), "404"), (target.replace("signature=", "signature=A"), "401")] {
        assert!(service.get(&target).unwrap().starts_with(&format!("HTTP/1.1 {status}")), "{target}");
    }
    for (credential, status) in
        [(token, "200"), (&format!("{token}A"), "401"), (key, "200"), (&format!("{key}A"), "401")]
    {
        let mut stream = TcpStream::connect(&service.address).unwrap();
        let head = format!("host: localhost\r\nauthorization: Bearer {credential}\r\nconnection: close");
        write!(stream, "GET /v1/materials HTTP/1.1\r\n{head}\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with(&format!("HTTP/1.1 {status}")), "{answer}");
    }
    assert_eq!(service.signal("-TERM"), Some(0));
    let log = std::fs::read_to_string(&log).unwrap();
    assert!(log.contains("request answered") && log.contains(&id), "{log}");
    let (_, signature) = target.rsplit_once('=').unwrap();
    for secret in [signature, token, &token[..40], &token[token.len() - 40..], &key[15..58]] {
        assert!(!log.contains(secret), "{secret}");
    }
}

#[test]
fn names_and_origins_are_given_by_flags_and_environment() {
    let dir = tempfile::tempdir().unwrap();
    let ask = |service: &Service, host: &str| {
        let mut stream = TcpStream::connect(&service.address).unwrap();
        let words = format!(
            "GET /healthz HTTP/1.1\r\nhost: {host}\r\norigin: https://app.example.org\r\nconnection: close\r\n\r\n"
        );
        stream.write_all(words.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    let options = ["--name", "lab.example.org", "--name", "b.example", "--origin", "https://app.example.org"];
    let service = Service::start_with("", &at(&dir, "data"), &options, Stdio::null());
    for host in ["lab.example.org", "b.example:80", "localhost"] {
        let answer = ask(&service, host);
        assert!(
            answer.starts_with("HTTP/1.1 200") && answer.contains("access-control-allow-origin: https://app"),
            "{answer}"
        );
    }
    assert!(ask(&service, "c.example").starts_with("HTTP/1.1 421"));
    let wrong = refused(2, &["serve", "--data", &at(&dir, "other"), "--listen", "127.0.0.1:0", "--origin", "*"]);
    assert!(wrong.contains("--origin: found `*`, expected SCHEME://HOST"), "{wrong}");
    let environment = Command::new(env!("CARGO_BIN_EXE_wavelume"))
        .args(["serve", "--data", &at(&dir, "other"), "--listen", "127.0.0.1:0"])
        .env("WAVELUME_NAMES", "lab.example.org,http://x")
        .output()
        .unwrap();
    assert_eq!(environment.status.code(), Some(2));
    assert!(String::from_utf8(environment.stderr).unwrap().contains("--name: found `http://x`"));
}

#[test]
fn a_stopping_service_says_so_while_it_still_answers_and_a_hangup_is_no_stop() {
    let dir = tempfile::tempdir().unwrap();
    let mut service = Service::start_with("", &at(&dir, "data"), &["--notice", "4s"], Stdio::null());
    service.send("-HUP");
    assert!(service.get("/readyz").unwrap().starts_with("HTTP/1.1 200"));
    service.send("-TERM");
    loop {
        let answer = service.get("/readyz").unwrap();
        if answer.starts_with("HTTP/1.1 503") {
            assert!(answer.contains("stopping"), "{answer}");
            break;
        }
    }
    assert!(service.get("/v1/formats").unwrap().starts_with("HTTP/1.1 200"), "requests are answered meanwhile");
    assert_eq!(service.child.wait().unwrap().code(), Some(0));
}

#[test]
fn settings_are_read_from_flags_and_from_the_environment() {
    let dir = tempfile::tempdir().unwrap();
    let limits = "export WAVELUME_UPLOAD_BYTES=100 WAVELUME_JSON_BYTES=2KiB";
    let service = Service::start_with(limits, &at(&dir, "data"), &["--json-bytes", "1KiB"], Stdio::null());
    let post = |path: &str, media: &str, length: usize| {
        let mut stream = TcpStream::connect(&service.address).unwrap();
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: {}\r\ncontent-type: {media}\r\nconnection: close\r\n",
            service.address
        );
        write!(stream, "{head}content-length: {length}\r\n\r\n{}", " ".repeat(length)).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    };
    assert!(post("/v1/measurements", "text/plain", 101).contains("may have 100 bytes"));
    assert!(post("/v1/jobs", "application/json", 1025).contains("the limit of 1024 bytes"));
    assert_eq!(service.signal("-INT"), Some(0));
    let wrong = refused(2, &["serve", "--data", &at(&dir, "data"), "--idle", "soon"]);
    assert!(wrong.contains("--idle") && wrong.contains("30s"), "{wrong}");
}

#[test]
#[cfg(target_os = "linux")]
fn the_limit_on_descriptors_is_raised_and_places_are_fitted_to_it() {
    let dir = tempfile::tempdir().unwrap();
    let service = Service::start_with("ulimit -S -n 256", &at(&dir, "raised"), &[], Stdio::null());
    let limits = std::fs::read_to_string(format!("/proc/{}/limits", service.child.id())).unwrap();
    let line = limits.lines().find(|line| line.starts_with("Max open files")).unwrap();
    let numbers: Vec<&str> = line.split_whitespace().skip(3).take(2).collect();
    assert_eq!(numbers[0], numbers[1], "{line}");
    drop(service);

    let service = Service::start_with("ulimit -n 400", &at(&dir, "low"), &[], Stdio::null());
    let to: SocketAddr = service.address.parse().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let connect = |last: u8| {
        runtime.block_on(async {
            let socket = tokio::net::TcpSocket::new_v4().unwrap();
            socket.bind((Ipv4Addr::new(127, 0, 0, last), 0).into()).unwrap();
            socket.connect(to).await.unwrap()
        })
    };
    // More connections than there are descriptors, from four addresses.
    let held: Vec<_> = (0_u16..480).map(|i| connect(2 + (i % 4) as u8)).collect();
    for path in ["/healthz", "/readyz"] {
        assert!(service.get(path).unwrap().starts_with("HTTP/1.1 200"), "{path}");
    }
    drop(held);
    while !service.get("/v1/measurements").is_ok_and(|answer| answer.starts_with("HTTP/1.1 200")) {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert_eq!(service.signal("-INT"), Some(0));
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
fn the_demo_ends_quietly_while_it_compresses() {
    let dir = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
    command.args(["demo", "--data", &at(&dir, "data"), "--listen", "127.0.0.1:0"]);
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .env_remove("RUST_LOG")
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    assert!(line.starts_with("listening on http://"), "{line}");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), stderr.as_str()), (Some(0), ""));
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
