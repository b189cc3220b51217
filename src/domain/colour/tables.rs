//! The CIE's tables: colour-matching functions and relative spectral powers of illuminants.

use crate::domain::named;
use std::sync::OnceLock;

/// The standard illuminants known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Illuminant {
    /// Incandescent light, 2856 K.
    A,
    /// Direct sunlight (obsolete with the CIE).
    B,
    /// Average daylight (obsolete with the CIE).
    C,
    /// Daylight, 5003 K.
    D50,
    /// Daylight, 6504 K.
    #[default]
    D65,
    /// A narrow-band fluorescent lamp, 4000 K; also called FL11.
    F11,
    /// The same power at every wavelength.
    E,
}
named!(Illuminant, "illuminant", { A = "A", B = "B", C = "C", D50 = "D50", D65 = "D65", F11 = "F11", E = "E" });

/// A tabulated function of wavelength: linear between its entries, its end values held beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    lambdas: Vec<f64>,
    values: Vec<f64>,
}

/// The colour-matching functions of the CIE 1931 2° standard observer, 360 to 830 nm by 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer {
    /// x̄.
    pub x: Curve,
    /// ȳ, which is also V(λ).
    pub y: Curve,
    /// z̄.
    pub z: Curve,
}

impl Curve {
    /// The wavelengths in nm, strictly increasing.
    pub fn lambdas(&self) -> &[f64] {
        &self.lambdas
    }

    /// The values at [`Self::lambdas`].
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value at `lambda` nm.
    pub fn at(&self, lambda: f64) -> f64 {
        let (lambdas, values) = (&self.lambdas, &self.values);
        match lambdas.partition_point(|&known| known <= lambda) {
            0 => values.first().copied().unwrap_or(f64::NAN),
            n if n == lambdas.len() => values[n - 1],
            n => {
                let t = (lambda - lambdas[n - 1]) / (lambdas[n] - lambdas[n - 1]);
                if t > 0.0 { (1.0 - t) * values[n - 1] + t * values[n] } else { values[n - 1] }
            }
        }
    }

    /// A column of a CSV table whose first column is wavelength; the tables are the program's own and tested to be whole.
    pub(super) fn of_table(text: &str, column: usize) -> Self {
        let row = |line: &str| -> Option<(f64, f64)> {
            let mut cells = line.split(',');
            let lambda = cells.next()?.trim().parse().ok()?;
            let value = cells.nth(column - 1)?.trim().parse().ok()?;
            Some((lambda, value))
        };
        let (lambdas, values) = text.lines().skip(1).filter_map(row).unzip();
        Self { lambdas, values }
    }
}

impl Observer {
    /// The CIE 1931 2° standard observer.
    pub fn cie_1931() -> &'static Self {
        const TABLE: &str = include_str!("../../../data/cmfs_CIE_1931_2_Degree_Standard_Observer.csv");
        static PARSED: OnceLock<Observer> = OnceLock::new();
        PARSED.get_or_init(|| Self {
            x: Curve::of_table(TABLE, 1),
            y: Curve::of_table(TABLE, 2),
            z: Curve::of_table(TABLE, 3),
        })
    }
}

impl Illuminant {
    /// The relative spectral power as the CIE gives it; A, D50, D65 and E are 100 at 560 nm.
    pub fn power(self) -> &'static Curve {
        const A: &str = include_str!("../../../data/illuminant_A.csv");
        const B: &str = include_str!("../../../data/illuminant_B.csv");
        const C: &str = include_str!("../../../data/illuminant_C.csv");
        const D50: &str = include_str!("../../../data/illuminant_D50.csv");
        const D65: &str = include_str!("../../../data/illuminant_D65.csv");
        const F11: &str = include_str!("../../../data/illuminant_F11.csv");
        const E: &str = "wavelength_nm,E\n300,100\n830,100\n";
        const TABLES: [&str; 7] = [A, B, C, D50, D65, F11, E];
        static PARSED: [OnceLock<Curve>; 7] = [const { OnceLock::new() }; 7];
        let index = usize::from(self.code());
        PARSED[index].get_or_init(|| Curve::of_table(TABLES[index], 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_whole() {
        let observer = Observer::cie_1931();
        for curve in [&observer.x, &observer.y, &observer.z] {
            let lambdas = curve.lambdas();
            assert_eq!((lambdas.len(), lambdas[0], lambdas[470]), (471, 360.0, 830.0));
        }
        assert_eq!(observer.y.at(555.0), 1.0);
        for &illuminant in Illuminant::ALL {
            let curve = illuminant.power();
            let (lambdas, values) = (curve.lambdas(), curve.values());
            assert!(lambdas[0] <= 380.0 && lambdas[lambdas.len() - 1] >= 780.0, "{illuminant}");
            assert!(illuminant == Illuminant::E || lambdas.array_windows().all(|[a, b]| b - a == 5.0), "{illuminant}");
            assert!(values.iter().all(|v| v.is_finite() && *v >= 0.0), "{illuminant}");
            if matches!(illuminant, Illuminant::A | Illuminant::D50 | Illuminant::D65 | Illuminant::E) {
                assert!((curve.at(560.0) - 100.0).abs() < 1e-4, "{illuminant}: {}", curve.at(560.0));
            }
        }
    }

    #[test]
    fn curves_are_linear_between_entries_and_held_beyond() {
        let curve = Curve::of_table("nm,v\r\n400,1\r\n410,3\r\n", 1);
        let at = [390.0, 400.0, 405.0, 410.0, 500.0].map(|lambda| curve.at(lambda));
        assert_eq!(at, [1.0, 1.0, 2.0, 3.0, 3.0]);
    }
}
