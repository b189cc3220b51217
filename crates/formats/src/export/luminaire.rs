//! Export of luminaires as LM-63 and EULUMDAT: in candela if the light is visible, else in the material's unit summed
//! over all wavelengths.

use super::error::{ExportError, UnfitError};
use super::exported::{Exported, Summary};
use super::lamp_errors::LampErrors;
use super::measure::{Draws, measure};
use super::options::{ExportOptions, check_size};
use super::subject::{Subject, entry, wavelengths};
use super::writer::{Write, Writer};
use super::{read_back, resolution};
use crate::domain::{Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame};
use crate::evaluate::{Interpolation, Material, Photometry};
use crate::formats::{
    self, AngleGrid, CPlanes, FormatError, FormatErrorKind, Interpretation, Samples, flux_of_planes, write_eulumdat,
    write_lm63,
};
use rayon::prelude::*;

/// Writer of LM-63 files.
pub(super) const LM63: Writer = Writer {
    name: "lm63",
    other_names: &["lm-63", "ies"],
    description: "IES LM-63-2002: a luminaire",
    extension: "ies",
    media_type: "text/plain",
    holds: "a luminaire (edf) of one value, or a density over wavelength, by direction",
    fits: |material| material.photometry().is_some(),
    whole: None,
    options: &[("step", "degrees between angles")],
    write: Write::Entry(lm63),
};

/// Writer of EULUMDAT files.
pub(super) const EULUMDAT: Writer = Writer {
    name: "eulumdat",
    other_names: &["ldt"],
    description: "EULUMDAT: a luminaire in candela",
    extension: "ldt",
    media_type: "text/plain",
    holds: "a luminaire (edf) in cd, cd/klm or visible watts by wavelength",
    fits: |material| material.photometry().is_some_and(|photometry| photometry.is_luminous()),
    whole: None,
    options: &[("step", "degrees between angles")],
    write: Write::Entry(eulumdat),
};

/// Describes the spectrum that a luminaire file cannot hold; `None` if the material has no spectrum.
fn lost(material: &Material, photometry: &Photometry) -> Option<String> {
    wavelengths(material).map(|grid| lost_spectrum(grid.len(), photometry))
}

/// Describes a spectrum of `count` wavelengths that a luminaire file cannot hold, and what is left of it.
pub(crate) fn lost_spectrum(count: usize, photometry: &Photometry) -> String {
    let left = if photometry.is_luminous() { "what is seen (683 lm/W, V(lambda))" } else { "the total" };
    format!("the spectrum: of {count} wavelengths, {left} is left")
}

fn lm63(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let (photometry, lamp) = sampled(material, options)?;
    let mut notes = vec![format!("values in {}, written by wavelume", photometry.unit)];
    notes.extend(lost(material, &photometry).map(|lost| format!("lost: {lost}")));
    if let Some(grid) = wavelengths(material) {
        notes.push(format!("the spectra went from {}, samples in {}", grid.in_words(), material.unit()));
    }
    let bytes = write_lm63(&lamp.planes, photometry.unit, &notes)?;
    lamp.exported(material, options, LM63.name, bytes, photometry)
}

fn eulumdat(material: &Material, options: &ExportOptions) -> Result<Exported, ExportError> {
    let (photometry, lamp) = sampled(material, options)?;
    let bytes = write_eulumdat(&lamp.planes, photometry.unit, lamp.flux, "wavelume")?;
    lamp.exported(material, options, EULUMDAT.name, bytes, photometry)
}

/// Intensities of a luminaire on C planes (vertical half planes through the lamp axis), with the flux of the material.
struct Lamp {
    planes: CPlanes,
    filled: usize,
    clipped: usize,
    flux: f64,
}

fn sampled(material: &Material, options: &ExportOptions) -> Result<(Photometry, Lamp), ExportError> {
    let Some(photometry) = material.photometry() else {
        return Err(UnfitError::NoLuminaire.into());
    };
    let subject = Subject::sum(material, options, photometry.weights.clone());
    let (gamma_step, c_step) = resolution::planes(material, options);
    let (low, high) = gamma_range(material);
    let list = |from: f64, to: f64, step: f64, closed: bool| -> Vec<f64> {
        let parts = libm::ceil((to - from) / step - 1e-9).max(1.0) as usize;
        (0..parts + usize::from(closed)).map(|i| from + (to - from) * i as f64 / parts as f64).collect()
    };
    let (gamma, c) = (list(low, high, gamma_step, true), list(0.0, 360.0, c_step, false));
    check_size(Some(12 * gamma.len() * c.len()), options, "ask for a larger step")?;
    let mut values = vec![0.0; gamma.len() * c.len()];
    let counts: Vec<(usize, usize)> = values
        .par_chunks_mut(gamma.len())
        .zip(&c)
        .map(|(plane, &c)| {
            let mut counts = (0, 0);
            for (value, &gamma) in plane.iter_mut().zip(&gamma) {
                let mut found = [0.0];
                // All planes share one direction at the poles.
                let c = if gamma == 0.0 || gamma == 180.0 { 0.0 } else { c };
                subject.at(None, Direction::from_luminaire_degrees(c, gamma), &mut found);
                counts.0 += usize::from(found[0].is_nan());
                counts.1 += usize::from(found[0] < 0.0);
                // NaN becomes 0 as well.
                *value = found[0].max(0.0);
            }
            counts
        })
        .collect();
    let mut flux = vec![0.0; material.lambdas()];
    material.albedo(&entry(material, options), None, Interpolation::Smooth, &mut flux)?;
    let flux = photometry.intensity(&flux);
    let sum = |part: fn(&(usize, usize)) -> usize| counts.iter().map(part).sum();
    let lamp = Lamp {
        planes: CPlanes { gamma, c, values },
        filled: sum(|counts| counts.0),
        clipped: sum(|counts| counts.1),
        flux,
    };
    Ok((photometry, lamp))
}

