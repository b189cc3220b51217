//! Many queries in one call: a table of directions in, a table of answers out, block by block in flat memory.

use super::failure::Failure;
use super::guard::Outputs;
use super::output::{count as thousands, warn};
use super::rows::Rows;
use super::table::{Table, TableFormat};
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Directions, EvaluateError, Material};
use std::path::{Path, PathBuf};

/// Upper bound on the output values that are computed at once for a table of queries. Raising it costs memory.
const VALUES: usize = 1 << 20;
/// Name of the column that flags extrapolated answers.
const EXTRAPOLATED: &str = "extrapolated";
/// Upper bound on the rows of a table of queries that are read and answered at once. Raising it costs memory.
const ROWS: usize = 1 << 14;

/// Destination and file format of the answers to a table of directions.
#[derive(Debug, clap::Args)]
pub(crate) struct BatchArgs {
    /// File for the answers to --directions, one row for each query [default: stdout]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// File format of the answers to --directions [default: by the extension of --output, else csv]
    #[arg(long, value_enum)]
    format: Option<TableFormat>,
}

/// Queries that are read from a table, one from each row.
pub(crate) struct Queries {
    rows: Rows,
    path: PathBuf,
    columns: &'static [&'static str],
}

/// Queries from consecutive rows of a table, which are answered together.
#[derive(Default)]
pub(crate) struct Block {
    wi: Option<Vec<Direction>>,
    wo: Option<Vec<Direction>>,
    points: Vec<[f64; 2]>,
    range: std::ops::Range<usize>,
}

impl Block {
    /// Returns the number of queries in this block of a table of queries.
    pub(crate) fn len(&self) -> usize {
        self.range.len()
    }

    /// Returns true if a direction of a query of this block lies beyond the measured angles of the material.
    fn is_extrapolated(&self, query: usize, material: &Material) -> bool {
        let of = |all: &Option<Vec<Direction>>| all.as_ref().map(|all| all[self.range.start + query]);
        material.is_extrapolated(of(&self.wi), of(&self.wo))
    }

    /// Returns the incoming directions of the queries; `None` if the table has no column for them.
    pub(crate) fn wi(&self) -> Option<Directions<'_>> {
        self.wi.as_deref().map(|all| Directions::of(&all[self.range.clone()]))
    }

    /// Returns the outgoing directions of the queries; `None` if the table has no column for them.
    pub(crate) fn wo(&self) -> Option<Directions<'_>> {
        self.wo.as_deref().map(|all| Directions::of(&all[self.range.clone()]))
    }

    /// Returns the points (u1, u2) of the unit square that the user's table of queries gives for drawing random
    /// directions; empty if the table has no columns for them.
    pub(crate) fn points(&self) -> &[[f64; 2]] {
        &self.points[self.range.clone()]
    }
}

impl Queries {
    /// Opens a table of directions at which a material is evaluated.
    pub(crate) fn evaluated(path: &Path, material: &Material) -> Result<Self, Failure> {
        let choices: &[&[&str]] = match sides(material) {
            (true, true) => &[&["theta_i", "phi_i", "theta_o", "phi_o"]],
            (true, false) => &[&["theta_i", "phi_i"]],
            (false, true) if material.quantity() == Quantity::Edf => &[&["theta_o", "phi_o"], &["c", "gamma"]],
            (false, true) => &[&["theta_o", "phi_o"]],
            (false, false) => {
                return Err(Failure::usage("--directions: this material has no directions, leave it out"));
            }
        };
        Self::open(path, choices)
    }

    /// Opens a table for drawing directions at random. Each row has a point of the unit square, and an incoming
    /// direction if the material depends on one.
    pub(crate) fn drawn(path: &Path, material: &Material) -> Result<Self, Failure> {
        Self::open(path, if sides(material).0 { &[&["theta_i", "phi_i", "u1", "u2"]] } else { &[&["u1", "u2"]] })
    }

