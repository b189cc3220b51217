//! Pairs of directions from lists, lines and floats, all in degrees.

use super::super::extract::parse_json;
use super::super::problem::Problem;
use super::super::schemas;
use crate::domain::{Direction, Quantity};
use crate::evaluate::luminaire_direction;
use bytes::Bytes;
use serde::Deserialize;
use std::ops::Range;
use std::sync::Arc;
use utoipa::ToSchema;

/// A direction as `[theta, phi]` in degrees.
pub(super) type Angles = [f64; 2];

/// Incoming and outgoing direction of one query of a batch; `None` for a direction that it lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pair {
    pub(super) wi: Option<Direction>,
    pub(super) wo: Option<Direction>,
}

impl Pair {
    /// Returns which of the two directions the query contains, as `(incoming, outgoing)`.
    pub(super) fn given(&self) -> (bool, bool) {
        (self.wi.is_some(), self.wo.is_some())
    }
}

/// Directions that each binary query record contains, as two f32 for each direction, the incoming one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Directions {
    pub(super) wi: bool,
    pub(super) wo: bool,
}

/// Lists of incoming and outgoing directions, paired by position. Without any list there is one query, which has no
/// direction.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    wi: Option<Vec<Angles>>,
    wo: Option<Outgoing>,
    /// Number of pairs of directions in the batch.
    count: usize,
    /// Number of answers wanted for each pair of directions, such as random directions; each counts as a query.
    each: usize,
}

/// List of outgoing directions in degrees.
#[derive(Clone, Debug)]
pub(super) enum Outgoing {
    /// Polar angle and azimuth, `[theta, phi]`.
    Polar(Vec<Angles>),
    /// Photometric angles of a luminaire, `[C, gamma]`.
    Luminaire(Vec<Angles>),
}

impl Outgoing {
    /// Returns the list that a request states under one of its two names; `None` if it states none.
    pub(super) fn of(wo: Option<Vec<Angles>>, c_gamma: Option<Vec<Angles>>) -> Result<Option<Self>, Problem> {
        match (wo, c_gamma) {
            (Some(_), Some(_)) => Err(Problem::invalid("found both wo and c_gamma, expected one of them")),
            (wo, c_gamma) => Ok(wo.map(Self::Polar).or(c_gamma.map(Self::Luminaire))),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Polar(list) | Self::Luminaire(list) => list.len(),
        }
    }

    fn at(&self, i: usize, quantity: Quantity) -> Result<Direction, Problem> {
        match self {
            Self::Polar(list) => check("wo", list[i]).map_err(Problem::invalid),
            Self::Luminaire(list) => Ok(luminaire_direction(quantity, list[i][0], list[i][1])?),
        }
    }
}

/// Some queries of a batch, in the encoding in which they arrived.
#[derive(Clone, Debug)]
pub(super) enum Records {
    /// Queries of a batch given as parsed lists of directions: the lists of the whole batch, and the range of the
    /// queries in this block, numbered from 0 in the batch. Each answer wanted for a pair of directions counts as a
    /// query.
    Listed(Arc<Places>, Range<usize>),
    /// Binary records, one for each query: polar angle and azimuth of each direction in degrees, as little-endian f32.
    Floats(Directions, Bytes),
    /// NDJSON lines; the last one may lack its newline.
    Lines(Bytes),
}

/// One query of a batch as a line of NDJSON.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Line)]
pub(super) struct Line {
    /// Incoming direction `[theta, phi]` in degrees, for quantities and operations that take one.
    #[serde(default)]
    #[schema(value_type = Option<schemas::Angles>)]
    wi: Option<[f64; 2]>,
    /// Outgoing direction `[theta, phi]` in degrees, for quantities and operations that take one.
    #[serde(default)]
    #[schema(value_type = Option<schemas::Angles>)]
    wo: Option<[f64; 2]>,
    /// Outgoing direction of a luminaire as `[C, gamma]` in degrees, instead of `wo`: theta = 180° − gamma, phi = C.
    #[serde(default)]
    #[schema(value_type = Option<schemas::LuminaireAngles>)]
    c_gamma: Option<[f64; 2]>,
}

impl Directions {
    /// Returns the length in bytes of a binary query record.
    pub(super) fn bytes(self) -> usize {
        8 * (usize::from(self.wi) + usize::from(self.wo))
    }
}

