//! `wavelume paper`: recomputes the tables of the paper, beside the printed figures.

use super::failure::Failure;
use super::output::{print, print_json};
use super::request::ThreadsArgs;
use crate::domain::Silent;
use crate::paper::{self, PaperError, TABLES};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Recompute only this table of the paper (Claustres et al. 2006), 1 to 7; may be repeated
    #[arg(long = "table", value_name = "N", value_parser = clap::value_parser!(u8).range(1..=7))]
    tables: Vec<u8>,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print the recomputed tables of the paper (Claustres et al. 2006) as one JSON array
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print the recomputed tables of the paper (Claustres et al. 2006) as CSV, one line for each number
    #[arg(long)]
    csv: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let wanted: &[u8] = if args.tables.is_empty() { &TABLES } else { &args.tables };
    let make = |&number: &u8| {
        paper::table(number, &Silent).map_err(|error| match error {
            PaperError::NoSuchTable { .. } => Failure::usage(error),
            _ => Failure::failed(error),
        })
    };
    if args.json {
        let tables: Vec<_> = wanted.iter().map(make).collect::<Result<_, _>>()?;
        return print_json(&tables);
    }
    // Each is shown as soon as it is made.
    for (i, number) in wanted.iter().enumerate() {
        let table = make(number)?;
        if args.csv {
            let text = table.csv();
            print(if i == 0 { &text } else { text.split_once('\n').map_or("", |(_, lines)| lines) })?;
        } else {
            print(&format!("{}{}", if i == 0 { "" } else { "\n" }, table.text()))?;
        }
    }
    Ok(())
}
