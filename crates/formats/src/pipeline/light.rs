//! Conservation of light (directional albedo, flux) on angle grids: corrected if cheap, otherwise a warning.

use crate::compress::{self, CompressError, Compressed, LightReport, Numbers, Policy, Settings, Target};
use crate::domain::{Axis, Measurement, Note, Progress};
use crate::evaluate::measured_share;
use crate::notes::MaterialNote;

/// Largest relative error of the directional albedo or flux at one incoming direction without correction or warning:
/// 0.03 is 3 %. Raising it tolerates larger errors.
const LIGHT: f64 = 0.03;
/// Largest relative growth of the file at which the directional albedo or flux is corrected without being requested:
/// 0.02 is 2 %. Raising it corrects more files.
const COST: f64 = 0.02;

/// Number of samples from which corrections are tried at the quantiser step of the file without them, before the step
/// is searched again. Raising it searches more measurements in vain.
const MANY: usize = 1 << 18;
/// Relative growth of the file, and multiple of its er(L2), in that trial from which no search follows: it would find
/// no file that grows by at most [`COST`]. Raising them searches more often in vain.
const HOPELESS: f64 = 0.1;
const HOPELESS_ERROR: f64 = 2.0;

/// Compresses a measurement; `stated` are the numbers of its file and the factor that makes them samples. If the albedo
/// or flux of an angle grid is off by more than [`LIGHT`], compresses again with corrections of it. Keeps these if they
/// add at most [`COST`] to the size.
pub(super) fn compress(
    measurement: &Measurement,
    stated: Option<Numbers<'_>>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let compressed = compress::compress_numbers(measurement, stated, settings, progress)?;
    let is_off = is_on_grid(measurement.tensor.axes()) && compressed.light.is_some_and(|light| light.largest > LIGHT);
    let is_free =
        settings.albedo_error.is_none() && settings.policy == Policy::Rd && settings.target != Target::Lossless;
    let is_whole = || measured_share(measurement, None).is_none_or(|share| share.is_whole());
    if !(is_off && is_free && is_whole()) {
        return Ok(compressed);
    }
    let compressed = compressed.without_samples();
    let bounded = Settings { albedo_error: Some(LIGHT), ..settings.clone() };
    if let Some(step) = compressed.summary.step.filter(|_| measurement.tensor.len() >= MANY) {
        let at_once = Settings { target: Target::Step(step), ..bounded.clone() };
        let is_hopeless = |tried: &Compressed| {
            let (growth, size) = (1.0 + HOPELESS, compressed.bytes.len() as f64);
            let [found, before] = [tried, &compressed].map(|file| file.summary.errors.er_l2);
            tried.bytes.len() as f64 > growth * size || found > HOPELESS_ERROR * before
        };
        match compress::compress(measurement, &at_once, progress) {
            Err(CompressError::Cancelled(cancelled)) => return Err(CompressError::Cancelled(cancelled)),
            Ok(tried) if is_hopeless(&tried) => return Ok(compressed),
            _ => {}
        }
    }
    match compress::compress(measurement, &bounded, progress) {
        Ok(kept) if kept.bytes.len() as f64 <= (1.0 + COST) * compressed.bytes.len() as f64 => Ok(kept),
        Err(CompressError::Cancelled(cancelled)) => Err(CompressError::Cancelled(cancelled)),
        // Corrections do not fit the target: keep the file without them.
        _ => Ok(compressed),
    }
}

/// Returns a warning if the directional albedo or flux on a grid of angles is off by more than [`LIGHT`].
pub(super) fn warning(axes: &[Axis], light: Option<&LightReport>) -> Option<Note> {
    let largest = light.filter(|light| is_on_grid(axes) && light.largest > LIGHT)?.largest;
    Some(MaterialNote::LightOff { largest_percent: 100.0 * largest, bound: LIGHT }.into())
}

fn is_on_grid(axes: &[Axis]) -> bool {
    axes.iter().any(|axis| matches!(axis, Axis::Grid(_)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Azimuths, DirectionGrid, Frame};

    #[test]
    fn only_light_that_is_far_off_on_a_grid_is_warned_of() {
        let light = |largest| LightReport { largest, rms: 0.5 * largest, brightest: 0.7 };
        let azimuths: Option<Azimuths> = None;
        let grid = Axis::Grid(DirectionGrid::new(Frame::Surface, vec![0.0, 30.0, 60.0], azimuths).unwrap());
        assert_eq!(warning(&[], Some(&light(0.05))), None);
        let axes = [grid];
        assert_eq!((warning(&axes, None), warning(&axes, Some(&light(0.029)))), (None, None));
        let message = warning(&axes, Some(&light(0.05))).unwrap().message;
        assert!(message.contains("is 5.0 % off") && message.contains("albedo_error 0.03"), "{message}");
    }
}