impl Places {
    /// Pairs two lists of directions of equal length, or a list with a single direction. Each pair gets `each` answers;
    /// `most` bounds the total number of answers.
    pub(super) fn of(wi: Option<Vec<Angles>>, wo: Option<Outgoing>, each: usize, most: usize) -> Result<Self, Problem> {
        let count = match (wi.as_ref().map(Vec::len), wo.as_ref().map(Outgoing::len)) {
            (None, None) => 1,
            (Some(n), None) | (None, Some(n)) => n,
            (Some(a), Some(b)) if a == b || b == 1 => a,
            (Some(1), Some(b)) => b,
            (Some(a), Some(b)) => {
                return Err(Problem::invalid(format!(
                    "{a} directions in wi and {b} in wo, expected as many, or one of them"
                )));
            }
        };
        if count == 0 || count > most {
            return Err(Problem::invalid(format!("{count} directions, expected 1 to {most}")));
        }
        if each == 0 || each > most / count {
            return Err(Problem::invalid(format!("count: found {each}, expected 1 to {}", most / count)));
        }
        Ok(Self { wi, wo, count, each })
    }

    /// Returns the number of answers: the number of pairs of directions, times the number of answers wanted for each
    /// pair.
    pub(super) fn len(&self) -> usize {
        self.count * self.each
    }

    fn pair(&self, answer: usize, quantity: Quantity) -> Result<Pair, Problem> {
        let number = |count: usize| if count == 1 { 0 } else { answer / self.each };
        let wi = self.wi.as_ref().map(|list| check("wi", list[number(list.len())]).map_err(Problem::invalid));
        let wo = self.wo.as_ref().map(|list| list.at(number(list.len()), quantity));
        let pair = wi.transpose().and_then(|wi| Ok(Pair { wi, wo: wo.transpose()? }));
        pair.map_err(|problem| match self.place(answer).as_str() {
            "" => problem,
            place => problem.at(place.trim_end_matches(": ")),
        })
    }

    /// Returns the prefix of an error text that names the pair of directions of an answer.
    fn place(&self, answer: usize) -> String {
        if self.count == 1 { String::new() } else { format!("pair {}: ", answer / self.each + 1) }
    }
}

/// Pairs of directions read before the first invalid query, and the error of that query.
pub(super) struct Read {
    pub(super) pairs: Vec<Pair>,
    /// Zero-based numbers, in the batch, of the queries that were read: one for each pair of directions (line number
    /// for NDJSON).
    pub(super) numbers: Vec<u64>,
    pub(super) problem: Option<Problem>,
}

impl Records {
    /// Splits this block of queries of a batch into parts of at most `most` queries, which threads evaluate in
    /// parallel.
    pub(super) fn parts(&self, most: usize) -> Vec<Self> {
        match self {
            Self::Listed(places, range) => range
                .clone()
                .step_by(most)
                .map(|start| Self::Listed(Arc::clone(places), start..(start + most).min(range.end)))
                .collect(),
            Self::Floats(directions, bytes) => {
                let step = most * directions.bytes();
                let starts = (0..bytes.len()).step_by(step);
                starts
                    .map(|start| Self::Floats(*directions, bytes.slice(start..(start + step).min(bytes.len()))))
                    .collect()
            }
            Self::Lines(bytes) => {
                let ends = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
                let mut parts = Vec::new();
                let mut start = 0;
                for end in ends.skip(most - 1).step_by(most) {
                    parts.push(Self::Lines(bytes.slice(start..end)));
                    start = end;
                }
                if start < bytes.len() {
                    parts.push(Self::Lines(bytes.slice(start..)));
                }
                parts
            }
        }
    }

