//! Comparison of the light of a material with that of its scattered samples, by incidence and group of bands.
//!
//! Both are sums over the same samples with the same weights: the solid angle that each sample represents times |cos
//! θ|. Rejected samples are no error of the material. Several of them close together may be a lobe narrower than the
//! sample spacing; these count in the sums that raise warnings. Isolated ones are only reported.

use crate::domain::{Axis, WavelengthGrid};
use crate::projection::{Incidence, ScatteredSamples};
use serde::{Deserialize, Serialize};

/// Largest number of groups of bands that are summed separately.
const GROUPS: usize = 8;
/// Relative difference of the light that raises a warning, if it also exceeds [`STANDARD_ERRORS`] of the noise.
/// Raising either warns less often.
const LIGHT: f64 = 0.03;
const STANDARD_ERRORS: f64 = 4.0;
/// Largest excess of an albedo over 1 without a warning: sums over sample areas are this inaccurate.
const ALBEDO: f64 = 0.02;
/// Marks samples that belong to no incidence.
const NONE: u32 = u32::MAX;

/// Difference between the light of the material and that of the samples, relative to the latter. It is given for one
/// incidence and one group of bands: −0.2 if the material has a fifth less. Differences are `None` if there is no
/// sample or the samples have no light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IncidenceLight {
    /// Polar angle of the incidence in degrees; `None` for the sum over all incidences, or without incidences.
    pub theta_i: Option<f64>,
    /// Azimuth of the incidence in degrees; `None` for isotropic data.
    pub phi_i: Option<f64>,
    /// First and last wavelength in nm; `None` without wavelengths.
    pub wavelengths: Option<[f64; 2]>,
    /// First and last channel of the group, from 0.
    pub channels: [usize; 2],
    /// Number of compared values, rejected ones included.
    pub values: u64,
    /// Weighted sum of the samples without isolated rejected ones, averaged over the channels.
    pub light: f64,
    /// True if samples are weighted by the areas they represent. Over a whole hemisphere `light` is then the
    /// directional albedo or the flux. False in a plane of incidence, and if each sample has its own incidence.
    pub by_area: bool,
    /// Difference at the samples that were not rejected.
    pub kept: Option<f64>,
    /// Difference including rejected samples that lie close together.
    pub together: Option<f64>,
    /// Difference including all rejected samples.
    pub all: Option<f64>,
    /// Standard error of `together` from the noise of the samples; 0 if the noise is unknown.
    pub noise: f64,
}

/// Largest differences of the light by magnitude, over all incidences and groups of bands; see [`IncidenceLight`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SampleLight {
    /// Difference at the samples that were not rejected.
    pub kept: Option<f64>,
    /// Difference including rejected samples that lie close together.
    pub together: Option<f64>,
    /// Difference including all rejected samples.
    pub all: Option<f64>,
}

/// Weighted sums over the values of the material and of the samples.
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

/// Classification of a value in the sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Kept,
    Together,
    Alone,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    classes: [Pair; 3],
    /// Variance of the sample sum, without isolated values, for a relative noise of 1.
    variance: f64,
}

/// Running sums for samples that arrive in order, in pieces.
pub(super) struct LightSums {
    /// Incidence and weight of each sample.
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

    /// Adds the values `[sample, wavelength]` of the samples from `from` on. `rejected` yields the positions of
    /// rejected values in increasing order, with true for those that lie close together.
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
                }
            }
        }
    }

    /// Returns the channels of a group; all groups have about equal size.
    fn channels(&self, group: usize) -> std::ops::Range<usize> {
        group * self.width / self.groups..(group + 1) * self.width / self.groups
    }

    /// Returns the differences, for samples with this relative noise. `spectral` is the axis of the channels.
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
    /// Returns the largest differences among `lights`.
    pub(super) fn of(lights: &[IncidenceLight]) -> Self {
        let largest = |of: fn(&IncidenceLight) -> Option<f64>| {
            lights.iter().filter_map(of).reduce(|most, next| if next.abs() > most.abs() { next } else { most })
        };
        Self { kept: largest(|l| l.kept), together: largest(|l| l.together), all: largest(|l| l.all) }
    }
}

/// Returns true if the difference is large and exceeds the noise.
fn is_off(light: &IncidenceLight) -> bool {
    light.together.is_some_and(|off| off.abs() > LIGHT && off.abs() > STANDARD_ERRORS * light.noise)
}

