//! `wavelume jobs`: lists, cancels and repeats jobs of a running service.

use super::answer::{escaped, read, send};
use super::failure::Failure;
use super::key_file::VARIABLE;
use super::output::{Table, print, print_json};
use super::runtime::block_on;
use super::site::ConfigArg;
use super::tls::TrustArg;
use crate::catalog::Priority;
use reqwest::header::{AUTHORIZATION, HeaderValue};
use reqwest::{Client, StatusCode};
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Command line of `wavelume jobs`, which acts on the jobs of a running service.
#[derive(Debug, clap::Args)]
#[command(
    arg_required_else_help = true,
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
    measurement: Option<String>,
    created_ms: i64,
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

    /// Returns the row of the job in the list, at the time `now` in milliseconds since the Unix epoch. `names` has the
    /// names of measurements.
    fn cells(self, names: &HashMap<String, String>, now: i64) -> [String; HEADINGS.len()] {
        let priority = match self.priority {
            Priority::Urgent => "urgent",
            Priority::Usual => "usual",
            Priority::Batch => "batch",
        };
        // The other kind of job reads no measurement.
        let kind = if self.measurement.is_some() { "compress" } else { "paper" };
        let of = self.measurement.and_then(|id| names.get(&id).cloned()).unwrap_or_default();
        let made = self.material.or(self.report).or(self.problem.map(|problem| problem.detail)).unwrap_or_default();
        let progress = format!("{:.0} %", 100.0 * self.progress);
        // One width lines up lists of any age alike.
        let age = format!("{:>6}", age(now - self.created_ms));
        [self.id, kind.to_owned(), self.state, priority.to_owned(), progress, age, of, made]
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
    let jobs = jobs.into_iter().map(Shown::of).collect::<Result<Vec<_>, _>>()?;
    let names = names(&client, &list.service.address.url, &jobs).await?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as i64;
    let is_empty = jobs.is_empty();
    let mut table = Table::new(&HEADINGS);
    for job in jobs {
        table.row(job.cells(&names, now));
    }
    print(&if is_empty { "no jobs\n".to_owned() } else { table.render() })
}

/// Headings of the list of jobs. `age` is the time since a job was created.
const HEADINGS: [&str; 8] =
    ["job", "kind", "state", "priority", ">progress", ">age", "measurement", "material, report or problem"];

/// Fetches the names of the measurements that jobs read, by id. A measurement that was deleted has none.
async fn names(client: &Client, base: &str, jobs: &[Shown]) -> Result<HashMap<String, String>, Failure> {
    let mut names = HashMap::new();
    for id in jobs.iter().filter_map(|job| job.measurement.as_ref()) {
        if names.contains_key(id) {
            continue;
        }
        let answer = send(client.get(format!("{base}/v1/measurements/{id}"))).await?;
        let is_gone = matches!(answer.status(), StatusCode::NOT_FOUND | StatusCode::GONE);
        let found = if is_gone { Value::Null } else { read(answer).await? };
        let name = found["name"].as_str().or(found["file_name"].as_str());
        names.insert(id.clone(), name.map_or_else(|| short(id), str::to_owned));
    }
    Ok(names)
}

/// Returns the beginning of an id, enough to recognise it: `b3-f4fa294e…`.
fn short(id: &str) -> String {
    id.chars().take(11).chain(['…']).collect()
}

/// Formats an age in its largest whole unit: `12 s`, `3 min`, `2 h`, `4 d`.
fn age(ms: i64) -> String {
    let seconds = ms.max(0) / 1000;
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{} min", seconds / 60),
        3600..86_400 => format!("{} h", seconds / 3600),
        _ => format!("{} d", seconds / 86_400),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_job_is_listed_with_its_kind_age_and_measurement() {
        let names = HashMap::from([("b3-1".to_owned(), "office lamp".to_owned())]);
        let row = |measurement: Value, created_ms: i64| {
            let job = json!({
                "id": "j", "state": "running", "priority": 0, "progress": 0.064, "measurement": measurement,
                "created_ms": created_ms, "material": null, "report": null, "problem": null,
            });
            Shown::of(job).unwrap().cells(&names, 90_000).join("|")
        };
        assert_eq!(row(json!("b3-1"), 20_000), "j|compress|running|usual|6 %| 1 min|office lamp|");
        assert_eq!(row(Value::Null, 90_001), "j|paper|running|usual|6 %|   0 s||");
        assert_eq!([3_600_000, 86_400_000 * 3].map(age), ["1 h", "3 d"]);
        assert_eq!(short("b3-f4fa294e77fea9"), "b3-f4fa294e…");
    }
}
