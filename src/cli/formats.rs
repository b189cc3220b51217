//! `wavelume formats`: the known file formats, and templates of those that are written by hand.

use super::failure::Failure;
use super::output::{Table, print, print_json};
use crate::formats;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print the list of file formats as one JSON array
    #[arg(long)]
    json: bool,
    /// Print a template of a measurement file to fill in: radiometric-csv-long, radiometric-csv-wide, npy-manifest,
    /// radiometric-arrow-python or phase-table
    #[arg(long, value_name = "NAME", conflicts_with = "json")]
    template: Option<String>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(name) = &args.template {
        let template = formats::template(name).ok_or_else(|| {
            let known: Vec<&str> = formats::TEMPLATES.iter().map(|template| template.name).collect();
            Failure::usage(format!("no template `{name}`, expected one of {}", known.join(", ")))
        })?;
        return print(template.text);
    }
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
