//! Optional clean-up of samples before a material is used: clamps negative samples, normalises phase functions.

use crate::compress;
use crate::domain::{Axis, Measurement, Quantity, Tensor, TriangleMesh};
use crate::evaluate::error::{EvaluateError, Need, QueryError, unfit};
use crate::evaluate::material::Material;
use serde::Serialize;

/// Changes to make to the samples of a measurement before use; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Preparation {
    /// Sets samples below 0, which are noise around zero light, to 0. Spectra, albedo, reflectance and reports then
    /// have no negative values. Sampling takes negative means over wavelengths as 0 in any case.
    pub clamp: bool,
    /// Divides every sample of a phase function by the function's integral over the sphere, for each incoming direction
    /// and wavelength, after clamping. Masked directions count as 0.
    pub normalise: bool,
}

/// Record of the changes made to the samples of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Prepared {
    /// Number of samples that were below 0 and were set to 0.
    pub clamped: u64,
    /// Most negative value among the samples that were set to 0, before the change; 0 if no sample was set.
    pub most_negative: f32,
    /// Number of integrals of a phase function scaled to 1: one for each sampled incoming direction and wavelength.
    pub normalised: u64,
    /// Number of integrals of a phase function left unchanged because they are not positive.
    pub not_normalised: u64,
    /// Least and largest integral of a phase function before normalisation.
    pub integrals: Option<(f64, f64)>,
}

impl Preparation {
    /// Returns the measurement with the chosen changes to its samples, and a record of the changes: negative samples
    /// are set to 0, phase functions are scaled to the integral 1, or both. Scaling fails for anything but a phase
    /// function over triangles.
    pub fn of(self, measurement: Measurement) -> Result<(Measurement, Prepared), EvaluateError> {
        let mut done = Prepared::default();
        if !self.clamp && !self.normalise {
            return Ok((measurement, done));
        }
        let axes = measurement.tensor.axes().to_vec();
        let mut mesh_and_lambdas = None;
        if self.normalise {
            mesh_and_lambdas = Some(sphere(&measurement)?);
        }
        let Measurement { quantity, unit, sampling, tensor } = measurement;
        let mut samples = tensor.into_samples();
        if self.clamp {
            for sample in samples.iter_mut().filter(|s| **s < 0.0) {
                done.clamped += 1;
                done.most_negative = done.most_negative.min(*sample);
                *sample = 0.0;
            }
        }
        if let Some((mesh, lambdas)) = mesh_and_lambdas {
            normalise(&mut samples, mesh, lambdas, &mut done);
        }
        let tensor = Tensor::new(axes, samples)?;
        Ok((Measurement { quantity, unit, sampling, tensor }, done))
    }
}

impl Material {
    /// Opens a compressed material from the bytes of its file, after the changes to its samples that `preparation`
    /// chooses: negative ones set to 0, phase functions scaled to the integral 1, or both. Also returns a record of the
    /// changes.
    pub fn open_prepared(bytes: &[u8], preparation: Preparation) -> Result<(Self, Prepared), EvaluateError> {
        let mut decoded = compress::decode(bytes)?;
        let (measurement, prepared) = preparation.of(decoded.measurement)?;
        decoded.measurement = measurement;
        Ok((Self::decoded(decoded)?, prepared))
    }

    /// Opens a measurement as a material, after the changes to its samples that `preparation` chooses: negative ones
    /// set to 0, phase functions scaled to the integral 1, or both. Also returns a record of the changes.
    pub fn of_prepared(measurement: Measurement, preparation: Preparation) -> Result<(Self, Prepared), EvaluateError> {
        let (measurement, prepared) = preparation.of(measurement)?;
        Ok((Self::of(measurement)?, prepared))
    }
}

/// Mesh of the outgoing directions of a phase function, and its number of samples in a spectrum.
fn sphere(measurement: &Measurement) -> Result<(TriangleMesh, usize), EvaluateError> {
    let quantity = measurement.quantity;
    if quantity != Quantity::Phase {
        return unfit(QueryError::NotNormalised { quantity });
    }
    let axes = measurement.tensor.axes();
    let layout = measurement.layout()?;
    match layout.outgoing.map(|axis| &axes[axis]) {
        Some(Axis::Triangles(mesh)) => Ok((*mesh, layout.spectral.map_or(1, |axis| axes[axis].len()))),
        _ => unfit(QueryError::NoOutgoing { need: Need::Normalisation, quantity }),
    }
}

fn normalise(samples: &mut [f32], mesh: TriangleMesh, lambdas: usize, done: &mut Prepared) {
    let measures = mesh.solid_angles();
    for block in samples.chunks_exact_mut(mesh.len() * lambdas) {
        let mut integrals = vec![0.0_f64; lambdas];
        for (spectrum, measure) in block.chunks_exact(lambdas).zip(&measures) {
            for (integral, &sample) in integrals.iter_mut().zip(spectrum).filter(|(_, sample)| !sample.is_nan()) {
                *integral += measure * f64::from(sample);
            }
        }
        for &integral in &integrals {
            if integral > 0.0 {
                done.normalised += 1;
                let (least, largest) = done.integrals.unwrap_or((integral, integral));
                done.integrals = Some((least.min(integral), largest.max(integral)));
            } else {
                done.not_normalised += 1;
            }
        }
        for spectrum in block.chunks_exact_mut(lambdas) {
            for (sample, integral) in spectrum.iter_mut().zip(&integrals).filter(|(_, integral)| **integral > 0.0) {
                *sample = (f64::from(*sample) / integral) as f32;
            }
        }
    }
}