/// Returns a warning if the light of a material differs from that of its samples by more than 3 % and by more than
/// their noise explains. Otherwise warns of an unresolved lobe, if `lobe` values belong to one: no sum shows such a
/// lobe, since no sample lies near its peak.
pub(super) fn warning(lights: &[IncidenceLight], lobe: u64) -> Option<String> {
    different(lights).or_else(|| {
        (lobe > 0).then(|| {
            format!(
                "{lobe} values far above their neighbours lie together, as those of a lobe do that is narrower than the scan \
                 resolves: its light cannot be told from these samples; measure more densely about them"
            )
        })
    })
}

/// Returns a warning about the incidence under which the light differs most.
fn different(lights: &[IncidenceLight]) -> Option<String> {
    let size = |light: &IncidenceLight| light.together.unwrap_or(0.0).abs();
    let off = lights.iter().filter(|light| is_off(light));
    let worst = off.clone().reduce(|most, next| if size(next) > size(most) { next } else { most })?;
    let incidence = match (worst.theta_i, worst.phi_i) {
        (Some(theta), Some(phi)) => format!(" under the incidence of {theta:.1}° (azimuth {phi:.1}°)"),
        (Some(theta), None) => format!(" under the incidence of {theta:.1}°"),
        _ => String::new(),
    };
    let is_part = lights.iter().any(|light| light.channels != worst.channels);
    let bands = match (worst.wavelengths, worst.channels) {
        _ if !is_part => String::new(),
        (Some([first, last]), _) => format!(" at {first:.0} to {last:.0} nm"),
        (None, [first, last]) => format!(" in the channels {first} to {last}"),
    };
    let others = match off.count() - 1 {
        0 => String::new(),
        others => format!("; so does that of {others} other incidences or groups of bands, by less"),
    };
    let (more, advice) = if worst.together > Some(0.0) {
        ("more", "the cells or the incoming directions may be too coarse for it")
    } else {
        (
            "less",
            "a lobe may be narrower than the distance between samples, or than the cells; measure more densely where samples \
             lie far above their neighbours",
        )
    };
    let noise = match 100.0 * STANDARD_ERRORS * worst.noise {
        0.0 => "noise is unknown".to_owned(),
        noise => format!("noise explains {noise:.2} %"),
    };
    Some(format!(
        "the material has {:.1} % {more} light than its samples{incidence}{bands}, where their {noise}{others}: {advice}",
        100.0 * size(worst),
    ))
}

/// Returns a warning if samples reflect more light than they receive, for quantities with an albedo.
pub(super) fn too_bright(lights: &[IncidenceLight]) -> Option<String> {
    let is_above =
        |light: &&IncidenceLight| light.by_area && light.light > 1.0 + ALBEDO.max(STANDARD_ERRORS * light.noise);
    let above = lights.iter().filter(is_above);
    let most = above.clone().reduce(|most, next| if next.light > most.light { next } else { most })?;
    let incidence = most.theta_i.map_or_else(String::new, |theta| format!(", most under the incidence of {theta:.1}°"));
    Some(format!(
        "the samples have an albedo above 1 under {} incidences or groups of bands: {:.3}{incidence}; the scale, the cosine or the \
         reference may be wrong",
        above.count(),
        most.light
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_light_that_is_off_by_more_than_noise_is_warned_of() {
        let of = |together, noise| IncidenceLight { theta_i: Some(40.0), together, noise, ..IncidenceLight::default() };
        assert_eq!(warning(&[], 0), None);
        assert_eq!(warning(&[of(None, 0.0), of(Some(0.029), 0.0), of(Some(-0.1), 0.026)], 0), None);
        assert!(warning(&[of(Some(0.029), 0.0)], 5).unwrap().starts_with("5 values far above"));
        let message = warning(&[of(Some(0.04), 0.001), of(Some(-0.2), 0.001)], 5).unwrap();
        assert!(message.contains("20.0 % less light than its samples under the incidence of 40.0°"), "{message}");
        assert!(message.contains("0.40 %; so does that of 1 other"), "{message}");
    }

    #[test]
    fn albedos_above_1_are_told_where_they_are_albedos() {
        let of = |light, by_area| IncidenceLight { theta_i: Some(20.0), light, by_area, ..IncidenceLight::default() };
        assert_eq!(too_bright(&[of(1.01, true), of(50.0, false)]), None);
        let message = too_bright(&[of(1.2, true), of(0.9, true), of(1.4, true)]).unwrap();
        assert!(message.contains("under 2 incidences") && message.contains("1.400, most under"), "{message}");
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
        for empty in &found[1..] {
            assert_eq!((empty.kept, empty.together, empty.all, empty.values), (None, None, None, 0));
        }
        assert_eq!(SampleLight::of(&found), SampleLight { all: Some(-1.0 / 3.0), ..SampleLight::of(&found[..1]) });
    }
}
