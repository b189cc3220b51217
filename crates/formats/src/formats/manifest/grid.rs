//! Assembly of angle axes into a grid: order, ranges, and extent of the azimuths.

use super::entry::{Angle, Entry, Role};
use super::refusal::unfit;
use crate::domain::{Axis, Quantity, Tensor};
use crate::formats::acquisition::{AngleGrid, Angles, Azimuths, Outside, ParseReport};
use crate::formats::azimuth::extended;
use crate::formats::error::FormatError;
use crate::formats::text::Brief;
use crate::notes::ScatteringNote;

/// Combines the angle axes of an array into a grid; they must come in the order of [`Role`].
pub(super) fn assemble(
    quantity: Quantity,
    entries: Vec<Entry>,
    mut values: Vec<f32>,
    report: &mut ParseReport,
) -> Result<AngleGrid, FormatError> {
    let mut lengths: Vec<usize> = entries.iter().map(Entry::len).collect();
    let (mut index, mut spectral, mut angles) = (Vec::new(), None, [const { None::<Angle> }; 4]);
    let mut last = Role::Index;
    for (i, entry) in entries.into_iter().enumerate() {
        let role = match &entry {
            Entry::Angle(angle) => angle.role,
            Entry::Axis(Axis::Index { .. }) => Role::Index,
            Entry::Axis(axis) if axis.is_spectral() => Role::Spectral,
            Entry::Axis(axis) => {
                return Err(unfit(format!(
                    "axis {i}: {} beside angles, expected angles for both directions",
                    axis.describe()
                )));
            }
        };
        if role < last || (role == last && role != Role::Index) {
            return Err(unfit(format!(
                "axis {i}: expected the order index, theta_i, phi_i, theta_o, phi_o, wavelength, each once (transpose the array)"
            )));
        }
        last = role;
        match entry {
            Entry::Angle(angle) => angles[role as usize - 1] = Some(angle),
            Entry::Axis(axis) if role == Role::Index => index.push(axis),
            Entry::Axis(axis) => spectral = Some(axis),
        }
    }
    let [theta_i, phi_i, theta_o, phi_o] = angles;
    let expected = match quantity {
        Quantity::Spectrum => return Err(unfit("axes of angles for a spectrum, expected none")),
        Quantity::Reflectance => (true, false),
        Quantity::Edf => (false, true),
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf | Quantity::Phase => (true, true),
    };
    if (theta_i.is_some(), theta_o.is_some()) != expected {
        let names = match expected {
            (true, true) => "theta_i and theta_o",
            (true, false) => "theta_i alone",
            _ => "theta_o alone",
        };
        return Err(unfit(format!(
            "quantity {quantity} on a grid of angles, expected {names} (with phi where it was measured)"
        )));
    }
    let isotropic = expected == (true, true) && phi_i.is_none();
    // Inner azimuths first: closing them changes the stride of the outer ones.
    let mut kept = None;
    let (phi_o, listed_o) = azimuths(phi_o, isotropic, &mut lengths, (&mut values, &mut kept), report)?;
    let (phi_i, listed_i) = azimuths(phi_i, false, &mut lengths, (&mut values, &mut kept), report)?;
    let theta_range = |theta_o: bool| match (quantity, theta_o) {
        (Quantity::Brdf, _) | (Quantity::Reflectance | Quantity::Btdf | Quantity::Bsdf, false) => (0.0, 90.0),
        (Quantity::Btdf, true) => (90.0, 180.0),
        _ => (0.0, 180.0),
    };
    let incoming = theta_i.map(|theta| polar(theta, phi_i, theta_range(false))).transpose()?;
    let outgoing = theta_o.map(|theta| polar(theta, phi_o, theta_range(true))).transpose()?;
    let mut grid = AngleGrid {
        index,
        incoming,
        outgoing,
        spectral,
        outside: Outside::Masked,
        values: values.into(),
        stated: None,
        sigma: None,
    };
    if let Some(values) = kept {
        let stated = grid.stated_as(values, &[listed_i, listed_o]).map_err(|error| unfit(error.to_string()))?;
        grid.stated = Some(Box::new(stated));
    }
    Ok(grid)
}

