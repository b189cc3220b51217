//! Process of one job, seen from the process that starts it: its files, its messages, and its end.

use super::attempt::{Failure, last};
use super::hub::Control;
use super::isolation::Isolation;
use super::pipe::{self, Message, Order};
use super::problem::Code;
use crate::domain::Progress;
use crate::pipeline::Report;
use crate::store::{Staged, Staging, StoreError};
use bytes::Bytes;
use rustix::process::{Pid, Signal, kill_process_group};
use serde::Serialize;
use std::io::{self, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

/// Command of the program that computes one job; users do not call it.
pub(crate) const COMMAND: &str = "compute-job";

/// Environment variables that the process of a job gets. None of them is a secret.
const VARIABLES: [&str; 1] = ["RUST_BACKTRACE"];

/// Upper bound in bytes on what the process of a job may write to the log. Raising it keeps longer backtraces.
const LOG: u64 = 64 << 10;

/// Result of the computation of a job, in a staged (temporary) file.
#[derive(Debug)]
pub(super) struct Written {
    pub(super) staged: Staged,
    /// Report of a compression; `None` for other computations.
    pub(super) report: Option<Box<Report>>,
}

/// Does the computation called `name` in a process of its own, which has no catalog and no store: only staged files.
pub(super) async fn compute(
    staging: &Staging,
    isolation: &Isolation,
    (name, computation): (&str, &(impl Serialize + Sync)),
    files: Vec<Bytes>,
    control: &Arc<Control>,
) -> Result<Written, Failure> {
    let copies = staging.clone();
    let staged = move || files.iter().map(|file| copies.stage(file)).collect::<Result<Vec<_>, _>>();
    let inputs = blocking(staged).await?;
    let result = staging.reserve();
    let order = pipe::encode(&Order {
        name: name.to_owned(),
        computation,
        files: inputs.iter().map(|input| input.name().to_owned()).collect(),
        result: result.name().to_owned(),
        threads: isolation.threads,
        memory: isolation.memory,
    });
    let order = order.map_err(|error| passing(&error))?;
    let child = start(isolation, staging).map_err(|error| passing(&error))?;
    let group = Group::of(&child);
    let mut talk = tokio::task::spawn_blocking({
        let (group, control) = (Group(Arc::clone(&group.0)), Arc::clone(control));
        move || talk(child, &group, &order, &control)
    });
    let ended = tokio::select! {
        biased;
        () = control.stopped() => None,
        ended = &mut talk => Some(ended),
    };
    let Some(ended) = ended else {
        group.kill();
        // The files of the process are removed after its end.
        drop(talk.await);
        return Err(Failure::Stopped);
    };
    match ended.map_err(|error| passing(&error.into()))?.map_err(|error| passing(&error))? {
        End::Said(Message::Made(report)) => Ok(Written { staged: blocking(move || result.take()).await?, report }),
        End::Said(Message::Failed(problem)) => Err(Failure::Final(problem)),
        End::Said(Message::Newer(detail)) => Err(Failure::Newer(detail)),
        End::Said(Message::Passing(detail)) => Err(Failure::Passing(detail)),
        End::Said(Message::NoSpace(detail)) => Err(Failure::NoSpace(detail)),
        End::Said(Message::OutOfMemory | Message::Progress(_)) | End::Died(Cause::Allocation, _) => Err(last(
            Code::OutOfMemory,
            format!(
                "the job needs more than {} of memory, the limit of one job: raise --job-memory of the workers, and \
                 put the job back in the queue",
                isolation.limit()
            ),
        )),
        End::Died(Cause::Killed, _) => Err(last(
            Code::OutOfMemory,
            format!(
                "the system killed the process of the job, as it does when memory runs out (limit of one job: {}): \
                 lower --workers, or raise --job-memory of workers on a machine with more memory, and put the job \
                 back in the queue",
                isolation.limit()
            ),
        )),
        End::Died(Cause::Other, status) => {
            Err(Failure::Passing(format!("the process of the job ended unexpectedly: {status}")))
        }
    }
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::task::spawn_blocking(work).await.map_err(|error| StoreError::Io(error.into()))?
}

fn passing(error: &io::Error) -> Failure {
    Failure::Passing(format!("the process of the job: {error}"))
}

/// Starts the process of a job in the directory of the staged files.
fn start(isolation: &Isolation, staging: &Staging) -> io::Result<Child> {
    let mut command = Command::new(&isolation.program);
    let kept = VARIABLES.into_iter().filter_map(|name| Some((name, std::env::var_os(name)?)));
    // Database and store may have their credentials in the environment.
    command.arg(COMMAND).env_clear().envs(kept).current_dir(staging.directory());
    // A group of its own: a Ctrl-C in the terminal is for the worker, which lets running jobs end.
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0).spawn()
}

