//! Header chunk: quantity, axes, coding parameters, and the errors of the decoded bytes.
//!
//! ```text
//! u8      quantity + 8 · sampling + 16 · number of axes (codes in the order of the lists in `domain`)
//! u8      unit + 32 · policy: 0 rate–distortion, 1 conventional, 2 lossless, 3 generic, 4 adaptive
//! varint  flags, the sum of: 1 the last axis is in the data's own basis, in the basis chunk (policy 0);
//!         2 the last triangles are the pyramid of the pyramid chunk (policy 0; there is no coefficients chunk then);
//!         4 there is a classes chunk (else every sample is positive or, other than in policy 0, measured);
//!         8 a floor was declared; 16 there is a corrections chunk (policy 0); 32 unscored samples have errors;
//!         64 not every sample is scored; 128 samples themselves are approximated, not logarithms (policy 0);
//!         256 there is a light chunk (policy 0, not flag 128);
//!         512 the last directions are the grid of the grid chunk (policy 0, not flag 2; there is no coefficients
//!         chunk then);
//!         1024 functions between stated directions have a share of straight lines (the last directions are a grid);
//!         2048 the grid chunk states coarser levels (flag 512);
//!         4096 samples are a factor times the numbers of the exact chunk (policy 2);
//!         8192 there is an interpolation chunk (an axis of incoming directions);
//!         16384 there is a lobe chunk (a BRDF over triangles);
//!         32768 there is a wide classes chunk (the last directions are a grid; not flag 4)
//! axes    as in `codec`'s axes
//! flag 1024: u8 the share of straight lines in 255ths, 1 … 255
//! not policy 2, not flags 2, 512: varint a transform for each axis (flag 1: but the last):
//!               0 identity, 1 bio-Haar, 2 orthonormal by area, 3 orthonormal by count,
//!               16 + the number of a basis on a line, followed by u8 its boundary rule
//! flags 2, 2048: varint  length of the pyramid or grid chunk: without it a flipped bit in that chunk's own length
//!               could make a whole file the prefix of another one
//! policy 0:     u16 step: the high 16 bits of an f32;  flag 256: f32 step of the light;
//!               flag 16: f32 correction step
//! flag 8: f32   absolute floor
//! flag 4096: f64  factor of the exact samples (policy 2)
//! not policy 2: varint  coefficients that are not zero
//! not policy 2: u24 er(L1), er(L2), largest relative error, relative RMSE, largest absolute error, flag 32: largest
//!               absolute error of unscored samples; each the high 24 bits of an f32, rounded up
//! flag 64: varint  zero, negative, below-floor and masked samples; all others are scored
//! ```

use super::between::{Between, Divisor};
use super::metadata_chunk::metadata_kind;
use super::policy::Policy;
use super::rd::gridded::{Around, Shape as GridShape};
use super::settings::Settings;
use super::spectral_basis::basis_of;
use super::stated::{read_error, write_error};
use super::summary::Summary;
use super::transform_code::{read_transform, write_transform};
use super::values::Values;
use crate::codec::{Announced, ChunkKind, Class, CodecError, Reader, Writer, read_axes, write_axes};
use crate::domain::{Axis, ErrorReport, Lobe, Measurement, Quantity, Sampling, Unit};
use crate::transform::{AxisTransform, Plan};

