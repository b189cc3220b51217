//! The header chunk: what a material is, how it was made, and the errors of its decoded bytes.
//!
//! ```text
//! u8      quantity, unit, sampling (codes in the order of their lists in `domain`)
//! axes    as in `codec`'s axes
//! u8      policy: 0 rate–distortion, 1 conventional, 2 lossless, 3 generic, 4 adaptive
//! not policy 2: varint a transform for each axis: 0 identity, 1 bio-Haar, 2 orthonormal by area, 3 orthonormal by count,
//!               4 the data's own basis in the basis chunk (policy 0, last axis only),
//!               5 the pyramid of the pyramid chunk (policy 0, last triangle axis only; other axes are then identities),
//!               16 + the number of a basis on a line, followed by u8 its boundary rule
//! policy 0:     f32 step; f32 correction step, 0 if there is no corrections chunk
//! u8      1 if there is a classes chunk, else 0 (every sample is positive or, other than in policy 0, measured)
//! f32     absolute floor, 0 if none was declared
//! varint  coefficients that are not zero (absent in policy 2)
//! f32     er(L1), er(L2), largest relative error, relative RMSE, largest absolute error, the same of unscored samples;
//!         each rounded up
//! varint  scored, zero, negative, below-floor and masked samples
//! ```

use super::{Policy, Summary, basis_of};
use crate::codec::{CodecError, Reader, Writer, read_axes, write_axes};
use crate::domain::{Axis, ErrorReport, Quantity, Sampling, Unit};
use crate::transform::{AxisTransform, Boundary, LineBasis, SphereBasis, Weights};

/// Everything in the header chunk.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Header {
    pub(crate) quantity: Quantity,
    pub(crate) unit: Unit,
    pub(crate) sampling: Sampling,
    pub(crate) axes: Vec<Axis>,
    pub(crate) policy: Policy,
    /// One for each axis; empty for lossless.
    pub(crate) transforms: Vec<AxisTransform>,
    /// Whether the last axis is in the basis of the basis chunk; its transform is then the identity.
    pub(crate) klt: bool,
    /// Whether the last triangle axis is predicted; all transforms are then identities.
    pub(crate) predicted: bool,
    pub(crate) step: f32,
    pub(crate) correction_step: f32,
    pub(crate) has_classes: bool,
    pub(crate) floor: f32,
    pub(crate) kept: u64,
    pub(crate) errors: ErrorReport,
}

const FIXED: [(u64, AxisTransform); 4] = [
    (0, AxisTransform::Identity),
    (1, AxisTransform::Sphere(SphereBasis::BioHaar)),
    (2, AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Area))),
    (3, AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count))),
];

/// The code of the data's own basis.
const KLT: u64 = 4;
/// The code of a predicted pyramid.
const PYRAMID: u64 = 5;
/// The code of basis 0 on a line.
const FIRST_LINE: u64 = 16;

fn write_transform(w: &mut Writer, transform: AxisTransform) {
    if let AxisTransform::Line { basis, boundary } = transform {
        w.varint(FIRST_LINE + u64::from(basis.code()));
        w.u8(boundary.code());
    } else {
        w.varint(FIXED.iter().find(|(_, known)| *known == transform).map_or(0, |(code, _)| *code));
    }
}

/// One transform for each axis.
#[derive(Default)]
struct Transforms {
    all: Vec<AxisTransform>,
    /// Whether the last is the data's own basis.
    klt: bool,
    /// Whether the last triangles are predicted.
    predicted: bool,
}

fn read_transforms(r: &mut Reader<'_>, axes: &[Axis], policy: Policy) -> Result<Transforms, CodecError> {
    let mut transforms = Transforms::default();
    if policy == Policy::Lossless {
        return Ok(transforms);
    }
    for axis in 0..axes.len() {
        let mut ahead = r.clone();
        let code = ahead.varint("transform")?;
        let klt = policy == Policy::Rd && axis + 1 == axes.len() && code == KLT;
        let predicted = policy == Policy::Rd && last_triangles(axes) == Some(axis) && code == PYRAMID;
        transforms.klt |= klt;
        transforms.predicted |= predicted;
        if klt || predicted {
            *r = ahead;
            transforms.all.push(AxisTransform::Identity);
        } else {
            transforms.all.push(read_transform(r)?);
        }
    }
    if transforms.predicted && transforms.all.iter().any(|t| *t != AxisTransform::Identity) {
        return Err(r.malformed("a transform beside a predicted pyramid"));
    }
    Ok(transforms)
}

fn last_triangles(axes: &[Axis]) -> Option<usize> {
    axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))
}

fn read_transform(r: &mut Reader<'_>) -> Result<AxisTransform, CodecError> {
    let code = r.varint("transform")?;
    if let Some((_, transform)) = FIXED.iter().find(|(known, _)| *known == code) {
        return Ok(*transform);
    }
    let number = code.checked_sub(FIRST_LINE).and_then(|number| u16::try_from(number).ok());
    let Some(basis) = number.and_then(LineBasis::from_code) else {
        return Err(r.malformed(format!("transform {code} is unknown")));
    };
    let rule = r.u8("boundary rule")?;
    let boundary = Boundary::from_code(rule).ok_or_else(|| r.malformed(format!("boundary rule {rule} is unknown")))?;
    Ok(AxisTransform::Line { basis, boundary })
}

