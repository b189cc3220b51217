//! `wavelume reflectance`: the directional albedo of a material as a material of its own.

use super::decode;
use super::failure::Failure;
use super::guard::Outputs;
use super::input::read_file;
use super::output::{Sheet, count, print, print_json, three_digits, write_file};
use super::report::{axes_lines, error_lines};
use super::request::{TargetArgs, ThreadsArgs};
use crate::compress::{self, Settings};
use crate::domain::{Axis, Silent};
use crate::evaluate::{Material, Side};
use crate::pipeline::{self, PipelineError};
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) of a BRDF, BTDF or BSDF
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Directional albedo to write: a material, or a NumPy array with its manifest if the name ends in .npy
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Side of the surface on which leaving light is counted
    #[arg(long, value_enum, default_value_t)]
    side: Which,
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
    /// Print a report on the written file as one line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum Which {
    /// All light that leaves the surface, on both sides.
    #[default]
    Both,
    /// Reflected light, which leaves on the side of the source.
    Reflected,
    /// Transmitted light, which leaves on the side away from the source.
    Transmitted,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        if self.is_array() { Outputs::array(&self.output) } else { Outputs::material(&self.output) }
    }

    /// Returns true if the name of the output asks for an array.
    fn is_array(&self) -> bool {
        self.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"))
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    args.threads.run(|| answer(args))?
}

fn answer(args: &Args) -> Result<(), Failure> {
    let about = |failure: Failure| failure.about(&args.material);
    let bytes = read_file(&args.material)?;
    let material = Material::open(&bytes).map_err(|error| about(error.into()))?;
    let side = match args.side {
        Which::Both => Side::Both,
        Which::Reflected => Side::Reflected,
        Which::Transmitted => Side::Transmitted,
    };
    let reflectance = material.reflectance(side).map_err(|error| about(error.into()))?;
    if args.is_array() {
        return decode::write_array(&args.output, reflectance, None, args.json);
    }
    let settings =
        Settings { target: args.target.or_default(), metadata: Some(provenance(&bytes, side)), ..Settings::default() };
    let compressed = compress::compress(&reflectance, &settings, &Silent);
    let compressed = compressed.map_err(|error| about(PipelineError::from(error).into()))?;
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

/// Returns the provenance of a directional albedo as JSON: the digest of the material that it was computed from, and
/// the side of the surface on which light was counted.
fn provenance(bytes: &[u8], side: Side) -> String {
    json!({
        "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")),
        "source": {"format": "wavelume material", "content_digest": pipeline::digest(bytes), "reflectance": side},
    })
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::Target;
    use crate::domain::Quantity;
    use crate::formats::Interpretation;
    use clap::Parser;
    use std::ffi::OsStr;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn write(line: &[&OsStr]) -> Result<(), Failure> {
        let line = [OsStr::new("reflectance")].into_iter().chain(line.iter().copied());
        run(&Line::try_parse_from(line).unwrap().args)
    }

    #[test]
    fn the_reflectance_of_a_material_is_a_material() {
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        let document = r#"{"wavelume": "virtual", "quantity": "brdf", "model": {"lambert": {"reflectance": 0.6}},
            "axes": ["hemi:1", "hemi:3", "lambda:400:20:16"]}"#;
        let interpretation = Interpretation::default();
        let input = pipeline::Input { bytes: document.as_bytes(), spectrum: None, interpretation: &interpretation };
        let request = pipeline::Request::to(Target::ErL2(0.01));
        let material = pipeline::compress(&pipeline::read(&input).unwrap(), &request, &Silent).unwrap().bytes;
        std::fs::write(path("m.wlm"), material).unwrap();
        let (from, to, array) = (path("m.wlm"), path("r.wlm"), path("r.npy"));
        write(&[from.as_os_str(), "-o".as_ref(), to.as_os_str(), "--er-l2".as_ref(), "0.005".as_ref()]).unwrap();
        let reflectance = Material::open(&std::fs::read(&to).unwrap()).unwrap();
        assert_eq!((reflectance.quantity(), reflectance.axes().len()), (Quantity::Reflectance, 2));
        let (low, high) = reflectance.measurement().unwrap().tensor.range().unwrap();
        assert!(low > 0.58 && high < 0.62, "{low} {high}");
        assert!(reflectance.summary().unwrap().metadata.as_ref().unwrap().contains("\"reflectance\":\"both\""));
        write(&[from.as_os_str(), "-o".as_ref(), array.as_os_str(), "--side".as_ref(), "transmitted".as_ref()])
            .unwrap();
        assert!(array.exists() && path("r.axes.json").exists());
        // A reflectance cannot be reduced again.
        let refused = write(&[to.as_os_str(), "-o".as_ref(), array.as_os_str()]).unwrap_err();
        assert!(refused.to_string().ends_with("this reflectance has no reflectance, expected a brdf, btdf or bsdf"));
        assert_eq!(refused.exit_code(), 2);
    }
}
