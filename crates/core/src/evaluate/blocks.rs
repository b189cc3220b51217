//! Values at many places: a block of places is located, then gathered, then expanded.
//!
//! Gathers of different places do not depend on each other, which hides most of the memory latency of materials larger
//! than the caches.

use super::arrived::Arrived;
use super::directions::{Directions, Pairs};
use super::error::{Argument, EvaluateError, QueryError, unfit};
use super::form::Form;
use super::function::Function;
use super::kernel::{BLOCK, vector_of};
use super::located::OUTSIDE;
use super::mixed::Mixed;
use super::place::Interpolation;
use super::planes::Planes;
use super::smooth::{SeenBlock, Smooth};
use super::warp::Draws;
use rayon::prelude::*;

/// Number of queries (pairs of directions) that a thread takes at a time.
const SHARE: usize = 4096;

/// Block of pairs of directions to evaluate, with the search results for each pair: the sample to which its incoming
/// direction belongs, and the nodes and weights of smooth interpolation.
pub(super) struct Places {
    arrived: Arrived,
    seen: SeenBlock,
}

impl Places {
    /// Initial scratch space for a block of queries. In a block that is not full, the entries behind its last query are
    /// computed like the others, and the results are ignored.
    pub(super) const NEW: Self = Self { arrived: Arrived::NEW, seen: SeenBlock::NOTHING };

    #[inline(always)]
    pub(super) fn arrived(&self) -> &Arrived {
        &self.arrived
    }

    #[inline(always)]
    pub(super) fn arrived_mut(&mut self) -> &mut Arrived {
        &mut self.arrived
    }
}

impl Function {
    /// Writes the spectra for the direction pairs `pairs` into `out`, `[pair][wavelength]`, on the calling thread, as
    /// [`Function::spectrum`] gives them. Does not allocate. Stops at the first invalid pair.
    pub(super) fn spectra(&self, pairs: Pairs<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let count = pairs.check(out.len(), self.geometry().lambdas())?;
        let lambdas = self.geometry().lambdas();
        let Form::Planes { planes, smooth } = self.form() else {
            let mut rows = out.chunks_exact_mut(lambdas).enumerate();
            return rows.try_for_each(|(i, out)| self.spectrum(pairs.place(i)?, how, out));
        };
        self.rows(planes, smooth, pairs, how, count, |start, rows| {
            planes.expand_all(rows, &mut out[start * lambdas..][..rows.len() * lambdas]);
        })
    }

    /// Interpolates the spectral coefficients for the direction pairs `pairs`, block by block. Passes each block to
    /// `work`, with the position of its first pair.
    pub(super) fn rows(
        &self,
        planes: &Planes,
        smooth: &Smooth,
        pairs: Pairs<'_>,
        how: Interpolation,
        count: usize,
        mut work: impl FnMut(usize, &[Mixed]),
    ) -> Result<(), EvaluateError> {
        let entry = self.geometry().entry(pairs.index)?;
        let [n_in, n_out, _] = self.geometry().shape();
        let (mut incoming, mut outgoing) = ([0; BLOCK], [0; BLOCK]);
        let (mut places, mut mixed) = (Places::NEW, [Mixed::NOTHING; BLOCK]);
        for start in (0..count).step_by(BLOCK) {
            let length = BLOCK.min(count - start);
            let part = pairs.part(start, start + length);
            let (incoming, outgoing) = (&mut incoming[..length], &mut outgoing[..length]);
            match how {
                Interpolation::Constant => {
                    self.geometry().incoming_entries(part, incoming)?;
                    self.geometry().outgoing_entries(part, outgoing)?;
                    for (mixed, (wi, wo)) in mixed.iter_mut().zip(incoming.iter().zip(&*outgoing)) {
                        let cell = (entry * n_in + *wi as usize) * n_out + *wo as usize;
                        *mixed = if *wo == OUTSIDE { Mixed::NOTHING } else { planes.mixed(cell) };
                    }
                }
                Interpolation::Smooth if part.wo.is_some() => {
                    places.arrived.write(self.geometry(), Some(smooth), part.wi, length)?;
                    self.smooth_rows_at(smooth, entry, part.wo, &mut places, &mut mixed[..length])?;
                }
                Interpolation::Smooth => {
                    for (i, mixed) in mixed[..length].iter_mut().enumerate() {
                        let seen = self.seen(smooth, None, part.place(i)?)?;
                        *mixed = seen.map_or(Mixed::NOTHING, |seen| smooth.at(entry, &seen));
                    }
                }
            }
            work(start, &mixed[..length]);
        }
        Ok(())
    }

