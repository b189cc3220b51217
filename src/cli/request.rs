//! Options of a compression: axes, target, policy, threads; named as in a request.

use super::failure::Failure;
use crate::compress::{DeltaE, Policy, Target};
use crate::domain::WavelengthGrid;
use crate::domain::colour::Illuminant;
use crate::domain::limits::MAX_LEVEL;
use crate::pipeline::{Curve, Request};
use crate::projection::DirectionDomain;

/// Target if none is given.
const DEFAULT_TARGET: Target = Target::ErL2(0.01);

/// Axes of the tensor; by default chosen from the density of the data.
#[derive(Debug, clap::Args)]
pub(crate) struct AxesArgs {
    /// Keep directions on the angles of the file (grid), or average them over triangles [default: grid if the file has
    /// one; a level implies triangles]
    #[arg(long, value_name = "grid|triangles")]
    domain: Option<DirectionDomain>,
    /// Replace each value of a BRDF on its own grid by its mean with the value of the exchanged pair of directions; the
    /// target holds against these means
    #[arg(long)]
    reciprocal: bool,
    /// Subdivision level of the triangles of incoming directions
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_LEVEL)))]
    incoming_level: Option<u8>,
    /// Subdivision level of the triangles of outgoing directions
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_LEVEL)))]
    outgoing_level: Option<u8>,
    /// Wavelengths to resample to, in nm, both ends included
    #[arg(long, value_name = "START:STOP:STEP", value_parser = range)]
    wavelengths: Option<String>,
}

/// Target: at most one of these; er(L2) 0.01 by default.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
pub(crate) struct TargetArgs {
    /// Upper bound on the root mean square of the relative error: 0.01 is 1 % [default: 0.01]; `auto` stops at the
    /// estimated noise, or at the uncertainty that the file states if that is larger (policy rd)
    #[arg(long, value_name = "E|auto", value_parser = er_l2)]
    er_l2: Option<Target>,
    /// Upper bound on the mean relative error: 0.01 is 1 %
    #[arg(long, value_name = "E", value_parser = positive)]
    er_l1: Option<f64>,
    /// Upper bound on the relative error of every sample > 0
    #[arg(long, value_name = "E", value_parser = positive)]
    max_relative_error: Option<f64>,
    /// Upper bound on the absolute error of every sample, in the unit of the samples
    #[arg(long, value_name = "E", value_parser = positive)]
    max_absolute_error: Option<f64>,
    /// Upper bound on the root of: sum of squared errors over sum of squared samples
    #[arg(long, value_name = "E", value_parser = positive)]
    relative_rmse: Option<f64>,
    /// Upper bound on the colour difference CIEDE2000 of every spectrum (policy rd)
    #[arg(long, value_name = "E", value_parser = positive)]
    delta_e: Option<f64>,
    /// Lower bound on the samples per kept coefficient
    #[arg(long, value_name = "R", value_parser = positive)]
    ratio: Option<f64>,
    /// Upper bound on the bytes of the file, metadata included
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    bytes: Option<u64>,
    /// No error bound: fixes the quantiser step (natural-log units); errors are still measured and reported (policy rd)
    #[arg(long, value_name = "S", value_parser = positive)]
    step: Option<f64>,
    /// Keep every bit
    #[arg(long)]
    lossless: bool,
}

/// Targets that have no illuminant.
const OTHER_TARGETS: [&str; 9] = [
    "er_l2",
    "er_l1",
    "max_relative_error",
    "max_absolute_error",
    "relative_rmse",
    "ratio",
    "bytes",
    "step",
    "lossless",
];

/// Options of a compression.
#[derive(Debug, clap::Args)]
pub(crate) struct RequestArgs {
    #[command(flatten)]
    axes: AxesArgs,
    #[command(flatten)]
    target: TargetArgs,
    /// Illuminant of --delta-e: A, B, C, D50, D65, F11 or E [default: D65]
    #[arg(long, value_name = "NAME", requires = "delta_e", conflicts_with_all = OTHER_TARGETS)]
    illuminant: Option<Illuminant>,
    /// rd: rate-distortion; those of the paper: conventional (one threshold), generic (one for each space), adaptive
    #[arg(long, default_value_t)]
    policy: Policy,
    /// Spectral basis: auto, klt (the data's own), identity, or a name that `wavelume bases` lists
    #[arg(long, default_value = "auto")]
    basis: String,
    /// Relative floor: samples below F x the maximum leave the relative errors, and their absolute error is at most
    /// that
    #[arg(long, value_name = "F", value_parser = fraction)]
    floor: Option<f64>,
    /// Upper bound on the relative error of the light of every direction and wavelength (directional albedo, flux;
    /// policy rd)
    #[arg(long, value_name = "E", value_parser = positive)]
    albedo_error: Option<f64>,
    /// Make each incoming direction decodable without the others (policy rd); no coarser levels
    #[arg(long)]
    random_access: bool,
    /// Interpolation between the directions of a grid of angles: cubics of logarithms that keep a luminaire's flux, or
    /// straight lines
    #[arg(long, value_name = "cubic|linear", default_value_t)]
    interpolation: Curve,
    /// Fail if the material adds more to the noise of scattered samples than twice the promised error or half of the
    /// noise, or if its light differs from theirs
    #[arg(long)]
    strict: bool,
    /// Leave the provenance out of the file
    #[arg(long)]
    no_metadata: bool,
}