impl Header {
    pub(crate) fn write(&self) -> Vec<u8> {
        let mut w = Writer::default();
        w.u8(self.quantity.code());
        w.u8(self.unit.code());
        w.u8(self.sampling.code());
        write_axes(&mut w, &self.axes);
        w.u8(self.policy.code());
        for (axis, &transform) in self.transforms.iter().enumerate() {
            if self.klt && axis + 1 == self.transforms.len() {
                w.varint(KLT);
            } else if self.predicted && last_triangles(&self.axes) == Some(axis) {
                w.varint(PYRAMID);
            } else {
                write_transform(&mut w, transform);
            }
        }
        if self.policy == Policy::Rd {
            w.f32(self.step);
            w.f32(self.correction_step);
        }
        w.u8(u8::from(self.has_classes));
        w.f32(self.floor);
        if self.policy != Policy::Lossless {
            w.varint(self.kept);
        }
        let e = &self.errors;
        for error in [
            e.er_l1,
            e.er_l2,
            e.max_relative_error,
            e.relative_rmse,
            e.max_absolute_error,
            e.max_absolute_error_unscored,
        ] {
            w.f32(rounded_up(error));
        }
        for count in [e.scored_samples, e.zero_samples, e.negative_samples, e.below_floor_samples, e.masked_samples] {
            w.varint(count);
        }
        w.into_bytes()
    }

    pub(crate) fn read(r: &mut Reader<'_>) -> Result<Self, CodecError> {
        fn coded<T>(r: &mut Reader<'_>, what: &'static str, known: fn(u8) -> Option<T>) -> Result<T, CodecError> {
            let code = r.u8(what)?;
            known(code).ok_or_else(|| r.malformed(format!("{what} {code} is unknown")))
        }
        let quantity = coded(r, "quantity", Quantity::from_code)?;
        let unit = coded(r, "unit", Unit::from_code)?;
        let sampling = coded(r, "sampling", Sampling::from_code)?;
        let axes = read_axes(r)?;
        let policy = coded(r, "policy", Policy::from_code)?;
        let Transforms { all: transforms, klt, predicted } = read_transforms(r, &axes, policy)?;
        let (step, correction_step) = match policy {
            Policy::Rd => (r.f32("step")?, r.f32("correction step")?),
            _ => (0.0, 0.0),
        };
        let has_classes = coded(r, "classes flag", |flag| (flag < 2).then_some(flag == 1))?;
        let floor = r.f32("floor")?;
        let kept = if policy == Policy::Lossless { 0 } else { r.varint("kept coefficients")? };
        let mut error = |what| r.f32(what).map(f64::from);
        let mut errors = ErrorReport {
            er_l1: error("er(L1)")?,
            er_l2: error("er(L2)")?,
            max_relative_error: error("largest relative error")?,
            relative_rmse: error("relative RMSE")?,
            max_absolute_error: error("largest absolute error")?,
            max_absolute_error_unscored: error("largest absolute error of unscored samples")?,
            ..ErrorReport::default()
        };
        errors.scored_samples = r.varint("scored samples")?;
        errors.zero_samples = r.varint("zero samples")?;
        errors.negative_samples = r.varint("negative samples")?;
        errors.below_floor_samples = r.varint("samples below the floor")?;
        errors.masked_samples = r.varint("masked samples")?;
        r.end("header")?;
        // The limit on the product of the axes holds before anything is decoded.
        errors.samples = crate::domain::check_axes(&axes).map_err(|e| r.malformed(e.to_string()))? as u64;
        crate::domain::Layout::of(quantity, &axes).map_err(|e| r.malformed(e.to_string()))?;
        Ok(Self {
            quantity,
            unit,
            sampling,
            axes,
            policy,
            transforms,
            klt,
            predicted,
            step,
            correction_step,
            has_classes,
            floor,
            kept,
            errors,
        })
    }

    /// The header as its users see it.
    pub(crate) fn summary(&self, metadata: Option<String>) -> Summary {
        Summary {
            quantity: self.quantity,
            unit: self.unit,
            sampling: self.sampling,
            axes: self.axes.clone(),
            policy: self.policy,
            basis: basis_of(&self.axes, &self.transforms, self.klt),
            kept_coefficients: (self.policy != Policy::Lossless).then_some(self.kept),
            floor: f64::from(self.floor),
            errors: self.errors,
            metadata,
        }
    }
}

/// The smallest f32 that is not below `error`.
fn rounded_up(error: f64) -> f32 {
    let nearest = error.min(f64::from(f32::MAX)) as f32;
    if f64::from(nearest) < error { nearest.next_up().min(f32::MAX) } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn errors_are_never_rounded_down() {
        for error in [0.0, 1e-3, 0.01, 1.0 / 3.0, 1e-30, 12_345.678_9] {
            let up = f64::from(rounded_up(error));
            assert!(up >= error && up <= error * (1.0 + 2e-7) + 1e-44);
        }
        assert_eq!(rounded_up(f64::MAX), f32::MAX);
    }

    #[test]
    fn every_transform_is_read_as_it_was_written() {
        let lines = LineBasis::all()
            .flat_map(|basis| Boundary::ALL.iter().map(move |&boundary| AxisTransform::Line { basis, boundary }));
        for transform in FIXED.into_iter().map(|(_, transform)| transform).chain(lines) {
            let mut w = Writer::default();
            write_transform(&mut w, transform);
            assert_eq!(read_transform(&mut Reader::new(&w.into_bytes(), 0)), Ok(transform));
        }
        for bytes in [[9, 0], [16, 5]] {
            assert!(matches!(read_transform(&mut Reader::new(&bytes, 0)), Err(CodecError::Malformed { .. })));
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_header_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..120)) {
            let _ = Header::read(&mut Reader::new(&bytes, 0));
        }
    }
}