/// Content of a file's header chunk.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools, reason = "each is a flag of the file")]
pub(crate) struct Header {
    pub(crate) quantity: Quantity,
    pub(crate) unit: Unit,
    pub(crate) sampling: Sampling,
    pub(crate) axes: Vec<Axis>,
    pub(crate) policy: Policy,
    /// Transform of each axis: identities if triangles or grids are coded by prediction; empty for lossless files.
    pub(crate) transforms: Vec<AxisTransform>,
    /// True if the last axis is in principal components of the data, stored in the basis chunk; its transform is then
    /// the identity.
    pub(crate) klt: bool,
    /// True if samples on the last triangle axis are coded as means over triangles: finer ones are predicted from
    /// coarser ones, and only the residuals coded. The axis transforms in `transforms` are then all the identity.
    pub(crate) predicted: bool,
    /// True if the last axis of directions is a grid of angles whose samples are predicted from neighbouring angles,
    /// and only the residuals coded. The axis transforms in `transforms` are then all the identity.
    pub(crate) gridded: bool,
    /// Share of straight lines in the interpolation between measured directions, in 255ths; the rest is cubics of
    /// logarithms.
    pub(crate) straight_lines: u8,
    /// Interpolation between incoming directions; its parameters come from the interpolation chunk.
    pub(crate) between: Option<Between>,
    /// True if the file has a chunk with an analytic lobe, which is added to the samples.
    pub(crate) has_lobe: bool,
    /// Analytic lobe that is added to the samples; `None` until its chunk is read.
    pub(crate) lobe: Option<Lobe>,
    /// True if the chunk of samples on a grid of angles lists coarser resolution levels.
    pub(crate) grid_levels: bool,
    /// Payload length in bytes of the chunk that codes samples on triangles by prediction, or samples on a grid of
    /// angles with coarser levels; 0 without such a chunk.
    pub(crate) pyramid_length: usize,
    /// True if the samples themselves are coded, false if their logarithms are.
    pub(crate) linear: bool,
    pub(crate) step: f32,
    /// Quantiser step of the corrections that keep the total light (albedo or flux), in natural logarithms; 0 without
    /// corrections. If it is negative, its magnitude is the step, and each correction applies either to the negative
    /// samples alone or to all others.
    pub(crate) light_step: f32,
    pub(crate) correction_step: f32,
    /// Kind of the chunk of the samples' classes (positive, negative, zero, masked); `None` if all are positive.
    pub(crate) classes: Option<ChunkKind>,
    pub(crate) floor: f32,
    /// Common factor of a lossless file: each sample is this factor times the number that the file stores for it; 1
    /// without a factor.
    pub(crate) factor: f64,
    pub(crate) kept: u64,
    pub(crate) errors: ErrorReport,
}

/// Bit set of a file's optional properties and chunks, listed in the description of the format.
struct Flags(u16);

impl Flags {
    const KLT: u16 = 1;
    const PREDICTED: u16 = 2;
    const CLASSES: u16 = 4;
    const FLOOR: u16 = 8;
    const CORRECTIONS: u16 = 16;
    const UNSCORED_ERROR: u16 = 32;
    const COUNTS: u16 = 64;
    const LINEAR: u16 = 128;
    const LIGHT: u16 = 256;
    const GRIDDED: u16 = 512;
    const STRAIGHT: u16 = 1024;
    const LEVELS: u16 = 2048;
    const FACTOR: u16 = 4096;
    const BETWEEN: u16 = 8192;
    const LOBE: u16 = 16_384;
    const WIDE_CLASSES: u16 = 32_768;
    const ALL: u16 = u16::MAX;

    fn of(header: &Header) -> Self {
        let e = &header.errors;
        let left_out = e.zero_samples + e.negative_samples + e.below_floor_samples + e.masked_samples;
        let flags = [
            (Self::KLT, header.klt),
            (Self::PREDICTED, header.predicted),
            (Self::CLASSES, header.classes == Some(ChunkKind::Classes)),
            (Self::FLOOR, header.floor != 0.0),
            (Self::CORRECTIONS, header.correction_step != 0.0),
            (Self::UNSCORED_ERROR, header.policy != Policy::Lossless && e.max_absolute_error_unscored != 0.0),
            (Self::COUNTS, left_out > 0),
            (Self::LINEAR, header.linear),
            (Self::LIGHT, header.light_step != 0.0),
            (Self::GRIDDED, header.gridded),
            (Self::STRAIGHT, header.straight_lines > 0),
            (Self::LEVELS, header.grid_levels),
            (Self::FACTOR, header.factor != 1.0),
            (Self::BETWEEN, header.between.is_some()),
            (Self::LOBE, header.has_lobe),
            (Self::WIDE_CLASSES, header.classes == Some(ChunkKind::WideClasses)),
        ];
        Self(flags.into_iter().filter(|(_, set)| *set).map(|(flag, _)| flag).sum())
    }

    fn has(&self, flag: u16) -> bool {
        self.0 & flag != 0
    }

