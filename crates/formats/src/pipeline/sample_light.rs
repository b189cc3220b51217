//! The light of a material against that of the scattered samples it was made of, under each incidence and in groups of bands.
//!
//! Both are sums over the same samples with the same weights: the areas that the samples stand for times |cos θ|. Samples that
//! were rejected are no error of the material, but where several of them lie together they may be a lobe narrower than their
//! spacing: these count in the sums that are warned of. Those that lie alone are stated only.

use crate::domain::{Axis, WavelengthGrid};
use crate::projection::{Incidence, ScatteredSamples};
use serde::{Deserialize, Serialize};

/// Groups of bands that are summed apart, at most.
const GROUPS: usize = 8;
/// Relative difference of the light that is warned of, if it is above so many standard errors of the noise, too.
const LIGHT: f64 = 0.03;
const STANDARD_ERRORS: f64 = 4.0;
/// Albedo above 1 that is not warned of: sums by area are so far off.
const ALBEDO: f64 = 0.02;
/// No row of a sum.
const NONE: u32 = u32::MAX;

/// Light of the material less that of the samples, in parts of the latter, under one incidence in one group of bands: −0.2
/// where the material has a fifth less. `None` where there is no sample, or the samples have no light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IncidenceLight {
    /// Polar angle of the incidence in degrees; `None` for all incidences together, or without any.
    pub theta_i: Option<f64>,
    /// Azimuth of the incidence in degrees; `None` for isotropic data.
    pub phi_i: Option<f64>,
    /// First and last wavelength in nm; `None` without wavelengths.
    pub wavelengths: Option<[f64; 2]>,
    /// First and last channel of the group, from 0.
    pub channels: [usize; 2],
    /// Values that were compared, rejected ones included.
    pub values: u64,
    /// Sum of the samples but for rejected ones that lie alone, the mean over the channels.
    pub light: f64,
    /// Whether samples weigh by the areas that they stand for, so that over a whole hemisphere `light` is the directional
    /// albedo, or the flux: not in a plane of incidence, nor where each sample has its own incidence.
    pub by_area: bool,
    /// Difference at the samples that were not rejected.
    pub kept: Option<f64>,
    /// Difference with the rejected samples that lie together.
    pub together: Option<f64>,
    /// Difference with all rejected samples.
    pub all: Option<f64>,
    /// Standard error of `together` by the noise of the samples; 0 where the noise is unknown.
    pub noise: f64,
}

/// Differences of the light that are the largest by magnitude over all incidences and groups of bands, as in
/// [`IncidenceLight`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SampleLight {
    /// At the samples that were not rejected.
    pub kept: Option<f64>,
    /// With the rejected samples that lie together.
    pub together: Option<f64>,
    /// With all rejected samples.
    pub all: Option<f64>,
}

/// Sums of the material and of the samples.
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

/// What becomes of a value in the sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Kept,
    Together,
    Alone,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    classes: [Pair; 3],
    /// Of the samples that are not alone, for a relative noise of 1.
    variance: f64,
}

/// Sums in the making, for samples that come in pieces in order.
pub(super) struct LightSums {
    /// The incidence and the weight of each sample.
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

    /// Adds the values of the samples from `from` on, `[sample, wavelength]`; `rejected` are the places of rejected ones,
    /// increasing, and whether they lie together.
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
                    // Noise of neighbouring bands may be common to them.
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

    /// The channels of a group: about as many in each.
    fn channels(&self, group: usize) -> std::ops::Range<usize> {
        group * self.width / self.groups..(group + 1) * self.width / self.groups
    }

    /// The differences, for samples of this relative noise; `spectral` is the axis of the channels.
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
    /// The largest of `lights`.
    pub(super) fn of(lights: &[IncidenceLight]) -> Self {
        let largest = |of: fn(&IncidenceLight) -> Option<f64>| {
            lights.iter().filter_map(of).reduce(|most, next| if next.abs() > most.abs() { next } else { most })
        };
        Self { kept: largest(|l| l.kept), together: largest(|l| l.together), all: largest(|l| l.all) }
    }
}

/// Whether the difference is large, and not by chance.
fn is_off(light: &IncidenceLight) -> bool {
    light.together.is_some_and(|off| off.abs() > LIGHT && off.abs() > STANDARD_ERRORS * light.noise)
}

/// A warning of a material whose light differs by more than 3 % from that of its samples, and by more than their noise explains;
/// or else of a lobe that these `lobe` values show, and no sum can, since none of them is near its peak.
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

/// A warning of the incidence under which the light of the material differs most from that of its samples.
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

/// A warning of samples that send out more light than falls on them, for quantities that have an albedo.
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
