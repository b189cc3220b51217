//! Where a material comes from, as its file tells it.

use super::fit::FitReport;
use super::request::Request;
use super::source::Source;

/// Lengths of runs of cells, in turn not filled and filled, the first of which may be 0; a last run of cells that are not
/// filled is left out.
pub fn runs(filled: &[bool]) -> Vec<usize> {
    let (mut runs, mut now, mut start) = (Vec::new(), false, 0);
    for (i, &is) in filled.iter().enumerate() {
        if is != now {
            runs.push(i - start);
            (now, start) = (is, i);
        }
    }
    if now {
        runs.push(filled.len() - start);
    }
    runs
}

/// Where a material comes from: no clock, path, host, timing or thread count, so that equal inputs give equal bytes.
/// `on_grid`: the measurement lies on the grid of its file; `fit`: what the material is at its scattered samples.
pub(super) fn provenance(
    source: &Source,
    request: &Request,
    filled: &[bool],
    (on_grid, fit): (bool, Option<&FitReport>),
) -> String {
    let acquisition = &source.acquisition;
    let mut document = serde_json::json!({
        "generator": concat!("wavelume ", env!("CARGO_PKG_VERSION")),
        "source": {
            "format": acquisition.format,
            "dialect": acquisition.dialect,
            "content_digest": source.content_digest,
            "spectrum_digest": source.spectrum_digest,
            "metadata": acquisition.report.metadata,
            "notes": acquisition.report.notes_of(on_grid).collect::<Vec<_>>(),
        },
        "request": request,
    });
    if !acquisition.instrument.is_unknown() {
        document["source"]["instrument"] = serde_json::json!(acquisition.instrument);
    }
    let count = filled.iter().filter(|filled| **filled).count();
    if count > 0 {
        document["filled"] = serde_json::json!({ "cells": count, "of": filled.len(), "runs": runs(filled) });
    }
    if let Some(fit) = fit {
        document["scattered"] = serde_json::json!(fit.stated());
    }
    document.to_string()
}
