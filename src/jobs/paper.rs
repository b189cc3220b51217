//! Job that makes the tables of the paper; its report is the output of `wavelume paper --json`.

use super::attempt::{Failure, Made, last, publish};
use super::engine::Engine;
use super::hub::Control;
use super::problem::Code;
use crate::catalog::Ended;
use crate::domain::Progress;
use crate::paper::{self, PaperError, Table};
use std::sync::Arc;

/// Runs one attempt and publishes the report.
pub(crate) async fn run(engine: &Arc<Engine>, tables: Vec<u8>, control: &Arc<Control>) -> Result<Made, Failure> {
    let control = Arc::clone(control);
    let tables = engine.background.run(move || make(&tables, &*control)).await??;
    let mut bytes = serde_json::to_vec(&tables).map_err(|e| last(Code::Internal, e))?;
    bytes.push(b'\n');
    let published = publish(engine, bytes).await?;
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

/// One table's part of the whole progress.
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

    /// Requests a stop once the progress has reached this fraction.
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
    fn tables_share_the_progress_and_stop_between_steps() {
        let until = Until(0.5, Mutex::default());
        assert_eq!(make(&[2, 2], &until), Err(PaperError::Cancelled(Cancelled)));
        let heard = until.1.into_inner().unwrap();
        assert!(heard.is_sorted() && heard.last() == Some(&0.5), "{heard:?}");
    }
}
