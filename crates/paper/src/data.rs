//! Bundled data behind the tables: spectra, colour-matching functions, luminaires, virtual materials.

use super::error::PaperError;
use crate::domain::colour::{Curve, Illuminant, Observer};
use crate::domain::{Axis, UnknownName};
use crate::formats::{Acquisition, Interpretation, Samples, read};

const COLORCHECKER: &[u8] = include_bytes!("../../../data/colorchecker_n_ohta.csv");

/// Three real luminaires for Table 6 of Claustres et al. (2006), with the CIE illuminant by which each is multiplied
/// there: name, illuminant, IES file.
pub(super) const LUMINAIRES: [(&str, &str, &[u8]); 3] = [
    ("aerolamp", "B", include_bytes!("../../../data/aerolamp.ies")),
    ("nukit_lantern", "C", include_bytes!("../../../data/nukit_lantern.ies")),
    ("ushio_b1", "D65", include_bytes!("../../../data/ushio_b1.ies")),
];

/// Names and JSON descriptions of simulated materials, which replace the unavailable measured ones in the order of
/// Table 3 of Claustres et al. (2006).
pub(super) const MATERIALS: [(&str, &str); 5] = [
    ("spectralon", include_str!("../../../data/virtual/spectralon.json")),
    ("wood", include_str!("../../../data/virtual/wood.json")),
    ("plastic", include_str!("../../../data/virtual/plastic.json")),
    ("cloth", include_str!("../../../data/virtual/cloth.json")),
    ("velvet", include_str!("../../../data/virtual/velvet.json")),
];

/// Number of wavelengths of the spectra in the reproductions of Tables 1 and 2 of Claustres et al. (2006): 380 to 775
/// nm in steps of 5 nm.
pub(super) const SPECTRUM_LENGTH: usize = 80;

/// Returns `count` wavelengths in nm from 380 in steps of 5.
pub(super) fn wavelengths(count: usize) -> Vec<f64> {
    (0..count).map(|i| 380.0 + 5.0 * i as f64).collect()
}

/// Returns the spectrum of a `ColorChecker` patch at the wavelengths `lambdas` in nm.
pub(super) fn patch(name: &str, lambdas: &[f64]) -> Result<Vec<f64>, PaperError> {
    column(COLORCHECKER, Some(name), lambdas)
}

/// Returns the spectrum of a CIE illuminant at wavelengths in nm. Beyond its table the last value is held (illuminant B
/// ends at 780 nm).
pub(super) fn illuminant(name: &str, lambdas: &[f64]) -> Result<Vec<f64>, PaperError> {
    let illuminant: Illuminant = name.parse().map_err(|e: UnknownName| PaperError::Data(e.to_string()))?;
    Ok(sampled(illuminant.power(), lambdas))
}

/// Returns the CIE 1931 2° colour-matching functions at the wavelengths `lambdas` in nm.
pub(super) fn colour_matching(lambdas: &[f64]) -> [Vec<f64>; 3] {
    let observer = Observer::cie_1931();
    [&observer.x, &observer.y, &observer.z].map(|curve| sampled(curve, lambdas))
}

/// Samples a spectral curve at wavelengths in nm, rounded to f32 like the samples of a measurement.
fn sampled(curve: &Curve, lambdas: &[f64]) -> Vec<f64> {
    lambdas.iter().map(|&lambda| f64::from(curve.at(lambda) as f32)).collect()
}

/// Reads one column of a spectral table, interpolated linearly to the wavelengths `lambdas` in nm.
fn column(bytes: &[u8], name: Option<&str>, lambdas: &[f64]) -> Result<Vec<f64>, PaperError> {
    let how = Interpretation { column: name.map(str::to_owned), ..Interpretation::default() };
    let acquisition = read(bytes, &how).map_err(|e| PaperError::Data(e.to_string()))?;
    let odd = || PaperError::Data(format!("{}: expected one column of a spectral table", acquisition.dialect));
    let Samples::OnAxes { tensor, .. } = &acquisition.samples else { return Err(odd()) };
    let Some(Axis::Wavelength(grid)) = tensor.axes().last() else { return Err(odd()) };
    if tensor.len() != grid.len() {
        return Err(odd());
    }
    let (first, last) = grid.range();
    let values = tensor.samples();
    let at = |lambda: &f64| match grid.locate(lambda.clamp(first, last)) {
        Some((i, t)) if t > 0.0 => (1.0 - t) * f64::from(values[i]) + t * f64::from(values[i + 1]),
        Some((i, _)) => f64::from(values[i]),
        None => f64::NAN,
    };
    Ok(lambdas.iter().map(at).collect())
}

/// Reads a measurement file or virtual-material document that is bundled with the program.
pub(super) fn acquire(bytes: &[u8]) -> Result<Acquisition, PaperError> {
    read(bytes, &Interpretation::default()).map_err(|e| PaperError::Data(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bundled_spectra_have_their_published_values() {
        let lambdas = wavelengths(SPECTRUM_LENGTH);
        assert_eq!((lambdas[0], lambdas[79]), (380.0, 775.0));
        let a = illuminant("A", &lambdas).unwrap();
        assert!((a[36] - 100.0).abs() < 1e-4, "illuminant A is 100 at 560 nm");
        let [_, y, _] = colour_matching(&lambdas);
        assert!((y[35] - 1.0).abs() < 1e-3, "V(555) is 1");
        assert!((patch("light skin", &lambdas).unwrap()[0] - 0.103).abs() < 1e-6);
        assert!(illuminant("Z", &lambdas).is_err());
        let long = illuminant("B", &wavelengths(91)).unwrap();
        assert_eq!(long[90], long[80]);
    }
}
