//! Comparison of the light of a material with that of its scattered samples, by incidence and group of bands.
//!
//! Both are sums over the same samples with the same weights: the solid angle that each sample represents times |cos
//! θ|. Rejected samples are no error of the material. Several of them close together may be a lobe narrower than the
//! sample spacing; these count in the sums that raise warnings. Isolated ones are only reported.

use crate::domain::{Axis, LobeCentre, Note, Quantity, WavelengthGrid};
use crate::formats::with_digits;
use crate::notes::{LobeNote, MaterialNote};
use crate::projection::{Incidence, ScatterReport, ScatteredSamples, UnresolvedLobe};
use serde::{Deserialize, Serialize};

/// Largest number of groups of wavelength bands in which a material and its samples are compared. Raising it localises
/// differences better.
const GROUPS: usize = 8;
/// Relative difference between material and samples, each summed over directions, that raises a warning, if it also
/// exceeds [`STANDARD_ERRORS`] of the noise. Raising either warns less often.
const LIGHT: f64 = 0.03;
const STANDARD_ERRORS: f64 = 4.0;
/// Largest excess of a directional albedo over 1 without a warning, because sums over sample areas are this inaccurate.
/// Raising it warns less often.
const ALBEDO: f64 = 0.02;
/// Marker in place of the number of the incident direction, for samples that belong to none.
const NONE: u32 = u32::MAX;

/// Relative difference between material and samples, each summed over directions, for one incident direction and one
/// group of wavelength bands: −0.2 if the material has a fifth less light. Differences are `None` if there is no sample
/// or the samples have no light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IncidenceLight {
    /// Polar angle in degrees of the incident direction under which material and samples are compared; `None` if all
    /// incident directions are compared together, or if the data have none.
    pub theta_i: Option<f64>,
    /// Azimuth of the incident direction in degrees; `None` for isotropic data.
    pub phi_i: Option<f64>,
    /// First and last wavelength of a group of bands in nm; `None` for data without wavelengths.
    pub wavelengths: Option<[f64; 2]>,
    /// First and last channel of a group of bands, counted from 0.
    pub channels: [usize; 2],
    /// Number of compared sample values, rejected outliers included.
    pub values: u64,
    /// Sum of the samples under one incident direction, each times the solid angle that it represents (where known) and
    /// |cos θ|. It is averaged over the channels of a group of wavelength bands, and leaves out isolated outliers.
    pub light: f64,
    /// Largest fraction of `light`, the weighted sum of samples, that a single sample contributes. Where it is large,
    /// the sum is uncertain: a sample on the peak of a narrow lobe represents more area than the lobe has.
    #[serde(default)]
    pub largest_share: f64,
    /// True if each sample is weighted in sums by the area (solid angle) it represents. Over a whole hemisphere the sum
    /// is then the directional albedo or the flux. False in a plane of incidence, and if each sample has its own
    /// incident direction.
    pub by_area: bool,
    /// Relative difference between the material's values and the sample values, each summed over directions with the
    /// same weights. Samples rejected as outliers are left out.
    pub kept: Option<f64>,
    /// Relative difference between the material's values and the sample values, each summed over directions with the
    /// same weights. Rejected outliers that lie close together are included, others left out.
    pub together: Option<f64>,
    /// Relative difference between the material's values and the sample values, each summed over directions with the
    /// same weights. All rejected outliers are included.
    pub all: Option<f64>,
    /// Standard error, due to the noise of the samples, of the relative difference between material and samples in
    /// their sums over directions; 0 if the noise is unknown. Isolated outliers are left out.
    pub noise: f64,
}

/// Largest relative differences, by magnitude, between material and samples, each summed over directions; over all
/// incident directions and groups of wavelength bands. See [`IncidenceLight`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SampleLight {
    /// Largest relative difference, over incident directions and wavelength bands, between the material's values and
    /// the sample values, each summed over directions. Samples rejected as outliers are left out.
    pub kept: Option<f64>,
    /// Largest relative difference, over incident directions and wavelength bands, between the material's values and
    /// the sample values, each summed over directions. Rejected outliers that lie close together are included, others
    /// left out.
    pub together: Option<f64>,
    /// Largest relative difference, over incident directions and wavelength bands, between the material's values and
    /// the sample values, each summed over directions. All rejected outliers are included.
    pub all: Option<f64>,
}

/// Sum of the material's values and sum of the sample values over the same outgoing directions and bands, with the same
/// weights (solid angle, where known, times |cos θ|); and the number of values.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    found: f64,
    stated: f64,
    values: u64,
}

