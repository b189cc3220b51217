//! Data directories: commands that only look make nothing, what is made is private, and other users' directories stay
//! theirs.

use super::service::Service;
use super::{at, data, done, json, refused};
use sqlx::Connection;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// User and group without rights, as which root runs the program in tests.
const NOBODY: u32 = 65534;

const SPECTRUM: &str = "wavelength,reflectance\n400,0.5\n500,0.25\n600,0.75\n";

/// Returns everything below a directory, which is not named itself.
fn below(directory: &Path) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![directory.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.symlink_metadata().unwrap().is_dir() {
                folders.push(path.clone());
            }
            found.push(path);
        }
    }
    found.sort();
    found
}

fn is_root() -> bool {
    fs::metadata("/proc/self").unwrap().uid() == 0
}

/// A directory in which a user without rights may run a copy of the program: another one than root, or this user.
struct Unprivileged {
    dir: TempDir,
    program: PathBuf,
}

impl Unprivileged {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let program = dir.path().join("wavelume");
        fs::copy(env!("CARGO_BIN_EXE_wavelume"), &program).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        fs::set_permissions(dir.path(), fs::Permissions::from_mode(0o755)).unwrap();
        Self { dir, program }
    }

    /// Makes a directory that belongs to the user without rights.
    fn directory(&self, name: &str) -> PathBuf {
        let path = self.dir.path().join(name);
        fs::create_dir(&path).unwrap();
        if is_root() {
            chown(&path, Some(NOBODY), Some(NOBODY)).unwrap();
        }
        path
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(args).current_dir(self.dir.path()).env("TMPDIR", "/tmp").stdin(Stdio::null());
        if is_root() {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }

    fn serve(&self, data: &str) -> Service {
        let mut command = self.command(&["serve", "--data", data, "--listen", "127.0.0.1:0"]);
        command.stderr(Stdio::null());
        Service::spawn(command)
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    fn done(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn refused(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {}", String::from_utf8_lossy(&output.stdout));
        String::from_utf8(output.stderr).unwrap()
    }
}

/// Sends a measurement to a service, and returns the beginning of the answer.
fn upload(service: &Service) -> String {
    let mut stream = TcpStream::connect(&service.address).unwrap();
    write!(
        stream,
        "POST /v1/measurements?filename=a.csv HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: \
         {}\r\n\r\n{SPECTRUM}",
        SPECTRUM.len()
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 201"), "{answer}");
    answer
}

#[test]
fn a_place_without_a_service_is_named_and_nothing_is_made_there() {
    let dir = tempfile::tempdir().unwrap();
    let (empty, missing, backup) = (at(&dir, "empty"), at(&dir, "missing"), at(&dir, "backup"));
    fs::create_dir(&empty).unwrap();
    let commands: [&[&str]; 8] = [
        &["fsck"],
        &["gc"],
        &["backup", &backup],
        &["keys", "list"],
        &["keys", "revoke", "0000000000"],
        &["tenants", "list"],
        &["tenants", "close", "lab"],
        &["tenants", "set", "lab", "--weight", "1"],
    ];
    for command in commands {
        let told = refused(1, &[command, &["--data", &empty]].concat());
        assert!(told.contains("there is no catalog") && told.contains("check --data"), "{told}");
        let told = refused(1, &[command, &["--data", &missing]].concat());
        assert!(told.contains("no such data directory"), "{told}");
    }
    let told = refused(1, &["move", "--from-data", &empty, "--data", &missing]);
    assert!(told.contains("there is no catalog"), "{told}");
    assert_eq!(below(dir.path()), [Path::new(&empty)]);

    let data = at(&dir, "data");
    done(&["keys", "create", "--data", &data]);
    assert_eq!(json(&["fsck", "--data", &data, "--json"])["checked_blobs"], 0);
    done(&["gc", "--data", &data]);
    done(&["backup", &backup, "--data", &data]);
    let made: Vec<_> =
        below(Path::new(&data)).iter().filter_map(|path| path.file_name().map(ToOwned::to_owned)).collect();
    assert_eq!(made, ["catalog.sqlite"]);
    let told = refused(1, &["fsck", "--data", &backup]);
    assert!(told.contains("wavelume restore"), "{told}");
    fs::remove_file(at(&dir, "data/catalog.sqlite")).unwrap();
    fs::create_dir(at(&dir, "data/blobs")).unwrap();
    let told = refused(1, &["fsck", "--data", &data]);
    assert!(told.contains("check --database"), "{told}");
}

#[test]
fn what_the_program_makes_is_private_unless_a_setting_says_otherwise() {
    for (umask, options, directory, file) in
        [("000", &[][..], 0o700, 0o600), ("077", &["--umask", "027"][..], 0o750, 0o640)]
    {
        let dir = tempfile::tempdir().unwrap();
        let (data, backup) = (at(&dir, "data"), at(&dir, "backup"));
        let shell = format!("umask {umask}");
        let service = Service::start_with(&shell, &data, options, Stdio::null());
        upload(&service);
        let script = format!("{shell}\nexec \"$0\" backup {backup} --data {data} {}", options.join(" "));
        let made = Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_wavelume")]).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let found = below(dir.path());
        assert!(found.len() > 20, "{found:?}");
        for path in found {
            let metadata = path.metadata().unwrap();
            let expected = if metadata.is_dir() { directory } else { file };
            assert_eq!(metadata.mode() & 0o777, expected, "{}", path.display());
        }
    }
    // Files that a user asks for are not data of a service.
    let dir = tempfile::tempdir().unwrap();
    let (input, output) = (data("illuminant_D65.csv"), at(&dir, "x.wlm"));
    let script = format!("umask 022\nexec \"$0\" compress {input} --er-l2 0.01 -o {output}");
    let made = Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_wavelume")]).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(fs::metadata(output).unwrap().mode() & 0o777, 0o644);
    let wrong = refused(2, &["migrate", "--data", &at(&dir, "data"), "--umask", "700"]);
    assert!(wrong.contains("from 000 to 077"), "{wrong}");
}

#[test]
fn a_read_only_directory_is_checked_listed_and_backed_up() {
    let user = Unprivileged::new();
    for (name, signal) in [("ended", "-TERM"), ("killed", "-KILL")] {
        let data = user.directory(name).display().to_string();
        let service = user.serve(&data);
        upload(&service);
        service.signal(signal);
        let write = |mark: &str| {
            assert!(Command::new("chmod").args(["-R", mark, &data]).status().unwrap().success());
        };
        write("a-w");
        let before = below(Path::new(&data));
        let backup = user.directory(&format!("{name}-backup")).display().to_string();
        for command in
            [&["fsck"][..], &["fsck", "--readings"], &["keys", "list"], &["tenants", "list"], &["backup", &backup]]
        {
            let told = user.done(&[command, &["--data", &data]].concat());
            let expected = match command {
                ["fsck"] => "checked 1 blobs",
                ["fsck", ..] => "read 1 measurement again\n",
                _ => "",
            };
            assert!(told.contains(expected), "{told}");
        }
        let (one, all) = (["gc"], ["fsck", "--repair"]);
        for command in [&one[..], &all] {
            let told = user.refused(&[command, &["--data", &data]].concat());
            assert!(told.contains("read-only"), "{told}");
        }
        assert_eq!(below(Path::new(&data)), before, "nothing is made");
        // A damaged file is found, although that cannot be noted.
        write("u+w");
        let blob = below(Path::new(&data)).into_iter().find(|path| path.to_string_lossy().contains("/b3-")).unwrap();
        fs::write(&blob, b"x").unwrap();
        write("a-w");
        assert!(user.refused(&["fsck", "--data", &data]).contains("1 fault found"));
        write("u+w");
        let restored = user.directory(&format!("{name}-restored")).display().to_string();
        user.done(&["restore", &backup, "--data", &restored]);
        assert!(user.done(&["fsck", "--data", &restored]).contains("checked 1 blobs"));
    }
}

#[test]
fn what_root_makes_belongs_to_the_owner_of_the_directory() {
    let user = Unprivileged::new();
    let (first, restored) = (user.directory("first"), user.directory("restored"));
    let (data, backup) = (first.display().to_string(), at(&user.dir, "backup"));
    // Run by this user, who may be root.
    done(&["keys", "create", "--data", &data]);
    let start = || user.serve(&data);
    let service = start();
    upload(&service);
    for command in [&["fsck"][..], &["gc"], &["migrate"], &["backup", &backup], &["tenants", "list"]] {
        done(&[command, &["--data", &data]].concat());
    }
    service.signal("-TERM");
    for command in [&["fsck"][..], &["gc"], &["migrate"], &["backup", &backup], &["tenants", "create", "lab"]] {
        done(&[command, &["--data", &data]].concat());
    }
    done(&["restore", &backup, "--data", &restored.display().to_string()]);
    for directory in [&first, &restored] {
        let owner = directory.metadata().unwrap().uid();
        for path in below(directory) {
            assert_eq!(path.symlink_metadata().unwrap().uid(), owner, "{}", path.display());
        }
    }
    assert_eq!(start().signal("-TERM"), Some(0));
}

#[test]
fn a_backup_into_the_data_directory_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    done(&["migrate", "--data", &data]);
    std::os::unix::fs::symlink(&data, at(&dir, "link")).unwrap();
    let before = below(dir.path());
    for inside in ["data", "data/backup", "data/a/b", "link/backup", "other/../data/backup"] {
        let told = refused(1, &["backup", &at(&dir, inside), "--data", &data]);
        assert!(told.contains("choose a place outside"), "{inside}: {told}");
    }
    assert_eq!(below(dir.path()), before);
    done(&["backup", &at(&dir, "database"), "--data", &data]);
}

#[test]
fn files_in_the_making_go_with_the_process_that_was_making_them() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    let staged = || fs::read_dir(at(&dir, "data/staging")).map_or(0, Iterator::count);
    let until = |number: usize| {
        let start = Instant::now();
        while staged() != number {
            assert!(start.elapsed() < Duration::from_mins(1), "{} files", staged());
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let begun = || {
        let service = Service::start_with("", &data, &["--sweep", "1h"], Stdio::null());
        let mut stream = TcpStream::connect(&service.address).unwrap();
        let head =
            "POST /v1/measurements?filename=a.csv HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000000\r\n\r\n";
        write!(stream, "{head}{}", "x".repeat(300_000)).unwrap();
        until(1);
        (service, stream)
    };
    let (service, stream) = begun();
    assert_eq!(json(&["gc", "--data", &data, "--json"])["removed_staging"], 0, "its process is alive");
    service.signal("-KILL");
    drop(stream);
    assert_eq!((staged(), &json(&["gc", "--data", &data, "--json"])["removed_staging"]), (1, &1.into()));
    let (service, stream) = begun();
    service.signal("-KILL");
    drop(stream);
    let service = Service::start_with("", &data, &["--sweep", "1h"], Stdio::null());
    until(0);
    assert_eq!(service.signal("-TERM"), Some(0));
}

#[test]
fn nothing_is_removed_by_a_clock_that_has_jumped() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    done(&["migrate", "--data", &data]);
    done(&["gc", "--data", &data]);
    let change = |statement: &'static str| {
        sqlx::any::install_default_drivers();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let url = format!("sqlite:{data}/catalog.sqlite");
            let mut connection = sqlx::AnyConnection::connect(&url).await.unwrap();
            let changed = sqlx::query(statement).execute(&mut connection).await.unwrap();
            connection.close().await.unwrap();
            changed.rows_affected()
        })
    };
    // As if the clock had advanced by 40 days while the machine counted none of them.
    let jump = "UPDATE facts SET value = CAST(value AS BIGINT) - 3456000000 WHERE name LIKE 'started:%'";
    assert_eq!(change(jump), u64::from(cfg!(target_os = "linux")));
    if cfg!(target_os = "linux") {
        let told = refused(1, &["gc", "--data", &data]);
        assert!(told.contains("has counted since its start") && told.contains("--trust-clock"), "{told}");
        done(&["gc", "--data", &data, "--trust-clock"]);
    }
    done(&["gc", "--data", &data]);
    let future = "INSERT INTO audit (id, tenant, at, actor, action) VALUES ('a', 'default', 4102444800000, 'x', 'y')";
    assert_eq!(change(future), 1);
    let told = refused(1, &["gc", "--data", &data]);
    assert!(told.contains("newest row is of 2100-01-01 00:00 UTC"), "{told}");
    done(&["gc", "--data", &data, "--trust-clock"]);
    done(&["gc", "--data", &data]);
}
