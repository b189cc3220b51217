//! Tables of the CIE: colour-matching functions and relative spectral powers of illuminants.

use super::coverage::{ColourError, check};
use crate::domain::{Axis, Tensor, named};
use crate::numeric::bracket::Bracket;
use std::sync::OnceLock;

/// CIE standard illuminants that colours can be computed for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Illuminant {
    /// Illuminant A: incandescent light, 2856 K.
    A,
    /// Illuminant B: direct sunlight (obsolete with the CIE).
    B,
    /// Illuminant C: average daylight (obsolete with the CIE).
    C,
    /// Illuminant D50: daylight, 5003 K.
    D50,
    /// Illuminant D65: daylight, 6504 K.
    #[default]
    D65,
    /// Illuminant F11 (also called FL11): a narrow-band fluorescent lamp, 4000 K.
    F11,
    /// Illuminant E (equal energy): constant power over wavelength.
    E,
}
named!(Illuminant, "illuminant", { A = "A", B = "B", C = "C", D50 = "D50", D65 = "D65", F11 = "F11", E = "E" });

/// CIE standard observers that colours can be computed for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum StandardObserver {
    /// CIE 1931 standard observer, for visual fields of 2°.
    #[default]
    Cie1931,
    /// CIE 1964 standard observer, for visual fields of 10°.
    Cie1964,
}
named!(StandardObserver, "observer", { Cie1931 = "1931", Cie1964 = "1964" });

/// Tabulated function of wavelength, interpolated linearly between its entries and constant beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    lambdas: Vec<f64>,
    values: Vec<f64>,
}

/// Three colour-matching functions of an observer; those of the CIE are tabulated from 360 to 830 nm in steps of 1 nm.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer {
    /// Colour-matching function x̄.
    pub x: Curve,
    /// Colour-matching function ȳ, which for the CIE 1931 observer is also V(λ).
    pub y: Curve,
    /// Colour-matching function z̄.
    pub z: Curve,
}

/// Reasons why a table cannot serve as the spectrum of a light or as colour-matching functions.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The axes of the table are neither wavelengths alone nor numbered columns followed by wavelengths.
    #[error(
        "the table has axes {}, expected wavelengths, or numbered columns and then wavelengths",
        axes.iter().map(Axis::describe).collect::<Vec<_>>().join(" × ")
    )]
    Axes {
        /// Axes of the refused table of a light's spectrum or of colour-matching functions.
        axes: Vec<Axis>,
    },
    /// The requested column does not exist in the table.
    #[error("the table has no column {found}, expected 0 to {}", columns - 1)]
    Column {
        /// Requested column of the table, counted from 0.
        found: usize,
        /// Number of columns of the table from which a function of wavelength was to be read.
        columns: usize,
    },
    /// No column of the table has the requested name or number.
    #[error("the table has no column `{found}`, expected a number from 1 to {columns} or a name in the table")]
    ColumnName {
        /// First 40 characters of the requested column name.
        found: String,
        /// Number of columns of the table from which a function of wavelength was to be read.
        columns: usize,
    },
    /// The table has several columns, and the request selects none.
    #[error("the table has {columns} columns, expected one, or the name of the column to use")]
    SeveralColumns {
        /// Number of columns of the table from which a function of wavelength was to be read.
        columns: usize,
    },
    /// A table of colour-matching functions does not have three columns.
    #[error("the observer table has {columns} columns over wavelength, expected 3: x, y and z")]
    ObserverColumns {
        /// Number of columns of the table of colour-matching functions.
        columns: usize,
    },
    /// A colour-matching function is nowhere above 0.
    #[error("colour-matching function {function} is nowhere above 0, expected positive values")]
    Dark {
        /// Name of the colour-matching function: x, y or z.
        function: &'static str,
    },
    /// The wavelengths of the table do not suffice to compute a colour.
    #[error(transparent)]
    Wavelengths(#[from] ColourError),
}

impl Curve {
    /// Reads column `column` of a table with axes `[lambda]` or `[index, lambda]`, such as the spectrum of a light.
    /// Masked samples are skipped; the others must cover 400 to 700 nm in steps of at most 20 nm.
    pub fn of_tensor(tensor: &Tensor, column: usize) -> Result<Self, TableError> {
        let (grid, columns) = match tensor.axes() {
            [Axis::Wavelength(grid)] => (grid, 1),
            [Axis::Index { count, .. }, Axis::Wavelength(grid)] => (grid, *count),
            axes => return Err(TableError::Axes { axes: axes.to_vec() }),
        };
        if column >= columns {
            return Err(TableError::Column { found: column, columns });
        }
        let samples = &tensor.samples()[column * grid.len()..][..grid.len()];
        let measured = grid.values().into_iter().zip(samples).filter(|(_, sample)| !sample.is_nan());
        let (lambdas, values): (Vec<f64>, Vec<f64>) = measured.map(|(l, &sample)| (l, f64::from(sample))).unzip();
        check(&lambdas)?;
        Ok(Self { lambdas, values })
    }

    /// Returns the wavelengths of the tabulated function in nm, strictly increasing.
    pub fn lambdas(&self) -> &[f64] {
        &self.lambdas
    }

    /// Returns the values of the tabulated function at its wavelengths ([`Self::lambdas`]).
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns the tabulated function at `lambda` nm, interpolated linearly.
    pub fn at(&self, lambda: f64) -> f64 {
        let (lambdas, values) = (&self.lambdas, &self.values);
        let Bracket { below, above, t } = Bracket::held(lambdas, lambda);
        if t > 0.0 {
            (1.0 - t) * values[below] + t * values[above]
        } else {
            values.get(below).copied().unwrap_or(f64::NAN)
        }
    }

