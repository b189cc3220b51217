//! Table 3: spectral BRDFs of 1,228,800 samples at seven ratios.

use super::data::MATERIALS;
use super::error::PaperError;
use super::goniometer::Goniometer;
use super::report::{Cell, Row, Table};
use super::tensors::{BIO_HAAR, ORTHONORMAL, cells, data_error, log_k_term, ratio_columns, thresholds, transforms};
use crate::compress::selection::{GenericTransform, Rule};
use crate::domain::Progress;
use crate::transform::LineBasis;

const RATIOS: [usize; 7] = [1, 2, 8, 16, 64, 128, 256];

/// L1 and L2 errors in per cent published in Table 3 of Claustres et al. (2006), `[material][ratio]`: for spectralon,
/// wood, plastic, cloth and velvet, at compression ratios from 1:1 to 256:1.
const PRINTED: [[[f64; 2]; 7]; 5] = [
    [[0.078, 0.36], [0.18, 0.41], [0.27, 0.46], [0.36, 0.54], [0.5, 0.74], [0.63, 0.92], [0.92, 1.1]],
    [[0.26, 1.2], [0.43, 1.3], [0.65, 1.4], [0.73, 1.4], [1.3, 2.2], [2.0, 3.0], [4.4, 6.3]],
    [[0.42, 2.9], [0.75, 3.0], [1.7, 4.9], [2.0, 5.1], [8.0, 13.0], [8.8, 20.0], [15.0, 30.0]],
    [[0.53, 2.8], [1.3, 3.2], [6.0, 10.0], [7.1, 12.0], [7.4, 12.0], [9.5, 16.0], [11.0, 19.0]],
    [[0.25, 1.0], [0.58, 1.1], [0.71, 1.2], [1.1, 1.6], [1.6, 2.2], [2.4, 3.0], [2.8, 3.5]],
];

pub(super) fn make(progress: &dyn Progress) -> Result<Table, PaperError> {
    let mut rows = Vec::new();
    for (m, ((name, document), printed)) in MATERIALS.iter().zip(PRINTED).enumerate() {
        progress.step(m as f64 / MATERIALS.len() as f64)?;
        let measured = Goniometer::measure(document)?;
        let paper_like = transforms(&measured.axes, BIO_HAAR, LineBasis::BIOR44);
        let generic =
            GenericTransform::new(&measured.axes, &paper_like, &measured.projected, true).map_err(data_error)?;
        let judge = |decoded: &[f32]| measured.errors(decoded).er_l2;
        let count = |ratio: usize| measured.projected.len() / ratio;
        for (method, rule) in [("generic", Rule::Generic), ("adaptive", Rule::Adaptive)] {
            let (mut figures, mut detail) = (Vec::new(), Vec::new());
            for (&ratio, printed) in RATIOS.iter().zip(printed) {
                progress.step(m as f64 / MATERIALS.len() as f64)?;
                if ratio == 1 {
                    figures.extend(cells(&measured.errors(&measured.projected), Some(printed)));
                    continue;
                }
                let found = generic.search_count(count(ratio), rule, &judge);
                figures.extend(cells(&measured.errors(&found.decoded), Some(printed)));
                detail.push(format!("{ratio}:1 {}", thresholds(&found.thresholds)));
            }
            rows.push(row(name, method, figures, detail.join("; ")));
        }
        let orthonormal = transforms(&measured.axes, ORTHONORMAL, LineBasis::BIOR44);
        let counts = RATIOS.map(count);
        let decoded = log_k_term(&measured.axes, &orthonormal, &measured.projected, &counts)?;
        let figures = decoded.iter().zip(printed).flat_map(|(d, printed)| cells(&measured.errors(d), Some(printed)));
        rows.push(row(name, "logarithm", figures.collect(), String::new()));
    }
    progress.report(1.0);
    Ok(Table {
        number: 3,
        title: "Relative error (%) of spectral BRDFs, 16 × 1024 × 75 samples, by ratio samples : coefficients".to_owned(),
        data: "virtual materials in place of the paper's goniometer data (wood for its plywood), read near the middle of \
               each of 1,024 triangles for 16 incoming directions, then projected onto the triangles; errors are against \
               the readings, so the 1:1 column is that of the projection. Readings have 0.3 % noise, velvet's 0.5 %, \
               cloth's an absolute one besides (0.00065/sr, a few per cent of its dark wavelengths). Levels and growth \
               depend on the materials, which are not the paper's and were chosen, with their noise and the aim of the \
               instrument, in some ninety trials to come in its order at every ratio by the policy generic: that order is \
               no finding. What compares is one method with another."
            .to_owned(),
        methods: vec![
            "generic: bio-Haar on triangles, bior4.4 along wavelength, L2-normalised coefficients, one threshold a space, \
             found for the least er(L2)."
                .to_owned(),
            "adaptive: the same with thresholds ε√d.".to_owned(),
            "logarithm: the largest coefficients of the logarithm, orthonormal Haar on triangles; not the paper's."
                .to_owned(),
        ],
        columns: ratio_columns(&RATIOS),
        rows,
        figures: Vec::new(),
    }
    .summarised())
}

fn row(label: &str, method: &str, cells: Vec<Cell>, detail: String) -> Row {
    Row { label: label.to_owned(), method: method.to_owned(), cells, detail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Silent;

    /// Compression errors of the simulated materials rank in the same order as the errors of the real materials
    /// published in Table 3 of Claustres et al. (2006). Wood and velvet are published with equal L2 errors at 64:1 and
    /// 128:1, so their order does not count there.
    #[test]
    #[ignore = "half of the time of all tests of the tables: tests/nightly paper"]
    fn materials_come_in_the_order_of_the_paper_at_every_ratio() {
        let table = make(&Silent).unwrap();
        print!("{}", table.text());
        assert_eq!(table.rows.len(), 15);
        for row in &table.rows {
            let l2: Vec<f64> = row.cells.iter().skip(1).step_by(2).map(|cell| cell.ours).collect();
            assert!(l2[0] > 0.0 && l2[1] < l2[6] && l2[3] < l2[6], "{}: {l2:?}", row.label);
        }
        let generic: Vec<&Row> = table.rows.iter().filter(|row| row.method == "generic").collect();
        assert!(generic.iter().map(|row| row.label.as_str()).eq(MATERIALS.map(|(name, _)| name)));
        let mut ties = Vec::new();
        for (column, head) in table.columns.iter().enumerate() {
            for (a, first) in generic.iter().enumerate() {
                for (b, second) in generic.iter().enumerate().skip(a + 1) {
                    let printed = |m: usize| PRINTED[m][column / 2][column % 2];
                    if printed(a) == printed(b) {
                        ties.push((head.as_str(), first.label.as_str(), second.label.as_str()));
                        continue;
                    }
                    let (ours_a, ours_b) = (first.cells[column].ours, second.cells[column].ours);
                    assert_eq!(
                        ours_a < ours_b,
                        printed(a) < printed(b),
                        "{head}: {} {ours_a}, {} {ours_b}",
                        first.label,
                        second.label
                    );
                }
            }
        }
        assert_eq!(ties, [("64:1 L2", "wood", "velvet"), ("128:1 L2", "wood", "velvet")]);
    }
}
