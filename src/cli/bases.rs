//! `wavelume bases`: lists the wavelet bases.

use super::failure::Failure;
use super::output::{Table, print, print_json};
use crate::transform::{self, Space};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print the list of wavelet bases as one JSON array
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let known = transform::bases();
    if args.json {
        return print_json(&known);
    }
    let mut table = Table::new(&["name", "space", "family", ">analysis", ">synthesis", ">moments", "properties"]);
    for basis in known {
        let properties = [(basis.orthogonal, "orthogonal"), (basis.symmetric, "symmetric")];
        let properties: Vec<_> = properties.iter().filter(|(holds, _)| *holds).map(|(_, name)| *name).collect();
        table.row([
            basis.name.to_owned(),
            space(basis.space).to_owned(),
            basis.family.to_owned(),
            taps(basis.analysis_length),
            taps(basis.synthesis_length),
            if basis.analysis_length == 0 { "-".to_owned() } else { basis.vanishing_moments.to_string() },
            properties.join(" "),
        ]);
    }
    print(&table.render())
}

/// Formats the number of taps of a wavelet filter; 0, for a basis without filters, becomes `-`.
fn taps(length: usize) -> String {
    if length == 0 { "-".to_owned() } else { length.to_string() }
}

fn space(space: Space) -> &'static str {
    match space {
        Space::Line => "line",
        Space::Sphere => "sphere",
    }
}
