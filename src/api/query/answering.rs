//! The evaluation of records: the answers to a part of a batch.

use super::super::problem::{Kind, Problem};
use super::answers::{Answers, Values};
use super::places::{Pair, Records};
use super::question::Question;
use crate::domain::{Direction, Quantity};
use crate::evaluate::{Directions, Material, Pairs};
use crate::numeric::random::half_open;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use std::ops::Range;

/// Outcome of evaluating a part of a batch of queries: the answers before the first failed query, and the error of that
/// query.
#[derive(Debug)]
pub(super) struct Answered {
    pub(super) answers: Answers,
    pub(super) problem: Option<Problem>,
}

/// Reads a part of a batch of queries (`records`) and answers it up to the first query that is invalid or fails.
/// `first` is the zero-based number of its first query (of its line for NDJSON). Answers are bit-identical however a
/// batch is cut into parts.
pub(super) fn answer(question: &Question, material: &Material, records: &Records, first: u64) -> Answered {
    let read = records.read(first, material.quantity());
    let pairs = &read.pairs;
    let (values, failed) = match question {
        Question::Evaluate { index, how, beyond, wavelengths } => {
            let width = question.width(material);
            let mut values = vec![0.0; pairs.len() * width];
            let done = Done::of_runs(pairs, |range, wi, wo| {
                let out = &mut values[range.start * width..range.end * width];
                // The library treats places without directions as one place.
                let each = if wi.is_none() && wo.is_none() { width } else { out.len() };
                out.chunks_exact_mut(each).try_for_each(|out| {
                    let places = Pairs { index, wi, wo };
                    match wavelengths {
                        Some(wavelengths) => material.spectra_at(places, *how, *beyond, wavelengths, out)?,
                        None => material.spectra(places, *how, out)?,
                    }
                    Ok(())
                })
            });
            values.truncate(done.answers * width);
            (Values::Rows { values, width }, done.problem)
        }
        Question::Albedo { index, how } => {
            let width = material.lambdas();
            let mut values = vec![0.0; pairs.len() * width];
            let rows = values.chunks_exact_mut(width).zip(pairs);
            let done = Done::one_by_one(rows.map(|(row, pair)| {
                without_wo(pair.wo.is_some())?;
                Ok(material.albedo(index, pair.wi, *how, row)?)
            }));
            values.truncate(done.answers * width);
            (Values::Rows { values, width }, done.problem)
        }
        Question::Pdf { index, level } => {
            let mut densities = vec![0.0; pairs.len()];
            let done = Done::of_runs(pairs, |range, wi, wo| {
                if wo.is_none() {
                    return Err(unfit("no outgoing direction wo was given, expected one"));
                }
                Ok(material.pdfs(Pairs { index, wi, wo }, *level, &mut densities[range])?)
            });
            densities.truncate(done.answers);
            (Values::Densities(densities), done.problem)
        }
        Question::Sample { index, level, seed } => {
            let points = points(*seed, &read.numbers);
            let mut samples = vec![None; pairs.len()];
            let done = Done::of_runs(pairs, |range, wi, wo| {
                without_wo(wo.is_some())?;
                Ok(material.samples(index, wi, &points[range.clone()], *level, &mut samples[range])?)
            });
            samples.truncate(done.answers);
            (Values::Samples(samples), done.problem)
        }
    };
    let answered = &pairs[..values.len()];
    let extrapolated = answered.iter().map(|pair| material.is_extrapolated(pair.wi, pair.wo)).collect();
    let answers = Answers { values, extrapolated, is_luminaire: material.quantity() == Quantity::Edf };
    let failed = failed.map(|problem| match records.name(first, answers.len()).as_str() {
        "" => problem,
        name => problem.at(name),
    });
    // A failed answer precedes the first unreadable record.
    Answered { answers, problem: failed.or(read.problem) }
}

/// Progress through a batch of queries: the number of answers so far, and the error that ended the batch, if any.
struct Done {
    answers: usize,
    problem: Option<Problem>,
}

impl Done {
    fn one_by_one(results: impl Iterator<Item = Result<(), Problem>>) -> Self {
        let mut answers = 0;
        for result in results {
            if let Err(problem) = result {
                return Self { answers, problem: Some(problem) };
            }
            answers += 1;
        }
        Self { answers, problem: None }
    }

    /// Answers queries by calls of `ask`, one for each run of consecutive queries with the same kinds of directions:
    /// incoming, outgoing, both or none.
    ///
    /// `ask` answers a range of queries with the given directions. It refuses the whole range if one query is invalid.
    fn of_runs(
        pairs: &[Pair],
        mut ask: impl FnMut(Range<usize>, Option<Directions<'_>>, Option<Directions<'_>>) -> Result<(), Problem>,
    ) -> Self {
        let mut answers = 0;
        for run in pairs.chunk_by(|a, b| a.given() == b.given()) {
            let wi: Option<Vec<Direction>> = run.iter().map(|pair| pair.wi).collect();
            let wo: Option<Vec<Direction>> = run.iter().map(|pair| pair.wo).collect();
            let start = answers;
            let done = Self::up_to_refused(0..run.len(), &mut |range| {
                let [wi, wo] = [&wi, &wo].map(|all| all.as_deref().map(|all| Directions::of(&all[range.clone()])));
                ask(start + range.start..start + range.end, wi, wo)
            });
            answers += done.answers;
            if done.problem.is_some() {
                return Self { answers, ..done };
            }
        }
        Self { answers, problem: None }
    }

