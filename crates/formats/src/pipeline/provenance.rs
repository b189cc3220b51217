//! Provenance of a material, as stored in its file.

use super::fit::FitReport;
use super::request::Request;
use super::source::Source;
use crate::formats::Note;

/// Returns the lengths of runs of equal flags in `filled`. A flag is true for a cell (position in the tensor) without
/// samples, whose values follow from other cells by a rule such as mirroring. Runs alternate between false and true;
/// the first one is false and may have length 0. A last run of false is omitted.
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

/// Returns the parts of a note that provenance stores: its kind and its sentence. Codes and values of notes are not
/// part of hashed bytes.
fn stated(note: &Note) -> serde_json::Value {
    serde_json::json!({ "kind": note.kind, "message": note.message })
}

/// Returns the provenance of a material as JSON. It holds no clock, path, host, timing or thread count, so that equal
/// inputs give equal bytes. `on_grid` is true if the measurement lies on the grid of its file. `fit` is the report on
/// the material at scattered samples, with warnings about them.
pub(super) fn provenance(
    source: &Source,
    request: &Request,
    filled: &[bool],
    (on_grid, fit): (bool, Option<(&FitReport, &[&str])>),
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
            "notes": acquisition.report.notes_of(on_grid).map(stated).collect::<Vec<_>>(),
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
    if let Some((fit, warnings)) = fit {
        document["scattered"] = serde_json::json!(fit.stated());
        if !warnings.is_empty() {
            document["warnings"] = serde_json::json!(warnings);
        }
    }
    document.to_string()
}