    /// Reads a column of a built-in CSV table whose first column is wavelength. Tests check that the tables are
    /// complete.
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
    /// Returns the colour-matching functions of a standard observer.
    pub fn standard(which: StandardObserver) -> &'static Self {
        match which {
            StandardObserver::Cie1931 => Self::cie_1931(),
            StandardObserver::Cie1964 => Self::cie_1964(),
        }
    }

    /// Reads colour-matching functions x̄, ȳ and z̄ from a table with axes `[3, lambda]`.
    pub fn of_tensor(tensor: &Tensor) -> Result<Self, TableError> {
        let columns = match tensor.axes() {
            [Axis::Wavelength(_)] => 1,
            [Axis::Index { count, .. }, Axis::Wavelength(_)] => *count,
            _ => 0,
        };
        if columns != 3 {
            return Err(TableError::ObserverColumns { columns });
        }
        let observer =
            Self { x: Curve::of_tensor(tensor, 0)?, y: Curve::of_tensor(tensor, 1)?, z: Curve::of_tensor(tensor, 2)? };
        for (function, curve) in [("x", &observer.x), ("y", &observer.y), ("z", &observer.z)] {
            if !curve.values.iter().any(|v| *v > 0.0) {
                return Err(TableError::Dark { function });
            }
        }
        Ok(observer)
    }

    /// Returns the colour-matching functions of the CIE 1964 10° standard observer.
    pub fn cie_1964() -> &'static Self {
        const TABLE: &str = include_str!("../../../../../data/cmfs_CIE_1964_10_Degree_Standard_Observer.csv");
        static PARSED: OnceLock<Observer> = OnceLock::new();
        PARSED.get_or_init(|| Self::of_table(TABLE))
    }

    /// Returns the colour-matching functions of the CIE 1931 2° standard observer.
    pub fn cie_1931() -> &'static Self {
        const TABLE: &str = include_str!("../../../../../data/cmfs_CIE_1931_2_Degree_Standard_Observer.csv");
        static PARSED: OnceLock<Observer> = OnceLock::new();
        PARSED.get_or_init(|| Self::of_table(TABLE))
    }

    fn of_table(text: &str) -> Self {
        Self { x: Curve::of_table(text, 1), y: Curve::of_table(text, 2), z: Curve::of_table(text, 3) }
    }
}

impl Illuminant {
    /// Returns the relative spectral power of the illuminant as tabulated by the CIE; A, D50, D65 and E are 100 at 560
    /// nm.
    pub fn power(self) -> &'static Curve {
        const A: &str = include_str!("../../../../../data/illuminant_A.csv");
        const B: &str = include_str!("../../../../../data/illuminant_B.csv");
        const C: &str = include_str!("../../../../../data/illuminant_C.csv");
        const D50: &str = include_str!("../../../../../data/illuminant_D50.csv");
        const D65: &str = include_str!("../../../../../data/illuminant_D65.csv");
        const F11: &str = include_str!("../../../../../data/illuminant_F11.csv");
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
        for &which in StandardObserver::ALL {
            let observer = Observer::standard(which);
            for curve in [&observer.x, &observer.y, &observer.z] {
                let lambdas = curve.lambdas();
                assert_eq!((lambdas.len(), lambdas[0], lambdas[470]), (471, 360.0, 830.0), "{which}");
            }
        }
        assert_eq!(Observer::cie_1931().y.at(555.0), 1.0);
        assert_eq!(Observer::cie_1964().y.at(557.0), 1.0);
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

    fn table(columns: usize, lambdas: usize, sample: impl Fn(usize) -> f32) -> Tensor {
        let grid = Axis::Wavelength(crate::domain::WavelengthGrid::even(380.0, 10.0, lambdas).unwrap());
        let index = Axis::Index { count: columns, labels: Vec::new() };
        Tensor::new(vec![index, grid], (0..columns * lambdas).map(sample).collect()).unwrap()
    }

    #[test]
    fn tables_of_the_user_are_curves_and_observers() {
        let observer = Observer::of_tensor(&table(3, 41, |i| i as f32)).unwrap();
        assert_eq!((observer.x.at(385.0), observer.y.at(380.0), observer.z.at(800.0)), (0.5, 41.0, 122.0));
        let holes = table(2, 41, |i| if i == 42 { f32::NAN } else { i as f32 });
        assert_eq!(Curve::of_tensor(&holes, 1).unwrap().at(390.0), 42.0);
        let short = table(1, 20, |i| i as f32);
        assert!(matches!(Curve::of_tensor(&short, 0), Err(TableError::Wavelengths(ColourError::Uncovered { .. }))));
        assert_eq!(Curve::of_tensor(&holes, 2), Err(TableError::Column { found: 2, columns: 2 }));
        let rgb = Tensor::new(vec![Axis::Rgb], vec![1.0; 3]).unwrap();
        assert_eq!(Curve::of_tensor(&rgb, 0), Err(TableError::Axes { axes: vec![Axis::Rgb] }));
        for (bad, error) in [
            (table(2, 41, |_| 1.0), TableError::ObserverColumns { columns: 2 }),
            (table(3, 41, |i| if i < 41 { 0.0 } else { 1.0 }), TableError::Dark { function: "x" }),
            (rgb, TableError::ObserverColumns { columns: 0 }),
        ] {
            assert_eq!(Observer::of_tensor(&bad), Err(error));
        }
    }

    #[test]
    fn curves_are_linear_between_entries_and_held_beyond() {
        let curve = Curve::of_table("nm,v\r\n400,1\r\n410,3\r\n", 1);
        let at = [390.0, 400.0, 405.0, 410.0, 500.0].map(|lambda| curve.at(lambda));
        assert_eq!(at, [1.0, 1.0, 2.0, 3.0, 3.0]);
    }
}
