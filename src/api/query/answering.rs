//! The evaluation of records: the answers to a part of a batch.

use super::super::problem::Problem;
use super::answers::Answers;
use super::places::{Pair, Records};
use super::question::Question;
use crate::domain::Direction;
use crate::evaluate::{Beyond, EvaluateError, Interpolation, Material, Place};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// What became of a part of a batch: answers up to the first record that has none.
#[derive(Debug)]
pub(super) struct Answered {
    pub(super) answers: Answers,
    pub(super) problem: Option<Problem>,
}

/// Reads `records` and answers them up to the first that is wrong or has no answer. `first` is the number of the
/// first record from 0, in lines for lines.
pub(super) fn answer(question: &Question, material: &Material, records: &Records, first: u64) -> Answered {
    let read = records.read(first);
    let pairs = &read.pairs;
    let (answers, failed) = match question {
        Question::Evaluate { index, how, beyond, wavelengths } => {
            let width = question.width(material);
            let mut values = vec![0.0; pairs.len() * width];
            let done = spectra(material, pairs, index, (*how, *beyond, wavelengths.as_deref()), &mut values);
            values.truncate(done.answers * width);
            (Answers::Rows { values, width }, done.error)
        }
        Question::Albedo { index, how } => {
            let width = material.lambdas();
            let mut values = vec![0.0; pairs.len() * width];
            let rows = values.chunks_exact_mut(width).zip(pairs);
            let done =
                Done::of(rows.map(|(row, pair)| without_wo(pair).and_then(|wi| material.albedo(index, wi, *how, row))));
            values.truncate(done.answers * width);
            (Answers::Rows { values, width }, done.error)
        }
        Question::Pdf { index, level } => {
            let mut densities = Vec::with_capacity(pairs.len());
            let done = Done::of(pairs.iter().map(|pair| {
                let wo = pair.wo.ok_or_else(|| EvaluateError::Unfit("no wo was given, expected one".to_owned()))?;
                densities.push(material.pdf(index, pair.wi, wo, *level)?);
                Ok(())
            }));
            (Answers::Densities(densities), done.error)
        }
        Question::Sample { index, level, seed } => {
            let mut random = Pcg64Mcg::seed_from_u64(*seed);
            random.advance(2 * u128::from(first));
            let mut samples = Vec::with_capacity(pairs.len());
            let done = Done::of(pairs.iter().map(|pair| {
                let u = [uniform(&mut random), uniform(&mut random)];
                samples.push(material.sample(index, without_wo(pair)?, u, *level)?);
                Ok(())
            }));
            (Answers::Samples(samples), done.error)
        }
    };
    let failed = failed.map(|error| match records.name(first, answers.len()).as_str() {
        "" => Problem::from(error),
        name => Problem::from(error).at(name),
    });
    // What failed stands before what could not be read.
    Answered { answers, problem: failed.or(read.problem) }
}

/// How far a batch came.
struct Done {
    answers: usize,
    error: Option<EvaluateError>,
}

impl Done {
    fn of(results: impl Iterator<Item = Result<(), EvaluateError>>) -> Self {
        let mut answers = 0;
        for result in results {
            if let Err(error) = result {
                return Self { answers, error: Some(error) };
            }
            answers += 1;
        }
        Self { answers, error: None }
    }
}

/// The spectra of `pairs`, one row each. The one place where batches meet the library.
fn spectra(
    material: &Material,
    pairs: &[Pair],
    index: &[usize],
    (how, beyond, wavelengths): (Interpolation, Beyond, Option<&[f64]>),
    out: &mut [f32],
) -> Done {
    if pairs.is_empty() {
        return Done { answers: 0, error: None };
    }
    let width = out.len() / pairs.len();
    Done::of(out.chunks_exact_mut(width).zip(pairs).map(|(row, &Pair { wi, wo })| {
        let place = Place { index, wi, wo };
        match wavelengths {
            Some(wavelengths) => material.at_wavelengths(place, how, beyond, wavelengths, row),
            None => material.evaluate(place, how, row),
        }
    }))
}

fn without_wo(pair: &Pair) -> Result<Option<Direction>, EvaluateError> {
    match pair.wo {
        None => Ok(pair.wi),
        Some(_) => Err(EvaluateError::Unfit("wo was given, expected wi alone".to_owned())),
    }
}

/// A number from [0, 1) with 53 random bits, as the command line draws them.
fn uniform(random: &mut Pcg64Mcg) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}