impl Pair {
    fn add(&mut self, other: &Self) {
        self.found += other.found;
        self.stated += other.stated;
        self.values += other.values;
    }

    fn difference(&self) -> Option<f64> {
        (self.values > 0 && self.stated > 0.0).then(|| (self.found - self.stated) / self.stated)
    }
}

/// Class of a sample value: not an outlier, an outlier close to other outliers, or an isolated outlier. Each class has
/// its own sum over directions when material and samples are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Kept,
    Together,
    Alone,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    classes: [Pair; 3],
    /// Variance, due to noise, of the sum of sample values over outgoing directions weighted by solid angle, if each
    /// sample's relative standard deviation is 1. Isolated outliers are left out of the sum.
    variance: f64,
    /// Largest magnitude that one sample contributes to the weighted sum of samples; isolated outliers are left out.
    largest: f64,
}

/// Running sums over outgoing directions of the sample values, and of the material's values at the same samples. The
/// samples are passed in file order, some at a time.
pub(super) struct LightSums {
    /// Number of the incident direction, and weight in the sum over directions, of each sample.
    places: Vec<(u32, f64)>,
    sums: Vec<Sum>,
    width: usize,
    groups: usize,
    angles: Vec<Option<(f64, Option<f64>)>>,
    by_area: Vec<bool>,
}

impl LightSums {
    pub(super) fn new(samples: &ScatteredSamples) -> Self {
        let width = samples.width();
        let groups = width.clamp(1, GROUPS);
        let mut places = vec![(NONE, 0.0); samples.len()];
        let mut by_area = Vec::new();
        for (incidence, number) in samples.incidences().iter().zip(0..) {
            let (weights, are_areas) = samples.weights(incidence);
            by_area.push(are_areas);
            for (&row, weight) in incidence.rows().iter().zip(weights) {
                places[row as usize] = (number, weight);
            }
        }
        let angles: Vec<_> = samples.incidences().iter().map(Incidence::angles).collect();
        Self { places, sums: vec![Sum::default(); angles.len() * groups], width, groups, angles, by_area }
    }

    /// Adds values of samples and of the material at the same samples, both `[sample, wavelength]`, to the running
    /// sums. `from` is the number of the first sample. `rejected` yields the positions of rejected values in increasing
    /// order, with true for those that lie close together.
    pub(super) fn add(
        &mut self,
        from: usize,
        (stated, found): (&[f32], &[f32]),
        rejected: impl Iterator<Item = (usize, bool)>,
    ) {
        let mut rejected = rejected.peekable();
        let rows = stated.chunks_exact(self.width).zip(found.chunks_exact(self.width));
        for (row, (stated, found)) in rows.enumerate() {
            let (incidence, weight) = self.places[from + row];
            let mut place = row * self.width;
            for group in 0..self.groups {
                let mut deviation = 0.0;
                let mut pairs = [Pair::default(); 3];
                for channel in self.channels(group) {
                    let class = match rejected.next_if(|rejection| rejection.0 == place) {
                        None => Class::Kept,
                        Some((_, true)) => Class::Together,
                        Some((_, false)) => Class::Alone,
                    };
                    place += 1;
                    let (stated, found) = (f64::from(stated[channel]), f64::from(found[channel]));
                    if stated.is_nan() || found.is_nan() {
                        continue;
                    }
                    let pair = Pair { found: weight * found, stated: weight * stated, values: 1 };
                    pairs[class as usize].add(&pair);
                    // Sum before squaring: noise may be common to neighbouring bands.
                    deviation += if class == Class::Alone { 0.0 } else { pair.stated.abs() };
                }
                if incidence != NONE {
                    let sum = &mut self.sums[incidence as usize * self.groups + group];
                    sum.classes.iter_mut().zip(&pairs).for_each(|(sum, pair)| sum.add(pair));
                    sum.variance += deviation * deviation;
                    sum.largest = sum.largest.max(deviation);
                }
            }
        }
    }

    /// Returns the range of channels in a group of wavelength bands; all groups have about equal size.
    fn channels(&self, group: usize) -> std::ops::Range<usize> {
        group * self.width / self.groups..(group + 1) * self.width / self.groups
    }