/// Divides the values of a BRDF or BTDF at each outgoing angle by its cosine; values at 90 degrees are masked.
pub(super) fn divide_by_cosine(grid: &mut AngleGrid, report: &mut ParseReport) -> Result<(), FormatError> {
    report.note(ScatteringNote::CosineDivided { source: "manifest" });
    let Some(outgoing) = &grid.outgoing else { return Ok(()) };
    let width = grid.spectral.as_ref().map_or(1, Axis::len);
    let inner = outgoing.phi.as_ref().map_or(1, |phi| phi.phi.len()) * width;
    let grazing = divide(&mut grid.values, &outgoing.theta, inner);
    if grazing > 0 {
        report.note(ScatteringNote::GrazingMasked { values: grazing });
    }
    if let Some(stated) = &mut grid.stated {
        let axes = stated.tensor.axes().to_vec();
        let azimuths = axes.iter().rev().find_map(|axis| match axis {
            Axis::Grid(directions) => Some(directions.shape()[1]),
            _ => None,
        });
        let mut values = stated.tensor.samples().to_vec();
        divide(&mut values, &outgoing.theta, azimuths.unwrap_or(1) * width);
        stated.tensor = Tensor::new(axes, values).map_err(|error| unfit(error.to_string()))?;
    }
    Ok(())
}

/// Divides values `[…, theta, inner]` by |cos theta|. Values at a cosine of 0 are masked; returns their number.
fn divide(values: &mut [f32], theta: &[f64], inner: usize) -> usize {
    let mut grazing = 0;
    for (values, theta) in values.chunks_exact_mut(inner).zip(theta.iter().cycle()) {
        let cosine = libm::cos(theta.to_radians()).abs();
        for value in values.iter_mut().filter(|value| !value.is_nan()) {
            let quotient = (f64::from(*value) / cosine) as f32;
            let good = cosine > 1e-9 && quotient.is_finite();
            grazing += usize::from(!good);
            *value = if good { quotient } else { f32::NAN };
        }
    }
    grazing
}

fn polar(theta: Angle, phi: Option<Azimuths>, (low, high): (f64, f64)) -> Result<Angles, FormatError> {
    let Angle { axis, values, .. } = theta;
    let (first, last) = (values[0], values[values.len() - 1]);
    let covers = theta.covers.unwrap_or((first, last));
    if first < low || last > high {
        return Err(unfit(format!(
            "axis {axis}: theta from {first}° to {last}°, expected within {low}° to {high}°",
            first = Brief(first),
            last = Brief(last)
        )));
    }
    if !(low <= covers.0 && covers.0 <= first && last <= covers.1 && covers.1 <= high) {
        return Err(unfit(format!(
            "axis {axis}: covers {}° to {}°, expected a range from {low}° to {high}° around the angles",
            Brief(covers.0),
            Brief(covers.1)
        )));
    }
    Ok(Angles { theta: values, covers, phi })
}

/// Returns the incoming or the outgoing azimuths of a grid. If the last listed azimuth repeats the first one, also
/// returns the original list.
fn azimuths(
    phi: Option<Angle>,
    mirror: bool,
    lengths: &mut [usize],
    (values, kept): (&mut Vec<f32>, &mut Option<Vec<f32>>),
    report: &mut ParseReport,
) -> Result<(Option<Azimuths>, Option<Vec<f64>>), FormatError> {
    let Some(Angle { axis, values: phi, extent, .. }) = phi else { return Ok((None, None)) };
    let inner = lengths[axis + 1..].iter().product();
    let (listed, what) = (phi.clone(), format!("axis {axis}"));
    let azimuths = extended(&what, phi, extent, mirror, (values, inner), kept, report).map_err(unfit)?;
    let is_merged = azimuths.phi.len() < listed.len();
    lengths[axis] = azimuths.phi.len();
    Ok((Some(azimuths), is_merged.then_some(listed)))
}
