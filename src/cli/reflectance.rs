//! `wavelume reflectance`: the directional albedo of a material as a material of its own.

use super::decode;
use super::failure::Failure;
use super::output::{Sheet, count, print, print_json, three_digits, write_file};
use super::query;
use super::report::{axes_lines, error_lines};
use super::request::TargetArgs;
use crate::compress::{self, Settings};
use crate::domain::colour::Illuminant;
use crate::domain::{Axis, Silent};
use crate::evaluate::Side;
use crate::pipeline;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The material: a brdf, btdf or bsdf
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// The reflectance to write: a material, or an array with its manifest if the name ends in .npy
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// The light that is counted
    #[arg(long, value_enum, default_value_t)]
    side: Which,
    #[command(flatten)]
    target: TargetArgs,
    /// Print what was written as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Which {
    /// All that leaves.
    #[default]
    Both,
    /// What leaves on the side of the source.
    Reflected,
    /// What leaves on the other side.
    Transmitted,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let material = query::open(&args.material)?;
    let side = match args.side {
        Which::Both => Side::Both,
        Which::Reflected => Side::Reflected,
        Which::Transmitted => Side::Transmitted,
    };
    let reflectance = material.reflectance(side).map_err(|error| Failure::from(error).about(&args.material))?;
    if args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy")) {
        return decode::write_array(&args.output, reflectance, None, args.json);
    }
    let settings = Settings {
        target: args.target.target(Illuminant::default()),
        metadata: Some(provenance(&args.material, side)?),
        ..Settings::default()
    };
    let compressed = compress::compress(&reflectance, &settings, &Silent);
    let compressed =
        compressed.map_err(|error| Failure::from(pipeline::PipelineError::from(error)).about(&args.material))?;
    write_file(&args.output, &compressed.bytes)?;
    let (summary, bytes) = (&compressed.summary, compressed.bytes.len() as u64);
    let axes: Vec<String> = summary.axes.iter().map(Axis::describe).collect();
    let digest = pipeline::digest(&compressed.bytes);
    if args.json {
        return print_json(&json!({
            "output": args.output.display().to_string(),
            "quantity": summary.quantity,
            "unit": summary.unit,
            "side": side,
            "axes": axes,
            "bytes": bytes,
            "range": reflectance.tensor.range(),
            "errors": summary.errors,
            "digest": digest,
        }));
    }
    let mut sheet = Sheet::default();
    sheet.line("quantity", format!("{}, {}", summary.quantity, summary.unit));
    axes_lines(&mut sheet, &axes);
    if let Some((low, high)) = reflectance.tensor.range() {
        sheet.line("range", format!("{} to {}", three_digits(f64::from(low)), three_digits(f64::from(high))));
    }
    sheet.line("size", format!("{} bytes", count(bytes)));
    error_lines(&mut sheet, "error", &summary.errors);
    sheet.line("digest", digest);
    let heading = format!("{} -> {}", args.material.display(), args.output.display());
    print(&sheet.render(&heading))
}

/// What the file says of where it comes from: the material's own digest.
fn provenance(material: &std::path::Path, side: Side) -> Result<String, Failure> {
    let bytes = super::input::read_file(material)?;
    Ok(json!({
        "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")),
        "source": {"format": "wavelume material", "content_digest": pipeline::digest(&bytes), "reflectance": side},
    })
    .to_string())
}
