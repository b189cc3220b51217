//! Fingerprint of a reading: weighted sums, by which two readings of one file are compared while neither is kept.
//!
//! Each number is multiplied by a pseudo-random weight from -1 to 1, which its position alone decides. Where a number
//! changes, moves or is scaled, the sums change by about the size of that, so that they tell how much has changed; a
//! difference of rounding stays a small one.

use crate::domain::{Axis, Direction, Quantity};
use crate::formats::{Acquisition, AngleGrid, Angles, Modelled, Samples, Scattered};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Fingerprint of the values and coordinates that were read from a measurement file; `wavelume fsck --readings`
/// compares it with that of a new reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = ReadingFingerprint)]
pub(crate) struct Fingerprint {
    /// Sums over all values in the order of the axes, and over the factors of a spectrum joined with them.
    pub values: Sums,
    /// Sums over the angles and wavelengths of all axes.
    pub coordinates: Sums,
}

/// Sums over a list of numbers, each multiplied by weights that only its position in the list decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = FingerprintSums)]
pub(crate) struct Sums {
    /// Four sums of the finite numbers of a list, each number multiplied by pseudo-random weights from -1 to 1.
    pub weighted: [f64; 4],
    /// Root of the sum of the squares of the finite numbers of a list.
    pub norm: f64,
}

/// Largest relative difference, as a root mean square, of two readings that count as equal. Lower ones may come from
/// rounding values to 24 bits; raising it overlooks larger differences.
const ROUNDING: f64 = 1e-6;

/// Largest number of incoming and of outgoing polar angles and azimuths at which a function is evaluated. Raising it
/// finds differences of narrower features, and takes longer.
const ANGLES: usize = 8;

impl Sums {
    /// Returns the relative difference of the numbers of two lists, estimated as a root mean square; `None` if it is no
    /// larger than that of rounded numbers.
    pub(crate) fn difference(&self, other: &Self) -> Option<f64> {
        let norm = self.norm.max(other.norm);
        // The mean square of a weight is a third.
        let squares = self.weighted.iter().zip(&other.weighted).map(|(a, b)| 3.0 * (a - b).powi(2));
        let difference = (squares.sum::<f64>() / self.weighted.len() as f64).sqrt();
        (difference > ROUNDING * norm).then(|| difference / norm)
    }
}

/// Sums while numbers are added to them.
#[derive(Default)]
struct Summed {
    sums: Sums,
    count: u64,
}

impl Summed {
    fn add(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for number in numbers {
            let bits = mixed(self.count);
            self.count += 1;
            if !number.is_finite() {
                continue;
            }
            self.sums.norm += number * number;
            for (sum, part) in self.sums.weighted.iter_mut().zip([0, 16, 32, 48]) {
                *sum += f64::from((bits >> part) as u16 as i16) / 32768.0 * number;
            }
        }
    }

    fn end(self) -> Sums {
        // Squares of sound numbers may be too large, and JSON holds no infinity.
        let held = |number: f64| if number.is_finite() { number } else { f64::MAX };
        Sums { weighted: self.sums.weighted.map(held), norm: held(self.sums.norm.sqrt()) }
    }
}

