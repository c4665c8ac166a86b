//! Records inside a chunk: decompressed into memory that grows with the actual output, and checked as a whole. Their
//! content is collected by [`Inventory`](super::Inventory).

use std::io::Read;
use std::ops::Range;

use zstd::stream::raw::{Decoder, InBuffer, Operation, OutBuffer};

use super::chunk_check::ChunkCheck;
use super::limits::Limits;
use super::records::{ChunkHeader, ChunkIndex};
use super::wire::Fields;

/// Whether chunks of this compression can be opened.
pub(super) fn knows(compression: &str) -> bool {
    matches!(compression, "" | "zstd" | "lz4")
}

/// Opens chunks outside the scan that [offers](super::Scan::offering_chunks) them, for instance on another thread.
#[derive(Default)]
pub struct Opener {
    inflate: Inflate,
    limits: Limits,
}

impl Opener {
    /// Opener of chunks within these limits.
    pub fn new(limits: Limits) -> Self {
        Self { inflate: Inflate::default(), limits }
    }

    /// Decompresses and checks the chunk whose bytes were put into its [room](Opened::room).
    pub fn open(&mut self, chunk: &mut Opened) {
        std::mem::swap(&mut self.inflate.out, &mut chunk.out);
        chunk.content = Some(locate(&chunk.body, chunk.body.len() as u64, &self.limits).and_then(|(header, data)| {
            // The total opened so far is known to the scan only, which checks it.
            self.limits.refuse_chunk(&header, 0, u64::MAX)?;
            let bytes = chunk.body.get(data.clone()).unwrap_or_default();
            Content::of(&header, data, bytes, &mut self.inflate, &self.limits).map(Box::new)
        }));
        std::mem::swap(&mut self.inflate.out, &mut chunk.out);
    }
}

/// A chunk that was opened outside the scan. Its memory can be reused for another chunk.
#[derive(Debug, Default)]
pub struct Opened {
    /// Body of the chunk record.
    body: Vec<u8>,
    out: Vec<u8>,
    pub(super) content: Option<Result<Box<Content>, String>>,
}

impl Opened {
    /// Clears the chunk and returns room for the body of a chunk record.
    pub fn room(&mut self, length: usize) -> &mut [u8] {
        self.content = None;
        self.body.resize(length, 0);
        &mut self.body
    }

    /// Memory in use, in bytes.
    pub fn size(&self) -> usize {
        self.body.capacity() + self.out.capacity()
    }

    /// Length of the body in bytes.
    pub(super) fn length(&self) -> u64 {
        self.body.len() as u64
    }

    /// Body of the chunk record.
    pub(super) fn body(&self) -> &[u8] {
        &self.body
    }

    /// Records at a place of the content.
    pub(super) fn records(&self, place: Storage, data: &Range<usize>) -> &[u8] {
        match place {
            Storage::Plain => self.body.get(data.clone()).unwrap_or_default(),
            Storage::Inflated => &self.out,
        }
    }
}

/// Content of a chunk.
#[derive(Debug)]
pub(super) struct Content {
    /// Range of the compressed records within the body.
    pub(super) data: Range<usize>,
    pub(super) place: Storage,
    /// Chunk index without the chunk's place in the file, which the chunk itself does not know.
    pub(super) index: ChunkIndex,
    pub(super) survey: ChunkCheck,
    /// Whether the chunk decompresses to more than it claims.
    pub(super) more: bool,
}

impl Content {
    /// Opens a chunk whose compressed records, at `data` in its body, are `bytes`.
    pub(super) fn of(
        header: &ChunkHeader<'_>,
        data: Range<usize>,
        bytes: &[u8],
        inflate: &mut Inflate,
        limits: &Limits,
    ) -> Result<Self, String> {
        let place = inflate.open(header, bytes)?;
        let survey = ChunkCheck::of(inflate.records(place, bytes), limits)?;
        let mut index = header.index();
        // Without messages both are 0, whatever the header says.
        (index.start_time, index.end_time) = survey.span.unwrap_or_default();
        Ok(Self { data, place, index, survey, more: inflate.more })
    }
}

/// Header of a chunk record, and the range of the compressed records in its body. The body has this length and begins
/// with these bytes.
pub(super) fn locate<'a>(
    body: &'a [u8],
    length: u64,
    limits: &Limits,
) -> Result<(ChunkHeader<'a>, Range<usize>), String> {
    let mut fields = Fields(body);
    let header = ChunkHeader::parse(&mut fields).ok_or("a malformed chunk record")?;
    let start = body.len() - fields.0.len();
    let room = length - start as u64;
    let size = header.compressed_size;
    match size {
        _ if size > room => Err(format!("a chunk that claims {size} bytes but has {room}")),
        _ if size > limits.chunk => {
            let most = limits.chunk;
            Err(format!("a chunk of {size} bytes: those of more than {most} are not opened (limits.chunk_mib)"))
        }
        _ => Ok((header, start..start + size as usize)),
    }
}

/// Decompressor of chunks, one after the other, into one buffer.
#[derive(Default)]
pub(super) struct Inflate {
    zstd: Option<Decoder<'static>>,
    out: Vec<u8>,
    /// Whether the last one decompresses to more than it claims.
    more: bool,
}

