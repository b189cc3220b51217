//! Helmholtz reciprocity: compares f(wi, wo) with f(wo, wi) at measured incoming directions and outgoing cells.

use super::spot::degrees;
use crate::domain::{Axis, Direction, TriangleMesh};
use crate::evaluate::error::{EvaluateError, Need};
use crate::evaluate::material::Material;
use crate::evaluate::place::{Interpolation, Place};
use crate::evaluate::stated::Stated;
use rayon::prelude::*;
use serde::Serialize;

/// Maximum number of pairs of directions compared for reciprocity; of more pairs, every n-th is compared. Raising it
/// makes reports more exact and slower.
const MOST_PAIRS: usize = 1 << 17;

/// Report on reciprocity: differences between f(wi, wo) and f(wo, wi) in smooth evaluation of a material.
///
/// Each incoming entry is paired with the centroid of each outgoing cell on the same side of the surface. Both
/// directions must be in both domains, and the outgoing elevation between the ends of a list of incoming ones. The
/// difference of a pair is Σ|a − b| / Σ½(|a| + |b|) over the wavelengths that are masked in neither: from 0 to 2. Pairs
/// are weighted by cos θi · cos θo and their solid angles. For phase functions the weights are solid angles alone.
/// Entries of a list of elevations all count alike.
///
/// One evaluation starts at a measured incoming direction, the other between measured ones. The differences therefore
/// include the interpolation error; [`ReciprocityReport::left_out_error`] is a measure of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReciprocityReport {
    /// Number of pairs of an incoming and an outgoing direction at which f(wi, wo) was compared with f(wo, wi).
    pub pairs: u64,
    /// Number of pairs of directions that cannot be compared: transmitted, outside one of the domains, masked, or dark
    /// both ways.
    pub left_out: u64,
    /// Stride n through all pairs of an incoming and an outgoing direction: every n-th pair was examined for
    /// reciprocity, f(wi, wo) = f(wo, wi). It is 1 if all pairs were.
    pub step: u64,
    /// Weighted mean of the relative differences between f(wi, wo) and f(wo, wi), 0 to 2.
    pub mean: f64,
    /// Weighted 90th percentile of the relative differences between f(wi, wo) and f(wo, wi), 0 to 2.
    pub p90: f64,
    /// Pair of directions with the largest relative difference between f(wi, wo) and f(wo, wi).
    pub largest: Option<WorstPair>,
    /// Difference weighted by light: Σ weight · |a − b| over Σ weight · ½(|a| + |b|), with a = f(wi, wo) and b = f(wo,
    /// wi). Dark pairs hardly count.
    pub light: f64,
    /// Leave-one-out error: Σ |error| · cos θo over Σ value · cos θo, when each measured incoming direction is
    /// predicted from its neighbours.
    pub left_out_error: Option<f64>,
}

/// Pair of directions with the largest relative difference between f(wi, wo) and f(wo, wi).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WorstPair {
    /// Relative difference between f(wi, wo) and f(wo, wi), 0 to 2.
    pub difference: f64,
    /// Position on each index axis (axis of the samples before those of directions and wavelength) at which f(wi, wo)
    /// and f(wo, wi) were compared.
    pub index: Vec<usize>,
    /// Polar angle and azimuth of the measured incoming direction, in degrees.
    pub wi: [f64; 2],
    /// Polar angle and azimuth of the outgoing direction, in degrees.
    pub wo: [f64; 2],
    /// Index of the spectral sample at which f(wi, wo) and f(wo, wi) differ most.
    pub lambda: usize,
    /// Wavelength in nm at which f(wi, wo) and f(wo, wi) differ most; `None` for data without wavelengths.
    pub wavelength: Option<f64>,
    /// Value of f(wi, wo) at the wavelength at which it differs most from f(wo, wi).
    pub there: f64,
    /// Value of f(wo, wi) at the wavelength at which it differs most from f(wi, wo).
    pub back: f64,
}

/// Comparison of f(wi, wo) with f(wo, wi) for one pair of directions.
#[derive(Clone, Copy)]
struct Compared {
    number: usize,
    weight: f64,
    /// Sums over wavelengths Σ|a − b| and Σ½(|a| + |b|), with a = f(wi, wo) and b = f(wo, wi).
    apart: f64,
    sum: f64,
}

impl Compared {
    fn difference(&self) -> f64 {
        self.apart / self.sum
    }
}

