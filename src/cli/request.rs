//! Options of a compression on the command line, derived from the declarations of the request and its targets.

use super::declared::{all_stated, argument, declared_args, help, refusal, stated};
use super::failure::Failure;
use crate::compress::{DeltaE, Target};
use crate::domain::colour::Illuminant;
use crate::domain::{Declared, Values};
use crate::pipeline::Request;
use clap::builder::ValueParser;
use clap::{Arg, ArgGroup, ArgMatches, Command};
use serde_json::{Value, json};

/// Name of the option for the illuminant under which `--delta-e` compares colours.
const ILLUMINANT: &str = "illuminant";
/// Names of the options that choose the axes of the tensor to compress.
const AXES: [&str; 5] = ["domain", "reciprocal", "incoming_level", "outgoing_level", "wavelengths"];
/// Names of the options that, like a promise (error bound, size or ratio), have a sum of materials compressed anew.
const AGAIN: [&str; 2] = ["policy", "basis"];
/// Name of the option that leaves the provenance out of a material.
const METADATA: &str = "metadata";

/// Axes of the tensor to compress; by default chosen from the density of the data.
#[derive(Clone, Debug)]
pub(crate) struct AxesArgs(Request);

/// Promise of a compression (error bound, size or ratio) that the command line gives; `None` without one.
#[derive(Clone, Debug)]
pub(crate) struct TargetArgs(Option<Target>);

/// Options of a compression.
#[derive(Clone, Debug)]
pub(crate) struct RequestArgs(Request);

/// Options of a compression that a sum of materials accepts. It accepts none for the axes, which the materials already
/// have.
#[derive(Clone, Debug)]
pub(crate) struct SumArgs {
    request: Request,
    is_stated: bool,
}

/// Option for the number of threads on which a command computes its result.
#[derive(Debug, clap::Args)]
pub(crate) struct ThreadsArgs {
    /// Number of threads [default: one per core]; results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl AxesArgs {
    /// Returns a compression request with the axes that the command line chooses, and with the default promise, a
    /// relative error.
    pub(crate) fn request(&self) -> Request {
        self.0.clone()
    }
}

impl TargetArgs {
    /// Returns the compression target that the command line gives, or the default target.
    pub(crate) fn or_default(&self) -> Target {
        self.0.unwrap_or_default()
    }
}

impl SumArgs {
    /// Returns the compression request for a sum of materials, with the promise, the policy and the basis that the
    /// command line states.
    pub(crate) fn request(&self) -> &Request {
        &self.request
    }

    /// Returns true if the command line states a promise, a policy or a basis. A sum of materials is then compressed
    /// anew.
    pub(crate) fn is_stated(&self) -> bool {
        self.is_stated
    }
}

impl RequestArgs {
    /// Returns the compression request with the promise and the options that the command line states.
    pub(crate) fn request(&self) -> Request {
        self.0.clone()
    }
}

/// Builds a compression request with the promise `target` (error bound, size or ratio) and those options of the command
/// line that `takes` accepts.
fn request(matches: &ArgMatches, target: Target, takes: fn(&Declared) -> bool) -> Result<Request, clap::Error> {
    let mut options = all_stated(matches, Request::OPTIONS.iter().filter(|declared| takes(declared)));
    options.insert("target".to_owned(), json!(target));
    serde_json::from_value(Value::Object(options)).map_err(refusal)
}

fn is_of_sums(declared: &Declared) -> bool {
    AGAIN.contains(&declared.name) || declared.name == METADATA
}

fn is_of_axes(declared: &Declared) -> bool {
    AXES.contains(&declared.name)
}

/// Builds the command-line argument for one promise of a compression, such as `--bytes` for a size. The one for
/// `--er-l2`, a relative error, also takes `auto` instead of a number.
fn target_argument(declared: &'static Declared) -> Arg {
    let default = json!(Target::default());
    let Some(default) = default.get(declared.name) else { return argument(declared) };
    let auto = Target::Auto.name();
    let meaning = Target::Auto.declared().map(help).unwrap_or_default();
    let read = move |text: &str| if text == auto { Ok(Value::from(auto)) } else { declared.read(text) };
    argument(declared)
        .value_name(format!("E|{auto}"))
        .value_parser(ValueParser::new(read))
        .help(format!("{}. `{auto}`: {meaning} [default: {default}]", help(declared)))
}

/// Returns the declarations of all compression targets that have a command-line option of their own.
fn targets() -> impl Iterator<Item = &'static Declared> {
    Target::DECLARED.iter().filter(|declared| declared.name != Target::Auto.name())
}

