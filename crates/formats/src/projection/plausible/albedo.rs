//! Largest directional albedo of a file: the sum of its values times the solid angles that they represent, times
//! |cos θo|.

use super::table::Table;
use crate::domain::vector::Vector;
use crate::domain::{Axis, Domain, Measurement, Quantity, Unit};
use crate::formats::{Acquisition, Samples, Scattered};
use crate::notes::CheckNote;
use crate::projection::same_angle::{azimuth_steps, steps};
use crate::projection::scattered::{areas, directions};
use std::borrow::Cow;

/// Upper bound on the number of values of a table that are summed for its albedos. In larger tables some incoming
/// directions are skipped, evenly. Raising it makes checks of large tables slower and more complete.
const MOST_VALUES: usize = 1 << 25;
/// Upper bound on the number of scattered samples whose solid angles are computed for albedos. Of larger scans,
/// incoming directions and samples are skipped evenly. The time is proportional to it: this many take 0.2 s on two
/// cores.
const MOST_SCATTERED: usize = 1 << 16;
/// Lower bound on the number of scattered samples of an incoming direction whose albedo is summed. Raising it skips
/// sparsely sampled incoming directions.
const FEWEST: usize = 24;
/// Largest excess of a directional albedo over 1 that causes no remark: sums over solid angles are this inaccurate.
/// Raising it gives fewer remarks.
const TOLERANCE: f64 = 0.02;

/// Largest directional albedo of a BRDF, BTDF or BSDF, over the incoming directions and bands of a file.
///
/// Directions that were not measured add nothing. Of scattered samples, a single one does not count if its light alone
/// lifts the albedo above 1: it may lie on the peak of a lobe narrower than the spacing. In very large files only some
/// incoming directions are summed, always the same ones.
#[derive(Clone, Debug, PartialEq)]
pub struct LargestAlbedo {
    /// Largest directional albedo; at most 1 for a surface that reflects no more light than it receives.
    pub albedo: f64,
    /// Polar angle and, unless the file is isotropic, azimuth of the incoming direction with the largest albedo, in
    /// degrees.
    pub incoming: (f64, Option<f64>),
    /// Spectral band with the largest albedo; `None` if there is a single band without wavelength.
    pub band: Option<Band>,
    /// Number of incoming directions whose albedo exceeds 1.02 in some spectral band.
    pub above: usize,
    /// Number of incoming directions whose albedo was computed.
    pub of: usize,
    /// Number of incoming directions of the file.
    pub all: usize,
}

/// A spectral band of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Band {
    /// Wavelength of the band in nm.
    Wavelength(f64),
    /// Number of the colour channel, counted from 0.
    Channel(usize),
}

impl LargestAlbedo {
    /// Finds the largest directional albedo of a file. Returns `None` if the quantity has no albedo, values are
    /// relative, or directions cover no area.
    pub(super) fn of(acquisition: &Acquisition) -> Option<Self> {
        if !acquisition.quantity.has_cosine() || acquisition.unit != Unit::PerSteradian {
            return None;
        }
        match &acquisition.samples {
            Samples::Scattered(scattered) => of_scattered(acquisition.quantity, scattered),
            _ => of_table(&Table::of(acquisition)?),
        }
    }

    /// Finds the largest directional albedo of a measurement, as of a file.
    pub(super) fn of_measurement(measurement: &Measurement) -> Option<Self> {
        if !measurement.quantity.has_cosine() || measurement.unit != Unit::PerSteradian {
            return None;
        }
        of_table(&Table::of_tensor(measurement.quantity, &measurement.tensor)?)
    }

    /// Returns true if the largest directional albedo exceeds 1 by more than sums over solid angles are inaccurate and
    /// by more than the relative error `error` explains.
    pub(super) fn is_above_by_more_than(&self, error: f64) -> bool {
        self.albedo > (1.0 + TOLERANCE) * (1.0 + error)
    }

    /// Returns a remark for the user if the largest directional albedo exceeds 1.
    pub(super) fn remark(&self) -> Option<CheckNote> {
        if self.albedo <= 1.0 + TOLERANCE {
            return None;
        }
        let (theta, phi) = self.incoming;
        let (wavelength_nm, channel) = match self.band {
            None => (None, None),
            Some(Band::Wavelength(nanometres)) => (Some(nanometres), None),
            Some(Band::Channel(number)) => (None, Some(number)),
        };
        Some(CheckNote::AlbedoAboveOne {
            albedo: self.albedo,
            above: self.above,
            summed: self.of,
            all: self.all,
            theta_i_degrees: theta,
            phi_i_degrees: phi,
            wavelength_nm,
            channel,
        })
    }
}

/// Running maximum of the directional albedo over incoming directions and bands.
struct Largest<'a> {
    spectral: Option<&'a Axis>,
    found: Option<LargestAlbedo>,
    all: usize,
}

impl<'a> Largest<'a> {
    fn new(spectral: Option<&'a Axis>, all: usize) -> Self {
        Self { spectral, found: None, all }
    }

