//! Answers to a batch: whole as JSON, or block by block as a stream in bounded memory.

use super::super::places::Place;
use super::super::problem::Problem;
use super::super::state::App;
use super::answering::{Answered, answer};
use super::answers::Answers;
use super::blocks::{Block, Source};
use super::media::Encoding;
use super::places::{Places, Records};
use super::question::Question;
use crate::evaluate::Material;
use crate::jobs::{Client, Limits, MathsError};
use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use futures::stream::BoxStream;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use tokio_util::task::AbortOnDropHandle;

/// Upper bound on the number of queries in a block, which is evaluated in one turn on the thread pool of queries.
/// Raising it costs memory and delays other clients.
const BLOCK: usize = 4096;
/// Upper bound on the number of output values of a block of queries. Blocks of queries with many values each reach it
/// before [`BLOCK`]. Raising it costs memory.
const BLOCK_VALUES: usize = 1 << 19;
/// Upper bound on the number of consecutive queries of a batch that one thread evaluates together. Raising it uses
/// fewer threads.
const PART: usize = 512;
/// Upper bound on the number of output values of the queries that one thread evaluates together. Queries with many
/// values each reach it before [`PART`], the bound on their number. Raising it uses fewer threads.
const PART_VALUES: usize = 1 << 16;
/// Largest number of blocks of queries of one streamed answer that are being evaluated or wait to be sent. Raising it
/// costs memory and lets more blocks be evaluated at once.
const BLOCKS: usize = 3;

/// Encoded answers to one block of queries: the bytes of the block's parts in order, and the error after the last
/// answer, if any.
#[derive(Debug)]
struct Sent {
    parts: VecDeque<Bytes>,
    problem: Option<Problem>,
}

/// Computes the answers to a whole batch as one JSON object. Runs on the thread pool of queries.
pub(super) fn whole(
    material: &Material,
    question: &Question,
    places: Places,
    limits: &Limits,
) -> Result<Vec<u8>, Problem> {
    let (count, width) = (places.len(), question.width(material));
    fits(count, width, limits.values)?;
    let mut all: Option<Answers> = None;
    let block = Block { records: Records::Listed(Arc::new(places), 0..count), first: 0 };
    for (answers, problem) in parts(material, question, &block, width, |answers| answers) {
        if let Some(problem) = problem {
            return Err(problem);
        }
        match &mut all {
            Some(all) => all.append(answers),
            None => all = Some(answers),
        }
    }
    let json = all.map(|all| all.json(question, material));
    json.transpose().map_err(|error| Problem::internal(&error)).map(Option::unwrap_or_default)
}

/// Refuses batches whose answers are too large for one JSON object.
fn fits(answers: usize, width: usize, most: usize) -> Result<(), Problem> {
    if answers.saturating_mul(width) > most {
        return Err(Problem::invalid(format!(
            "{answers} answers of {width} values, expected at most {most} values in one JSON answer; NDJSON and f32 have no limit"
        )));
    }
    Ok(())
}

