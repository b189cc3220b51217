//! Job that makes the tables of the paper; its report is the output of `wavelume paper --json`.

use super::attempt::{Failure, Made, last, publish};
use super::computation::{Computation, Computed, compute};
use super::engine::Engine;
use super::hub::Control;
use super::problem::Code;
use super::process::Written;
use super::request::RequestError;
use super::work::Work;
use crate::catalog::{Ended, Priority};
use crate::domain::Progress;
use crate::paper::{self, PaperError, TABLES, Table};
use bytes::Bytes;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::ToSchema;

/// Kind of a job request that recomputes tables of the paper by Claustres et al. (2006).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PaperKind {
    /// Recomputation of tables of the paper by Claustres et al. (2006).
    Paper,
}

/// Request to recompute tables of the paper by Claustres et al. (2006). The report states each recomputed number beside
/// the published one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PaperRequest {
    /// Kind of the job: always `paper`.
    pub kind: PaperKind,
    /// Numbers, 1 to 7, of the tables of Claustres et al. (2006) to recompute, in the desired order and each at most
    /// once. Default: all tables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<u8>>, min_items = 1, max_items = 7)]
    pub tables: Option<Vec<i64>>,
    /// Priority of the job.
    #[serde(default, skip_serializing_if = "Priority::is_left_out")]
    #[schema(required = false)]
    pub priority: Priority,
}

impl PaperRequest {
    /// Returns the numbers, 1 to 7, of the tables of Claustres et al. (2006) that the request names, or all if it names
    /// none. The error says that a number is unknown or repeated, or that the list is empty.
    fn numbers(&self) -> Result<Vec<u8>, String> {
        let Some(wanted) = &self.tables else { return Ok(TABLES.to_vec()) };
        if wanted.is_empty() {
            return Err(
                "tables: found an empty list, expected table numbers from 1 to 7, or no `tables` for all".to_owned()
            );
        }
        let mut numbers = Vec::new();
        for &wanted in wanted {
            let known = TABLES.into_iter().find(|&number| i64::from(number) == wanted);
            let number = known.ok_or_else(|| format!("tables: found {wanted}, expected table numbers from 1 to 7"))?;
            if numbers.contains(&number) {
                return Err(format!("tables: found table {number} twice, expected each table once"));
            }
            numbers.push(number);
        }
        Ok(numbers)
    }
}

impl Work for PaperRequest {
    type Arguments = Vec<u8>;
    type Computation = Tables;

    fn check(&self) -> Result<(), RequestError> {
        self.numbers().map(|_| ()).map_err(RequestError::Text)
    }

    fn priority(&self) -> Priority {
        self.priority
    }

    fn arguments(&self) -> Result<Vec<u8>, String> {
        self.numbers()
    }

    async fn run(engine: &Arc<Engine>, tables: Vec<u8>, control: &Arc<Control>) -> Result<Made, Failure> {
        run(engine, tables, control).await
    }
}

/// Computation of tables of the paper by Claustres et al. (2006), by their numbers.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Tables(Vec<u8>);

impl Computation for Tables {
    const NAME: &'static str = "paper";

    fn compute(self, _files: Vec<Bytes>, progress: &dyn Progress) -> Result<Computed, Failure> {
        let mut bytes = serde_json::to_vec(&make(&self.0, progress)?).map_err(|e| last(Code::Internal, e))?;
        bytes.push(b'\n');
        Ok(Computed { bytes, report: None })
    }
}

/// Runs one attempt at a job that recomputes tables of the paper by Claustres et al. (2006), and stores the report.
async fn run(engine: &Arc<Engine>, tables: Vec<u8>, control: &Arc<Control>) -> Result<Made, Failure> {
    let Written { staged, .. } = compute(engine, Tables(tables), Vec::new(), control).await?;
    let published = publish(engine, staged).await?;
    let ended = Ended::Report(published.claim().clone());
    Ok(Made { ended, published })
}

fn make(numbers: &[u8], progress: &dyn Progress) -> Result<Vec<Table>, PaperError> {
    let share = 1.0 / numbers.len() as f64;
    let make = |(i, &number): (usize, &u8)| {
        let part = Part { whole: progress, start: i as f64 * share, share };
        part.step(0.0)?;
        paper::table(number, &part)
    };
    numbers.iter().enumerate().map(make).collect()
}

/// Receiver of the progress of one table, in a job that recomputes several tables of the paper by Claustres et al.
/// (2006). It reports this progress as a part of that of the job.
struct Part<'a> {
    whole: &'a dyn Progress,
    start: f64,
    share: f64,
}

impl Progress for Part<'_> {
    fn report(&self, fraction: f64) {
        self.whole.report(self.start + self.share * fraction);
    }

    fn is_cancelled(&self) -> bool {
        self.whole.is_cancelled()
    }
}

impl From<PaperError> for Failure {
    fn from(error: PaperError) -> Self {
        match error {
            PaperError::Cancelled(_) => Self::Stopped,
            // The numbers were checked when the job was queued.
            PaperError::NoSuchTable { .. } => Self::Newer(error.to_string()),
            PaperError::Data(_) => last(Code::Internal, error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Cancelled;
    use std::sync::Mutex;

    /// Receiver of progress for tests: records each reported fraction of the work, and asks the work to stop once a
    /// given fraction is reached.
    struct Until(f64, Mutex<Vec<f64>>);

    impl Progress for Until {
        fn report(&self, fraction: f64) {
            self.1.lock().unwrap().push(fraction);
        }

        fn is_cancelled(&self) -> bool {
            self.1.lock().unwrap().last().is_some_and(|fraction| *fraction >= self.0)
        }
    }

    #[test]
    fn tables_are_all_or_those_asked_for() {
        let numbers = |extra: &str| {
            let text = format!("{{\"kind\":\"paper\"{extra}}}");
            serde_json::from_str::<PaperRequest>(&text).unwrap().numbers()
        };
        assert_eq!(numbers(""), Ok(TABLES.to_vec()));
        assert_eq!(numbers(",\"tables\":[3,1]"), Ok(vec![3, 1]));
        for (bad, reason) in
            [("", "an empty list"), ("0", "found 0"), ("-1", "found -1"), ("1,300", "found 300"), ("2,2", "2 twice")]
        {
            let refusal = numbers(&format!(",\"tables\":[{bad}]")).unwrap_err();
            assert!(refusal.contains(reason), "{refusal}");
        }
    }

    #[test]
    fn tables_share_the_progress_and_stop_between_steps() {
        let until = Until(0.5, Mutex::default());
        assert_eq!(make(&[2, 2], &until), Err(PaperError::Cancelled(Cancelled)));
        let heard = until.1.into_inner().unwrap();
        assert!(heard.is_sorted() && heard.last() == Some(&0.5), "{heard:?}");
    }
}
