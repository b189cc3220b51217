//! A batch cut into blocks, whatever pieces its body comes in.

use super::super::problem::{Kind, Problem};
use super::places::{Directions, Places, Records};
use super::read_ahead::ReadAhead;
use bytes::{Bytes, BytesMut};
use futures::FutureExt;
use std::sync::Arc;

/// Upper bound in bytes on one line of an NDJSON batch.
const LINE: usize = 4096;

/// Number of bytes of NDJSON lines that complete a block for evaluation; exceeded by one line at most. Raising it costs
/// memory per stream.
const LINES: usize = 256 << 10;

/// Block of a batch: consecutive queries that are evaluated together.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) records: Records,
    /// Zero-based number, within the batch, of the first query of the block.
    pub(super) first: u64,
}

/// Source of the blocks of queries of a batch: parsed lists of directions, or a request body that arrives in pieces.
#[derive(Debug)]
pub(super) enum Source {
    Listed { places: Arc<Places>, next: usize },
    Body { pieces: ReadAhead, cutter: Cutter, end: End },
}

/// State of the end of a request body: more pieces may come, the body is complete, or it broke off.
#[derive(Debug)]
pub(super) enum End {
    NotYet,
    Whole,
    Broken(Option<Problem>),
}

impl Source {
    /// Returns the next block of at most `most` queries; `None` at the end. No block follows an error.
    pub(super) async fn next(&mut self, most: usize) -> Option<Result<Block, Problem>> {
        match self {
            Self::Listed { places, next } => {
                let start = *next;
                *next = (start + most).min(places.len());
                let records = Records::Listed(Arc::clone(places), start..*next);
                (start < *next).then_some(Ok(Block { records, first: start as u64 }))
            }
            Self::Body { pieces, cutter, end } => loop {
                if let Some(block) = cutter.cut(most, !matches!(end, End::NotYet)) {
                    return Some(block);
                }
                match end {
                    End::NotYet => {}
                    End::Whole => return cutter.end(),
                    End::Broken(problem) => return problem.take().map(Err),
                }
                // Received records are evaluated before waiting for more.
                let piece = match pieces.next().now_or_never() {
                    Some(piece) => piece,
                    None => match cutter.cut(most, true) {
                        Some(block) => return Some(block),
                        None => pieces.next().await,
                    },
                };
                match piece {
                    Some(Ok(bytes)) => cutter.push(&bytes),
                    Some(Err(problem)) => *end = End::Broken(Some(problem)),
                    None => *end = End::Whole,
                }
            },
        }
    }

    /// Creates the source of the queries in a request body that arrives in pieces.
    pub(super) fn body(pieces: ReadAhead, cutter: Cutter) -> Self {
        Self::Body { pieces, cutter, end: End::NotYet }
    }
}

/// Bytes of a request body that were received but are not yet cut into a block of queries.
#[derive(Debug)]
pub(super) struct Cutter {
    form: Form,
    bytes: BytesMut,
    /// Zero-based number of the next query in the batch (of the next line for NDJSON).
    next: u64,
}

#[derive(Clone, Copy, Debug)]
enum Form {
    Floats(Directions),
    /// Queries as NDJSON, one on each line. `seen` is the number of received bytes that were searched for line ends and
    /// are not yet cut into a block of queries.
    Lines {
        seen: usize,
        /// Number of whole lines, which end with a newline, among the `seen` bytes.
        count: usize,
        /// Length in bytes of the whole lines among the `seen` bytes.
        whole: usize,
    },
}

impl Cutter {
    pub(super) fn floats(directions: Directions) -> Self {
        Self { form: Form::Floats(directions), bytes: BytesMut::new(), next: 0 }
    }

    pub(super) fn lines() -> Self {
        Self { form: Form::Lines { seen: 0, count: 0, whole: 0 }, bytes: BytesMut::new(), next: 0 }
    }

    fn push(&mut self, bytes: &Bytes) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Cuts a block of `most` queries from the received bytes; if `any` is true, also a smaller block of those that
    /// have arrived. Returns `None` if no block is complete.
    fn cut(&mut self, most: usize, any: bool) -> Option<Result<Block, Problem>> {
        let first = self.next;
        match &mut self.form {
            Form::Floats(directions) => {
                let count = (self.bytes.len() / directions.bytes()).min(most);
                if count == 0 || (count < most && !any) {
                    return None;
                }
                self.next += count as u64;
                let bytes = self.bytes.split_to(count * directions.bytes()).freeze();
                Some(Ok(Block { records: Records::Floats(*directions, bytes), first }))
            }
            Form::Lines { seen, count, whole } => {
                let full = |count: usize, whole: usize| count == most || whole >= LINES;
                while !full(*count, *whole) && *seen < self.bytes.len() {
                    *seen += 1;
                    if self.bytes[*seen - 1] == b'\n' {
                        (*count, *whole) = (*count + 1, *seen);
                    }
                }
                let endless = *seen - *whole > LINE;
                if *count > 0 && (any || endless || full(*count, *whole)) {
                    self.next += *count as u64;
                    let bytes = self.bytes.split_to(*whole).freeze();
                    (*seen, *count, *whole) = (*seen - *whole, 0, 0);
                    return Some(Ok(Block { records: Records::Lines(bytes), first }));
                }
                endless.then(|| {
                    let detail = format!("line {}: more than {LINE} bytes", first + 1);
                    Err(Problem::new(Kind::TooLarge, detail))
                })
            }
        }
    }

