//! Viewing conditions: the illuminant and the observer that colours are computed for.

use crate::domain::colour::{
    Adaptation, ColourError, Curve, Illuminant, Observer, StandardObserver, TableError, Tristimulus, Xyz,
};
use crate::domain::{Axis, Tensor, WavelengthGrid};

/// Viewing conditions of a colour: an illuminant and an observer, with the names that a report shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewing {
    illuminant: String,
    power: Curve,
    observer: String,
    functions: Observer,
}

impl Default for Viewing {
    /// Returns the default viewing conditions: illuminant D65 and the CIE 1931 2° observer.
    fn default() -> Self {
        Self::standard(Illuminant::default(), StandardObserver::default())
    }
}

impl Viewing {
    /// Creates viewing conditions from a standard illuminant and a standard observer of the CIE.
    pub fn standard(illuminant: Illuminant, observer: StandardObserver) -> Self {
        Self {
            illuminant: illuminant.name().to_owned(),
            power: illuminant.power().clone(),
            observer: observer.name().to_owned(),
            functions: Observer::standard(observer).clone(),
        }
    }

    /// Replaces the illuminant by a table `[lambda]`, or by one column of a table `[index, lambda]`. `column` is a name
    /// or a number from 1. The illuminant must have luminance.
    pub fn under(mut self, name: &str, table: &Tensor, column: Option<&str>) -> Result<Self, TableError> {
        self.power = Curve::of_tensor(table, position(table, column)?)?;
        self.illuminant = column.map_or_else(|| name.to_owned(), |column| format!("{name}, {column}"));
        self.check()
    }

    /// Replaces the observer by a table of the colour matching functions x̄, ȳ and z̄, `[3, lambda]`.
    pub fn seen_by(mut self, name: &str, table: &Tensor) -> Result<Self, TableError> {
        self.functions = Observer::of_tensor(table)?;
        name.clone_into(&mut self.observer);
        self.check()
    }

    /// Name of the illuminant under which colours are computed, as reports show it.
    pub fn illuminant(&self) -> &str {
        &self.illuminant
    }

    /// Name of the observer (set of colour matching functions, such as CIE 1931) for which colours are computed, as
    /// reports show it.
    pub fn observer(&self) -> &str {
        &self.observer
    }

    /// Colour matching functions of the observer.
    pub fn functions(&self) -> &Observer {
        &self.functions
    }

    /// Returns true if the illuminant is D65, the light under which RGB data are defined.
    pub(crate) fn is_d65(&self) -> bool {
        self.power == *Illuminant::D65.power()
    }

    /// Returns true if the tristimulus value Y of emitted light is photometric: only ȳ of the CIE 1931 observer is
    /// V(λ).
    pub(crate) fn is_photometric(&self) -> bool {
        self.functions == *Observer::cie_1931()
    }

    /// Returns the weights at each wavelength that give the XYZ of a reflectance, scaled to Y = 100 for the perfect
    /// reflector.
    pub(crate) fn reflectance(&self, grid: &WavelengthGrid) -> Result<Tristimulus, ColourError> {
        Tristimulus::reflectance_by(grid, &self.power, &self.functions)
    }

    /// Returns the weights at each wavelength that give the XYZ of emitted light, scaled by 683 lm/W.
    pub(crate) fn emission(&self, grid: &WavelengthGrid) -> Result<Tristimulus, ColourError> {
        Tristimulus::emission_by(grid, &self.functions)
    }

    /// Returns the XYZ of the perfect diffuser under the illuminant, scaled to Y = 100.
    pub(crate) fn white(&self) -> Result<Xyz, ColourError> {
        Ok(self.reflectance(&every_nanometre()?)?.white())
    }

    /// Returns the chromatic adaptation from the white point `white` to the white of sRGB (D65).
    pub(crate) fn adaptation(white: Xyz) -> Result<Adaptation, ColourError> {
        // The tabulated D65 white rather than the rounded one of the standard's matrix, so that D65 data stay
        // unchanged.
        Ok(Adaptation::between(white, Tristimulus::reflectance(&every_nanometre()?, Illuminant::D65)?.white()))
    }

    fn check(self) -> Result<Self, TableError> {
        let white = self.white()?;
        if white.x > 0.0 && white.y > 0.0 && white.z >= 0.0 { Ok(self) } else { Err(ColourError::Dark.into()) }
    }
}

fn position(table: &Tensor, column: Option<&str>) -> Result<usize, TableError> {
    let (count, labels) = match table.axes().first() {
        Some(Axis::Index { count, labels }) => (*count, labels.as_slice()),
        _ => (1, &[][..]),
    };
    let Some(wanted) = column.map(str::trim) else {
        return if count == 1 { Ok(0) } else { Err(TableError::SeveralColumns { columns: count }) };
    };
    let by_name = labels.iter().position(|label| label == wanted);
    let by_number = || wanted.parse().ok().filter(|n| (1..=count).contains(n)).map(|n| n - 1);
    by_name.or_else(by_number).ok_or_else(|| {
        let found: String = wanted.chars().take(40).collect();
        TableError::ColumnName { found, columns: count }
    })
}

fn every_nanometre() -> Result<WavelengthGrid, ColourError> {
    WavelengthGrid::even(380.0, 1.0, 401).map_err(|_| ColourError::NoWavelengths)
}
