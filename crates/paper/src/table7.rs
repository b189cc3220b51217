//! Table 7: phase functions on 2048 × 2048 pairs of directions.

use super::data;
use super::error::PaperError;
use super::report::{Row, Table};
use super::tensors::{
    BIO_HAAR, ORTHONORMAL, cells, data_error, effect_k_term, log_k_term, ratio_columns, thresholds, transforms,
};
use crate::compress::selection::{GenericTransform, Rule};
use crate::domain::{ErrorReport, Progress};
use crate::formats::Samples;
use crate::transform::LineBasis;

const RATIOS: [usize; 5] = [2, 8, 16, 32, 64];

/// Name of a phase function, parameters (r, k1, k2) of its Schlick approximation, and the printed L1 and L2 errors in
/// per cent by compression ratio.
type Subject = (&'static str, [f64; 3], [[f64; 2]; 5]);

const SUBJECTS: [Subject; 3] = [
    ("Rayleigh", [0.5, -0.46, 0.46], [[0.28, 0.44], [2.0, 2.5], [2.1, 2.6], [2.3, 2.8], [4.2, 4.9]]),
    ("Mie, hazy", [0.12, -0.50, 0.70], [[1.5, 2.1], [2.9, 3.5], [4.5, 5.4], [6.2, 8.5], [9.0, 10.0]]),
    ("Mie, murky", [0.19, -0.65, 0.91], [[2.4, 3.4], [7.2, 8.9], [9.4, 11.0], [16.0, 19.0], [19.0, 23.0]]),
];

const METHODS: [&str; 5] = ["logarithm", "by effect", "conventional", "generic", "adaptive"];

pub(super) fn make(progress: &dyn Progress) -> Result<Table, PaperError> {
    let mut rows = Vec::new();
    for (m, (label, [r, k1, k2], printed)) in SUBJECTS.into_iter().enumerate() {
        let document = serde_json::json!({
            "wavelume": "virtual", "quantity": "phase", "sampling": "point", "wavelength": 550.0,
            "model": {"schlick": {"r": r, "k1": k1, "k2": k2}}, "axes": ["sphere:4", "sphere:4"]});
        let Samples::OnAxes { tensor, .. } = data::acquire(document.to_string().as_bytes())?.samples else {
            return Err(PaperError::Data("a phase function without axes".to_owned()));
        };
        let (axes, samples) = (tensor.axes(), tensor.samples());
        let errors = |decoded: &[f32]| ErrorReport::measure(samples, decoded, 0.0);
        let judge = |decoded: &[f32]| errors(decoded).er_l2;
        let counts = RATIOS.map(|ratio| samples.len() / ratio);
        let orthonormal = transforms(axes, ORTHONORMAL, LineBasis::BIOR44);
        let bio = transforms(axes, BIO_HAAR, LineBasis::BIOR44);
        let generic = GenericTransform::new(axes, &bio, samples, true).map_err(data_error)?;
        for (k, method) in METHODS.into_iter().enumerate() {
            progress.step((m as f64 + k as f64 / METHODS.len() as f64) / SUBJECTS.len() as f64)?;
            let mut detail = Vec::new();
            let decoded = match method {
                "logarithm" => log_k_term(axes, &orthonormal, samples, &counts)?,
                "by effect" => effect_k_term(axes, &orthonormal, samples, &counts, 0.0, 0)?,
                _ => {
                    let rule = match method {
                        "conventional" => Rule::Conventional,
                        "generic" => Rule::Generic,
                        _ => Rule::Adaptive,
                    };
                    let mut decoded = Vec::new();
                    for (&count, ratio) in counts.iter().zip(RATIOS) {
                        progress.step((m as f64 + k as f64 / METHODS.len() as f64) / SUBJECTS.len() as f64)?;
                        let found = generic.search_count(count, rule, &judge);
                        detail.push(format!("{ratio}:1 {}", thresholds(&found.thresholds)));
                        decoded.push(found.decoded);
                    }
                    decoded
                }
            };
            let cells = decoded.iter().zip(printed).flat_map(|(d, printed)| cells(&errors(d), Some(printed))).collect();
            rows.push(Row { label: label.to_owned(), method: method.to_owned(), cells, detail: detail.join("; ") });
        }
    }
    progress.report(1.0);
    Ok(Table {
        number: 7,
        title: "Relative error (%) of monochromatic phase functions, 2048 × 2048 samples, by ratio".to_owned(),
        data: "Schlick's approximations of Rayleigh, hazy and murky Mie scattering at the centroids of triangles, as in the \
               paper; their parameters are recalled, not copied from the publication."
            .to_owned(),
        methods: vec![
            "logarithm: the largest coefficients of the logarithm, orthonormal Haar on triangles.".to_owned(),
            "by effect: linear, the same basis, coefficients ranked by their effect on the relative error.".to_owned(),
            "conventional, generic, adaptive: the paper's policies, bio-Haar, L2-normalised; thresholds found for the \
             least er(L2)."
                .to_owned(),
        ],
        columns: ratio_columns(&RATIOS),
        rows,
        figures: Vec::new(),
    }
    .summarised())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Silent;

    #[test]
    #[ignore = "takes half a minute and more: tests/nightly paper"]
    fn the_figures_wanted_are_reached() {
        let table = make(&Silent).unwrap();
        print!("{}", table.text());
        let figures = |method: &str| table.figures.iter().find(|f| f.method == method).unwrap();
        assert!(figures("logarithm").largest <= 0.65);
        assert!(figures("by effect").largest <= 1.0);
    }
}