/// Returns the range of gamma (the angle from nadir) in degrees that the outgoing directions of a luminaire cover.
fn gamma_range(material: &Material) -> (f64, f64) {
    match material.layout().outgoing.map(|axis| &material.axes()[axis]) {
        Some(Axis::Triangles(mesh)) if mesh.domain() == Domain::Lower => (0.0, 90.0),
        Some(Axis::Triangles(mesh)) if mesh.domain() == Domain::Hemisphere => (90.0, 180.0),
        _ => (0.0, 180.0),
    }
}

impl Lamp {
    /// Reads the luminaire file back and measures its error, including that of its flux.
    fn exported(
        self,
        material: &Material,
        options: &ExportOptions,
        format: &'static str,
        bytes: Vec<u8>,
        photometry: Photometry,
    ) -> Result<Exported, ExportError> {
        let grid = grid(&bytes)?;
        let lost = lost(material, &photometry);
        let subject = Subject::sum(material, options, photometry.weights);
        let (low, high) = gamma_range(material);
        // z falls from 1 at zenith to −1 at nadir.
        let z = |gamma: f64| -libm::round(libm::cos(gamma.to_radians())) as i8;
        let error = measure(
            if lost.is_some() { "the intensity over all wavelengths" } else { "the intensity" },
            Draws::Emission { low: z(low), high: z(high) },
            1,
            &|_, wo, values: &mut [f64]| subject.at(None, wo, values),
            &|_, wo, values: &mut [f64]| read_back::evaluate(&grid, None, wo, values),
        );
        let flux_error = (self.flux > 0.0).then(|| flux_of_planes(&grid) / self.flux - 1.0);
        let lamp = lamp_errors(&subject, &grid, (low, high));
        let resolution = format!("{} C planes of {} gamma angles", self.planes.c.len(), self.planes.gamma.len());
        let (unit, lost) = (photometry.unit.to_string(), lost.into_iter().collect());
        let (filled, clipped) = (self.filled, self.clipped);
        Ok(Exported {
            bytes,
            about: Summary { warning: None, format, resolution, unit, lost, filled, clipped, flux_error, lamp, error },
        })
    }
}

/// Steps in degrees between the gamma angles, and between the C planes, at which a luminaire file is compared with the
/// material.
const COMPARED: (f64, f64) = (1.0, 5.0);

/// Returns the photometric errors of a luminaire file against the material, on a grid of angles finer than most
/// measured ones.
fn lamp_errors(subject: &Subject<'_>, file: &AngleGrid, (low, high): (f64, f64)) -> Option<LampErrors> {
    let list = |from: f64, to: f64, step: f64| -> Vec<f64> {
        (0..=((to - from) / step) as usize).map(|i| from + step * i as f64).collect()
    };
    let azimuths = Azimuths { angles: list(0.0, 360.0 - COMPARED.1, COMPARED.1), extent: AzimuthExtent::Circle };
    let directions = DirectionGrid::new(Frame::TypeC, list(low, high, COMPARED.0), Some(azimuths)).ok()?;
    let values: Vec<[f64; 2]> = (0..directions.len())
        .into_par_iter()
        .map(|i| {
            let (gamma, c) = (low + COMPARED.0 * (i / directions.shape()[1]) as f64, i % directions.shape()[1]);
            let direction = Direction::from_luminaire_degrees(COMPARED.1 * c as f64, gamma);
            let (mut stated, mut found) = ([0.0], [0.0]);
            subject.at(None, direction, &mut stated);
            read_back::evaluate(file, None, direction, &mut found);
            [stated[0], found[0]]
        })
        .collect();
    let side = |which: usize| values.iter().map(|pair| pair[which] as f32).collect::<Vec<f32>>();
    LampErrors::of(&directions, &side(0), &side(1))
}

fn grid(bytes: &[u8]) -> Result<AngleGrid, FormatError> {
    let acquisition = formats::read(bytes, &Interpretation::default())?;
    match acquisition.samples {
        Samples::Grid(grid) => Ok(grid),
        _ => Err(FormatError {
            kind: FormatErrorKind::Malformed,
            format: acquisition.format,
            position: None,
            message: "the written file does not read back as a grid of angles, a bug of wavelume".to_owned(),
        }),
    }
}