    /// Returns the last, incomplete block of queries once the body has ended, or the error of a truncated query.
    fn end(&mut self) -> Option<Result<Block, Problem>> {
        if self.bytes.is_empty() {
            return None;
        }
        let bytes = self.bytes.split().freeze();
        match &mut self.form {
            Form::Floats(directions) => Some(Err(cut_off(bytes.len() as u64, *directions))),
            Form::Lines { seen, .. } => {
                *seen = 0;
                Some(Ok(Block { records: Records::Lines(bytes), first: self.next }))
            }
        }
    }
}

/// Builds the error for a request body that ends inside a binary query record.
pub(super) fn cut_off(bytes: u64, directions: Directions) -> Problem {
    let record = directions.bytes() as u64;
    let detail = format!("the body ends {} bytes into a record of {record} bytes", bytes % record);
    Problem::new(Kind::BadBody, detail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;
    use std::time::Duration;

    const WO: Directions = Directions { wi: false, wo: true };

    /// Returns every pair of directions of a body that comes in pieces of `size` bytes, and the error at its end.
    async fn pairs(
        cutter: Cutter,
        body: &[u8],
        size: usize,
        most: usize,
    ) -> (Vec<super::super::places::Pair>, Option<Problem>) {
        let pieces: Vec<Result<Vec<u8>, std::io::Error>> = body.chunks(size).map(|piece| Ok(piece.to_vec())).collect();
        let body = Body::from_stream(futures::stream::iter(pieces));
        let mut source = Source::body(ReadAhead::new(body, Duration::from_secs(9)), cutter);
        let mut pairs = Vec::new();
        while let Some(block) = source.next(most).await {
            let block = match block {
                Ok(block) => block,
                Err(problem) => return (pairs, Some(problem)),
            };
            assert!(block.records.count() <= most);
            let read = block.records.read(block.first, crate::domain::Quantity::Brdf);
            pairs.extend(read.pairs);
            if read.problem.is_some() {
                return (pairs, read.problem);
            }
        }
        (pairs, None)
    }

    #[tokio::test]
    async fn any_pieces_give_the_same_records() {
        let floats: Vec<u8> = (0..40).flat_map(|i| (i as f32).to_le_bytes()).collect();
        let lines: Vec<String> = (0..20).map(|i| format!("{{\"wo\":[{},{}]}}\n", 2 * i, 2 * i + 1)).collect();
        let lines = lines.concat();
        let whole = pairs(Cutter::floats(WO), &floats, floats.len(), 4096).await.0;
        assert_eq!(whole.len(), 20);
        for size in [1, 2, 3, 5, 8, 13, 64, 1000] {
            for most in [1, 7, 4096] {
                assert_eq!(pairs(Cutter::floats(WO), &floats, size, most).await.0, whole, "{size} {most}");
                let text = lines.as_bytes();
                assert_eq!(pairs(Cutter::lines(), text, size, most).await.0, whole, "{size} {most}");
                let unended = &text[..text.len() - 1];
                assert_eq!(pairs(Cutter::lines(), unended, size, most).await.0, whole, "{size} {most}");
            }
        }
    }

    #[tokio::test]
    async fn what_is_left_over_is_told() {
        for size in [1, 100] {
            let (found, problem) = pairs(Cutter::floats(WO), &[0; 21], size, 4096).await;
            assert_eq!(found.len(), 2);
            assert_eq!(problem.unwrap().body().detail, "the body ends 5 bytes into a record of 8 bytes");
            let long = format!("{{\"wo\":[1,2]}}\n\n{}", " ".repeat(LINE + 1));
            let (found, problem) = pairs(Cutter::lines(), long.as_bytes(), size, 4096).await;
            assert_eq!(found.len(), 1);
            assert_eq!(problem.unwrap().body().detail, format!("line 3: more than {LINE} bytes"));
            let (found, problem) = pairs(Cutter::lines(), b"{\"wo\":[1,2]}\n\n{\"wo\":[1", size, 4096).await;
            assert_eq!(found.len(), 1);
            assert!(problem.unwrap().body().detail.starts_with("line 3: "));
            assert_eq!(pairs(Cutter::lines(), b"", size, 1).await.0.len(), 0);
        }
    }

    #[tokio::test]
    async fn a_body_that_breaks_is_a_problem_behind_what_came() {
        let pieces = [Ok(vec![0; 12]), Err(std::io::Error::other("gone"))];
        let pieces = ReadAhead::new(Body::from_stream(futures::stream::iter(pieces)), Duration::from_secs(9));
        let mut source = Source::body(pieces, Cutter::floats(WO));
        assert_eq!(source.next(4096).await.unwrap().unwrap().records.count(), 1);
        let broken = source.next(4096).await.unwrap().unwrap_err();
        assert!(broken.body().detail.contains("ended early"));
    }
}
