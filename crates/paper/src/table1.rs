//! Table 1: spectra of 80 samples kept with 16, 8 and 4 coefficients in the best of all bases.

use super::data::{self, SPECTRUM_LENGTH};
use super::error::PaperError;
use super::report::{Cell, Row, Table};
use crate::compress::selection::{Choice, best_basis, line_dictionaries};
use crate::domain::Progress;

const COUNTS: [usize; 3] = [16, 8, 4];

/// Label of a spectrum, its name in the data, and six errors in per cent published in Table 1 of Claustres et al.
/// (2006): L1 and L2 with 16, then with 8, then with 4 coefficients.
type Subject = (&'static str, &'static str, [f64; 6]);

const PATCHES: [Subject; 5] = [
    ("Light Skin", "light skin", [1.1, 1.6, 2.9, 3.8, 7.6, 10.0]),
    ("Blue Sky", "blue sky", [0.47, 0.68, 2.0, 3.0, 9.1, 12.0]),
    ("Foliage", "foliage", [3.9, 5.9, 10.0, 14.0, 26.0, 33.0]),
    ("Red", "red", [4.5, 6.8, 8.0, 13.0, 17.0, 26.0]),
    ("Neutral .35", "neutral 3.5 (1.05 D)", [0.15, 0.23, 0.39, 0.58, 1.7, 3.2]),
];
const ILLUMINANTS: [Subject; 4] = [
    ("Illuminant A", "A", [0.23, 0.36, 2.6, 4.8, 9.6, 15.0]),
    ("Illuminant B", "B", [1.0, 1.3, 3.0, 3.8, 5.2, 6.4]),
    ("Illuminant C", "C", [1.1, 1.5, 4.1, 5.6, 7.7, 10.0]),
    ("Illuminant D65", "D65", [1.2, 1.6, 2.0, 3.0, 3.4, 5.3]),
];

const METHODS: [(&str, Choice); 3] =
    [("plain", Choice::Largest), ("refitted", Choice::Refitted), ("greedy", Choice::Greedy)];

pub(super) fn make(progress: &dyn Progress) -> Result<Table, PaperError> {
    let lambdas = data::wavelengths(SPECTRUM_LENGTH);
    let dictionaries = line_dictionaries(SPECTRUM_LENGTH);
    let patches = PATCHES.iter().map(|subject| (subject, data::patch(subject.1, &lambdas)));
    let illuminants = ILLUMINANTS.iter().map(|subject| (subject, data::illuminant(subject.1, &lambdas)));
    let mut rows = Vec::new();
    for (i, (&(label, _, printed), samples)) in patches.chain(illuminants).enumerate() {
        let samples = samples?;
        for (method, choice) in METHODS {
            progress.step((i as f64) / (PATCHES.len() + ILLUMINANTS.len()) as f64)?;
            let (mut cells, mut chosen) = (Vec::new(), Vec::new());
            for (&count, printed) in COUNTS.iter().zip(printed.chunks(2)) {
                let ranked = best_basis(&dictionaries, &samples, count, choice, &[]);
                let Some(best) = ranked.first() else {
                    return Err(PaperError::Data(format!("no basis for {label}")));
                };
                cells.push(Cell::new(100.0 * best.errors.l1, Some(printed[0])));
                cells.push(Cell::new(100.0 * best.errors.l2, Some(printed[1])));
                chosen.push(format!("{count}: {}", best.basis));
            }
            rows.push(Row { label: label.to_owned(), method: method.to_owned(), cells, detail: chosen.join("; ") });
        }
    }
    progress.report(1.0);
    let columns = COUNTS.iter().flat_map(|count| ["L1", "L2"].map(|norm| format!("{count} {norm}")));
    Ok(Table {
        number: 1,
        title: "Relative error (%) of spectra with 16, 8 and 4 of 80 coefficients".to_owned(),
        data:
            "ColorChecker N. Ohta and CIE illuminants, 380 to 775 nm by 5, the paper's own kind of data; its patches \
               may be of another measurement and \"Neutral .35\" is taken as neutral 3.5."
                .to_owned(),
        methods: vec![
            format!(
                "Each figure is in the basis and boundary rule of least er(L2) among {}; L1 and L2 are of the same \
                 approximation.",
                dictionaries.len()
            ),
            "plain: the largest coefficients as they are, ranked by their L2 norm or by their effect on the relative \
             error, whichever is better."
                .to_owned(),
            "refitted: the same coefficients with the values of least er(L2).".to_owned(),
            "greedy: chosen one by one for er(L2) with all values free, then exchanged while that helps.".to_owned(),
        ],
        columns: columns.collect(),
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
    fn the_figures_wanted_are_reached() {
        let table = make(&Silent).unwrap();
        print!("{}", table.text());
        for row in &table.rows {
            println!("{} {} {}", row.label, row.method, row.detail);
        }
        assert_eq!((table.rows.len(), table.columns.len()), (27, 6));
        let figures = |method: &str| table.figures.iter().find(|f| f.method == method).unwrap();
        assert!(figures("plain").cells == 54 && figures("plain").geometric_mean <= 0.70);
        assert!(figures("refitted").geometric_mean <= 0.50 && figures("refitted").largest <= 1.70);
        assert!(figures("greedy").largest <= 1.45);
    }
}