    /// Returns the number of queries in this part of a batch; the queries of the next part are numbered on from there.
    /// Each answer to a pair of directions counts as one query, and so does a blank line of NDJSON.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Listed(_, range) => range.len(),
            Self::Floats(directions, bytes) => bytes.len() / directions.bytes(),
            Self::Lines(bytes) => bytes.split(|byte| *byte == b'\n').count() - 1,
        }
    }

    /// Parses the pairs of directions up to the first invalid query. `first` is the zero-based number of the first
    /// query in the batch; `quantity` that of the material.
    pub(super) fn read(&self, first: u64, quantity: Quantity) -> Read {
        let (mut pairs, mut numbers) = (Vec::new(), Vec::new());
        let mut problem = None;
        let mut take = |number: u64, pair: Result<Option<Pair>, Problem>| match pair {
            Ok(pair) => {
                numbers.extend(pair.map(|_| number));
                pairs.extend(pair);
                true
            }
            Err(wrong) => {
                problem = Some(wrong);
                false
            }
        };
        match self {
            Self::Listed(places, range) => {
                let _ = range
                    .clone()
                    .zip(first..)
                    .all(|(answer, number)| take(number, places.pair(answer, quantity).map(Some)));
            }
            Self::Floats(directions, bytes) => {
                let records = bytes.chunks_exact(directions.bytes());
                let _ = records.zip(first..).all(|(record, number)| {
                    let pair = floats(*directions, record).map(Some);
                    take(number, pair.map_err(|problem| problem.at(&format!("record {}", number + 1))))
                });
            }
            Self::Lines(bytes) => {
                let lines = bytes.split(|byte| *byte == b'\n');
                let _ = lines.zip(first..).all(|(text, number)| {
                    take(number, line(text, quantity).map_err(|problem| problem.at(&format!("line {}", number + 1))))
                });
            }
        }
        Read { pairs, numbers, problem }
    }

    /// Returns the name of a query for an error text: the query behind answer number `at` of this part, counted from 0.
    /// `first` is the zero-based number of the part's first query in the batch.
    pub(super) fn name(&self, first: u64, at: usize) -> String {
        match self {
            Self::Listed(places, range) => places.place(range.start + at).trim_end_matches(": ").to_owned(),
            Self::Floats(..) => format!("record {}", first + at as u64 + 1),
            Self::Lines(bytes) => {
                // Blank lines have no answer.
                let lines = bytes.split(|byte| *byte == b'\n').zip(first..);
                let number = lines.filter(|(text, _)| !text.trim_ascii().is_empty()).nth(at).map_or(first, |(_, n)| n);
                format!("line {}", number + 1)
            }
        }
    }
}

/// Converts the angles of a direction in degrees to a direction. The error names the parameter `what` and the angles
/// found.
pub(super) fn check(what: &str, [theta, phi]: Angles) -> Result<Direction, String> {
    if (0.0..=180.0).contains(&theta) && phi.is_finite() {
        Ok(Direction::from_degrees(theta, phi))
    } else {
        Err(format!("{what}: found [{theta}, {phi}], expected [theta, phi] in degrees with theta from 0 to 180"))
    }
}

fn floats(directions: Directions, record: &[u8]) -> Result<Pair, Problem> {
    let at = |what, byte: usize| {
        let float = |at: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|i| record[byte + at + i])));
        check(what, [float(0), float(4)]).map_err(Problem::invalid)
    };
    let wi = if directions.wi { Some(at("wi", 0)?) } else { None };
    let wo = if directions.wo { Some(at("wo", if directions.wi { 8 } else { 0 })?) } else { None };
    Ok(Pair { wi, wo })
}