    /// Returns the differences between material and samples, each summed over directions, per incident direction and
    /// group of bands. `noise` is the relative noise of the samples, and `spectral` the axis of their bands.
    pub(super) fn finish(&self, noise: Option<f64>, spectral: Option<&Axis>) -> Vec<IncidenceLight> {
        let grid = spectral.and_then(|axis| if let Axis::Wavelength(grid) = axis { Some(grid) } else { None });
        let grid = grid.filter(|grid| grid.len() == self.width);
        let of = |(i, sum): (usize, &Sum)| {
            let channels = self.channels(i % self.groups);
            let channels = [channels.start, channels.end.saturating_sub(1)];
            let mut total = sum.classes[Class::Kept as usize];
            let kept = total.difference();
            total.add(&sum.classes[Class::Together as usize]);
            let (together, weighty) = (total.difference(), total.stated);
            total.add(&sum.classes[Class::Alone as usize]);
            let angles = self.angles[i / self.groups];
            let error = noise.unwrap_or(0.0) * sum.variance.sqrt() / weighty;
            IncidenceLight {
                theta_i: angles.map(|angles| angles.0),
                phi_i: angles.and_then(|angles| angles.1),
                wavelengths: grid.map(|grid: &WavelengthGrid| channels.map(|channel| grid.at(channel))),
                channels,
                values: total.values,
                light: weighty / (channels[1] + 1 - channels[0]) as f64,
                largest_share: if weighty > 0.0 { sum.largest / weighty } else { 0.0 },
                by_area: self.by_area[i / self.groups],
                kept,
                together,
                all: total.difference(),
                noise: if together.is_some() { error } else { 0.0 },
            }
        };
        self.sums.iter().enumerate().map(of).collect()
    }
}

impl SampleLight {
    /// Returns the relative differences, largest in magnitude, between the material's values and the sample values,
    /// each summed over outgoing directions. They are sought among the incident directions and groups of wavelength
    /// bands in `lights`, and keep their signs.
    pub(super) fn of(lights: &[IncidenceLight]) -> Self {
        let largest = |of: fn(&IncidenceLight) -> Option<f64>| {
            lights.iter().filter_map(of).reduce(|most, next| if next.abs() > most.abs() { next } else { most })
        };
        Self { kept: largest(|l| l.kept), together: largest(|l| l.together), all: largest(|l| l.all) }
    }
}

/// Returns true if material and samples, each summed over directions, differ by more than 3 % and by more than the
/// noise explains.
fn is_off(light: &IncidenceLight) -> bool {
    light.together.is_some_and(|off| off.abs() > LIGHT && off.abs() > STANDARD_ERRORS * light.noise)
}

/// Narrow lobe whose light cannot be determined from the samples, and that the material does not hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Untold {
    /// Number of sample values that belong to a lobe that could not be fitted.
    Together(u64),
    /// Outliers among the samples around a likely centre of a lobe, such as the mirror direction: the centre and their
    /// number.
    Centred(UnresolvedLobe),
}

impl Untold {
    /// Returns the narrow lobe that scattered samples suggest but that could not be fitted to them; `None` if they
    /// suggest none.
    pub(super) fn of(scatter: &ScatterReport) -> Option<Self> {
        let together = (scatter.lobe > 0).then_some(Self::Together(scatter.lobe));
        together.or_else(|| scatter.unresolved.map(Self::Centred))
    }

    /// Returns the warning that samples of `quantity` suggest a narrow lobe that could not be fitted.
    ///
    /// For surfaces it states the largest albedo that the lobe can have: 1 minus the mean albedo of the samples in
    /// `lights`.
    fn warning(self, quantity: Quantity, lights: &[IncidenceLight]) -> Note {
        let areas = || lights.iter().filter(|light| light.by_area);
        let albedo = areas().map(|light| light.light).sum::<f64>() / areas().count() as f64;
        // Without areas the albedo is not a number.
        let is_dim = quantity.has_cosine() && albedo < 1.0;
        let largest_albedo = is_dim.then(|| with_digits(1.0 - albedo, 2));
        let note = match self {
            Self::Together(values) => LobeNote::Suspected { values, largest_albedo },
            Self::Centred(UnresolvedLobe { centre, values }) => {
                let about = match (centre, quantity) {
                    (LobeCentre::Source, _) => "the direction back to the source",
                    (_, Quantity::Btdf | Quantity::Phase) => "the direction straight through",
                    (_, Quantity::Bsdf) => "the mirror direction or the direction straight through",
                    _ => "the mirror direction",
                };
                LobeNote::SuspectedAbout { values, about, largest_albedo }
            }
        };
        note.into()
    }
}

/// Quantity and narrow lobe of a measurement, with which a warning explains why a material has more or less light than
/// its samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scanned {
    pub(super) quantity: Quantity,
    /// Narrow lobe that the samples suggest but that the material does not hold; `None` if they suggest none.
    pub(super) untold: Option<Untold>,
    /// Fraction of the light of the material's narrow lobe that was removed to conserve energy.
    pub(super) reduced: Option<f64>,
}

