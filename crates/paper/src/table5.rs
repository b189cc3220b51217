//! Table 5: gain of thresholds ε√d on plastic, whose levels differ much.

use super::data::MATERIALS;
use super::error::PaperError;
use super::goniometer::Goniometer;
use super::report::{Row, Table};
use super::tensors::{BIO_HAAR, cells, data_error, gains, thresholds, transforms};
use crate::compress::selection::{GenericTransform, Rule};
use crate::domain::{ErrorReport, Progress};
use crate::transform::LineBasis;

/// Figures published in Table 5 of Claustres et al. (2006) for the BRDF of plastic. Each entry has a compression ratio,
/// the L1 and L2 errors in per cent with fixed thresholds, and those with thresholds that adapt to the range of the
/// data.
const PRINTED: [(usize, [f64; 2], [f64; 2]); 2] = [(128, [20.0, 37.0], [8.8, 20.0]), (256, [21.0, 41.0], [15.0, 30.0])];

/// Names and roughnesses of two simulated plastics, both with a lighter diffuse base than the one for Table 3 of
/// Claustres et al. (2006). The second is so smooth that its largest value is at least 100 times its smallest, as in
/// the paper.
const ALPHAS: [(&str, f64); 2] = [("plastic", 0.15), ("polished", 0.06)];

pub(super) fn make(progress: &dyn Progress) -> Result<Table, PaperError> {
    let mut rows = Vec::new();
    let mut ranges = Vec::new();
    for (m, (name, alpha)) in ALPHAS.into_iter().enumerate() {
        let document = MATERIALS[2].1.replace("\"scale\": 0.15", "\"scale\": 0.8");
        let document = document.replace("\"isotropic\": 0.16", &format!("\"isotropic\": {alpha}"));
        let measured = Goniometer::measure(&document)?;
        let (low, high) = measured.readings.iter().fold((f32::MAX, 0.0_f32), |(l, h), &s| (l.min(s), h.max(s)));
        ranges.push(format!("{name}: levels differ by a factor of {:.0}", high / low));
        let bases = transforms(&measured.axes, BIO_HAAR, LineBasis::BIOR44);
        let errors = |decoded: &[f32]| ErrorReport::measure(&measured.projected, decoded, 0.0);
        let judge = |decoded: &[f32]| errors(decoded).er_l2;
        for (method, normalised) in [("raw", false), ("normalised", true)] {
            let transform =
                GenericTransform::new(&measured.axes, &bases, &measured.projected, normalised).map_err(data_error)?;
            for (ratio, plain, adaptive) in PRINTED {
                progress.step((m as f64 + 0.5 * f64::from(u8::from(normalised))) / ALPHAS.len() as f64)?;
                let count = measured.projected.len() / ratio;
                let without = transform.search_count(count, Rule::Generic, &judge);
                let with = transform.search_count(count, Rule::Adaptive, &judge);
                let detail = thresholds(&with.thresholds);
                let without = cells(&errors(&without.decoded), Some(plain));
                let with = cells(&errors(&with.decoded), Some(adaptive));
                let cells = without.into_iter().chain(with).chain(gains(&without, &with)).collect();
                rows.push(Row { label: format!("{name} {ratio}:1"), method: method.to_owned(), cells, detail });
            }
        }
    }
    progress.report(1.0);
    Ok(Table {
        number: 5,
        title: "Relative error (%) of plastic without and with adaptive thresholds, and the gain (%)".to_owned(),
        data: format!(
            "virtual plastics in place of the paper's, whose levels differ by a factor of 100, measured as for Table 4; their \
             base is lighter than that of Table 3's plastic, whose levels differ more ({}).",
            ranges.join("; ")
        ),
        methods: vec![
            "raw, normalised: as in Table 4; one threshold a space in all columns, in the adaptive ones times √(max − min) \
             of the function that it is used in."
                .to_owned(),
        ],
        columns: ["plain L1", "plain L2", "adaptive L1", "adaptive L2", "gain L1", "gain L2"].map(str::to_owned).to_vec(),
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
    fn adaptive_thresholds_gain_more_where_levels_differ_more() {
        let table = make(&Silent).unwrap();
        print!("{}", table.text());
        assert_eq!(table.rows.len(), 8);
        let gain = |label: &str| {
            let row = table.rows.iter().find(|row| row.label == label && row.method == "normalised");
            row.unwrap().cells[5].ours
        };
        assert!(gain("plastic 128:1") > 0.0 && gain("polished 256:1") > gain("plastic 256:1"));
    }
}
