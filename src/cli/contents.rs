//! Contents of an archive: one line a file, each read as it would be alone.

use super::failure::Failure;
use super::input::Loaded;
use super::output::{Table, count};
use crate::domain::{Quantity, Unit};
use crate::formats::{Acquisition, Archive};
use serde::Serialize;

/// Listing of a zip archive, with the measurements in it.
#[derive(Serialize)]
pub(crate) struct Contents {
    kind: &'static str,
    bytes: u64,
    members: Vec<Inside>,
}

/// Description of one file in a zip archive.
#[derive(Serialize)]
struct Inside {
    name: String,
    bytes: u64,
    #[serde(flatten)]
    understood: Option<Understood>,
    /// Reason why a file of a zip archive cannot be read as a measurement.
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
}

#[derive(Serialize)]
struct Understood {
    format: &'static str,
    dialect: String,
    quantity: Quantity,
    unit: Unit,
}

impl Contents {
    /// Reads every file of a zip archive as a measurement, with the user's reading options.
    pub(crate) fn read(loaded: &Loaded) -> Result<Self, Failure> {
        let mut archive = Archive::open(loaded.bytes()).map_err(Failure::failed)?;
        let members = archive.members().to_vec();
        let members = members.into_iter().map(|member| {
            let (understood, problem) = match archive.read(&member, loaded.interpretation()) {
                Ok(Acquisition { format, dialect, quantity, unit, .. }) => {
                    (Some(Understood { format, dialect, quantity, unit }), None)
                }
                Err(error) => (None, Some(error.to_string())),
            };
            Inside { name: member.name, bytes: member.bytes, understood, problem }
        });
        Ok(Self { kind: "archive", bytes: loaded.bytes().len() as u64, members: members.collect() })
    }

    /// Renders the listing of a zip archive as a human-readable table, one line for each file.
    pub(crate) fn render(&self, name: &str) -> String {
        let read = self.members.iter().filter(|member| member.understood.is_some()).count();
        let mut table = Table::new(&["bytes", "name", "quantity", "what it is"]);
        for Inside { name, bytes, understood, problem } in &self.members {
            let (quantity, what) = match (understood, problem) {
                (Some(read), _) => {
                    (format!("{}, {}", read.quantity, read.unit), format!("{} ({})", read.format, read.dialect))
                }
                (None, problem) => ("-".to_owned(), format!("not read: {}", problem.as_deref().unwrap_or_default())),
            };
            table.row([count(*bytes), name.clone(), quantity, what]);
        }
        let all = self.members.len();
        format!(
            "{name}: an archive of {all} files, {read} of them measurements; choose one with --member NAME\n{}",
            table.render()
        )
    }
}