/// Streams the answers to a batch block by block. `bytes` is the length of the response, if known.
pub(super) async fn stream(
    app: &App,
    client: Client,
    material: Arc<Material>,
    question: Question,
    source: Source,
    encoding: Encoding,
    bytes: Option<u64>,
) -> Result<Response, Problem> {
    let place = app.held.streams.take(client.clone(), 1)?;
    let width = question.width(&material);
    let most = BLOCK.min(BLOCK_VALUES / width).max(1);
    let asked = Arc::new((material, question));
    let blocks = futures::stream::unfold(source, move |mut source| async move {
        let block = source.next(most).await?;
        Some((block, source))
    });
    let queries = app.engine.queries.clone();
    let mut answered = blocks
        .map(move |block| {
            let (asked, queries) = (Arc::clone(&asked), queries.clone());
            // A separate task takes the turn when it comes, even while the client does not read.
            AbortOnDropHandle::new(tokio::spawn(client.clone().on_behalf(async move {
                let block = block?;
                let sent = queries.run_in_turn(move || send(&asked.0, &asked.1, &block, width, encoding)).await?;
                Ok::<_, Problem>(sent)
            })))
        })
        .buffered(BLOCKS)
        .map(|sent| {
            let sent = sent.unwrap_or_else(|error| Err(MathsError::Panicked(error.to_string()).into()));
            sent.unwrap_or_else(|problem| Sent { parts: VecDeque::new(), problem: Some(problem) })
        })
        .boxed();
    // The status waits for the first answer, so that an early failure is an ordinary problem.
    let mut sent = Sent { parts: VecDeque::new(), problem: None };
    while sent.parts.is_empty() {
        if let Some(problem) = sent.problem {
            return Err(problem);
        }
        let Some(next) = answered.next().await else { break };
        sent = next;
    }
    // Floats cannot encode a problem: while nothing is sent, it can still be the answer.
    if let Some(problem) = sent.problem.take_if(|_| encoding == Encoding::Floats) {
        return Err(problem);
    }
    let state = Sending { answered, sent, _place: place };
    let mut response =
        Body::from_stream(futures::stream::try_unfold(state, move |state| state.next(encoding))).into_response();
    response.headers_mut().insert(header::CONTENT_TYPE, encoding.header());
    response.headers_mut().extend(bytes.map(|bytes| (header::CONTENT_LENGTH, bytes.into())));
    Ok(response)
}

/// Streamed answer that is being sent: the blocks still to come, and the rest of the current one.
struct Sending {
    answered: BoxStream<'static, Sent>,
    sent: Sent,
    _place: Place,
}

impl Sending {
    async fn next(mut self, encoding: Encoding) -> io::Result<Option<(Bytes, Self)>> {
        loop {
            if let Some(part) = self.sent.parts.pop_front() {
                return Ok(Some((part, self)));
            }
            if let Some(problem) = self.sent.problem.take() {
                // Blocks after the problem are dropped.
                self.answered = futures::stream::empty().boxed();
                let problem = problem.body();
                tracing::info!(detail = problem.detail, "a streamed answer ended with an error");
                if encoding == Encoding::Floats {
                    return Err(io::Error::other(problem.detail));
                }
                let mut line = serde_json::to_vec(&problem)?;
                line.push(b'\n');
                return Ok(Some((line.into(), self)));
            }
            match self.answered.next().await {
                Some(sent) => self.sent = sent,
                None => return Ok(None),
            }
        }
    }
}

/// Evaluates and encodes a block of queries. Runs on the thread pool of queries.
fn send(material: &Material, question: &Question, block: &Block, width: usize, encoding: Encoding) -> Sent {
    let mut sent = Sent { parts: VecDeque::new(), problem: None };
    for (bytes, problem) in parts(material, question, block, width, |answers| answers.bytes(encoding)) {
        match bytes {
            Ok(bytes) if bytes.is_empty() => {}
            Ok(bytes) => sent.parts.push_back(bytes.into()),
            Err(error) => sent.problem = Some(Problem::internal(&error)),
        }
        sent.problem = sent.problem.or(problem);
        if sent.problem.is_some() {
            break;
        }
    }
    sent
}

/// Evaluates the parts of a block of queries in parallel. Each part returns its answers and the error after the last
/// one, if any.
fn parts<T: Send>(
    material: &Material,
    question: &Question,
    block: &Block,
    width: usize,
    take: impl Fn(Answers) -> T + Sync,
) -> Vec<(T, Option<Problem>)> {
    let mut next = block.first;
    let numbered: Vec<(Records, u64)> = block
        .records
        .parts(PART.min(PART_VALUES / width).max(1))
        .into_iter()
        .map(|records| {
            let first = next;
            next += records.count() as u64;
            (records, first)
        })
        .collect();
    let answered = |(records, first): (Records, u64)| {
        let Answered { answers, problem } = answer(question, material, &records, first);
        (take(answers), problem)
    };
    numbered.into_par_iter().map(answered).collect()
}
