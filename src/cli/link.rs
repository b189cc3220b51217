//! `wavelume link`: prints URLs that fetch the files of materials for a limited time, made offline from a key.

use super::failure::Failure;
use super::key_file::{KeyArgs, TimeArgs, material};
use super::output::print;
use crate::trust::{Link, MaterialId};

#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// URL of the service, with the prefix that a proxy removes, if there is one
    #[arg(long, value_name = "URL", value_parser = base)]
    url: String,
    /// Id of the material, `b3-…`; several ids print one link each, on lines of their own
    #[arg(long = "material", value_name = "ID", required = true, value_parser = material)]
    materials: Vec<MaterialId>,
    #[command(flatten)]
    time: TimeArgs,
    #[command(flatten)]
    key: KeyArgs,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let key = args.key.read()?;
    let (now, seconds) = args.time.since_now();
    let mut lines = String::new();
    for material in &args.materials {
        let link = Link::make(&key, *material, now, seconds).map_err(Failure::failed)?;
        lines.extend([&args.url, link.target().as_str(), "\n"]);
    }
    print(&lines)
}

/// Parses the base URL of a service, and removes the slashes at its end.
fn base(text: &str) -> Result<String, String> {
    let expected = "expected the URL of a service without user, query and fragment, for example https://host";
    let url = reqwest::Url::parse(text).map_err(|_| expected.to_owned())?;
    let is_base = matches!(url.scheme(), "http" | "https")
        && url.username().is_empty()
        && url.password().is_none()
        && url.query().is_none()
        && url.fragment().is_none();
    if is_base { Ok(url.as_str().trim_end_matches('/').to_owned()) } else { Err(expected.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_base_of_a_link_is_a_plain_url() {
        for (text, expected) in [
            ("https://host", "https://host"),
            ("https://host/", "https://host"),
            ("http://127.0.0.1:8080", "http://127.0.0.1:8080"),
            ("https://Host.example/wavelume//", "https://host.example/wavelume"),
        ] {
            assert_eq!(base(text).as_deref(), Ok(expected));
        }
        for text in ["", "host", "ftp://host", "https://", "https://user@host", "https://host?x", "https://host/#x"] {
            assert!(base(text).is_err(), "{text}");
        }
    }
}