impl Inflate {
    /// Decompresses and checks the chunk whose compressed bytes are `data`. Returns the place of its records.
    ///
    /// The error is a description of the problem. The size is not checked here, but by [`Limits`].
    pub(super) fn open(&mut self, header: &ChunkHeader<'_>, data: &[u8]) -> Result<Storage, String> {
        let size = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX);
        self.more = false;
        let place = match header.compression {
            "" => Storage::Plain,
            "zstd" => self
                .zstd(data, size)
                .map_err(|cause| foreign(data, "zstd", &ZSTD, cause))
                .map(|()| Storage::Inflated)?,
            "lz4" => {
                self.lz4(data, size).map_err(|cause| foreign(data, "lz4", &LZ4, cause)).map(|()| Storage::Inflated)?
            }
            other => return Err(unread(other)),
        };
        let records = self.records(place, data);
        if records.len() != size {
            return Err(format!("a chunk of {} uncompressed bytes that claims {size}", records.len()));
        }
        let crc = header.uncompressed_crc;
        if crc != 0 && crc32fast::hash(records) != crc {
            return Err("a chunk whose CRC does not hold".to_owned());
        }
        Ok(place)
    }

    /// Records at the `place` that [`Inflate::open`] returned.
    pub(super) fn records<'a>(&'a self, place: Storage, data: &'a [u8]) -> &'a [u8] {
        match place {
            Storage::Plain => data,
            Storage::Inflated => &self.out,
        }
    }

    fn zstd(&mut self, data: &[u8], size: usize) -> Result<(), String> {
        let decoder = match &mut self.zstd {
            Some(decoder) => decoder,
            none => none.insert(Decoder::new().map_err(corrupt)?),
        };
        decoder.reinit().map_err(corrupt)?;
        self.out.clear();
        let mut input = InBuffer::around(data);
        while self.out.len() < size {
            reserve(&mut self.out, size, data.len());
            let before = (input.pos(), self.out.len());
            let mut output = OutBuffer::around_pos(&mut self.out, before.1);
            decoder.run(&mut input, &mut output).map_err(corrupt)?;
            if (input.pos(), self.out.len()) == before {
                break;
            }
        }
        // A buffer left over from a longer chunk has room for more than this one claims.
        let more = self.out.len() > size || self.zstd_goes_on(&mut input)?;
        self.out.truncate(size);
        self.more = more;
        Ok(())
    }

    /// Whether the frames contain more than was asked for.
    fn zstd_goes_on(&mut self, input: &mut InBuffer<'_>) -> Result<bool, String> {
        let Some(decoder) = &mut self.zstd else { return Ok(false) };
        let mut beyond = [0; 1];
        let mut output = OutBuffer::around(&mut beyond[..]);
        loop {
            let before = input.pos();
            // Bytes after the last frame that are no frame are ignored, as every reader does.
            let Ok(_) = decoder.run(input, &mut output) else { return Ok(false) };
            if output.pos() > 0 || input.pos() == before {
                return Ok(output.pos() > 0);
            }
        }
    }

    fn lz4(&mut self, data: &[u8], size: usize) -> Result<(), String> {
        let (mut rest, mut filled) = (data, 0);
        let mut more = false;
        // Bytes of the previous chunk are overwritten, which is faster than clearing them.
        self.out.truncate(size);
        while filled < size && !rest.is_empty() {
            let mut frame = lz4::Decoder::new(&mut rest).map_err(corrupt)?;
            while filled < size {
                if filled == self.out.len() {
                    reserve(&mut self.out, size, data.len());
                    self.out.resize(self.out.capacity().min(size), 0);
                }
                match frame.read(self.out.get_mut(filled..).unwrap_or_default()).map_err(corrupt)? {
                    0 => break,
                    read => filled += read,
                }
            }
            more = frame.read(&mut [0; 1]).is_ok_and(|read| read > 0);
        }
        more |= lz4::Decoder::new(&mut rest).is_ok_and(|mut frame| frame.read(&mut [0; 1]).is_ok_and(|read| read > 0));
        self.out.truncate(filled);
        self.more = more;
        Ok(())
    }
}

/// First bytes of a frame.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
const LZ4: [u8; 4] = [0x04, 0x22, 0x4d, 0x18];

/// Error text for a compression that is not supported.
fn unread(compression: &str) -> String {
    let spelt = match compression.to_lowercase().as_str() {
        "zstd" | "lz4" => " (MCAP spells its own `zstd` and `lz4`)",
        _ => "",
    };
    let compression = crate::printable(compression);
    format!(
        "a chunk whose compression `{compression}` is not read{spelt}: MCAP knows zstd, lz4 and none; have the program that \
         wrote it write one of these, or `mcap compress --compression zstd` if its reader knows `{compression}`"
    )
}

/// Error text of a decompressor, with a hint if the bytes are not in the format that the chunk claims.
fn foreign(data: &[u8], name: &str, magic: &[u8], cause: String) -> String {
    match data.starts_with(magic) {
        true => cause,
        false => format!(
            "{cause}: it says {name}, but is no {name} frame (a raw block?); have the program that wrote it write frames, or \
             no compression"
        ),
    }
}

/// Place of a chunk's records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// In the recording itself: the chunk is not compressed.
    Plain,
    /// In the buffer of [`Inflate`].
    Inflated,
}

/// Reserves memory in steps that real compression ratios justify, never beyond `size`.
fn reserve(out: &mut Vec<u8>, size: usize, compressed: usize) {
    if out.capacity() == out.len() {
        let step = out.len().max(compressed.saturating_mul(8)).max(1 << 16);
        out.reserve_exact(step.min(size - out.len()));
    }
}

/// Error text for corrupt data. The decompressor's own text is dropped, since it depends on the room it was given.
fn corrupt(_cause: std::io::Error) -> String {
    "a chunk that cannot be decompressed".to_owned()
}