/// Way in which the process of a job ended.
#[derive(Debug)]
enum End {
    /// The process ended with this message as its last one.
    Said(Message),
    /// The process died without a last message.
    Died(Cause, ExitStatus),
}

/// Sends the process its work, passes its progress on, and waits for its end. Blocks the thread. The process ends by
/// itself if this one ends first, because its standard input is closed then.
fn talk(mut child: Child, group: &Group, order: &[u8], control: &Control) -> io::Result<End> {
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let log = std::thread::Builder::new().name("log of a job".to_owned()).spawn(move || stderr.map(read_log));
    let said = stdin.zip(stdout).map(|(mut stdin, mut stdout)| -> io::Result<Message> {
        match io::Write::write_all(&mut stdin, order) {
            // It died already.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
            sent => sent?,
        }
        loop {
            match pipe::read(&mut stdout)? {
                Message::Progress(fraction) => control.report(fraction),
                said => return Ok(said),
            }
        }
    });
    let status = group.end(&mut child)?;
    let log = log?.join().ok().flatten().unwrap_or_default();
    if !log.is_empty() {
        tracing::warn!(%status, log = log.trim(), "the process of a job wrote");
    }
    match said {
        Some(Ok(message)) => Ok(End::Said(message)),
        Some(Err(error)) if error.kind() != io::ErrorKind::UnexpectedEof => Err(error),
        _ => Ok(End::Died(cause(status, &log), status)),
    }
}

/// Reads what the process of a job writes to the log: its beginning, within a limit.
fn read_log(mut from: ChildStderr) -> String {
    let mut text = Vec::new();
    // On a read error the log is the text read so far.
    let _ = (&mut from).take(LOG).read_to_end(&mut text);
    let _ = io::copy(&mut from, &mut io::sink());
    String::from_utf8_lossy(&text).into_owned()
}

/// Process of a job and those that it has started; `None` after their end, when the id may be another's. Dropping it
/// kills them.
struct Group(Arc<Mutex<Option<Pid>>>);

impl Group {
    fn of(child: &Child) -> Self {
        Self(Arc::new(Mutex::new(Some(Pid::from_child(child)))))
    }

    fn kill(&self) {
        if let Some(group) = *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            // It may have ended by itself.
            let _ = kill_process_group(group, Signal::KILL);
        }
    }

    /// Waits for the end of the job's process once it has closed its standard output, or kills the process.
    fn end(&self, child: &mut Child) -> io::Result<ExitStatus> {
        let mut group = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(group) = *group {
            // A process that is ending keeps the reason for which it ends.
            let _ = kill_process_group(group, Signal::KILL);
        }
        let status = child.wait()?;
        *group = None;
        Ok(status)
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Reason why the process of a job died without a last message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    /// The process asked for more memory than its limit.
    Allocation,
    /// SIGKILL ended the process of the job, and this process did not send it.
    Killed,
    Other,
}

fn cause(status: ExitStatus, log: &str) -> Cause {
    match status.signal().and_then(Signal::from_named_raw) {
        Some(Signal::KILL) => Cause::Killed,
        // Rust's last words before the abort. A stack overflow aborts, too.
        Some(Signal::ABORT) if log.contains("memory allocation of ") => Cause::Allocation,
        _ => Cause::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_memory_ends_a_job_for_good() {
        let status = ExitStatus::from_raw;
        for (raw, log, expected) in [
            (6, "memory allocation of 1048576 bytes failed\n", Cause::Allocation),
            (6, "thread 'main' has overflowed its stack\n", Cause::Other),
            (9, "", Cause::Killed),
            (11, "memory allocation of 8 bytes failed\n", Cause::Other),
            (1 << 8, "", Cause::Other),
        ] {
            assert_eq!(cause(status(raw), log), expected, "{raw} {log}");
        }
    }
}