    /// Evaluates a batch of spectra like [`Function::spectra`], on all threads.
    pub(super) fn par_spectra(
        &self,
        pairs: Pairs<'_>,
        how: Interpolation,
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let count = pairs.check(out.len(), self.geometry().lambdas())?;
        out.par_chunks_mut(SHARE * self.geometry().lambdas()).enumerate().try_for_each(|(share, out)| {
            let from = share * SHARE;
            self.spectra(pairs.part(from, (from + SHARE).min(count)), how, out)
        })
    }

    /// Interpolates the spectral coefficients smoothly at the given outgoing directions; coefficients are 0 outside the
    /// outgoing domain.
    fn smooth_rows_at(
        &self,
        smooth: &Smooth,
        entry: usize,
        wo: Option<Directions<'_>>,
        places: &mut Places,
        rows: &mut [Mixed],
    ) -> Result<(), EvaluateError> {
        let (Some(lookup), Some(wo)) = (self.geometry().mesh(), wo) else {
            let quantity = self.geometry().quantity();
            return unfit(QueryError::UnexpectedDirection { argument: Argument::Wo, quantity });
        };
        wo.write_block(&mut places.seen.wo)?;
        self.smooth_rows(smooth, entry, places, rows);
        for (i, row) in rows.iter_mut().enumerate() {
            if !lookup.holds(vector_of(&places.seen.wo, i)) {
                *row = Mixed::NOTHING;
            }
        }
        Ok(())
    }

    /// Interpolates the spectral coefficients smoothly at drawn directions; coefficients are 0 for failed draws.
    pub(super) fn rows_at_draws(
        &self,
        smooth: &Smooth,
        entry: usize,
        places: &mut Places,
        draws: &Draws,
        rows: &mut [Mixed],
    ) {
        places.seen.wo = draws.directions;
        self.smooth_rows(smooth, entry, places, rows);
        for (row, _) in rows.iter_mut().zip(&draws.pdf).filter(|(_, pdf)| **pdf <= 0.0) {
            *row = Mixed::NOTHING;
        }
    }

    /// Interpolates the spectral coefficients smoothly at the outgoing directions stored in `places`.
    fn smooth_rows(&self, smooth: &Smooth, entry: usize, places: &mut Places, rows: &mut [Mixed]) {
        let Places { arrived, seen } = places;
        seen.wi = *arrived.wi();
        if self.geometry().is_isotropic() {
            arrived.turn_back(&mut seen.wo);
        }
        for (i, around) in arrived.around().iter().enumerate().take(rows.len()) {
            seen.set_around(i, around);
        }
        smooth.at_block(entry, seen, rows);
    }

    /// Copies the spectral coefficients of the triangles in which directions were drawn; coefficients are 0 for failed
    /// draws.
    pub(super) fn rows_of_leaves(
        &self,
        planes: &Planes,
        entry: usize,
        places: &Places,
        draws: &Draws,
        rows: &mut [Mixed],
    ) {
        let [n_in, n_out, _] = self.geometry().shape();
        for (i, row) in rows.iter_mut().enumerate() {
            let incoming = entry * n_in + places.arrived.entry(i) as usize;
            let cell = incoming * n_out + draws.leaves[i] as usize;
            *row = if draws.pdf[i] > 0.0 { planes.mixed(cell) } else { Mixed::NOTHING };
        }
    }
}