/// Returns 64 bits that look random and depend on `position` alone: the generator `splitmix64`. Rows of the catalog
/// hold what comes of it, so that it never changes.
fn mixed(position: u64) -> u64 {
    let mut bits = position.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

impl Fingerprint {
    /// Returns the fingerprint of a measurement that was read.
    pub(crate) fn of(acquisition: &Acquisition) -> Self {
        let (mut values, mut coordinates) = (Summed::default(), Summed::default());
        match &acquisition.samples {
            Samples::OnAxes { tensor, .. } => {
                tensor.axes().iter().for_each(|axis| add_axis(&mut coordinates, axis));
                values.add(tensor.samples().iter().map(|&value| f64::from(value)));
            }
            Samples::Grid(grid) => add_grid(&mut coordinates, &mut values, grid),
            Samples::Scattered(scattered) => add_scattered(&mut coordinates, &mut values, scattered),
            Samples::Function(modelled) => {
                add_angles(&mut coordinates, &modelled.incoming);
                modelled.spectral.iter().for_each(|axis| add_axis(&mut coordinates, axis));
                add_function(&mut values, modelled, acquisition.quantity);
            }
        }
        if let Some(factor) = &acquisition.spectral_factor {
            coordinates.add(factor.grid.values());
            values.add(factor.factors.iter().copied());
        }
        Self { values: values.end(), coordinates: coordinates.end() }
    }
}

fn add_grid(coordinates: &mut Summed, values: &mut Summed, grid: &AngleGrid) {
    grid.index.iter().for_each(|axis| add_axis(coordinates, axis));
    grid.incoming.iter().chain(&grid.outgoing).for_each(|angles| add_angles(coordinates, angles));
    grid.spectral.iter().for_each(|axis| add_axis(coordinates, axis));
    values.add(grid.values.as_slice().iter().map(|&value| f64::from(value)));
}

fn add_scattered(coordinates: &mut Summed, values: &mut Summed, scattered: &Scattered) {
    coordinates.add(scattered.incoming.iter().chain(&scattered.outgoing).flatten().copied());
    scattered.spectral.iter().for_each(|axis| add_axis(coordinates, axis));
    values.add(scattered.values.iter().map(|&value| f64::from(value)));
}

fn add_axis(coordinates: &mut Summed, axis: &Axis) {
    match axis {
        Axis::Wavelength(grid) => coordinates.add(grid.values()),
        Axis::Elevation(angles) => coordinates.add(angles.iter().copied()),
        Axis::Grid(grid) => {
            coordinates.add(grid.polar().iter().copied());
            coordinates.add(grid.azimuths().iter().flat_map(|azimuths| azimuths.angles.iter().copied()));
        }
        // The description of the axis says all.
        Axis::Triangles(_) | Axis::Index { .. } | Axis::Rgb => {}
    }
}

fn add_angles(coordinates: &mut Summed, angles: &Angles) {
    coordinates.add(angles.theta.iter().copied());
    coordinates.add(angles.phi.iter().flat_map(|azimuths| azimuths.phi.iter().copied()));
}

/// Adds the values of a function at some of its incoming directions, each with outgoing directions all around.
fn add_function(values: &mut Summed, modelled: &Modelled, quantity: Quantity) {
    let azimuths = modelled.incoming.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
    let farthest = if quantity == Quantity::Phase { 180.0 } else { 85.0 };
    let mut found = vec![0.0; modelled.spectral.as_ref().map_or(1, Axis::len)];
    for theta in some(&modelled.incoming.theta) {
        for phi in some(azimuths) {
            let incoming = Direction::from_degrees(theta, phi);
            for polar in 0..ANGLES {
                for azimuth in 0..ANGLES {
                    let turn = |number: usize, whole: f64| whole * number as f64 / ANGLES as f64;
                    let polar = farthest * (polar as f64 + 0.5) / ANGLES as f64;
                    let outgoing = Direction::from_degrees(polar, phi + turn(azimuth, 360.0));
                    modelled.function.evaluate(incoming, outgoing, &mut found);
                    values.add(found.iter().copied());
                }
            }
        }
    }
}

/// Returns at most [`ANGLES`] of the angles, evenly chosen.
fn some(angles: &[f64]) -> impl Iterator<Item = f64> {
    angles.iter().copied().step_by(angles.len().div_ceil(ANGLES).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Interpretation, read};

    fn summed(numbers: &[f64]) -> Sums {
        let mut sums = Summed::default();
        sums.add(numbers.iter().copied());
        sums.end()
    }

    #[test]
    fn sums_stay_what_rows_of_the_catalog_hold() {
        let Sums { weighted, norm } = summed(&[1.0, 2.0, f64::NAN, 4.0]);
        assert_eq!(weighted.map(|sum| sum * 32768.0), [-89_785.0, 100_287.0, -145_491.0, 41_276.0]);
        assert_eq!(norm, 21.0_f64.sqrt());
        assert_eq!(summed(&[1e200]).norm, f64::MAX);
    }

    #[test]
    fn a_difference_has_its_size_and_rounding_is_none() {
        let numbers: Vec<f64> = (0..500).map(|i| 1.0 + (f64::from(i) * 0.7).sin()).collect();
        let sums = summed(&numbers);
        let scaled: Vec<f64> = numbers.iter().map(|number| 100.0 * number).collect();
        let told = sums.difference(&summed(&scaled)).unwrap();
        assert!(told > 0.1 && told < 3.0, "{told}");
        let rounded: Vec<f64> = numbers.iter().map(|&number| f64::from((number * (1.0 + 1e-8)) as f32)).collect();
        assert_eq!(sums.difference(&summed(&rounded)), None);
        let mut swapped = numbers.clone();
        swapped.swap(3, 400);
        assert!(sums.difference(&summed(&swapped)).is_some());
        assert_eq!(summed(&[]).difference(&summed(&[])), None);
        assert_eq!(summed(&[0.0]).difference(&summed(&[0.0])), None);
    }

    #[test]
    fn every_form_of_samples_has_values_and_coordinates() {
        for name in ["illuminant_D65.csv", "aerolamp.ies", "virtual/plastic.json"] {
            let path = format!("{}/data/{name}", env!("CARGO_MANIFEST_DIR"));
            let acquisition = read(&std::fs::read(path).unwrap(), &Interpretation::default()).unwrap();
            let Fingerprint { values, coordinates } = Fingerprint::of(&acquisition);
            assert!(values.norm > 0.0 && coordinates.norm > 0.0, "{name}");
            assert_eq!(Fingerprint::of(&acquisition), Fingerprint { values, coordinates });
        }
    }
}
