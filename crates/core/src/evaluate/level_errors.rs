//! Errors of the coarser levels of a material on a grid of angles, measured by evaluation at the samples of the file.

use super::directions::{Directions, Pairs};
use super::error::EvaluateError;
use super::material::Material;
use super::place::Interpolation;
use crate::compress::{decode_level, levels, with_level_errors};
use crate::domain::{Axis, Direction, Measurement};

/// Relative error assumed for a sample at which a resolution level of the file gives no finite value.
const UNKNOWN: f64 = 1.0;

/// Adds the errors of the coarser resolution levels to a file made from `measurement` by
/// [`compress`](crate::compress::compress). The error of a level is er(L2), the root mean square relative error, at the
/// measured angles. Directions measured several times are compared with their mean. Files without levels on a grid are
/// unchanged.
pub fn state_levels(bytes: Vec<u8>, measurement: &Measurement) -> Result<Vec<u8>, EvaluateError> {
    let levels = levels(&bytes)?;
    let [coarser @ .., _] = levels.as_slice() else { return Ok(bytes) };
    if coarser.is_empty() || !measurement.tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_))) {
        return Ok(bytes);
    }
    let mut stated = None;
    let mut errors = Vec::with_capacity(coarser.len());
    // The finest level comes first: while it is decoded, the material of the measurement does not take memory yet.
    for info in coarser.iter().rev() {
        let decoded = decode_level(&bytes, info.level)?;
        let stated = match &mut stated {
            Some(stated) => stated,
            none => none.insert(Material::of(measurement.clone())?),
        };
        let floor = decoded.summary.floor;
        let level = Material::decoded(decoded)?;
        errors.push(er_l2(stated, &level, measurement, floor)?);
    }
    errors.reverse();
    Ok(with_level_errors(&bytes, &errors)?)
}