/// Returns a warning if material and samples, each summed over directions, differ by more than 3 % and by more than the
/// noise explains. Otherwise warns of a narrow lobe that the samples suggest but do not resolve.
///
/// The sums cannot show such a lobe, since no sample lies near its peak.
pub(super) fn warning(lights: &[IncidenceLight], scanned: Scanned) -> Option<Note> {
    let unresolved = || scanned.untold.map(|lobe| lobe.warning(scanned.quantity, lights));
    different(lights, scanned.reduced).or_else(unresolved)
}

/// Returns a warning about the incident direction under which material and samples, each summed over directions, differ
/// most. `reduced` is the fraction by which the light of the material's narrow lobe was reduced.
fn different(lights: &[IncidenceLight], reduced: Option<f64>) -> Option<Note> {
    let size = |light: &IncidenceLight| light.together.unwrap_or(0.0).abs();
    let off = lights.iter().filter(|light| is_off(light));
    let worst = off.clone().reduce(|most, next| if size(next) > size(most) { next } else { most })?;
    let is_part = lights.iter().any(|light| light.channels != worst.channels);
    let (wavelengths, channels) = match worst.wavelengths {
        _ if !is_part => (None, None),
        Some(wavelengths) => (Some(wavelengths), None),
        None => (None, Some(worst.channels)),
    };
    let noise_percent = 100.0 * STANDARD_ERRORS * worst.noise;
    let note = MaterialNote::LightDiffers {
        difference_percent: 100.0 * size(worst),
        is_more: worst.together > Some(0.0),
        theta_i_degrees: worst.theta_i,
        phi_i_degrees: worst.phi_i,
        first_nm: wavelengths.map(|[first, _]| first),
        last_nm: wavelengths.map(|[_, last]| last),
        first_channel: channels.map(|[first, _]| first),
        last_channel: channels.map(|[_, last]| last),
        noise_percent: Some(noise_percent).filter(|noise| *noise != 0.0),
        others: off.count() - 1,
        lobe_reduced_percent: reduced.map(|part| 100.0 * part),
    };
    Some(note.into())
}

