//! `wavelume demo`: the service on real measurements, uploaded and compressed through its own HTTP interface.

use super::answer::{escaped, read, reason, send, text};
use super::failure::Failure;
use super::output::{Table, count, per_cent, print, three_digits};
use super::runtime::{block_on, stop_signal};
use super::serve;
use crate::api::{AuthMode, Stop};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    site: serve::Place,
    /// Stop once the table of results is printed, instead of serving until Ctrl-C
    #[arg(long, hide = true)]
    once: bool,
}

/// Measurement that comes with the program, and the options with which the demonstration compresses it.
struct Exhibit {
    /// Human-readable title of a measurement.
    title: &'static str,
    file: &'static str,
    bytes: &'static [u8],
    /// Name and bytes of a second file, with the spectrum of a luminaire; `None` for other measurements.
    spectrum: Option<(&'static str, &'static [u8])>,
    /// Facts that the measurement file does not state, as names and values of query parameters.
    options: &'static [(&'static str, &'static str)],
    er_l2: f64,
}

const EXHIBITS: &[Exhibit] = &[
    Exhibit {
        title: "far-UVC lamp, goniometry x spectrum",
        file: "aerolamp.ies",
        bytes: include_bytes!("../../data/aerolamp.ies"),
        spectrum: Some(("aerolamp.csv", include_bytes!("../../data/aerolamp.csv"))),
        options: &[],
        er_l2: 0.01,
    },
    // Noisy, with dark samples about zero: 1 % would spend its bytes on the noise.
    Exhibit {
        title: "blue car paint, isotropic RGB BRDF",
        file: "carpaint_blue.mbsdf",
        bytes: include_bytes!("../../data/carpaint_blue.mbsdf"),
        spectrum: None,
        options: &[],
        er_l2: 0.05,
    },
    Exhibit {
        title: "ColorChecker light skin",
        file: "colorchecker_n_ohta.csv",
        bytes: include_bytes!("../../data/colorchecker_n_ohta.csv"),
        spectrum: None,
        options: &[("column", "light skin"), ("quantity", "reflectance")],
        er_l2: 0.01,
    },
    Exhibit {
        title: "CIE illuminant D65",
        file: "illuminant_D65.csv",
        bytes: include_bytes!("../../data/illuminant_D65.csv"),
        spectrum: None,
        options: &[],
        er_l2: 0.01,
    },
];

/// Interval between two requests for the state of a running job.
const PAUSE: Duration = Duration::from_millis(100);

/// Result of compressing a measurement that comes with the program.
struct Outcome {
    material: Value,
    seconds: f64,
    /// True if an earlier start of `wavelume demo` had already compressed this measurement to the same material, which
    /// is used again.
    kept: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    block_on(async {
        let stop = stop_signal()?;
        let config = args.site.config().await?;
        if config.auth != AuthMode::Off {
            return Err(Failure::usage("the demonstration asks its own service without a key: leave --auth out"));
        }
        let server = serve::bind(config).await?;
        let base = format!("http://{}", super::health::reachable(&server.address().to_string()));
        print(&format!(
            "listening on http://{}, data in {}\n\n",
            server.address(),
            args.site.data.places.directory.display()
        ))?;
        let (end, ended) = tokio::sync::oneshot::channel::<()>();
        let is_stopped = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&is_stopped);
        let mut service = tokio::spawn(server.run(async move {
            tokio::select! {
                how = stop => {
                    told.store(true, Ordering::Release);
                    how
                }
                _ = ended => Stop::AtOnce,
            }
        }));
        let shown = tokio::select! {
            shown = exhibit(&base) => shown,
            early = &mut service => return ended_well(early),
        };
        if shown.is_err() && is_stopped.load(Ordering::Acquire) {
            // The user has stopped the service while it worked: requests to it fail.
            return ended_well(service.await);
        }
        if shown.is_err() || args.once {
            // The receiver is gone only if the service has ended already.
            let _ = end.send(());
            return shown.and(ended_well(service.await));
        }
        print("\nserving until Ctrl-C\n")?;
        let ended = ended_well(service.await);
        drop(end);
        ended
    })
}

fn ended_well<E: std::fmt::Display>(ended: Result<Result<(), E>, tokio::task::JoinError>) -> Result<(), Failure> {
    ended.map_err(Failure::failed)?.map_err(Failure::failed)
}