    /// Answers a range of queries by a call of `ask`. If `ask` refuses the range, bisects it to answer the queries
    /// before the first invalid one; returns their number and the error of the invalid one.
    fn up_to_refused(range: Range<usize>, ask: &mut impl FnMut(Range<usize>) -> Result<(), Problem>) -> Self {
        let problem = match ask(range.clone()) {
            Ok(()) => return Self { answers: range.len(), problem: None },
            Err(problem) => problem,
        };
        if range.len() == 1 {
            return Self { answers: 0, problem: Some(problem) };
        }
        let middle = range.start + range.len() / 2;
        let first = Self::up_to_refused(range.start..middle, ask);
        if first.problem.is_some() {
            return first;
        }
        let second = Self::up_to_refused(middle..range.end, ask);
        Self { answers: first.answers + second.answers, ..second }
    }
}

fn without_wo(has_wo: bool) -> Result<(), Problem> {
    if has_wo { Err(unfit("an outgoing direction wo was given, expected an incoming one (wi) alone")) } else { Ok(()) }
}

fn unfit(detail: &str) -> Problem {
    Problem::new(Kind::UnfitQuery, detail)
}

/// Returns two random numbers from 0 to 1 for each query of a batch, given the queries' ascending numbers. They depend
/// only on the seed and the number.
fn points(seed: u64, numbers: &[u64]) -> Vec<[f64; 2]> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut next = 0;
    let point = |&number: &u64| {
        random.advance(2 * u128::from(number - next));
        next = number + 1;
        [half_open(&mut random), half_open(&mut random)]
    };
    numbers.iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::super::media::Encoding;
    use super::super::places::{Outgoing, Places};
    use super::*;
    use crate::domain::{Axis, Domain, Measurement, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid};
    use crate::evaluate::{Beyond, Interpolation, Place};
    use bytes::Bytes;
    use std::sync::Arc;

    const COUNT: usize = 333;

    fn material() -> Material {
        let triangles = |level| Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap());
        let lambdas = WavelengthGrid::even(400.0, 25.0, 12).unwrap();
        let axes = vec![triangles(1), triangles(2), Axis::Wavelength(lambdas)];
        let samples = (0..axes.iter().map(Axis::len).product()).map(|i: usize| {
            let x = ((i / 12).wrapping_mul(2_654_435_761) >> 7) % 61;
            (x as f32 / 60.0 * ((i % 12) as f32 / 5.0).sin()).exp()
        });
        let tensor = Tensor::new(axes.clone(), samples.collect()).unwrap();
        let measurement = Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor);
        Material::of(measurement.unwrap()).unwrap()
    }

    fn angles(i: usize) -> [[f64; 2]; 2] {
        let turn = |step: f64, most: f64| (i as f64 * step) % most;
        [[turn(1.37, 89.0), turn(7.1, 360.0)], [turn(2.53, 100.0), turn(11.3, 360.0)]]
    }

    fn questions() -> Vec<Question> {
        let index = Vec::new;
        let evaluate = |how, wavelengths| Question::Evaluate { index: index(), how, beyond: Beyond::Zero, wavelengths };
        let some = (0..20).map(|i| 390.0 + 17.3 * f64::from(i)).collect();
        vec![
            evaluate(Interpolation::Smooth, None),
            evaluate(Interpolation::Constant, None),
            evaluate(Interpolation::Smooth, Some(some)),
            Question::Pdf { index: index(), level: None },
            Question::Sample { index: index(), level: None, seed: 7 },
            Question::Sample { index: index(), level: Some(1), seed: 7 },
        ]
    }

    fn is_drawn(question: &Question) -> bool {
        matches!(question, Question::Sample { .. })
    }

    fn listed(question: &Question, count: usize) -> Records {
        let side = |k: usize| Some((0..count).map(|i| angles(i)[k]).collect());
        let wo = if is_drawn(question) { None } else { side(1) };
        Records::Listed(Arc::new(Places::of(side(0), wo.map(Outgoing::Polar), 1, count).unwrap()), 0..count)
    }

    fn cut(question: &Question, material: &Material, records: &Records, most: usize) -> (Answers, Option<Problem>) {
        let mut whole: Option<Answers> = None;
        let mut first = 0;
        for part in records.parts(most) {
            let Answered { answers, problem } = answer(question, material, &part, first);
            first += part.count() as u64;
            match &mut whole {
                Some(whole) => whole.append(answers),
                None => whole = Some(answers),
            }
            if problem.is_some() {
                return (whole.unwrap(), problem);
            }
        }
        (whole.unwrap(), None)
    }

    #[test]
    fn answers_do_not_depend_on_how_a_batch_is_cut() {
        let material = material();
        for question in questions() {
            let records = listed(&question, COUNT);
            let (whole, problem) = cut(&question, &material, &records, COUNT);
            assert!(problem.is_none() && whole.len() == COUNT);
            for most in [1, 7, 48, 100] {
                assert_eq!(cut(&question, &material, &records, most).0, whole, "{question:?} {most}");
            }
        }
    }

    fn lines(question: &Question, wi_of: impl Fn(usize) -> [f64; 2]) -> Vec<String> {
        let line = |i: usize| {
            let (wi, [_, wo]) = (wi_of(i), angles(i));
            let wo = if is_drawn(question) { String::new() } else { format!(",\"wo\":{wo:?}") };
            format!("{{\"wi\":{wi:?}{wo}}}\n")
        };
        (0..COUNT).map(line).collect()
    }

    fn text(answers: &Answers) -> Vec<String> {
        let bytes = answers.bytes(Encoding::Lines).unwrap();
        String::from_utf8(bytes).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn all_records_before_one_that_is_refused_have_the_answers_of_a_whole_batch() {
        let material = material();
        for question in questions() {
            let whole = text(&cut(&question, &material, &listed(&question, COUNT), COUNT).0);
            for bad in [0, 1, 47, 48, 200, COUNT - 1] {
                let mut records = lines(&question, |i| if i == bad { [120.0, 0.0] } else { angles(i)[0] });
                for (refused, reason) in
                    [(None, "wi has theta = 120"), (Some("{\"wo\":[1,2]}\n"), "w"), (Some("{}\n"), "was given")]
                {
                    records[bad] = refused.map_or_else(|| records[bad].clone(), str::to_owned);
                    let records = Records::Lines(Bytes::from(records.concat()));
                    for most in [COUNT, 100] {
                        let (answers, problem) = cut(&question, &material, &records, most);
                        let detail = problem.unwrap().body().detail;
                        assert!(
                            detail.starts_with(&format!("line {}: ", bad + 1)) && detail.contains(reason),
                            "{detail}"
                        );
                        assert_eq!(text(&answers), whole[..bad], "{question:?} {bad} {most}");
                    }
                }
            }
        }
    }

    #[test]
    fn blank_lines_between_records_do_not_change_with_the_cut() {
        let material = material();
        for question in questions() {
            let with_blanks = lines(&question, |i| angles(i)[0]).join("\n");
            let records = Records::Lines(Bytes::from(with_blanks));
            let (whole, _) = cut(&question, &material, &records, 2 * COUNT);
            assert_eq!(whole.len(), COUNT);
            for most in [3, 100] {
                assert_eq!(cut(&question, &material, &records, most).0, whole, "{question:?} {most}");
            }
        }
    }

    #[test]
    fn batches_are_as_near_to_single_answers_as_promised() {
        let material = material();
        for question in questions() {
            let Question::Evaluate { how, beyond, wavelengths, .. } = &question else { continue };
            let (answers, _) = cut(&question, &material, &listed(&question, COUNT), COUNT);
            let Values::Rows { values, width } = answers.values else { unreachable!("spectra are rows") };
            let mut one = vec![0.0; width];
            for (i, row) in values.chunks_exact(width).enumerate() {
                let [wi, wo] = angles(i).map(|[theta, phi]| Some(Direction::from_degrees(theta, phi)));
                let place = Place { index: &[], wi, wo };
                match wavelengths {
                    Some(wavelengths) => material.at_wavelengths(place, *how, *beyond, wavelengths, &mut one).unwrap(),
                    None => material.evaluate(place, *how, &mut one).unwrap(),
                }
                assert!(
                    one.iter().zip(row).all(|(a, b)| (a - b).abs() <= 2e-5 * a.abs()),
                    "{how:?} {i}: {one:?} {row:?}"
                );
            }
        }
    }

    #[test]
    fn places_without_directions_are_answered_each() {
        let axes = vec![Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap())];
        let tensor = Tensor::new(axes, vec![1.0, 2.0, 3.0]).unwrap();
        let measurement = Measurement::new(Quantity::Spectrum, Unit::Relative, Sampling::Average, tensor).unwrap();
        let material = Material::of(measurement).unwrap();
        let question = questions().swap_remove(0);
        let records = Records::Lines(Bytes::from_static(b"{}\n{}\n{\"wi\":[1,2]}\n"));
        let (answers, problem) = cut(&question, &material, &records, 9);
        assert_eq!(text(&answers), ["{\"values\":[1.0,2.0,3.0]}"; 2]);
        assert!(problem.unwrap().body().detail.starts_with("line 3: wi was given"));
    }
}
