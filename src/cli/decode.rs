//! `wavelume decode`: a material → a dense float32 array with its manifest.

use super::failure::Failure;
use super::guard::{Outputs, manifest_of_array, marks_of_array};
use super::input::read_file;
use super::output::{Sheet, count, print, print_json, write_file};
use super::report::{axes_lines, coverage_lines};
use super::request::ThreadsArgs;
use crate::compress::{self, DecodeError, Decoded};
use crate::domain::{Axis, Measurement};
use crate::formats;
use crate::projection::Coverage;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to decode
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// NumPy array to write (.npy, float32, NaN = masked), with a manifest of its axes, NAME.axes.json, beside it
    #[arg(short, long, value_name = "T.npy")]
    output: PathBuf,
    /// Resolution to decode: `inspect` lists the levels, from 0, the coarsest, and how many of the first bytes of the
    /// file each needs. A coarser level has fewer angles or larger triangles
    #[arg(long, value_name = "N")]
    level: Option<u8>,
    /// Incoming direction to decode alone, by number from 0 (row-major over all axes before the outgoing directions);
    /// writes an array [outgoing, wavelength]. Of a material written with --random-access nothing else is decoded
    #[arg(long, value_name = "I", conflicts_with = "level")]
    incoming: Option<usize>,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print a report on the written files as one line of JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        Outputs::array(&self.output)
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let measurement = match args.incoming {
        Some(block) => decode_slice(&args.material, block, &args.threads)?,
        None => decode(&args.material, args.level, &args.threads)?,
    };
    write_array(&args.output, measurement, None, args.json)
}

/// Decodes the material in the file `path` at the resolution `level`; `None` stands for the finest level.
fn decode(path: &Path, level: Option<u8>, threads: &ThreadsArgs) -> Result<Measurement, Failure> {
    let bytes = read_file(path)?;
    let decode = || level.map_or_else(|| compress::decode(&bytes), |level| compress::decode_level(&bytes, level));
    let whole = || decode().and_then(Decoded::whole);
    threads.run(whole)?.map_err(|error| Failure::from(error).about(path))
}

/// Decodes the samples of one incoming direction of the material in the file `path`. `block` is its row-major number
/// over all axes before the outgoing directions.
fn decode_slice(path: &Path, block: usize, threads: &ThreadsArgs) -> Result<Measurement, Failure> {
    let bytes = read_file(path)?;
    let decode = || {
        let decoded = compress::decode_block(&bytes, block)?;
        let (quantity, unit, sampling) = (decoded.summary.quantity, decoded.summary.unit, decoded.summary.sampling);
        // A slice lacks some of the axes that its quantity requires.
        Ok(Measurement { quantity, unit, sampling, tensor: decoded.whole(block)? })
    };
    threads.run(decode)?.map_err(|error: DecodeError| Failure::from(error).about(path))
}

/// Writes a measurement as a `.npy` array with a manifest of its axes beside it, and reports both files.
pub(crate) fn write_array(
    path: &Path,
    measurement: Measurement,
    coverage: Option<&Coverage>,
    json: bool,
) -> Result<(), Failure> {
    write_marked(path, measurement, coverage, &[], json)
}

/// Writes a measurement as a `.npy` array with a manifest of its axes beside it. If `filled` is not empty, a second
/// array, `NAME.filled.npy`, without a spectral axis, marks by 1 the spectra that were filled in without samples.
pub(crate) fn write_marked(
    path: &Path,
    measurement: Measurement,
    coverage: Option<&Coverage>,
    filled: &[bool],
    json: bool,
) -> Result<(), Failure> {
    let manifest = formats::manifest_of(&measurement);
    let shape = measurement.tensor.shape();
    let axes: Vec<String> = measurement.tensor.axes().iter().map(Axis::describe).collect();
    let (quantity, unit, masked) = (measurement.quantity, measurement.unit, measurement.tensor.masked());
    let axes_are_spectral = measurement.tensor.axes().last().is_some_and(Axis::is_spectral);
    let (samples, range) = (measurement.tensor.len(), measurement.tensor.range());
    // The encoded array is a second copy of the samples; the first is dropped before the bytes are written.
    let bytes = formats::write_npy(&shape, measurement.tensor.samples());
    drop(measurement);
    write_file(path, &bytes)?;
    let beside = manifest_of_array(path);
    write_file(&beside, format!("{manifest}\n").as_bytes())?;
    let marks = (!filled.is_empty()).then(|| marks_of_array(path));
    if let Some(marks) = &marks {
        let directions = if axes_are_spectral { &shape[..shape.len() - 1] } else { &shape[..] };
        let values: Vec<f32> = filled.iter().map(|&filled| f32::from(u8::from(filled))).collect();
        write_file(marks, &formats::write_npy(directions, &values))?;
    }
    if json {
        let marks = marks.as_ref().map(|marks| marks.display().to_string());
        let mut document = json!({
            "output": path.display().to_string(),
            "manifest": beside.display().to_string(),
            "quantity": quantity,
            "unit": unit,
            "shape": shape,
            "axes": axes,
            "samples": samples,
            "masked_samples": masked,
            "range": range,
            "coverage": coverage,
        });
        if let Some(marks) = marks {
            document["filled"] = json!(marks);
        }
        return print_json(&document);
    }
    let mut sheet = Sheet::default();
    sheet.line("quantity", format!("{quantity}, {unit}"));
    axes_lines(&mut sheet, &axes);
    sheet.line("samples", format!("{}, {} masked", count(samples as u64), count(masked as u64)));
    if let Some((low, high)) = range {
        sheet.line("range", format!("{low} to {high}"));
    }
    if let Some(coverage) = coverage {
        coverage_lines(&mut sheet, coverage);
    }
    sheet.line("manifest", beside.display());
    if let Some(marks) = &marks {
        sheet.line("filled cells", marks.display());
    }
    print(&sheet.render(&path.display().to_string()))
}