/// Root mean square relative error er(L2) of a resolution level at the measured directions.
fn er_l2(stated: &Material, level: &Material, measurement: &Measurement, floor: f64) -> Result<f64, EvaluateError> {
    let axes = measurement.tensor.axes();
    let layout = stated.layout();
    let Some(Axis::Grid(outgoing)) = layout.outgoing.map(|axis| &axes[axis]) else { return Ok(f64::MAX) };
    let wo: Vec<Direction> = (0..outgoing.len()).map(|entry| outgoing.direction(entry)).collect();
    let wi: Vec<Option<Direction>> = match layout.incoming.map(|axis| &axes[axis]) {
        Some(Axis::Elevation(angles)) => {
            angles.iter().map(|&angle| Some(Direction::from_degrees(angle, 0.0))).collect()
        }
        Some(Axis::Grid(grid)) => (0..grid.len()).map(|entry| Some(grid.direction(entry))).collect(),
        _ => vec![None],
    };
    let row = outgoing.len() * stated.lambdas();
    let (mut sum, mut count) = (0.0, 0_u64);
    let [mut means, mut found] = [vec![0.0; row], vec![0.0; row]];
    for (slice, samples) in measurement.tensor.samples().chunks_exact(row).enumerate() {
        let index = stated.index_of(slice / wi.len());
        let directions = wi[slice % wi.len()].map(|wi| vec![wi; wo.len()]);
        let pairs =
            Pairs { index: &index, wi: directions.as_deref().map(Directions::of), wo: Some(Directions::of(&wo)) };
        stated.par_spectra(pairs, Interpolation::Smooth, &mut means)?;
        level.par_spectra(pairs, Interpolation::Smooth, &mut found)?;
        for ((&sample, &mean), &found) in samples.iter().zip(&means).zip(&found) {
            if sample > 0.0 && f64::from(sample) >= floor {
                let error = f64::from(found) / f64::from(mean) - 1.0;
                let error = if error.is_finite() { error } else { UNKNOWN };
                sum += error * error;
                count += 1;
            }
        }
    }
    Ok(if count == 0 { 0.0 } else { libm::sqrt(sum / count as f64) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compress::{Decoded, Policy, Settings, Target, compress, decode};
    use crate::domain::{AzimuthExtent, Azimuths, DirectionGrid, Frame, Quantity, Sampling, Silent, Tensor};
    use crate::evaluate::Place;

    fn every(step: f64, count: usize) -> Vec<f64> {
        (0..count).map(|i| step * i as f64).collect()
    }

    fn grid(frame: Frame, polar: Vec<f64>, angles: Vec<f64>, extent: AzimuthExtent) -> DirectionGrid {
        DirectionGrid::new(frame, polar, Some(Azimuths { angles, extent })).unwrap()
    }

    /// Test measurement of a lobe with noise, zeros and masked samples, under each polar angle of incidence in
    /// `incoming` (degrees); without any, the lobe is that of 20°.
    fn measured(
        quantity: Quantity,
        incoming: Option<Vec<f64>>,
        outgoing: DirectionGrid,
        last: Option<Axis>,
    ) -> Measurement {
        let mut state = 7_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            0.1 * ((state >> 40) as f64 / 16_777_216.0 - 0.5)
        };
        let lambdas = last.as_ref().map_or(1, Axis::len);
        let azimuths = outgoing.shape()[1];
        let mut samples = Vec::new();
        for theta in incoming.as_deref().unwrap_or(&[20.0]) {
            let start = samples.len();
            for entry in 0..outgoing.len() {
                let [x, y, z] = outgoing.direction(entry).xyz();
                let lobe = libm::exp(3.0 * (x * libm::sin(theta.to_radians()) + z.abs()) + 0.3 * y);
                for lambda in 0..lambdas {
                    let value = lobe * (1.0 + 0.2 * lambda as f64) * (1.0 + noise());
                    samples.push(match entry {
                        500..510 => 0.0,
                        // All azimuths at the pole share one value.
                        _ if entry > 0 && entry < azimuths => samples[start + lambda],
                        600..603 => f32::NAN,
                        _ => value as f32,
                    });
                }
            }
        }
        let axes = incoming.map(Axis::Elevation).into_iter().chain([Axis::Grid(outgoing)]).chain(last).collect();
        Measurement::new(quantity, quantity.default_unit(), Sampling::Point, Tensor::new(axes, samples).unwrap())
            .unwrap()
    }

    fn all() -> Vec<Measurement> {
        let half = grid(Frame::Surface, every(4.0, 22), every(12.0, 16), AzimuthExtent::Mirrored);
        let open = grid(Frame::Surface, every(1.5, 60), every(10.0, 33), AzimuthExtent::Sector);
        vec![
            measured(
                Quantity::Edf,
                None,
                grid(Frame::TypeC, every(2.5, 73), every(15.0, 24), AzimuthExtent::Circle),
                None,
            ),
            measured(
                Quantity::Edf,
                None,
                grid(Frame::TypeC, every(1.0, 91), every(2.5, 37), AzimuthExtent::Quadrant),
                None,
            ),
            measured(Quantity::Edf, None, open, None),
            measured(Quantity::Brdf, Some(vec![0.0, 5.0, 20.0, 45.0, 50.0, 75.0]), half, Some(Axis::Rgb)),
        ]
    }

    fn samples(decoded: &Decoded) -> Vec<u32> {
        decoded.measurement.tensor.samples().iter().map(|sample| sample.to_bits()).collect()
    }

    fn direction_pairs(m: &Measurement) -> Vec<(Option<Direction>, Direction)> {
        let axes = m.tensor.axes();
        let Some(Axis::Grid(outgoing)) = axes.iter().find(|axis| matches!(axis, Axis::Grid(_))) else { panic!() };
        let wi = match &axes[0] {
            Axis::Elevation(angles) => angles.iter().map(|&a| Some(Direction::from_degrees(a, 0.0))).collect(),
            _ => vec![None],
        };
        wi.iter().flat_map(|&wi| (0..outgoing.len()).map(move |entry| (wi, outgoing.direction(entry)))).collect()
    }

    #[test]
    fn a_prefix_has_the_error_that_is_stated_of_it() {
        for m in all() {
            let settings =
                Settings { target: Target::ErL2(0.001), metadata: Some("{}".to_owned()), ..Settings::default() };
            let whole = compress(&m, &settings, &Silent).unwrap();
            let bytes = state_levels(whole.bytes.clone(), &m).unwrap();
            assert_eq!(bytes.len(), whole.bytes.len());
            assert_eq!(samples(&decode(&bytes).unwrap()), samples(&decode(&whole.bytes).unwrap()));
            let infos = levels(&bytes).unwrap();
            assert!(infos.len() > 1, "{:?} {infos:?}", m.tensor.shape());
            for (info, next) in infos.iter().zip(&infos[1..]) {
                assert!(next.bytes > info.bytes && info.er_l2 > 0.9 * next.er_l2, "{infos:?}");
                let prefix = &bytes[..info.bytes as usize];
                assert!(decode_level(&prefix[..prefix.len() - 1], info.level).is_err());
                let level = Material::open_level(prefix, info.level).unwrap();
                assert!(level.axes().iter().map(Axis::len).product::<usize>() < m.tensor.len());
                let mut found = vec![0.0; level.lambdas()];
                let (mut sum, mut count) = (0.0, 0.0);
                for ((wi, wo), samples) in direction_pairs(&m).into_iter().zip(m.tensor.samples().chunks(found.len())) {
                    level.evaluate(Place { index: &[], wi, wo: Some(wo) }, Interpolation::Smooth, &mut found).unwrap();
                    for (&found, &sample) in found.iter().zip(samples).filter(|(_, sample)| **sample > 0.0) {
                        assert!(found.is_finite());
                        sum += (f64::from(found) / f64::from(sample) - 1.0).powi(2);
                        count += 1.0;
                    }
                }
                let error = f64::sqrt(sum / count);
                assert!((error / info.er_l2 - 1.0).abs() < 0.01, "{:?} {info:?}: {error}", m.tensor.shape());
            }
        }
    }

    #[test]
    fn sizes_hold_with_levels_and_some_files_have_none() {
        let m = &all()[0];
        for wanted in [900, 1500] {
            let settings = Settings { target: Target::Bytes(wanted), ..Settings::default() };
            let file = compress(m, &settings, &Silent).unwrap();
            assert!(file.bytes.len() as u64 <= wanted && file.bytes.len() as u64 + 30 > wanted, "{}", file.bytes.len());
            let last = levels(&file.bytes).unwrap().len() as u8 - 1;
            assert_eq!(samples(&decode_level(&file.bytes, last).unwrap()), samples(&decode(&file.bytes).unwrap()));
            assert!(decode_level(&file.bytes, last + 1).is_err());
        }
        let lossless = Settings { target: Target::Lossless, policy: Policy::Lossless, ..Settings::default() };
        for settings in [lossless, Settings { target: Target::ErL2(0.5), ..Settings::default() }] {
            let file = compress(m, &settings, &Silent).unwrap();
            assert_eq!(levels(&file.bytes).unwrap().len(), 1);
            assert_eq!(state_levels(file.bytes.clone(), m).unwrap(), file.bytes);
        }
    }
}
