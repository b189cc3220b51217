//! Bodies with `Content-Encoding: zstd` (RFC 8878), decoded as they arrive: one block at a time, in a window of at most
//! 8 MB.

use ruzstd::decoding::errors::FrameDecoderError;
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::io::{self, Read};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use tokio::io::{AsyncBufRead, AsyncRead, ReadBuf};

/// Upper bound in bytes on the window of a zstd-compressed body (RFC 9659: 8 MB).
const WINDOW: u64 = 8 << 20;
/// Magic number at the start of a zstd frame, little-endian (RFC 8878, section 3.1.1).
const MAGIC: u32 = 0xFD2F_B528;
const MAGIC_AND_DESCRIPTOR: usize = 5;
/// Magic number of a skippable zstd frame without its last four bits (RFC 8878, section 3.1.2).
const SKIPPABLE: u32 = 0x184D_2A50;
/// Upper bound in bytes on the content of a zstd block (RFC 8878, section 3.1.1.2).
const BLOCK: usize = 128 << 10;
/// Upper bound on the frame headers and blocks decoded before other tasks have their turn: four blocks of repeated
/// bytes take milliseconds. Raising it decodes a body sooner and lets other requests wait for longer.
const AT_ONCE: u32 = 4;
/// Length in bytes of the header of a zstd block.
const BLOCK_HEADER: usize = 3;
/// Length in bytes of the checksum of a zstd frame.
const CHECKSUM: usize = 4;

/// Asynchronous reader that decompresses `source`, which contains zstd frames one after another.
pub(super) struct ZstdReader<R> {
    source: R,
    frames: Frames,
}

/// Decompressor of zstd frames, with the received part of the frame header or block that it decodes next.
struct Frames {
    decoder: FrameDecoder,
    piece: Vec<u8>,
    next: Piece,
    /// Zstd frame that is being received; `None` between frames.
    frame: Option<Frame>,
}

/// State of a zstd frame during decompression: facts that the frame header declares, and the length so far. They are
/// compared at the end of the frame.
struct Frame {
    has_checksum: bool,
    /// Size of the decompressed content in bytes that the frame header declares; `None` if it declares none.
    declared: Option<u64>,
    /// Number of bytes of decompressed content that have been read from the current zstd frame so far.
    read: u64,
}

/// Part of a zstd-compressed body that comes next: a frame header, a block, or bytes to skip.
#[derive(Clone, Copy)]
enum Piece {
    /// Header of a zstd frame, unless the body ends here.
    Header,
    /// Block of a zstd frame; the last block of a frame includes the checksum of the frame, if it has one.
    Block,
    /// Content of a skippable zstd frame, with the number of bytes that are still to be skipped.
    Skipped(u32),
}

impl Piece {
    /// Returns the piece with the rest of a skippable zstd frame, or the next frame header if nothing is left to skip.
    fn skipped(left: u32) -> Self {
        if left > 0 { Self::Skipped(left) } else { Self::Header }
    }
}

impl<R> ZstdReader<R> {
    /// Creates a decompressor that begins at the first zstd frame of `source`.
    pub(super) fn new(source: R) -> Self {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(WINDOW);
        let frames = Frames { decoder, piece: Vec::new(), next: Piece::Header, frame: None };
        Self { source, frames }
    }
}

impl<R: AsyncBufRead + Unpin> AsyncRead for ZstdReader<R> {
    fn poll_read(self: Pin<&mut Self>, context: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let Self { source, frames } = self.get_mut();
        let mut decoded = 0;
        while frames.decoder.can_collect() == 0 {
            frames.check()?;
            let mut source = Pin::new(&mut *source);
            let arrived = ready!(source.as_mut().poll_fill_buf(context))?;
            if arrived.is_empty() {
                return Poll::Ready(frames.end());
            }
            if decoded == AT_ONCE {
                context.waker().wake_by_ref();
                return Poll::Pending;
            }
            let taken = frames.take(arrived)?;
            source.consume(taken);
            decoded += u32::from(frames.piece.is_empty());
        }
        let read = frames.decoder.read(to.initialize_unfilled())?;
        to.advance(read);
        if let Some(frame) = &mut frames.frame {
            frame.read += read as u64;
        }
        Poll::Ready(Ok(()))
    }
}

impl Frames {
    /// Takes bytes that have arrived, at most to the end of the current frame header or block, and decodes it when
    /// complete. Returns the number of bytes taken.
    fn take(&mut self, arrived: &[u8]) -> io::Result<usize> {
        if let Piece::Skipped(left) = self.next {
            let taken = arrived.len().min(left as usize);
            self.next = Piece::skipped(left - taken as u32);
            return Ok(taken);
        }
        let taken = arrived.len().min(self.length()? - self.piece.len());
        self.piece.extend_from_slice(&arrived[..taken]);
        if self.piece.len() == self.length()? {
            self.decode()?;
            self.piece.clear();
        }
        Ok(taken)
    }