    fn open(path: &Path, choices: &[&'static [&'static str]]) -> Result<Self, Failure> {
        let rows = Rows::open(path, choices)?;
        Ok(Self { columns: rows.names(), rows, path: path.to_owned() })
    }

    /// Builds queries from `numbers`, the values of consecutive rows of a table. `before` is the number of rows read
    /// earlier, for the row numbers in errors.
    fn block(&self, numbers: &[f64], before: u64) -> Result<Block, Failure> {
        let width = self.columns.len();
        let count = numbers.len() / width;
        let column = |name: &str| self.columns.iter().position(|found| *found == name);
        let check = |row: usize, at: usize| {
            let (found, name) = (numbers[row * width + at], self.columns[at]);
            let (is_right, expected) = match name.split('_').next() {
                Some("theta" | "gamma") => ((0.0..=180.0).contains(&found), "0 to 180 degrees"),
                Some("phi" | "c") => (found.is_finite(), "degrees"),
                _ => ((0.0..1.0).contains(&found), "0 to less than 1"),
            };
            if is_right {
                return Ok(found);
            }
            let message = format!("row {}, column {name}: found {found}, expected {expected}", before + row as u64 + 1);
            Err(Failure::failed(message).about(&self.path))
        };
        let pairs = |first: &str| -> Result<Option<Vec<[f64; 2]>>, Failure> {
            let Some(at) = column(first) else { return Ok(None) };
            (0..count).map(|row| Ok([check(row, at)?, check(row, at + 1)?])).collect::<Result<_, _>>().map(Some)
        };
        let directions = |angles: Option<Vec<[f64; 2]>>| {
            angles.map(|all| all.into_iter().map(|[theta, phi]| Direction::from_degrees(theta, phi)).collect())
        };
        let of_luminaire = |[c, gamma]: [f64; 2]| Direction::from_luminaire_degrees(c, gamma);
        let luminaire = pairs("c")?.map(|all| all.into_iter().map(of_luminaire).collect());
        let (wi, wo) = (directions(pairs("theta_i")?), directions(pairs("theta_o")?).or(luminaire));
        Ok(Block { wi, wo, points: pairs("u1")?.unwrap_or_default(), range: 0..count })
    }
}

/// Returns two flags: true if a material depends on an incoming direction, and true if on an outgoing one.
fn sides(material: &Material) -> (bool, bool) {
    let layout = material.layout();
    let has_incoming = layout.incoming.is_some() || material.quantity().directions() == 2;
    (has_incoming, layout.outgoing.is_some() && material.quantity() != Quantity::Reflectance)
}

impl BatchArgs {
    /// Returns the file for the answers, if there is one.
    pub(super) fn outputs(&self) -> Option<Outputs> {
        let path = self.output.clone()?;
        let (kind, suffixes) = match TableFormat::of(Some(&path), self.format) {
            TableFormat::Csv => ("a CSV table", vec!["csv", "txt", "dat"]),
            TableFormat::Npy => ("a NumPy array", vec!["npy"]),
            TableFormat::F32 => ("a sequence of float32 numbers", vec!["f32", "dat"]),
        };
        Some(Outputs { kind, suffixes, paths: vec![path] })
    }

    /// Refuses the options for answers to a table of directions if no table is given, because they have no effect.
    pub(crate) fn check_unused(&self) -> Result<(), Failure> {
        let named = [("--output", self.output.is_some()), ("--format", self.format.is_some())];
        match named.iter().find(|(_, is_named)| *is_named) {
            Some((option, _)) => Err(Failure::usage(format!("{option} does nothing without --directions"))),
            None => Ok(()),
        }
    }

    /// Answers all queries of a table about `material`, block by block. `ask` computes `names.len()` values for each
    /// query of a block. A CSV has a last column `extrapolated`: 1 where a direction lies beyond the measured angles.
    /// For other formats a warning counts these queries.
    pub(crate) fn answer(
        &self,
        mut queries: Queries,
        names: &[String],
        material: &Material,
        ask: impl Fn(&Block, &mut [f32]) -> Result<(), EvaluateError>,
    ) -> Result<(), Failure> {
        let width = names.len();
        let most = (VALUES / width.max(1)).clamp(1, ROWS);
        let mut table = Table::new(self.output.as_deref(), self.format, names, EXTRAPOLATED)?;
        let (mut numbers, mut values, mut before) = (Vec::new(), Vec::new(), 0_u64);
        let mut extrapolated = 0_u64;
        loop {
            numbers.clear();
            let count = queries.rows.read(most, &mut numbers)?;
            if count == 0 {
                if extrapolated > 0 && !table.has_flags() {
                    warn(&format!(
                        "{} of {} queries lie beyond the measured angles: their values are extrapolated",
                        thousands(extrapolated),
                        thousands(before)
                    ));
                }
                return table.finish();
            }
            let mut block = queries.block(&numbers, before)?;
            values.clear();
            values.resize(count * width, 0.0);
            if let Err(error) = ask(&block, &mut values) {
                // A block is refused as a whole: repeat it row by row to find the one at fault.
                let at_fault = (0..count).find_map(|row| {
                    block.range = row..row + 1;
                    let refused = ask(&block, &mut values[row * width..][..width]).err()?;
                    Some((row, refused))
                });
                let failure = match at_fault {
                    Some((row, refused)) => {
                        let message = format!("row {}: {refused}", before + row as u64 + 1);
                        Failure::failed(message)
                    }
                    None => error.into(),
                };
                return Err(failure.about(&queries.path));
            }
            let flags: Vec<bool> = (0..count).map(|query| block.is_extrapolated(query, material)).collect();
            extrapolated += flags.iter().filter(|flag| **flag).count() as u64;
            table.write(&values, &flags)?;
            before += count as u64;
        }
    }
}