/// Parses one NDJSON line into a pair of directions; `None` if the line is blank.
fn line(text: &[u8], quantity: Quantity) -> Result<Option<Pair>, Problem> {
    if text.trim_ascii().is_empty() {
        return Ok(None);
    }
    let line: Line = parse_json(text)?;
    let at =
        |what, angles: Option<Angles>| angles.map(|angles| check(what, angles)).transpose().map_err(Problem::invalid);
    let outgoing = Outgoing::of(line.wo.map(|wo| vec![wo]), line.c_gamma.map(|angles| vec![angles]))?;
    let wo = outgoing.map(|outgoing| outgoing.at(0, quantity)).transpose()?;
    Ok(Some(Pair { wi: at("wi", line.wi)?, wo }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: Directions = Directions { wi: true, wo: true };

    fn packed(values: &[f32]) -> Bytes {
        values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>().into()
    }

    fn pairs(records: &Records, first: u64) -> Vec<Pair> {
        let read = records.read(first, Quantity::Edf);
        assert!(read.problem.is_none(), "{:?}", read.problem);
        read.pairs
    }

    #[test]
    fn lists_of_directions_pair_up() {
        let (two, three) = (vec![[0.0, 0.0], [30.0, 90.0]], vec![[0.0, 0.0]; 3]);
        let count = |wi, wo: Option<Vec<Angles>>, each| {
            Places::of(wi, wo.map(Outgoing::Polar), each, 9).map(|places| places.len())
        };
        assert_eq!(count(Some(two.clone()), Some(two.clone()), 1).unwrap(), 2);
        assert_eq!(count(Some(two[..1].to_vec()), Some(three.clone()), 3).unwrap(), 9);
        assert_eq!(count(None, None, 1).unwrap(), 1);
        assert!(count(Some(two), Some(three.clone()), 1).is_err());
        assert!(count(Some(vec![]), None, 1).is_err() && count(Some(vec![[0.0; 2]; 10]), None, 1).is_err());
        for each in [0, 4, usize::MAX] {
            assert!(count(Some(three.clone()), None, each).is_err(), "{each}");
        }
    }

    #[test]
    fn the_three_forms_say_the_same() {
        let (wi, wo) = (vec![[30.0, 90.0], [10.0, 0.5]], vec![[20.0, 1.0], [40.0, -3.0]]);
        let text = b"{\"wi\":[30,90],\"wo\":[20,1]}\n\r\n{\"wo\":[40,-3],\"wi\":[10,0.5]}";
        let listed = Records::Listed(Arc::new(Places::of(Some(wi), Some(Outgoing::Polar(wo)), 1, 9).unwrap()), 0..2);
        let floats = Records::Floats(BOTH, packed(&[30.0, 90.0, 20.0, 1.0, 10.0, 0.5, 40.0, -3.0]));
        let lines = Records::Lines(Bytes::from_static(text));
        assert_eq!(pairs(&listed, 0), pairs(&floats, 0));
        assert_eq!(pairs(&listed, 0), pairs(&lines, 7));
        assert_eq!(
            [&listed, &floats, &lines].map(|records| records.read(7, Quantity::Edf).numbers),
            [[7, 8], [7, 8], [7, 9]]
        );
        assert_eq!(
            (listed.name(0, 1), floats.name(5, 1), lines.name(7, 1)),
            ("pair 2".into(), "record 7".into(), "line 10".into())
        );
        for records in [listed, floats, lines] {
            let whole = pairs(&records, 0);
            let parts: Vec<Pair> = records.parts(1).iter().flat_map(|part| pairs(part, 0)).collect();
            assert_eq!(parts, whole);
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_number_behind_what_is_right() {
        let text = b"{\"wo\":[20,1]}\n\n{\"wo\":[200,1]}\n{\"wo\":[20,1]}\n";
        let read = Records::Lines(Bytes::from_static(text)).read(10, Quantity::Edf);
        assert_eq!(read.pairs.len(), 1);
        assert!(read.problem.unwrap().body().detail.starts_with("line 13: wo: found [200, 1]"));
        for bad in ["[[1,2],[3,4]]", "{\"wx\":[1,2]}", "{", "7", "{\"wi\":[1]}"] {
            let read = Records::Lines(Bytes::copy_from_slice(bad.as_bytes())).read(0, Quantity::Edf);
            assert!(read.problem.unwrap().body().detail.starts_with("line 1: "), "{bad}");
        }
        let nan = packed(&[1.0, 1.0, 1.0, 1.0, f32::NAN, 0.0, 1.0, 1.0]);
        let read = Records::Floats(BOTH, nan).read(0, Quantity::Edf);
        assert!(read.problem.unwrap().body().detail.starts_with("record 2: wi: found [NaN, 0]"));
    }

    #[test]
    fn luminaires_are_asked_by_c_and_gamma() {
        let asked = b"{\"c_gamma\":[90,30]}\n{\"wo\":[150,90]}\n{\"c_gamma\":[90,30],\"wo\":[150,90]}\n";
        let lines = Records::Lines(Bytes::from_static(asked));
        let read = lines.read(0, Quantity::Edf);
        let at = |pair: &Pair| pair.wo.unwrap().xyz();
        assert!(at(&read.pairs[0]).iter().zip(at(&read.pairs[1])).all(|(a, b)| (a - b).abs() < 1e-15));
        assert!(read.problem.unwrap().body().detail.starts_with("line 3: found both wo and c_gamma"));
        let refused = lines.read(0, Quantity::Brdf).problem.unwrap().body().detail;
        assert!(refused.starts_with("line 1: C and gamma are angles of a luminaire, but this is a brdf"), "{refused}");
        let list = Places::of(None, Outgoing::of(None, Some(vec![[0.0, 0.0], [0.0, 181.0]])).unwrap(), 1, 9).unwrap();
        let listed = Records::Listed(Arc::new(list), 0..2).read(0, Quantity::Edf);
        assert_eq!(listed.pairs.len(), 1);
        assert!(listed.problem.unwrap().body().detail.starts_with("pair 2: found C 0 and gamma 181"));
    }
}