/// Builds the promise of a compression (error bound, size or ratio) from the command line; `None` if it states no
/// promise.
fn target(matches: &ArgMatches, illuminant: Option<Illuminant>) -> Result<Option<Target>, clap::Error> {
    let found = targets().find_map(|declared| Some((declared, stated(matches, declared)?)));
    let Some((declared, value)) = found else { return Ok(None) };
    let target = match (declared.values, illuminant) {
        (Values::Switch, _) => json!(declared.name),
        _ if value == Target::Auto.name() => value,
        (_, Some(illuminant)) => json!({ declared.name: { "at_most": value, "illuminant": illuminant } }),
        _ => json!({ declared.name: value }),
    };
    serde_json::from_value(target).map(Some).map_err(refusal)
}

declared_args!(TargetArgs);

impl TargetArgs {
    fn arguments(command: Command) -> Command {
        let group = ArgGroup::new("target").args(targets().map(|declared| declared.name)).multiple(false);
        command.args(targets().map(target_argument)).group(group)
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        target(matches, None).map(Self)
    }
}

declared_args!(AxesArgs);

impl AxesArgs {
    fn arguments(command: Command) -> Command {
        command.args(Request::OPTIONS.iter().filter(|declared| is_of_axes(declared)).map(argument))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        request(matches, Target::default(), is_of_axes).map(Self)
    }
}

declared_args!(SumArgs);

impl SumArgs {
    fn arguments(command: Command) -> Command {
        let options = Request::OPTIONS.iter().filter(|declared| is_of_sums(declared));
        TargetArgs::arguments(command).args(options.map(argument))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let target = target(matches, None)?;
        let again = Request::OPTIONS.iter().filter(|declared| AGAIN.contains(&declared.name));
        let is_stated = target.is_some() || !all_stated(matches, again).is_empty();
        Ok(Self { request: request(matches, target.unwrap_or_default(), is_of_sums)?, is_stated })
    }
}

declared_args!(RequestArgs);

impl RequestArgs {
    fn arguments(command: Command) -> Command {
        let names = Illuminant::all_names();
        let illuminant = Arg::new(ILLUMINANT)
            .long(ILLUMINANT)
            .value_name("NAME")
            .value_parser(clap::value_parser!(Illuminant))
            .requires(Target::DeltaE(DeltaE::from(1.0)).name())
            .help(format!("Illuminant of --delta-e: {} [default: {}]", names.join(", "), Illuminant::default()));
        TargetArgs::arguments(command).arg(illuminant).args(Request::OPTIONS.iter().map(argument))
    }

    fn read(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let target = target(matches, matches.get_one(ILLUMINANT).copied())?;
        request(matches, target.unwrap_or_default(), |_| true).map(Self)
    }
}

impl ThreadsArgs {
    /// Runs `work` on as many threads as the user chose, or on one for each core.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
        let Some(threads) = self.threads else { return Ok(work()) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build();
        let pool = pool.map_err(|error| Failure::failed(format!("cannot start {threads} threads: {error}")))?;
        Ok(pool.install(work))
    }
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
    fn a_sum_is_compressed_anew_if_its_promise_policy_or_basis_is_stated() {
        #[derive(Debug, Parser)]
        struct Line {
            #[command(flatten)]
            sum: SumArgs,
        }
        let sum = |line: &[&str]| Line::try_parse_from([&["combine"], line].concat()).map(|line| line.sum);
        for (line, is_stated) in [
            (&[][..], false),
            (&["--no-metadata"], false),
            (&["--er-l2", "0.01"], true),
            (&["--policy", "rd"], true),
            (&["--basis", "auto"], true),
        ] {
            let found = sum(line).unwrap();
            assert_eq!((found.is_stated(), found.request()), (is_stated, &request(line).unwrap()), "{line:?}");
        }
        for line in [&["--basis", "no-such-basis"][..], &["--policy", "best"], &["--floor", "0.1"]] {
            assert!(sum(line).is_err(), "{line:?}");
        }
    }

    #[test]
    fn the_help_names_every_value_and_every_default() {
        use clap::CommandFactory;
        let help = Line::command().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let words = help.split(|c: char| c.is_whitespace() || "<>[],.;:|`".contains(c)).collect::<Vec<_>>();
        for declared in Request::OPTIONS {
            let Values::Name { names, .. } = declared.values else { continue };
            for name in names() {
                assert!(words.contains(&name), "{name} of {} in {help}", declared.name);
            }
        }
        for default in ["[default: 0.01]", "[default: rd]", "[default: auto]", "[default: cubic]", "[default: D65]"] {
            assert!(help.contains(default), "{default} in {help}");
        }
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
