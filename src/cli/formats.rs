//! `wavelume formats`: the file formats that are known.

use super::failure::Failure;
use super::output::{Table, print, print_json};
use crate::formats;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print an array of JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let known = formats::formats();
    if args.json {
        return print_json(&known);
    }
    let mut table = Table::new(&["name", "reads", "writes", "extensions", "what it is"]);
    let mark = |yes: bool| if yes { "yes" } else { "-" }.to_owned();
    for format in known {
        let extensions = format.extensions.join(" ");
        table.row([
            format.name.to_owned(),
            mark(format.reads),
            mark(format.writes),
            extensions,
            format.description.to_owned(),
        ]);
    }
    print(&table.render())
}