/// Number of threads that compute.
#[derive(Debug, clap::Args)]
pub(crate) struct ThreadsArgs {
    /// Threads to use [default: one per core]; the bytes do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl AxesArgs {
    /// Builds a request for these axes with the default target.
    pub(crate) fn request(&self) -> Request {
        Request {
            domain: self.domain,
            reciprocal: self.reciprocal,
            incoming_level: self.incoming_level,
            outgoing_level: self.outgoing_level,
            wavelengths: self.wavelengths.clone(),
            ..Request::to(DEFAULT_TARGET)
        }
    }
}

/// Parses a number, or `auto`.
fn er_l2(text: &str) -> Result<Target, String> {
    if text == "auto" { Ok(Target::Auto) } else { positive(text).map(Target::ErL2) }
}

impl TargetArgs {
    pub(super) fn target(&self, illuminant: Illuminant) -> Target {
        self.named_under(illuminant).unwrap_or(DEFAULT_TARGET)
    }

    /// Returns the target that is given, for colours under D65.
    pub(crate) fn named(&self) -> Option<Target> {
        self.named_under(Illuminant::default())
    }

    /// Returns the target, or the default if none is given.
    pub(crate) fn or_default(&self) -> Target {
        self.target(Illuminant::default())
    }

    fn named_under(&self, illuminant: Illuminant) -> Option<Target> {
        let named = self.er_l2;
        let named = named.or(self.er_l1.map(Target::ErL1));
        let named = named.or(self.max_relative_error.map(Target::MaxRelativeError));
        let named = named.or(self.max_absolute_error.map(Target::MaxAbsoluteError));
        let named = named.or(self.relative_rmse.map(Target::RelativeRmse));
        let named = named.or(self.delta_e.map(|at_most| Target::DeltaE(DeltaE { at_most, illuminant })));
        let named = named.or(self.ratio.map(Target::Ratio));
        let named = named.or(self.bytes.map(Target::Bytes));
        let named = named.or(self.step.map(Target::Step));
        named.or(self.lossless.then_some(Target::Lossless))
    }
}

impl RequestArgs {
    /// Builds the request.
    pub(crate) fn request(&self) -> Request {
        Request {
            target: self.target.target(self.illuminant.unwrap_or_default()),
            policy: self.policy,
            basis: self.basis.clone(),
            floor: self.floor,
            albedo_error: self.albedo_error,
            metadata: !self.no_metadata,
            random_access: self.random_access,
            interpolation: self.interpolation,
            strict: self.strict,
            ..self.axes.request()
        }
    }
}

impl ThreadsArgs {
    /// Runs `work` on the number of threads asked for.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
        let Some(threads) = self.threads else { return Ok(work()) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build();
        let pool = pool.map_err(|error| Failure::failed(format!("cannot start {threads} threads: {error}")))?;
        Ok(pool.install(work))
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err("expected a finite number > 0".to_owned()) }
}

fn fraction(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if (0.0..1.0).contains(&value) { Ok(value) } else { Err("expected a number from 0 to less than 1".to_owned()) }
}

fn range(text: &str) -> Result<String, String> {
    WavelengthGrid::parse_range(text).map(|_| text.to_owned()).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        request: RequestArgs,
    }

    fn request(line: &[&str]) -> Result<Request, clap::Error> {
        Line::try_parse_from([&["compress"], line].concat()).map(|line| line.request.request())
    }

    #[test]
    fn the_default_promise_is_one_per_cent() {
        assert_eq!(request(&[]).unwrap(), Request::to(Target::ErL2(0.01)));
    }

    #[test]
    fn every_promise_has_its_option() {
        for (line, target) in [
            (&["--er-l2", "0.02"][..], Target::ErL2(0.02)),
            (&["--er-l2", "auto"], Target::Auto),
            (&["--er-l1", "0.02"], Target::ErL1(0.02)),
            (&["--max-absolute-error", "7.5"], Target::MaxAbsoluteError(7.5)),
            (&["--relative-rmse", "0.02"], Target::RelativeRmse(0.02)),
            (&["--delta-e", "1"], Target::DeltaE(DeltaE { at_most: 1.0, illuminant: Illuminant::D65 })),
            (
                &["--delta-e", "0.5", "--illuminant", "A"],
                Target::DeltaE(DeltaE { at_most: 0.5, illuminant: Illuminant::A }),
            ),
            (&["--max-relative-error", "0.02"], Target::MaxRelativeError(0.02)),
            (&["--ratio", "64"], Target::Ratio(64.0)),
            (&["--bytes", "4096"], Target::Bytes(4096)),
            (&["--step", "0.02"], Target::Step(0.02)),
            (&["--lossless"], Target::Lossless),
        ] {
            assert_eq!(request(line).unwrap().target, target);
        }
    }

    #[test]
    fn two_promises_and_impossible_numbers_are_refused() {
        for line in [
            &["--er-l2", "0.01", "--ratio", "64"][..],
            &["--lossless", "--bytes", "100"],
            &["--er-l1", "0.01", "--er-l2", "0.01"],
            &["--delta-e", "1", "--relative-rmse", "0.01"],
            &["--illuminant", "A"],
            &["--er-l2", "0.01", "--illuminant", "A"],
            &["--delta-e", "1", "--illuminant", "D93"],
            &["--max-absolute-error", "-1"],
            &["--er-l2", "0"],
            &["--er-l2", "nan"],
            &["--er-l2", "inf"],
            &["--ratio", "-3"],
            &["--bytes", "0"],
            &["--floor", "1"],
            &["--incoming-level", "9"],
            &["--wavelengths", "780:380:5"],
            &["--policy", "best"],
        ] {
            assert!(request(line).is_err(), "{line:?}");
        }
    }
}