/// Returns a warning if samples reflect more light than they receive, that is, if their directional albedo exceeds 1.
/// It must exceed 1 without the sample that contributes most, too.
pub(super) fn too_bright(lights: &[IncidenceLight]) -> Option<Note> {
    let is_above = |light: &&IncidenceLight| {
        let without_largest = light.light * (1.0 - light.largest_share);
        light.by_area && without_largest > 1.0 + ALBEDO.max(STANDARD_ERRORS * light.noise)
    };
    let above = lights.iter().filter(is_above);
    let most = above.clone().reduce(|most, next| if next.light > most.light { next } else { most })?;
    let note =
        MaterialNote::AlbedoAboveOne { albedo: most.light, places: above.count(), theta_i_degrees: most.theta_i };
    Some(note.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Scanned = Scanned { quantity: Quantity::Brdf, untold: None, reduced: None };

    #[test]
    fn only_light_that_is_off_by_more_than_noise_is_warned_of() {
        let of = |together, noise| IncidenceLight { theta_i: Some(40.0), together, noise, ..IncidenceLight::default() };
        assert_eq!(warning(&[], PLAIN), None);
        assert_eq!(warning(&[of(None, 0.0), of(Some(0.029), 0.0), of(Some(-0.1), 0.026)], PLAIN), None);
        let lobe = Scanned { untold: Some(Untold::Together(5)), ..PLAIN };
        assert!(warning(&[of(Some(0.029), 0.0)], lobe).unwrap().message.starts_with("5 values far above"));
        let message = warning(&[of(Some(0.04), 0.001), of(Some(-0.2), 0.001)], lobe).unwrap().message;
        assert!(message.contains("20.0 % less light than its samples under the incidence of 40.0°"), "{message}");
        assert!(message.contains("0.40 %; so does that of one other incidence or group of bands"), "{message}");
        assert!(message.contains("measure more densely"), "{message}");
    }

    #[test]
    fn a_single_band_has_one_wavelength_and_a_single_channel_one_number() {
        let of = |together, channels, wavelengths| IncidenceLight {
            together: Some(together),
            channels,
            wavelengths,
            ..IncidenceLight::default()
        };
        let told = |channels, wavelengths| {
            let lights = [of(-0.2, channels, wavelengths), of(0.0, [7, 9], Some([700.0, 720.0]))];
            warning(&lights, PLAIN).unwrap().message
        };
        assert!(told([0, 0], Some([400.0; 2])).contains("its samples at 400 nm, where"));
        assert!(told([0, 1], Some([400.0, 410.0])).contains("its samples at 400 to 410 nm, where"));
        assert!(told([0, 0], None).contains("its samples in channel 0, where"));
        assert!(told([0, 1], None).contains("its samples in the channels 0 to 1, where"));
    }

    #[test]
    fn a_lobe_dimmed_to_conserve_energy_is_told_as_such() {
        let less = IncidenceLight { together: Some(-0.2), ..IncidenceLight::default() };
        let dimmed = Scanned { reduced: Some(0.25), ..PLAIN };
        let message = warning(&[less], dimmed).unwrap().message;
        assert!(message.contains("reduced by 25.0 %") && !message.contains("densely"), "{message}");
        let more = IncidenceLight { together: Some(0.2), ..IncidenceLight::default() };
        assert!(warning(&[more], dimmed).unwrap().message.contains("too coarse"));
    }

    #[test]
    fn unresolved_lobes_are_told_with_their_place_and_the_light_left_for_them() {
        let told = |quantity, centre| {
            let untold = Some(Untold::Centred(UnresolvedLobe { centre, values: 2 }));
            let half = IncidenceLight { light: 0.5, by_area: true, together: Some(0.0), ..IncidenceLight::default() };
            let in_plane = IncidenceLight { light: 40.0, by_area: false, ..half };
            warning(&[half, in_plane], Scanned { quantity, untold, reduced: None }).unwrap().message
        };
        let message = told(Quantity::Brdf, LobeCentre::HalfVector);
        assert!(
            message.starts_with("2 values far above their neighbours stand about the mirror direction"),
            "{message}"
        );
        assert!(
            message.contains("narrower than the scan resolves") && message.contains("between 0 and 0.5 "),
            "{message}"
        );
        assert!(told(Quantity::Btdf, LobeCentre::Mirror).ends_with("densely about the direction straight through"));
        assert!(told(Quantity::Bsdf, LobeCentre::Source).ends_with("densely about the direction back to the source"));
        let phase = told(Quantity::Phase, LobeCentre::Mirror);
        assert!(!phase.contains("albedo") && phase.ends_with("straight through"), "{phase}");
        let message = warning(&[], Scanned { untold: Some(Untold::Together(3)), ..PLAIN }).unwrap().message;
        assert!(!message.contains("albedo") && message.ends_with("more densely about them"), "{message}");
    }

    #[test]
    fn albedos_above_1_are_told_where_they_are_albedos() {
        let of = |light, by_area| IncidenceLight { theta_i: Some(20.0), light, by_area, ..IncidenceLight::default() };
        assert_eq!(too_bright(&[of(1.01, true), of(50.0, false)]), None);
        let peak = IncidenceLight { largest_share: 0.5, ..of(2.0, true) };
        assert_eq!(too_bright(&[peak]), None);
        assert!(too_bright(&[IncidenceLight { light: 2.1, ..peak }]).is_some());
        let message = too_bright(&[of(1.2, true), of(0.9, true), of(1.4, true)]).unwrap().message;
        assert!(message.contains("under 2 incidences") && message.contains("1.400, most under"), "{message}");
        let message = too_bright(&[of(1.2, true), of(0.9, true)]).unwrap().message;
        assert!(message.contains("under one incidence or group of bands: 1.200"), "{message}");
    }

    #[test]
    fn sums_without_samples_are_none() {
        let mut sums = LightSums {
            places: vec![(0, 1.0), (0, 2.0), (NONE, 1.0)],
            sums: vec![Sum::default(); 4],
            width: 2,
            groups: 2,
            angles: vec![None, Some((30.0, None))],
            by_area: vec![true, false],
        };
        let stated = [1.0, f32::NAN, 1.0, f32::NAN, 7.0, 7.0];
        sums.add(0, (&stated, &[1.0, 1.0, 0.5, 1.0, 0.0, 0.0]), [(2, false)].into_iter());
        let found = sums.finish(Some(0.01), None);
        assert_eq!((found[0].kept, found[0].together, found[0].all), (Some(0.0), Some(0.0), Some(-1.0 / 3.0)));
        assert_eq!((found[0].values, found[0].light, found[0].noise), (2, 1.0, 0.01));
        assert_eq!((found[0].largest_share, found[1].largest_share), (1.0, 0.0));
        for empty in &found[1..] {
            assert_eq!((empty.kept, empty.together, empty.all, empty.values), (None, None, None, 0));
        }
        assert_eq!(SampleLight::of(&found), SampleLight { all: Some(-1.0 / 3.0), ..SampleLight::of(&found[..1]) });
    }
}
