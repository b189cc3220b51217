//! `wavelume preview`: a picture of a material.

use super::failure::Failure;
use super::guard::Outputs;
use super::opened::Opened;
use super::output::{warn, write_file};
use super::query::{self, List};
use super::request::ThreadsArgs;
use super::viewing::ViewingArgs;
use crate::preview::{self, DEFAULT_SIZE, Look, SIZES, Style};
use clap::builder::PossibleValuesParser;
use clap::builder::TypedValueParser;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Material (compressed measurement) to show in the picture, or a measurement, which is compressed in memory
    #[arg(value_name = "M.wlm")]
    material: PathBuf,
    /// Picture to write, as PNG or, with the extension .svg, as SVG, which diagrams have and balls do not; an existing
    /// file is replaced as a whole
    #[arg(short, long, value_name = "P.png|svg")]
    output: PathBuf,
    /// Width and height of the picture in pixels, 64 to 2048
    #[arg(long, value_name = "N", default_value_t = DEFAULT_SIZE, value_parser = size)]
    size: usize,
    /// Style of a diagram: light lines on dark ground, or dark lines on white for data sheets
    #[arg(long, value_name = "NAME", default_value = Style::Dark.name(), value_parser = style())]
    style: Style,
    /// Title above a diagram
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0 [default: all
    /// entries in a plot of spectra, otherwise the first]
    #[arg(long, value_name = "I,...", value_parser = query::index)]
    index: Option<List<usize>>,
    #[command(flatten)]
    viewing: ViewingArgs,
    #[command(flatten)]
    threads: ThreadsArgs,
}

impl Args {
    pub(super) fn outputs(&self) -> Outputs {
        Outputs { kind: "a PNG or SVG picture", suffixes: vec!["png", "svg"], paths: vec![self.output.clone()] }
    }
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let viewing = args.viewing.viewing()?;
    let index = args.index.as_ref().map(|index| index.0.as_slice());
    let is_svg = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
    let look = Look { size: args.size, style: args.style, title: args.title.as_deref(), is_svg };
    let (picture, remark) = args.threads.run(|| {
        let (material, _) = Opened::open(&args.material)?;
        let about = |error| Failure::from(error).about(&args.material);
        let picture = preview::picture(&material, index, &viewing, look).map_err(about)?;
        Ok::<_, Failure>((picture, preview::colour_remark(&material, &viewing).map_err(about)?))
    })??;
    write_file(&args.output, &picture)?;
    if let Some(remark) = remark {
        warn(&remark);
    }
    Ok(())
}

fn style() -> impl TypedValueParser<Value = Style> {
    let names = PossibleValuesParser::new(Style::ALL.map(Style::name));
    names.map(|name| Style::ALL.into_iter().find(|style| style.name() == name).unwrap_or_default())
}

fn size(text: &str) -> Result<usize, String> {
    let refused = || format!("expected {} to {} pixels", SIZES.start(), SIZES.end());
    text.parse().ok().filter(|size| SIZES.contains(size)).ok_or_else(refused)
}