async fn exhibit(base: &str) -> Result<(), Failure> {
    let client = Client::builder().no_proxy().build().map_err(|error| Failure::failed(reason(&error)))?;
    let visitor = Visitor { client, base: base.to_owned() };
    let mut table = Table::new(&[
        "measurement",
        ">samples",
        ">file",
        ">float32",
        ">stored",
        ">ratio",
        ">er(L1)",
        ">er(L2)",
        ">seconds",
    ]);
    let mut ids = Vec::new();
    let mut kept = 0;
    for exhibit in EXHIBITS {
        let outcome = visitor.compress(exhibit).await?;
        kept += usize::from(outcome.kept);
        let m = &outcome.material;
        let (samples, stored) = (number(m, "samples")?, number(m, "bytes")?);
        table.row([
            exhibit.title.to_owned(),
            count(samples as u64),
            count(exhibit.bytes.len() as u64),
            count(4 * samples as u64),
            count(stored as u64),
            format!("{} : 1", three_digits(4.0 * samples / stored)),
            per_cent(number(m, "er_l1")?),
            per_cent(number(m, "er_l2")?),
            if outcome.kept { "kept".to_owned() } else { format!("{:.2}", outcome.seconds) },
        ]);
        ids.push(text(m, "id")?.to_owned());
    }
    print(&table.render())?;
    print(
        "file, float32 and stored in bytes; ratio of float32 to stored; errors of the decoded file\n\
         stored sizes include 150 bytes or more of provenance, which outweighs a single spectrum\n",
    )?;
    if kept > 0 {
        print(&format!("{kept} of {} materials were in the data directory already and are used again\n", ids.len()))?;
    }
    let [lamp, paint, ..] = ids.as_slice() else { return Ok(()) };
    print(&format!(
        "\nthe lamp's spectrum straight down, and what it is:\n  \
           curl '{base}/v1/materials/{lamp}/spectrum?wo=180,0'\n  \
           curl '{base}/v1/materials/{lamp}'\n\
         directions drawn from the paint lit from 30 degrees:\n  \
           curl -H 'content-type: application/json' -d '{{\"wi\":[30,0],\"count\":4,\"seed\":1}}' \\\n       \
           '{base}/v1/materials/{paint}/sample'\n\
         the material, for good, to evaluate and sample on your own machine:\n  \
           curl -o lamp.wlm '{base}/v1/materials/{lamp}/content'\n  \
           wavelume evaluate lamp.wlm --wo 180,0\n"
    ))
}

/// Client that calls the demonstrated service over HTTP.
struct Visitor {
    client: Client,
    base: String,
}

impl Visitor {
    async fn compress(&self, exhibit: &Exhibit) -> Result<Outcome, Failure> {
        let mut options: Vec<(&str, String)> =
            exhibit.options.iter().map(|(name, value)| (*name, (*value).to_owned())).collect();
        if let Some((file, bytes)) = exhibit.spectrum {
            options.push(("spectrum", self.upload(file, bytes, &[]).await?));
        }
        let measurement = self.upload(exhibit.file, exhibit.bytes, &options).await?;
        let start = Instant::now();
        // An equal key finds the job of an earlier start, unless its material was deleted since.
        let key = format!("demo-{measurement}-{}", exhibit.er_l2);
        let (job, known) = self.job(&measurement, exhibit.er_l2, Some(&key)).await?;
        if let Some(material) = self.material(&job).await? {
            return Ok(Outcome { material, seconds: start.elapsed().as_secs_f64(), kept: known });
        }
        let (job, _) = self.job(&measurement, exhibit.er_l2, None).await?;
        let material = self.material(&job).await?;
        let material = material.ok_or_else(|| {
            Failure::failed(format!("{}: the material compressed from it was deleted meanwhile", exhibit.file))
        })?;
        Ok(Outcome { material, seconds: start.elapsed().as_secs_f64(), kept: false })
    }

    /// Uploads a file and returns the measurement's id.
    async fn upload(&self, file: &str, bytes: &'static [u8], options: &[(&str, String)]) -> Result<String, Failure> {
        let mut url = format!("{}/v1/measurements?filename={}", self.base, escaped(file));
        for (name, value) in options {
            url.extend(["&", name, "=", &escaped(value)]);
        }
        let answer = read(send(self.client.post(url).body(bytes)).await?).await?;
        Ok(text(&answer, "id")?.to_owned())
    }

    /// Queues a compression job and waits for its end. Also returns true if an earlier start of the demonstration had
    /// already run the same job.
    async fn job(&self, measurement: &str, er_l2: f64, key: Option<&str>) -> Result<(Value, bool), Failure> {
        let body = json!({ "measurement": measurement, "target": { "er_l2": er_l2 } });
        let mut request = self.client.post(format!("{}/v1/jobs", self.base)).json(&body);
        if let Some(key) = key {
            request = request.header("Idempotency-Key", key);
        }
        let mut job = read(send(request).await?).await?;
        let known = text(&job, "state")? == "succeeded";
        loop {
            match text(&job, "state")? {
                "succeeded" => return Ok((job, known)),
                "queued" | "running" => tokio::time::sleep(PAUSE).await,
                state => {
                    let problem = job["problem"]["detail"].as_str().unwrap_or("no reason given");
                    return Err(Failure::failed(format!("job {state}: {problem}")));
                }
            }
            let url = format!("{}/v1/jobs/{}", self.base, text(&job, "id")?);
            job = read(send(self.client.get(url)).await?).await?;
        }
    }

    /// Returns the description of the material that a job made; `None` if the material was deleted.
    async fn material(&self, job: &Value) -> Result<Option<Value>, Failure> {
        let url = format!("{}/v1/materials/{}", self.base, text(job, "material")?);
        let answer = send(self.client.get(url)).await?;
        match answer.status() {
            StatusCode::NOT_FOUND | StatusCode::GONE => Ok(None),
            _ => read(answer).await.map(Some),
        }
    }
}

/// Returns the number called `name` in the JSON description of a material, or else in `errors`, the report on
/// compression errors in that description.
fn number(material: &Value, name: &str) -> Result<f64, Failure> {
    let found = material[name].as_f64().or_else(|| material["errors"][name].as_f64());
    found.ok_or_else(|| Failure::failed(format!("the service's answer has no `{name}`")))
}