    /// Returns the length in bytes of the next piece to receive: a zstd frame header, or a zstd block with its header.
    /// If too few bytes have arrived to tell, returns how many bytes are needed to tell it.
    fn length(&self) -> io::Result<usize> {
        match (self.next, self.piece.as_slice()) {
            (Piece::Header, [a, b, c, d, after @ ..]) => match (u32::from_le_bytes([*a, *b, *c, *d]), after) {
                (MAGIC, []) => Ok(MAGIC_AND_DESCRIPTOR),
                (MAGIC, [descriptor, ..]) => Ok(header_length(*descriptor)),
                (magic, _) if magic & !0xF == SKIPPABLE => Ok(8),
                (magic, _) => Err(invalid(format!("found {magic:#010X} where a frame begins with {MAGIC:#010X}"))),
            },
            (Piece::Header, _) => Ok(4),
            (_, [a, b, c, ..]) => {
                let header = u32::from_le_bytes([*a, *b, *c, 0]);
                let (is_last, is_repeated, size) = (header & 1 == 1, header >> 1 & 3 == 1, (header >> 3) as usize);
                if size > BLOCK {
                    return Err(invalid(format!("a block of {size} bytes, expected at most {BLOCK}")));
                }
                let has_checksum = self.frame.as_ref().is_some_and(|frame| frame.has_checksum);
                let after = if is_last && has_checksum { CHECKSUM } else { 0 };
                Ok(BLOCK_HEADER + if is_repeated { 1 } else { size } + after)
            }
            _ => Ok(BLOCK_HEADER),
        }
    }

    /// Decodes the next piece of a zstd stream, a frame header or a block, once all its bytes have arrived.
    fn decode(&mut self) -> io::Result<()> {
        let is_header = matches!(self.next, Piece::Header);
        self.next = match self.piece.as_slice() {
            [0x50..=0x5F, _, _, _, a, b, c, d] if is_header => Piece::skipped(u32::from_le_bytes([*a, *b, *c, *d])),
            header if is_header => {
                self.decoder.reset(header).map_err(|error| refused(&error))?;
                let descriptor = header[4];
                let declares = content_size_length(descriptor) > 0;
                let declared = declares.then(|| self.decoder.content_size());
                self.frame = Some(Frame { has_checksum: descriptor & 4 != 0, declared, read: 0 });
                Piece::Block
            }
            block => {
                let is_last = self
                    .decoder
                    .decode_blocks(block, BlockDecodingStrategy::UptoBlocks(1))
                    .map_err(|error| refused(&error))?;
                if is_last { Piece::Header } else { Piece::Block }
            }
        };
        Ok(())
    }

    /// Checks the declared size and the checksum of a zstd frame that has ended, once its content has been read.
    fn check(&mut self) -> io::Result<()> {
        let ended = self.frame.take_if(|_| matches!(self.next, Piece::Header));
        let Some(Frame { has_checksum, declared, read }) = ended else { return Ok(()) };
        if has_checksum && self.decoder.get_calculated_checksum() != self.decoder.get_checksum_from_data() {
            return Err(invalid("the checksum of a frame is not that of its content".to_owned()));
        }
        match declared {
            Some(declared) if declared != read => Err(invalid(format!("a frame of {read} bytes says {declared}"))),
            _ => Ok(()),
        }
    }