    /// Rejects header flags that contradict the compression policy (method of choosing and coding coefficients) or the
    /// axes that the header states.
    fn check(&self, r: &Reader<'_>, policy: Policy, axes: &[Axis]) -> Result<(), CodecError> {
        let of_rd =
            Self::KLT | Self::PREDICTED | Self::CORRECTIONS | Self::LINEAR | Self::LIGHT | Self::GRIDDED | Self::LEVELS;
        let allowed = match policy {
            Policy::Rd => Self::ALL & !Self::FACTOR,
            Policy::Lossless => Self::ALL & !(of_rd | Self::UNSCORED_ERROR),
            _ => Self::ALL & !(of_rd | Self::FACTOR),
        };
        if self.0 & !allowed != 0 {
            return Err(r.malformed(format!("the header flags {:#04x} contradict compression policy {policy}", self.0)));
        }
        if self.has(Self::PREDICTED) && !axes.iter().any(|axis| matches!(axis, Axis::Triangles(_))) {
            return Err(r.malformed("the header announces a pyramid chunk, but no axis of triangles"));
        }
        if self.has(Self::GRIDDED) && (self.has(Self::PREDICTED) || GridShape::of(axes).is_none()) {
            return Err(
                r.malformed("the header announces a grid chunk, but no grid of angles, or a pyramid chunk as well")
            );
        }
        if self.has(Self::WIDE_CLASSES) && (self.has(Self::CLASSES) || GridShape::of(axes).is_none()) {
            return Err(r.malformed(
                "the header announces a wide classes chunk, but no grid of angles, or a classes chunk as well",
            ));
        }
        if self.has(Self::LEVELS) && !self.has(Self::GRIDDED) {
            return Err(r.malformed("the header announces coarser levels of a grid chunk, but no grid chunk"));
        }
        if self.has(Self::STRAIGHT) && !ends_on_grid(axes) {
            return Err(r.malformed(
                "the header states straight lines between directions, but the directions are on no grid of angles",
            ));
        }
        if self.has(Self::LIGHT)
            && (self.has(Self::LINEAR) || !axes.iter().any(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_))))
        {
            return Err(r.malformed("the header announces a light chunk, but no logarithms of samples over directions"));
        }
        if self.has(Self::KLT) && axes.is_empty() {
            return Err(r.malformed("the header announces a spectral basis, but no axis"));
        }
        Ok(())
    }
}

/// Returns true if the last axis of directions is a grid of angles.
pub(super) fn ends_on_grid(axes: &[Axis]) -> bool {
    let mut directions = axes.iter().rev().filter(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_)));
    matches!(directions.next(), Some(Axis::Grid(_)))
}

/// Number of axis transforms that a header must list. Lossless and predicted files need none; a last axis in principal
/// components of the data (`klt`) needs no entry.
fn transforms_written(policy: Policy, klt: bool, predicted: bool, axes: usize) -> usize {
    if policy == Policy::Lossless || predicted { 0 } else { axes - usize::from(klt && axes > 0) }
}

impl Header {
    /// Builds the header of a measurement, with the fields of its coding policy still at their defaults.
    pub(crate) fn of(measurement: &Measurement, policy: Policy) -> Self {
        Self {
            quantity: measurement.quantity,
            unit: measurement.unit,
            sampling: measurement.sampling,
            axes: measurement.tensor.axes().to_vec(),
            policy,
            transforms: Vec::new(),
            klt: false,
            predicted: false,
            gridded: false,
            straight_lines: 0,
            between: None,
            has_lobe: false,
            lobe: None,
            grid_levels: false,
            pyramid_length: 0,
            linear: false,
            step: 0.0,
            light_step: 0.0,
            correction_step: 0.0,
            classes: None,
            floor: 0.0,
            factor: 1.0,
            kept: 0,
            errors: ErrorReport::default(),
        }
    }

    /// Adds to a file header what `settings` say about evaluation: how much of the interpolation over outgoing angles
    /// is linear rather than cubic, how to interpolate between incoming directions, and the analytic lobe.
    pub(crate) fn stating(self, settings: &Settings) -> Self {
        Self {
            straight_lines: settings.straight_lines,
            between: settings.between.stated(),
            has_lobe: settings.lobe.is_some(),
            lobe: settings.lobe.clone(),
            ..self
        }
    }

