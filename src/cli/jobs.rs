//! `wavelume jobs`: lists, cancels and repeats jobs of a running service.

use super::answer::{escaped, read, send};
use super::failure::Failure;
use super::key_file::VARIABLE;
use super::output::{Table, print, print_json};
use super::runtime::block_on;
use super::site::ConfigArg;
use super::tls::TrustArg;
use crate::catalog::Priority;
use reqwest::Client;
use reqwest::header::{AUTHORIZATION, HeaderValue};
use serde::Deserialize;
use serde_json::Value;
use std::time::Duration;

/// Command line of `wavelume jobs`, which acts on the jobs of a running service.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Each command sends the access key in the environment variable WAVELUME_KEY, which a service with keys needs"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List jobs, newest first
    List(List),
    /// Request that jobs stop
    Cancel(Chosen),
    /// Put jobs that have failed, were given up or were cancelled back in the queue
    Retry(Chosen),
}

#[derive(Debug, clap::Args)]
struct List {
    #[command(flatten)]
    service: ServiceArgs,
    /// Only jobs in this state: queued, running, succeeded, failed, dead or cancelled
    #[arg(long, value_name = "STATE")]
    state: Option<String>,
    /// Only jobs that read the measurement with this id
    #[arg(long, value_name = "ID")]
    measurement: Option<String>,
    /// Upper bound on the number of jobs listed
    #[arg(long, value_name = "N", default_value_t = 50)]
    limit: usize,
    /// Print the jobs as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct Chosen {
    #[command(flatten)]
    service: ServiceArgs,
    /// Ids of the jobs to cancel or to put back in the queue
    #[arg(value_name = "JOB", required = true)]
    jobs: Vec<String>,
}

/// Options for the running service, and for the configuration file that may name it.
#[derive(Debug, clap::Args)]
struct ServiceArgs {
    #[command(flatten)]
    file: ConfigArg,
    #[command(flatten)]
    address: UrlArg,
    #[command(flatten)]
    trust: TrustArg,
}

/// Option for the address (URL) of the running service.
#[derive(Debug, clap::Args)]
pub(crate) struct UrlArg {
    /// Address (URL) of the running service
    #[arg(
        long,
        value_name = "URL",
        default_value = "http://127.0.0.1:8080",
        env = "WAVELUME_URL",
        hide_env_values = true
    )]
    url: String,
}

/// Facts about a job that the command prints, taken from an answer of the service.
#[derive(Deserialize)]
struct Shown {
    id: String,
    state: String,
    priority: Priority,
    progress: f64,
    material: Option<String>,
    report: Option<String>,
    problem: Option<ShownProblem>,
}

#[derive(Deserialize)]
struct ShownProblem {
    detail: String,
}

impl Shown {
    /// Takes the facts that the command prints from the JSON description of a job. Fails if one of them is missing.
    fn of(job: Value) -> Result<Self, Failure> {
        let unfit = |error| Failure::failed(format!("found a job description that this program cannot read: {error}"));
        serde_json::from_value(job).map_err(unfit)
    }
}

/// Longest time to wait for an answer of the service. Raising it tolerates a busier service.
const PATIENCE: Duration = Duration::from_mins(1);

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.action {
        Action::List(list) => block_on(show(list)),
        Action::Cancel(chosen) => block_on(each(chosen, "cancel")),
        Action::Retry(chosen) => block_on(each(chosen, "retry")),
    }
}

async fn show(list: &List) -> Result<(), Failure> {
    let client = list.service.client()?;
    let mut query = vec![("limit", list.limit.min(1000).to_string())];
    query.extend(list.state.iter().map(|state| ("state", state.clone())));
    query.extend(list.measurement.iter().map(|id| ("measurement", id.clone())));
    let (mut jobs, mut cursor): (Vec<Value>, Option<String>) = (Vec::new(), None);
    while jobs.len() < list.limit {
        let mut query = query.clone();
        query.extend(cursor.take().map(|cursor| ("cursor", cursor)));
        let text: Vec<String> = query.iter().map(|(name, value)| format!("{name}={}", escaped(value))).collect();
        let page =
            read(send(client.get(format!("{}/v1/jobs?{}", list.service.address.url, text.join("&")))).await?).await?;
        jobs.extend(page["items"].as_array().into_iter().flatten().cloned());
        cursor = page["next"].as_str().map(str::to_owned);
        if cursor.is_none() {
            break;
        }
    }
    jobs.truncate(list.limit);
    if list.json {
        return print_json(&jobs);
    }
    let is_empty = jobs.is_empty();
    let mut table = Table::new(&["job", "state", "priority", ">progress", "material, report or problem"]);
    for job in jobs {
        let job = Shown::of(job)?;
        let priority = match job.priority {
            Priority::Urgent => "urgent",
            Priority::Usual => "usual",
            Priority::Batch => "batch",
        };
        let progress = format!("{:.0} %", 100.0 * job.progress);
        let made = job.material.or(job.report).or(job.problem.map(|problem| problem.detail));
        table.row([job.id, job.state, priority.to_owned(), progress, made.unwrap_or_default()]);
    }
    print(&if is_empty { "no jobs\n".to_owned() } else { table.render() })
}

async fn each(chosen: &Chosen, action: &str) -> Result<(), Failure> {
    let client = chosen.service.client()?;
    let mut failed = None;
    for id in &chosen.jobs {
        let request = client.post(format!("{}/v1/jobs/{id}/{action}", chosen.service.address.url));
        let answer = async { read(send(request).await?).await };
        match answer.await {
            Ok(job) => print(&format!("{id}  {}\n", Shown::of(job)?.state))?,
            Err(failure) => {
                print(&format!("{id}  {failure}\n"))?;
                failed = Some(failure);
            }
        }
    }
    failed.map_or(Ok(()), Err)
}

impl ServiceArgs {
    fn client(&self) -> Result<Client, Failure> {
        let mut builder = Client::builder().timeout(PATIENCE);
        if let Some(key) = std::env::var_os(VARIABLE).filter(|key| !key.is_empty()) {
            let value = HeaderValue::from_str(&format!("Bearer {}", key.to_string_lossy().trim()));
            // The text is not shown: it may be a key with one character too many.
            let mut value =
                value.map_err(|_| Failure::usage(format!("{VARIABLE}: found characters that no access key has")))?;
            value.set_sensitive(true);
            builder = builder.default_headers([(AUTHORIZATION, value)].into_iter().collect());
        }
        self.trust.client(builder)
    }
}