    /// Adds the albedos of one incoming direction, one for each spectral band, to the running maximum.
    fn add(&mut self, incoming: (f64, Option<f64>), sums: &[f64]) {
        let largest = sums.iter().copied().enumerate().fold(None, |most: Option<(usize, f64)>, next| match most {
            Some(most) if most.1 >= next.1 => Some(most),
            _ => Some(next),
        });
        let Some((band, albedo)) = largest else { return };
        let spectral = self.spectral;
        let found = self.found.get_or_insert(LargestAlbedo {
            albedo: f64::NEG_INFINITY,
            incoming,
            band: None,
            above: 0,
            of: 0,
            all: self.all,
        });
        found.of += 1;
        found.above += usize::from(albedo > 1.0 + TOLERANCE);
        if albedo > found.albedo {
            found.albedo = albedo;
            found.incoming = incoming;
            found.band = match spectral {
                None => None,
                Some(Axis::Wavelength(grid)) => Some(Band::Wavelength(grid.at(band))),
                Some(_) => Some(Band::Channel(band)),
            };
        }
    }
}

fn of_table(table: &Table<'_>) -> Option<LargestAlbedo> {
    if table.is_half_plane() {
        return None;
    }
    let weights = table.outgoing.projected_solid_angles()?;
    let bands = table.bands();
    let blocks = table.values.len() / table.block();
    let every = blocks.div_ceil((MOST_VALUES / table.block()).max(1));
    let mut largest = Largest::new(table.spectral, blocks);
    let mut sums = vec![0.0; bands];
    for (number, block) in table.values.chunks_exact(table.block()).enumerate().step_by(every) {
        sums.fill(0.0);
        for (row, weight) in block.chunks_exact(bands).zip(&weights) {
            for (sum, &value) in sums.iter_mut().zip(row).filter(|(_, value)| !value.is_nan()) {
                *sum += weight * f64::from(value);
            }
        }
        let [theta, phi] = table.incoming.degrees(number % table.incoming.len());
        largest.add((theta, (!table.incoming.is_isotropic()).then_some(phi)), &sums);
    }
    largest.found
}

fn of_scattered(quantity: Quantity, scattered: &Scattered) -> Option<LargestAlbedo> {
    let domain = match quantity {
        Quantity::Brdf => Domain::Hemisphere,
        Quantity::Btdf => Domain::Lower,
        _ => Domain::Sphere,
    };
    let bands = scattered.spectral.as_ref().map_or(1, Axis::len);
    if scattered.values.len() != scattered.directions() * bands || scattered.outgoing.is_empty() {
        return None;
    }
    let outgoing = directions(scattered, scattered.isotropic);
    let groups = incidences(scattered, |row| match domain {
        Domain::Hemisphere => outgoing[row].1[2] >= 0.0,
        Domain::Lower => outgoing[row].1[2] <= 0.0,
        Domain::Sphere => true,
    });
    let samples: usize = groups.iter().map(Vec::len).sum();
    let every = samples.div_ceil(MOST_SCATTERED).max(1);
    let mut largest = Largest::new(scattered.spectral.as_ref(), groups.len());
    let (mut sums, mut largest_terms) = (vec![0.0; bands], vec![0.0_f64; bands]);
    for rows in groups.iter().step_by(every) {
        let rows = thinned(rows);
        let directions: Vec<Vector> = rows.iter().map(|&row| outgoing[row].1).collect();
        let Some(areas) = areas(&directions, domain) else { continue };
        sums.fill(0.0);
        largest_terms.fill(0.0);
        for ((&row, area), direction) in rows.iter().zip(areas).zip(&directions) {
            let weight = area * direction[2].abs();
            let values = &scattered.values[row * bands..][..bands];
            let totals = sums.iter_mut().zip(&mut largest_terms);
            for ((sum, largest), &value) in totals.zip(values).filter(|(_, value)| !value.is_nan()) {
                let term = weight * f64::from(value);
                *sum += term;
                *largest = largest.max(term);
            }
        }
        // A sample on the peak of a narrow lobe represents more area than the lobe has. Without it the sum is too low.
        for (sum, largest) in sums.iter_mut().zip(&largest_terms) {
            let is_above = |sum: f64| sum > 1.0 + TOLERANCE;
            if is_above(*sum) && !is_above(*sum - largest) {
                *sum -= largest;
            }
        }
        let [theta, phi] = scattered.incoming[rows[0]];
        largest.add((theta, (!scattered.isotropic).then_some(phi)), &sums);
    }
    largest.found
}

/// Groups samples by incoming direction, in increasing order of angles, and returns the sample indices of each group.
/// Skips samples for which `is_within` is false, and incoming directions with too few samples.
fn incidences(scattered: &Scattered, is_within: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let key = |row: usize| {
        let [theta, phi] = scattered.incoming[row];
        [steps(theta), if scattered.isotropic { 0 } else { azimuth_steps(theta, phi) }]
    };
    let rows = 0..scattered.incoming.len();
    let mut keyed: Vec<([i64; 2], usize)> = rows.filter(|row| is_within(*row)).map(|row| (key(row), row)).collect();
    keyed.sort_unstable();
    let groups = keyed.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() >= FEWEST);
    groups.map(|group| group.iter().map(|keyed| keyed.1).collect()).collect()
}

/// Returns an evenly spaced selection of at most 65,536 sample indices from `rows`, to limit the number of samples
/// whose solid angles are computed.
fn thinned(rows: &[usize]) -> Cow<'_, [usize]> {
    match rows.len().div_ceil(MOST_SCATTERED) {
        0 | 1 => Cow::Borrowed(rows),
        every => Cow::Owned(rows.iter().step_by(every).copied().collect()),
    }
}
