//! Process of one job, seen from inside: it limits itself, computes, and writes its result to a file.

use super::attempt::Failure;
use super::computation::Computed;
use super::kinds;
use super::maths::message as panic_message;
use super::pipe::{self, Message, Order};
use super::problem::{Code, JobProblem};
use crate::domain::Progress;
use bytes::Bytes;
use rayon::ThreadPoolBuilder;
use rustix::process::{Resource, Rlimit, setrlimit};
use serde_json::Value;
use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// Preference of the kernel for this process when memory runs out, from -1000 to 1000: with 1000 the kernel ends it
/// before any other process.
const FIRST: &str = "1000";

/// Size in bytes of the stack of each thread that computes. Raising it computes deeper recursions, and lets a process
/// use more memory beside that of its job.
const STACK: usize = 2 << 20;

/// Smallest step of progress that is reported. Raising it sends fewer messages.
const STEP: f64 = 0.001;

/// Reads the work of a job from standard input, does it, and reports on standard output. Ends the process at once if
/// the process that has started it ends.
pub(crate) fn compute_job() -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let _context = runtime.enter();
    let _ignored = ignore_signals()?;
    // A kernel without these files ignores the preference and the name only.
    let _ = fs::write("/proc/self/oom_score_adj", FIRST);
    let _ = fs::write("/proc/self/comm", "wavelume-job");
    let order: Order<Value> = pipe::read(&mut io::stdin().lock())?;
    std::thread::Builder::new().name("parent".to_owned()).spawn(end_with_parent)?;
    let pool = ThreadPoolBuilder::new().num_threads(order.threads).stack_size(STACK).build();
    let pool = pool.map_err(io::Error::other)?;
    // The kernel counts the stacks of the threads as data, but the stated memory is for the job.
    let stacks = (pool.current_num_threads() * STACK) as u64;
    limit(order.memory.map(|bytes| bytes.saturating_add(stacks)))?;
    let out = Out { sent: Mutex::new((0.0, io::stdout())) };
    let worked = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(order, &out))));
    out.send(&worked.unwrap_or_else(|panic| {
        let message = panic_message(panic.as_ref());
        tracing::error!(message, "a computation panicked");
        Message::Failed(JobProblem::new(
            Code::Internal,
            "the computation failed; this is a bug of the service, not of the request",
        ))
    }))
}

/// Ignores the signals that ask a service to stop: a supervisor may send them to all of its processes, but running jobs
/// have time to end.
fn ignore_signals() -> io::Result<[Signal; 3]> {
    Ok([signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?, signal(SignalKind::hangup())?])
}

/// Ends this process when standard input is closed: the process that has started it is gone.
fn end_with_parent() {
    let mut stdin = io::stdin().lock();
    let mut rest = [0; 64];
    loop {
        match stdin.read(&mut rest) {
            Ok(0) => break,
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    std::process::exit(1);
}

/// Limits the memory of this process, and keeps it from leaving a core file.
fn limit(memory: Option<u64>) -> io::Result<()> {
    let most = |bytes| Rlimit { current: Some(bytes), maximum: Some(bytes) };
    setrlimit(Resource::Core, most(0))?;
    if let Some(bytes) = memory {
        setrlimit(Resource::Data, most(bytes))?;
    }
    Ok(())
}

fn work(order: Order<Value>, progress: &Out) -> Message {
    let files = order.files.iter().map(|name| fs::read(name).map(Bytes::from)).collect::<io::Result<Vec<_>>>();
    let files = match files {
        Ok(files) => files,
        Err(error) if error.kind() == io::ErrorKind::OutOfMemory => return Message::OutOfMemory,
        Err(error) => return Message::Passing(format!("the input of the job: {error}")),
    };
    let Computed { bytes, report } = match kinds::compute(&order.name, order.computation, files, progress) {
        Ok(computed) => computed,
        Err(Failure::Final(problem)) => return Message::Failed(problem),
        Err(Failure::Newer(detail)) => return Message::Newer(detail),
        Err(Failure::Passing(detail)) => return Message::Passing(detail),
        Err(Failure::NoSpace(detail)) => return Message::NoSpace(detail),
        Err(Failure::Stopped | Failure::Damaged) => {
            return Message::Passing("the computation stopped by itself".to_owned());
        }
    };
    let create = OpenOptions::new().write(true).create_new(true).open(&order.result);
    match create.and_then(|mut file| file.write_all(&bytes)) {
        Ok(()) => Message::Made(report),
        Err(error) if matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {
            Message::NoSpace(format!("the result of the job: {error}"))
        }
        Err(error) => Message::Passing(format!("the result of the job: {error}")),
    }
}

/// Standard output of the process of a job, with the fraction of progress that was sent last.
struct Out {
    sent: Mutex<(f64, io::Stdout)>,
}

impl Out {
    fn send(&self, message: &Message) -> io::Result<()> {
        let sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        pipe::write(&mut sent.1.lock(), message)
    }
}

impl Progress for Out {
    fn report(&self, fraction: f64) {
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        if fraction.is_finite() && fraction >= sent.0 + STEP {
            sent.0 = fraction;
            // Without a reader this process ends soon.
            let _ = pipe::write(&mut sent.1.lock(), &Message::Progress(fraction));
        }
    }
}
