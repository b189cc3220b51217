//! Common part of the views of all roles: a material, an entry of its index axes, and the queries.

use super::error::RoleError;
use super::sample::Sample;
use crate::domain::limits::MAX_AXES;
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Beyond, Chosen, Interpolation, Material, Place, SampleOptions};

const HOW: Interpolation = Interpolation::Smooth;

/// Material that is to be queried as a surface, medium, light source or spectrum and has the quantity and directions
/// for that, with the selected entry of its index axes (axes of numbered entries).
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    material: &'a Material,
    index: Index,
}

/// Selected entry of the index axes (axes of numbered entries): one number per index axis.
#[derive(Clone, Copy, Debug)]
struct Index {
    numbers: [usize; MAX_AXES],
    count: usize,
}

impl Index {
    /// Copies the position of the selected entry: one number for each axis of numbered entries, at most [`MAX_AXES`].
    fn new(index: &[usize]) -> Self {
        let mut numbers = [0; MAX_AXES];
        numbers[..index.len()].copy_from_slice(index);
        Self { numbers, count: index.len() }
    }

    fn numbers(&self) -> &[usize] {
        &self.numbers[..self.count]
    }
}

/// Radiometric quantities and directions that a view of a material needs.
pub(super) struct Needs {
    pub(super) quantities: &'static [Quantity],
    pub(super) named: &'static str,
    pub(super) has_incoming: bool,
    pub(super) has_outgoing: bool,
}

impl<'a> View<'a> {
    pub(super) fn new(material: &'a Material, index: &[usize], needs: &Needs) -> Result<Self, RoleError> {
        let quantity = material.quantity();
        if !needs.quantities.contains(&quantity) {
            return Err(RoleError::Quantity { found: quantity, expected: needs.named });
        }
        let layout = material.layout();
        let found = [layout.incoming.is_some(), layout.outgoing.is_some()];
        let expected = [needs.has_incoming, needs.has_outgoing];
        if found != expected {
            let (found, expected) = (directions(found), directions(expected));
            return Err(RoleError::Directions { quantity, found, expected });
        }
        material.entry(index)?;
        material.needs_whole("sample, density (pdf) and integral")?;
        Ok(Self { material, index: Index::new(index) })
    }

    pub(super) fn at_wavelengths(&self, wavelengths: &[f64], out: &mut [f32]) -> Result<(), RoleError> {
        Ok(self.material.at_wavelengths(self.place(None, None), HOW, Beyond::Masked, wavelengths, out)?)
    }

    pub(super) fn material(&self) -> &'a Material {
        self.material
    }

    pub(super) fn lambdas(&self) -> usize {
        self.material.lambdas()
    }

    pub(super) fn eval(&self, wi: Option<Direction>, wo: Option<Direction>) -> Vec<f32> {
        let mut out = vec![0.0; self.lambdas()];
        self.eval_into(wi, wo, &mut out);
        out
    }

    /// Writes the spectrum at an incoming and an outgoing direction to `out`; zeros for a direction outside the
    /// material's domain.
    ///
    /// # Panics
    /// If the length of `out` is not that of a spectrum.
    pub(super) fn eval_into(&self, wi: Option<Direction>, wo: Option<Direction>, out: &mut [f32]) {
        assert_eq!(out.len(), self.lambdas(), "room for the samples of a spectrum");
        // Other errors were excluded on creation of the view, so wi is outside its domain.
        if self.material.evaluate(self.place(wi, wo), HOW, out).is_err() {
            out.fill(0.0);
        }
    }

    pub(super) fn pdf(&self, wi: Option<Direction>, wo: Direction) -> f64 {
        self.material.pdf(self.index.numbers(), wi, wo, SampleOptions::default()).unwrap_or(0.0)
    }

    pub(super) fn sample(&self, wi: Option<Direction>, u: [f64; 2]) -> Option<Sample<f64>> {
        let drawn =
            self.material.sample(self.index.numbers(), wi, in_square(u), SampleOptions::default()).ok().flatten()?;
        Some(Sample { wo: drawn.direction, weight: drawn.weight, pdf: drawn.pdf })
    }

    pub(super) fn albedo(&self, wi: Option<Direction>) -> Vec<f32> {
        let mut out = vec![0.0; self.lambdas()];
        if self.material.albedo(self.index.numbers(), wi, HOW, &mut out).is_err() {
            out.fill(0.0);
        }
        out
    }

    pub(super) fn at<const N: usize>(self, wavelengths: [f64; N], beyond: Beyond) -> Result<ViewAt<'a, N>, RoleError> {
        const { assert!(N <= Chosen::MOST, "at most eight wavelengths are chosen at once") };
        Ok(ViewAt { chosen: self.material.choose(&wavelengths, beyond)?, view: self })
    }

    fn place(&self, wi: Option<Direction>, wo: Option<Direction>) -> Place<'_> {
        Place { index: self.index.numbers(), wi, wo }
    }
}

/// View of a material at chosen wavelengths.
#[derive(Clone, Debug)]
pub(super) struct ViewAt<'a, const N: usize> {
    view: View<'a>,
    chosen: Chosen<'a>,
}

impl<const N: usize> ViewAt<'_, N> {
    pub(super) fn wavelengths(&self) -> [f64; N] {
        std::array::from_fn(|i| self.chosen.wavelengths()[i])
    }

    #[inline]
    pub(super) fn eval(&self, wi: Option<Direction>, wo: Option<Direction>) -> [f32; N] {
        self.chosen.at(self.view.place(wi, wo), HOW).map_or([0.0; N], first)
    }

    #[inline]
    pub(super) fn pdf(&self, wi: Option<Direction>, wo: Direction) -> f64 {
        self.view.pdf(wi, wo)
    }

    #[inline]
    pub(super) fn sample(&self, wi: Option<Direction>, u: [f64; 2]) -> Option<Sample<[f32; N]>> {
        let drawn =
            self.chosen.sample(self.view.index.numbers(), wi, in_square(u), SampleOptions::default()).ok().flatten()?;
        Some(Sample { wo: drawn.direction, weight: first(drawn.weights), pdf: drawn.pdf })
    }
}

/// Returns the first `N` values of an array.
fn first<const N: usize>(values: [f32; Chosen::MOST]) -> [f32; N] {
    std::array::from_fn(|i| values[i])
}

/// Clamps the coordinates of a point to the unit square; NaN becomes 0.
fn in_square(u: [f64; 2]) -> [f64; 2] {
    u.map(|u| if u.is_nan() { 0.0 } else { u.clamp(0.0, 1.0) })
}

fn directions([incoming, outgoing]: [bool; 2]) -> &'static str {
    match (incoming, outgoing) {
        (true, true) => "incoming and outgoing directions",
        (true, false) => "incoming directions alone",
        (false, true) => "outgoing directions alone",
        (false, false) => "no directions",
    }
}