    pub(crate) fn write(&self) -> Vec<u8> {
        let flags = Flags::of(self);
        let mut w = Writer::default();
        w.u8(self.quantity.code() | self.sampling.code() << 3 | (self.axes.len() as u8) << 4);
        w.u8(self.unit.code() | self.policy.code() << 5);
        w.varint(u64::from(flags.0));
        write_axes(&mut w, &self.axes);
        if flags.has(Flags::STRAIGHT) {
            w.u8(self.straight_lines);
        }
        let written = transforms_written(self.policy, self.klt, self.predicted || self.gridded, self.axes.len());
        for &transform in self.transforms.iter().take(written) {
            write_transform(&mut w, transform);
        }
        if self.predicted || self.grid_levels {
            w.varint(self.pyramid_length as u64);
        }
        if self.policy == Policy::Rd {
            w.low_bytes(self.step.to_bits() >> 16, 2);
        }
        if flags.has(Flags::LIGHT) {
            w.f32(self.light_step);
        }
        if flags.has(Flags::CORRECTIONS) {
            w.f32(self.correction_step);
        }
        if flags.has(Flags::FLOOR) {
            w.f32(self.floor);
        }
        if flags.has(Flags::FACTOR) {
            w.f64(self.factor);
        }
        let e = &self.errors;
        if self.policy != Policy::Lossless {
            w.varint(self.kept);
            let stated = [e.er_l1, e.er_l2, e.max_relative_error, e.relative_rmse, e.max_absolute_error];
            let unscored = flags.has(Flags::UNSCORED_ERROR).then_some(e.max_absolute_error_unscored);
            for error in stated.into_iter().chain(unscored) {
                write_error(&mut w, error);
            }
        }
        if flags.has(Flags::COUNTS) {
            for count in [e.zero_samples, e.negative_samples, e.below_floor_samples, e.masked_samples] {
                w.varint(count);
            }
        }
        w.into_bytes()
    }