impl Material {
    /// Compares f(wi, wo) with f(wo, wi). Fails for quantities without reciprocity: spectra, reflectances, emissions,
    /// BTDFs.
    pub fn reciprocity(&self) -> Result<ReciprocityReport, EvaluateError> {
        let up = Direction::from_degrees(0.0, 0.0);
        self.pair(Place { index: &[], wi: Some(up), wo: Some(up) })?;
        let cells = self.over_triangles()?;
        let mesh = cells.needs_outgoing(Need::Reciprocity)?;
        let [incoming, outgoing, _] = cells.geometry().shape();
        let wis: Vec<(Direction, f64)> =
            (0..incoming).filter_map(|i| Some((cells.incoming_direction(i)?, cells.incoming_measure(i)))).collect();
        let wos: Vec<(Direction, f64)> = (0..outgoing).map(|o| (mesh.centroid(o), mesh.solid_angle(o))).collect();
        let all = self.geometry().entries() * incoming * outgoing;
        let step = all.div_ceil(MOST_PAIRS).max(1);
        // An odd stride does not hit the same outgoing cells under every incoming direction: cell counts are even.
        let step = if step > 1 { step | 1 } else { step };
        let numbers: Vec<usize> = (0..all).step_by(step).collect();
        let lambdas = self.lambdas();
        let compared: Vec<Option<Compared>> = numbers
            .par_iter()
            .map_init(
                || (vec![0.0; lambdas], vec![0.0; lambdas]),
                |(there, back), &number| {
                    let (wi, a) = wis[number / outgoing % incoming];
                    let (wo, b) = wos[number % outgoing];
                    let index = self.index_of(number / (incoming * outgoing));
                    let weight = a * b * self.cosines(wi, wo);
                    self.compare(&index, wi, wo, there, back).map(|(apart, sum)| Compared {
                        number,
                        weight,
                        apart,
                        sum,
                    })
                },
            )
            .collect();
        let left_out = compared.iter().filter(|pair| pair.is_none()).count() as u64;
        let mut pairs: Vec<Compared> = compared.into_iter().flatten().collect();
        let largest = pairs.iter().fold(None, |worst: Option<Compared>, pair| match worst {
            Some(worst) if worst.difference() >= pair.difference() => Some(worst),
            _ => Some(*pair),
        });
        let largest = largest.map(|pair| {
            self.worst(
                &pair,
                pair.number / (incoming * outgoing),
                wis[pair.number / outgoing % incoming].0,
                wos[pair.number % outgoing].0,
            )
        });
        let sum = |of: &dyn Fn(&Compared) -> f64| pairs.iter().map(of).sum::<f64>();
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        let weight = sum(&|pair| pair.weight);
        let mean = ratio(sum(&|pair| pair.weight * pair.difference()), weight);
        let light = ratio(sum(&|pair| pair.weight * pair.apart), sum(&|pair| pair.weight * pair.sum));
        Ok(ReciprocityReport {
            pairs: pairs.len() as u64,
            left_out,
            step: step as u64,
            mean,
            p90: quantile(&mut pairs, 0.9 * weight),
            largest,
            light,
            left_out_error: self.report().left_out_error,
        })
    }

    /// Returns Σ|a − b| and Σ½(|a| + |b|) over wavelengths, with a = f(wi, wo) and b = f(wo, wi); `None` if the pair
    /// cannot be compared.
    fn compare(
        &self,
        index: &[usize],
        wi: Direction,
        wo: Direction,
        there: &mut [f32],
        back: &mut [f32],
    ) -> Option<(f64, f64)> {
        // A list over the scattering angle has a value for any two directions.
        let is_list = self.stated().is_some_and(Stated::is_scattering);
        let is_known = !self.is_transmitted(wi, wo) && self.is_between(wo) && self.holds(wi, wo) && self.holds(wo, wi);
        if !is_list && !is_known {
            return None;
        }
        let how = Interpolation::Smooth;
        self.evaluate(Place { index, wi: Some(wi), wo: Some(wo) }, how, there).ok()?;
        self.evaluate(Place { index, wi: Some(wo), wo: Some(wi) }, how, back).ok()?;
        let both = there.iter().zip(&*back).filter(|(a, b)| !a.is_nan() && !b.is_nan());
        let (apart, sum) = both.fold((0.0, 0.0), |(apart, sum), (&a, &b)| {
            let (a, b) = (f64::from(a), f64::from(b));
            (apart + (a - b).abs(), sum + 0.5 * (a.abs() + b.abs()))
        });
        (sum > 0.0).then_some((apart, sum))
    }

    fn worst(&self, pair: &Compared, entry: usize, wi: Direction, wo: Direction) -> WorstPair {
        let index = self.index_of(entry);
        let (mut there, mut back) = (vec![0.0; self.lambdas()], vec![0.0; self.lambdas()]);
        self.compare(&index, wi, wo, &mut there, &mut back);
        let apart = |lambda: usize| (there[lambda] - back[lambda]).abs();
        let lambda = (0..there.len()).filter(|&lambda| !apart(lambda).is_nan());
        let lambda = lambda
            .fold(0, |most, lambda| if apart(lambda) > apart(most) || apart(most).is_nan() { lambda } else { most });
        WorstPair {
            difference: pair.difference(),
            index,
            wi: degrees(wi),
            wo: degrees(wo),
            lambda,
            wavelength: self.wavelength(lambda),
            there: f64::from(there[lambda]),
            back: f64::from(back[lambda]),
        }
    }

    /// Returns true if a direction lies between the least and the largest measured elevation of incidence, or if
    /// incoming directions are not a list of elevations.
    fn is_between(&self, direction: Direction) -> bool {
        match self.incoming_axis() {
            Some(Axis::Elevation(values)) => {
                let theta = direction.theta_degrees();
                values.first().is_some_and(|&first| first <= theta) && values.last().is_some_and(|&last| theta <= last)
            }
            _ => true,
        }
    }

    fn incoming_measure(&self, entry: usize) -> f64 {
        match self.incoming_axis() {
            Some(Axis::Triangles(mesh)) => TriangleMesh::solid_angle(*mesh, entry),
            _ => 1.0,
        }
    }

    fn cosines(&self, wi: Direction, wo: Direction) -> f64 {
        if self.quantity().has_cosine() { (wi.cos_theta() * wo.cos_theta()).abs() } else { 1.0 }
    }
}

/// Weighted quantile of the relative differences between f(wi, wo) and f(wo, wi): the least difference up to which
/// pairs have the total weight `weight`.
fn quantile(pairs: &mut [Compared], weight: f64) -> f64 {
    pairs.sort_by(|a, b| a.difference().total_cmp(&b.difference()).then(a.number.cmp(&b.number)));
    let mut so_far = 0.0;
    for pair in &*pairs {
        so_far += pair.weight;
        if so_far >= weight {
            return pair.difference();
        }
    }
    pairs.last().map_or(0.0, Compared::difference)
}