    /// Accepts the end of the compressed body; fails if it is inside a zstd frame.
    fn end(&self) -> io::Result<()> {
        let is_whole = matches!(self.next, Piece::Header) && self.piece.is_empty();
        if is_whole { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }
}

/// Returns the length in bytes of a zstd frame header, which its descriptor byte determines (RFC 8878, section
/// 3.1.1.1.1).
fn header_length(descriptor: u8) -> usize {
    let window = usize::from(!is_one_segment(descriptor));
    let dictionary = [0, 1, 2, 4][usize::from(descriptor & 3)];
    MAGIC_AND_DESCRIPTOR + window + dictionary + content_size_length(descriptor)
}

/// Returns the length in bytes of the content-size field of a zstd frame header; 0 if the field is absent.
fn content_size_length(descriptor: u8) -> usize {
    match descriptor >> 6 {
        0 => usize::from(is_one_segment(descriptor)),
        flag => 1 << flag,
    }
}

/// Returns true if the descriptor of a zstd frame says that the window is as large as the content (single segment).
fn is_one_segment(descriptor: u8) -> bool {
    descriptor & 0x20 != 0
}

fn refused(error: &FrameDecoderError) -> io::Error {
    invalid(error.to_string())
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    use std::task::Waker;
    use tokio::io::{AsyncReadExt, BufReader};

    /// Test text compressed by `zstd --check -19` 1.5.4: one compressed block and a checksum.
    const OTHER: &[u8] = include_bytes!("../../tests/fixtures/zstd/table.zst");

    fn text() -> Vec<u8> {
        (0..600_u32).flat_map(|i| format!("{},{}\n", i % 90, i * i % 977).into_bytes()).collect()
    }

    /// Decompresses a zstd body that arrives `step` bytes at a time.
    async fn decoded(body: &[u8], step: usize) -> io::Result<Vec<u8>> {
        let mut out = Vec::new();
        ZstdReader::new(BufReader::with_capacity(step, body)).read_to_end(&mut out).await?;
        Ok(out)
    }

    #[tokio::test]
    async fn frames_come_back_however_they_arrive() {
        let text = text();
        let own = compress_to_vec(&*text.repeat(70), CompressionLevel::Fastest);
        let raw = compress_to_vec(&*text.repeat(70), CompressionLevel::Uncompressed);
        let empty = compress_to_vec(&[][..], CompressionLevel::Fastest);
        let skipped =
            [&[0x5A, 0x2A, 0x4D, 0x18, 3, 0, 0, 0, 1, 2, 3, 0x50, 0x2A, 0x4D, 0x18, 0, 0, 0, 0], OTHER].concat();
        for (body, times) in [
            (OTHER.to_vec(), 1),
            (own.clone(), 70),
            (raw.clone(), 70),
            (skipped, 1),
            (empty, 0),
            (vec![], 0),
            ([OTHER, &own, &raw].concat(), 141),
        ] {
            for step in [1, 7, 1 << 16] {
                assert!(decoded(&body, step).await.unwrap() == text.repeat(times), "{} bytes by {step}", body.len());
            }
        }
    }

    #[tokio::test]
    async fn what_is_cut_or_broken_is_refused() {
        for end in 1..OTHER.len() {
            let error = decoded(&OTHER[..end], 4096).await.unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof, "{end}: {error}");
        }
        let mut broken = OTHER.to_vec();
        *broken.last_mut().unwrap() ^= 1;
        assert!(decoded(&broken, 4096).await.unwrap_err().to_string().contains("checksum"));
        for at in 0..OTHER.len() {
            let mut broken = OTHER.to_vec();
            broken[at] ^= 0x55;
            assert!(decoded(&broken, 4096).await.is_err(), "byte {at}");
        }
        let reserved = [&OTHER[..header_length(OTHER[4])], &[0x07, 0, 0]].concat();
        assert!(decoded(&reserved, 4096).await.is_err());
        let large_block = [&OTHER[..header_length(OTHER[4])], &[0xFC, 0xFF, 0xFF]].concat();
        assert!(decoded(&large_block, 4096).await.unwrap_err().to_string().contains("expected at most 131072"));
    }

    proptest! {
        /// Arbitrary bytes after the header of a zstd frame are decoded or refused; nothing panics.
        #[test]
        fn hostile_blocks_are_refused(descriptor: u8, body in proptest::collection::vec(any::<u8>(), 0..400)) {
            let body = [&OTHER[..4], &[descriptor], &body[..]].concat();
            let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
            let _ = runtime.block_on(decoded(&body, 64));
        }

        /// A zstd frame in which some bytes are replaced is refused, or decodes to the original text.
        #[test]
        fn damaged_blocks_are_refused(places in proptest::collection::vec((9..OTHER.len(), any::<u8>()), 1..9)) {
            let mut body = OTHER.to_vec();
            for (place, byte) in places {
                body[place] = byte;
            }
            let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
            if let Ok(found) = runtime.block_on(decoded(&body, 64)) {
                prop_assert!(found == text());
            }
        }
    }

    #[test]
    fn a_small_body_that_grows_lets_others_have_their_turn() {
        let repeated = |is_last: bool| {
            let header = (BLOCK as u32) << 3 | 1 << 1 | u32::from(is_last);
            [&header.to_le_bytes()[..BLOCK_HEADER], b"a"].concat()
        };
        let blocks: Vec<u8> = (0..80).flat_map(|i| repeated(i == 79)).collect();
        let body = [&[0x28, 0xB5, 0x2F, 0xFD, 0, 13 << 3][..], &blocks].concat();
        let mut reader = ZstdReader::new(&body[..]);
        let (mut context, mut text, mut turns) = (Context::from_waker(Waker::noop()), [0; 64], 0);
        while Pin::new(&mut reader).poll_read(&mut context, &mut ReadBuf::new(&mut text)).is_pending() {
            turns += 1;
        }
        assert_eq!(text, [b'a'; 64]);
        assert!(turns >= 10, "{turns}");
    }

    #[tokio::test]
    async fn a_window_beyond_eight_megabytes_is_refused() {
        let frame = |window: u8| [&[0x28, 0xB5, 0x2F, 0xFD, 0, window][..], &[0x0B, 0, 0, b'a']].concat();
        assert_eq!(decoded(&frame(13 << 3), 64).await.unwrap(), b"a");
        let error = decoded(&frame(13 << 3 | 1), 64).await.unwrap_err();
        assert!(error.to_string().contains("9437184"), "{error}");
    }
}