    pub(crate) fn read(r: &mut Reader<'_>) -> Result<Self, CodecError> {
        fn coded<T>(r: &Reader<'_>, what: &str, code: u8, known: fn(u8) -> Option<T>) -> Result<T, CodecError> {
            known(code).ok_or_else(|| r.malformed(format!("the code {code} of the {what} is unknown")))
        }
        let first = r.u8("quantity and number of axes")?;
        let quantity = coded(r, "quantity", first & 7, Quantity::from_code)?;
        let sampling = coded(r, "sampling", first >> 3 & 1, Sampling::from_code)?;
        let second = r.u8("unit and policy")?;
        let unit = coded(r, "unit", second & 31, Unit::from_code)?;
        let policy = coded(r, "policy", second >> 5, Policy::from_code)?;
        let flags = r.varint("flags")?;
        let flags =
            Flags(u16::try_from(flags).map_err(|_| r.malformed(format!("the header flags {flags:#x} are unknown")))?);
        let axes = read_axes(r, usize::from(first >> 4))?;
        flags.check(r, policy, &axes)?;
        // The limit on the product of the axes holds before anything is decoded.
        let samples = crate::domain::check_axes(&axes).map_err(|e| r.malformed(e.to_string()))? as u64;
        crate::domain::Layout::of(quantity, &axes).map_err(|e| r.malformed(e.to_string()))?;
        let straight_lines = if flags.has(Flags::STRAIGHT) { r.u8("share of straight lines")? } else { 0 };
        if flags.has(Flags::STRAIGHT) && straight_lines == 0 {
            return Err(r.malformed("the share of straight lines in the interpolation is 0, expected 1 to 255"));
        }
        let (klt, predicted, gridded) = (flags.has(Flags::KLT), flags.has(Flags::PREDICTED), flags.has(Flags::GRIDDED));
        let written = transforms_written(policy, klt, predicted || gridded, axes.len());
        let mut transforms = (0..written).map(|_| read_transform(r)).collect::<Result<Vec<_>, _>>()?;
        if policy != Policy::Lossless {
            transforms.resize(axes.len(), AxisTransform::Identity);
        }
        let grid_levels = flags.has(Flags::LEVELS);
        let pyramid_length =
            if predicted || grid_levels { r.size(usize::MAX >> 1, "length of the pyramid")? } else { 0 };
        let step = if policy == Policy::Rd { f32::from_bits(r.low_bytes(2, "step")? << 16) } else { 1.0 };
        let light_step = if flags.has(Flags::LIGHT) { r.f32("step of the light")? } else { 0.0 };
        let correction_step = if flags.has(Flags::CORRECTIONS) { r.f32("correction step")? } else { 0.0 };
        let floor = if flags.has(Flags::FLOOR) { r.f32("floor")? } else { 0.0 };
        let factor = if flags.has(Flags::FACTOR) { r.f64("factor")? } else { 1.0 };
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(
                r.malformed(format!("the common factor of the samples is {factor}, expected a positive number"))
            );
        }
        if !(step > 0.0 && step.is_finite()) {
            return Err(r.malformed(format!("the quantiser step is {step}, expected a positive number")));
        }
        // A negative light step in a signed grid marks odd steps as corrections of negative samples.
        let classes = if flags.has(Flags::WIDE_CLASSES) {
            Some(ChunkKind::WideClasses)
        } else {
            flags.has(Flags::CLASSES).then_some(ChunkKind::Classes)
        };
        let signed = gridded && classes.is_some();
        for (what, flag, value) in [
            ("step of the light", Flags::LIGHT, if signed { light_step.abs() } else { light_step }),
            ("correction step", Flags::CORRECTIONS, correction_step),
            ("floor", Flags::FLOOR, floor),
        ] {
            if flags.has(flag) && value <= 0.0 {
                return Err(r.malformed(format!("the {what} in the header is {value}, expected a positive number")));
            }
        }
        let mut header = Self {
            quantity,
            unit,
            sampling,
            axes,
            policy,
            transforms,
            klt,
            predicted,
            gridded,
            straight_lines,
            // The interpolation chunk is read later.
            between: flags.has(Flags::BETWEEN).then(Between::default),
            has_lobe: flags.has(Flags::LOBE),
            lobe: None,
            grid_levels,
            pyramid_length,
            linear: flags.has(Flags::LINEAR),
            step: if policy == Policy::Rd { step } else { 0.0 },
            light_step,
            correction_step,
            classes,
            floor,
            factor,
            kept: 0,
            errors: ErrorReport { samples, ..ErrorReport::default() },
        };
        if policy != Policy::Lossless {
            header.kept = r.varint("kept coefficients")?;
            let e = &mut header.errors;
            e.er_l1 = read_error(r, "er(L1)")?;
            e.er_l2 = read_error(r, "er(L2)")?;
            e.max_relative_error = read_error(r, "largest relative error")?;
            e.relative_rmse = read_error(r, "relative RMSE")?;
            e.max_absolute_error = read_error(r, "largest absolute error")?;
            if flags.has(Flags::UNSCORED_ERROR) {
                e.max_absolute_error_unscored = read_error(r, "largest absolute error of unscored samples")?;
            }
        }
        read_counts(r, flags.has(Flags::COUNTS), &mut header.errors)?;
        r.end("header")?;
        Ok(header)
    }

    /// Returns which value of each sample the file codes: the logarithm or the sample itself.
    pub(crate) fn values(&self) -> Values {
        if self.linear { Values::Samples { signed: self.errors.negative_samples > 0 } } else { Values::Logarithms }
    }

    /// Collects what the header and the chunks before it say about samples on a grid of angles.
    pub(crate) fn around_grid<'a>(&'a self, classes: Option<&'a [Class]>) -> Around<'a> {
        let divisor = self.between.map_or(Divisor::None, |between| between.divisor);
        Around { axes: &self.axes, classes, step: self.step, is_linear: self.linear, divisor }
    }

    /// Subdivision level of the mesh of the last triangle axis, 0 without such an axis.
    pub(crate) fn finest_level(&self) -> u8 {
        let level = |axis: &Axis| if let Axis::Triangles(mesh) = axis { Some(mesh.level()) } else { None };
        self.axes.iter().rev().find_map(level).unwrap_or(0)
    }

    /// Chunks expected after the header, in file order; the last, the metadata chunk, is optional.
    pub(crate) fn announced(&self) -> Vec<Announced> {
        let lossless = self.policy == Policy::Lossless;
        let all = [
            (ChunkKind::Between, self.between.is_some()),
            (ChunkKind::Lobe, self.has_lobe),
            (ChunkKind::Classes, self.classes == Some(ChunkKind::Classes)),
            (ChunkKind::WideClasses, self.classes == Some(ChunkKind::WideClasses)),
            (ChunkKind::Basis, self.klt),
            (ChunkKind::Pyramid, self.predicted),
            (ChunkKind::Grid, self.gridded),
            (ChunkKind::Coefficients, !lossless && !self.predicted && !self.gridded),
            (ChunkKind::Light, self.light_step != 0.0),
            (ChunkKind::Corrections, self.correction_step != 0.0),
            (ChunkKind::Exact, lossless),
            (metadata_kind(&self.axes), true),
        ];
        let is_stated = |kind| kind == ChunkKind::Pyramid || kind == ChunkKind::Grid && self.grid_levels;
        let length = |kind| is_stated(kind).then_some(self.pyramid_length);
        let announced = all.into_iter().filter(|(_, announced)| *announced);
        announced.map(|(kind, _)| Announced { kind, length: length(kind) }).collect()
    }

    /// Returns the content of the header in the form that users of the library see.
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
            step: (self.policy == Policy::Rd).then(|| f64::from(self.step)),
            straight_lines: ends_on_grid(&self.axes).then(|| f64::from(self.straight_lines) / 255.0),
            between: self.between.unwrap_or_default(),
            lobe: self.lobe.clone(),
            factor: self.factor,
            errors: self.errors,
            metadata,
        }
    }
}

