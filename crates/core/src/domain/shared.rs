//! List of samples whose clones share memory until one of them is changed.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// List of samples. Clones share one copy, and a clone that is about to be changed takes a copy of its own.
///
/// It dereferences to `Vec<f32>`.
///
/// ```
/// use wavelume_core::domain::Shared;
/// let measured = Shared::from(vec![1.0, 2.0]);
/// let mut changed = measured.clone();
/// changed[0] = 3.0;
/// assert_eq!((measured, changed), (vec![1.0, 2.0].into(), vec![3.0, 2.0].into()));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shared(Arc<Vec<f32>>);

impl Shared {
    /// Returns the samples as a list of its own, which are copied only if another clone shares them.
    pub fn into_vec(self) -> Vec<f32> {
        Arc::unwrap_or_clone(self.0)
    }
}

impl From<Vec<f32>> for Shared {
    fn from(samples: Vec<f32>) -> Self {
        Self(Arc::new(samples))
    }
}

impl FromIterator<f32> for Shared {
    fn from_iter<I: IntoIterator<Item = f32>>(samples: I) -> Self {
        samples.into_iter().collect::<Vec<f32>>().into()
    }
}

impl Deref for Shared {
    type Target = Vec<f32>;

    fn deref(&self) -> &Vec<f32> {
        &self.0
    }
}

impl DerefMut for Shared {
    fn deref_mut(&mut self) -> &mut Vec<f32> {
        Arc::make_mut(&mut self.0)
    }
}

impl<'a> IntoIterator for &'a Shared {
    type Item = &'a f32;
    type IntoIter = std::slice::Iter<'a, f32>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl PartialEq<Vec<f32>> for Shared {
    fn eq(&self, other: &Vec<f32>) -> bool {
        *self.0 == *other
    }
}

impl<const N: usize> PartialEq<[f32; N]> for Shared {
    fn eq(&self, other: &[f32; N]) -> bool {
        *self.0 == *other
    }
}
