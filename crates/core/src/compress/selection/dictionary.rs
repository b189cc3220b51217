//! Dense matrices of a basis on a line of a few dozen samples.

use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan, PlanError};

/// Analysis and synthesis matrices of one basis for a given number of samples, in f64 (their entries come from the f32
/// transform).
#[derive(Clone, Debug, PartialEq)]
pub struct Dictionary {
    name: String,
    length: usize,
    /// Analysis matrix: row k holds the weights of the samples in coefficient k.
    analysis: Vec<f64>,
    /// Synthesis matrix: row k holds the function that coefficient k multiplies.
    atoms: Vec<f64>,
}

impl Dictionary {
    /// Builds the analysis and synthesis matrices of `transform` on `length` samples, with the display name `name`.
    pub fn new(name: impl Into<String>, length: usize, transform: AxisTransform) -> Result<Self, PlanError> {
        let index = || Axis::Index { count: length, labels: Vec::new() };
        let plan = Plan::new(&[index(), index()], &[transform, AxisTransform::Identity])?;
        let mut identity = vec![0.0_f32; length * length];
        for i in 0..length {
            identity[i * length + i] = 1.0;
        }
        let mut synthesis = identity.clone();
        plan.forward(&mut identity);
        plan.inverse(&mut synthesis);
        let analysis = identity.into_iter().map(f64::from).collect();
        let atoms = (0..length * length).map(|at| f64::from(synthesis[at % length * length + at / length])).collect();
        Ok(Self { name: name.into(), length, analysis, atoms })
    }

    /// Name of the basis and of its boundary rule.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of samples of a signal that the basis represents, equal to the number of basis functions.
    #[allow(clippy::len_without_is_empty, reason = "a plan refuses empty axes")]
    pub fn len(&self) -> usize {
        self.length
    }

    /// Returns the samples of the synthesis function that coefficient `k` multiplies.
    ///
    /// # Panics
    /// If `k` is out of range.
    pub fn atom(&self, k: usize) -> &[f64] {
        &self.atoms[k * self.length..][..self.length]
    }

    /// Computes the coefficients of `samples` in this basis.
    ///
    /// # Panics
    /// If the number of samples differs from the dictionary's length.
    pub fn coefficients(&self, samples: &[f64]) -> Vec<f64> {
        assert_eq!(samples.len(), self.length, "as many samples as the dictionary is long");
        let dot = |row: &[f64]| row.iter().zip(samples).map(|(a, s)| a * s).sum();
        self.analysis.chunks(self.length).map(dot).collect()
    }

    /// Computes the samples from `coefficients` of the basis functions `kept`.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn synthesise(&self, kept: &[usize], coefficients: &[f64]) -> Vec<f64> {
        let mut samples = vec![0.0; self.length];
        for (&k, c) in kept.iter().zip(coefficients) {
            samples.iter_mut().zip(self.atom(k)).for_each(|(s, a)| *s += c * a);
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use crate::compress::selection::line_dictionaries;

    #[test]
    fn synthesis_undoes_analysis_in_every_basis() {
        let samples: Vec<f64> = (0..75).map(|i| 1.0 + (f64::from(i) * 0.3).sin()).collect();
        for dictionary in line_dictionaries(75) {
            let c = dictionary.coefficients(&samples);
            let all: Vec<usize> = (0..75).collect();
            let back = dictionary.synthesise(&all, &c);
            for (a, b) in back.iter().zip(&samples) {
                assert!((a - b).abs() < 1e-3, "{}: {a} {b}", dictionary.name());
            }
        }
    }
}