/// Number of bytes by which a header grows when it states the error of samples that are excluded from relative errors.
pub(crate) const UNSCORED_BYTES: usize = 3;

/// Conversion of decoded values to magnitudes (the exponential, if logarithms are coded) that can be applied while
/// decoding.
///
/// `None` if corrections of the total light (albedo, flux) or of single samples must be added to the values first.
pub(super) fn finish_of(header: &Header) -> Option<Values> {
    (header.light_step == 0.0 && header.correction_step == 0.0).then(|| header.values())
}

/// Builds the transform plan from the axes and bases that a header names.
pub(super) fn plan_of(header: &Header) -> Result<Plan, CodecError> {
    Plan::new(&header.axes, &header.transforms).map_err(|e| CodecError::Malformed { at: 0, reason: e.to_string() })
}

/// Reads how many samples relative errors leave out: zero, negative, below the declared floor, masked. Derives how many
/// samples they take into account.
fn read_counts(r: &mut Reader<'_>, present: bool, errors: &mut ErrorReport) -> Result<(), CodecError> {
    if present {
        errors.zero_samples = r.varint("zero samples")?;
        errors.negative_samples = r.varint("negative samples")?;
        errors.below_floor_samples = r.varint("samples below the floor")?;
        errors.masked_samples = r.varint("masked samples")?;
    }
    let left_out = [errors.zero_samples, errors.negative_samples, errors.below_floor_samples, errors.masked_samples];
    let scored = left_out.into_iter().try_fold(errors.samples, u64::checked_sub);
    errors.scored_samples = scored.ok_or_else(|| {
        r.malformed("the header counts more samples left out of relative errors than there are samples")
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::stated::rounded_up;
    use super::*;
    use crate::domain::{Domain, TriangleMesh, WavelengthGrid};
    use crate::numeric::drawn::any_list;
    use crate::transform::SphereBasis;
    use arbtest::arbtest;

    fn folded() -> Header {
        let mesh = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let axes = vec![mesh(1), mesh(4), Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 75).unwrap())];
        Header {
            quantity: Quantity::Brdf,
            unit: Unit::PerSteradian,
            sampling: Sampling::Average,
            policy: Policy::Rd,
            transforms: vec![AxisTransform::Identity; axes.len()],
            axes,
            klt: true,
            predicted: true,
            gridded: false,
            straight_lines: 0,
            between: None,
            has_lobe: false,
            lobe: None,
            grid_levels: false,
            pyramid_length: 300,
            step: 0.015_625,
            linear: false,
            light_step: 0.0,
            correction_step: 0.0,
            classes: None,
            floor: 0.0,
            factor: 1.0,
            kept: 437,
            errors: ErrorReport {
                samples: 1_228_800,
                scored_samples: 1_228_800,
                er_l1: 0.0078,
                er_l2: 0.0099,
                max_relative_error: 0.05,
                relative_rmse: 0.008,
                max_absolute_error: 0.11,
                ..ErrorReport::default()
            },
        }
    }

    fn read(bytes: &[u8]) -> Result<Header, CodecError> {
        Header::read(&mut Reader::new(bytes, 0))
    }

    #[test]
    fn a_header_is_small_and_is_read_as_it_was_written() {
        let plain = folded();
        assert!(plain.write().len() <= 32, "{}", plain.write().len());
        let mut full = Header {
            correction_step: 0.02,
            classes: Some(ChunkKind::Classes),
            floor: 0.25,
            predicted: false,
            gridded: false,
            pyramid_length: 0,
            ..plain.clone()
        };
        full.transforms[1] = AxisTransform::Sphere(SphereBasis::BioHaar);
        full.errors.max_absolute_error_unscored = 0.5;
        full.errors.zero_samples = 100;
        full.errors.masked_samples = 800;
        full.errors.scored_samples -= 900;
        let exact = Header {
            policy: Policy::Lossless,
            transforms: vec![],
            klt: false,
            predicted: false,
            gridded: false,
            pyramid_length: 0,
            step: 0.0,
            kept: 0,
            errors: ErrorReport { samples: 1_228_800, scored_samples: 1_228_800, ..ErrorReport::default() },
            ..plain.clone()
        };
        assert!(exact.write().len() <= 11);
        let multiplied = Header { factor: 0.93, ..exact.clone() };
        assert_eq!(multiplied.write().len(), exact.write().len() + 9);
        // The interpolation's parameters are in a chunk of their own.
        let between = Header { between: Some(Between::default()), ..plain.clone() };
        for header in [plain, full, exact, multiplied, between] {
            let bytes = header.write();
            let back = read(&bytes).unwrap();
            for (stated, error) in [
                (back.errors.er_l1, header.errors.er_l1),
                (back.errors.er_l2, header.errors.er_l2),
                (back.errors.max_absolute_error_unscored, header.errors.max_absolute_error_unscored),
            ] {
                assert_eq!(stated, f64::from(rounded_up(error)));
            }
            assert_eq!(Header { errors: header.errors, ..back.clone() }, header);
            assert_eq!(back.write(), bytes);
            for end in 0..bytes.len() {
                assert!(read(&bytes[..end]).is_err());
            }
        }
    }

    #[test]
    fn headers_that_contradict_themselves_are_refused() {
        let bytes = folded().write();
        let refused = |change: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = bytes.clone();
            change(&mut bytes);
            matches!(read(&bytes), Err(CodecError::Malformed { .. }))
        };
        assert!(refused(&|b| b[0] |= 7), "quantity 7");
        assert!(refused(&|b| b[1] |= 31), "unit 31");
        assert!(refused(&|b| b[1] |= 5 << 5), "policy 5");
        assert!(refused(&|b| b[1] = b[1] & 31 | 1 << 5), "a pyramid in policy 1");
        assert!(refused(&|b| b[2] |= 128), "flag 128");
        assert!(refused(&|b| b[3] |= 31), "level 31");
        let step = bytes.len() - 15 - 2 - 2;
        assert!(refused(&|b| b[step..step + 2].fill(0)), "step 0");
        assert!(refused(&|b| b[step..step + 2].copy_from_slice(&[0x80, 0x7F])), "step infinity");
        assert!(refused(&|b| b[step + 6] = 0xFF), "a negative error");
        assert!(refused(&|b| b.push(0)), "a byte more");
        assert!(
            refused(&|b| {
                b[2] |= Flags::COUNTS as u8;
                b.extend([0xFF, 0xFF, 0xFF, 0x7F, 0, 0, 0]);
            }),
            "too many zeros"
        );
    }

    #[test]
    fn any_bytes_are_a_header_or_an_error() {
        arbtest(|u| {
            let bytes: Vec<u8> = any_list(u, 0..=119)?;
            let _ = Header::read(&mut Reader::new(&bytes, 0));
            Ok(())
        });
    }
}
