//! MCAP files: records behind an opcode and a length, messages mostly in packed chunks.
//!
//! The summary at the end repeats schemas and channels, says where chunks stand and how many messages
//! each channel has. A recorder that was stopped hard leaves none; its records are read in turn.
//!
//! Reference: <https://mcap.dev/spec>.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use mcap::MAGIC;
use mcap::records::{Record, op};

use super::format::MessageFormat;
use super::mcap_record::parse;
use super::unpack::unpack;
use super::visit::{Channel, Message, Visit, Walk};
use crate::DatasetError;
use crate::fault::Fault;
use crate::input::Input;

/// Bytes of a record before its content: opcode and length.
const HEAD: u64 = 9;
/// Bytes of a footer with its head.
const FOOTER: u64 = HEAD + 20;
/// A schema, a channel or an index beyond this `[B]` is a damaged length.
const MAX_DESCRIPTION: u64 = 4 << 20;

/// MCAP.
pub(super) const FORMAT: MessageFormat = MessageFormat { name: "MCAP", magic: MAGIC, walk };

fn walk(input: &mut Input<'_>, visit: &mut Visit<'_>) -> Result<Walk, DatasetError> {
    let (names, chunks, walk) = (Names::default(), Vec::new(), Walk::default());
    let mut file = Mcap { input, names, is_closed: false, chunks, walk };
    file.summary()?;
    file.records(visit)?;
    Ok(file.walk)
}

/// Schemas and channels by number.
#[derive(Default)]
struct Names {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
}

impl Names {
    /// Takes note of a schema or a channel.
    fn learn(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                let encoding = channel.message_encoding;
                self.channels
                    .insert(channel.id, Channel { topic: channel.topic, schema, encoding });
            }
            _ => {}
        }
    }
}

struct Mcap<'a, 'b> {
    input: &'a mut Input<'b>,
    names: Names,
    /// Whether the writer came to its end; a record that is too long is then a damaged length.
    is_closed: bool,
    /// Where chunks begin, rising; empty without a summary.
    chunks: Vec<u64>,
    walk: Walk,
}

impl Mcap<'_, '_> {
    /// The head of the record at `at`: opcode and length of its content.
    fn head(&mut self, at: u64) -> Result<Option<(u8, u64)>, DatasetError> {
        let head = self.input.array::<{ HEAD as usize }>(at)?;
        Ok(head
            .map(|[op, a, b, c, d, e, f, g, h]| (op, u64::from_le_bytes([a, b, c, d, e, f, g, h]))))
    }

    /// Reads the summary, if the file got as far as to have one.
    fn summary(&mut self) -> Result<(), DatasetError> {
        let length = self.input.length();
        let magic = MAGIC.len() as u64;
        let Some(footer) = length.checked_sub(FOOTER + magic) else {
            self.walk.note(length, "the file ends before its footer");
            return Ok(());
        };
        let tail = self.input.read(footer, FOOTER + magic)?;
        let is_closed = tail.ends_with(MAGIC) && tail.starts_with(&[op::FOOTER]);
        let start = match tail.get(HEAD as usize..) {
            Some(content) if is_closed => match parse(op::FOOTER, content) {
                Ok(Record::Footer(footer)) => footer.summary_start,
                _ => 0,
            },
            _ => {
                self.walk.note(length, "the file ends without its footer");
                return Ok(());
            }
        };
        self.is_closed = true;
        // 0 says that there is none.
        if start > 0 && !(start < footer && self.read_summary(start, footer)?) {
            self.walk.note(start, "the summary cannot be read");
            self.walk.expected = None;
            self.chunks.clear();
        }
        self.chunks.sort_unstable();
        Ok(())
    }

    /// Whether every record of the summary, from `at` to `end`, could be read.
    fn read_summary(&mut self, mut at: u64, end: u64) -> Result<bool, DatasetError> {
        while at < end {
            let Some((op, length)) = self.head(at)? else { return Ok(false) };
            if length > MAX_DESCRIPTION || at + HEAD + length > end {
                return Ok(false);
            }
            let content = self.input.read(at + HEAD, length)?;
            match parse(op, &content) {
                Ok(Record::Statistics(statistics)) => {
                    let mut expected = BTreeMap::new();
                    for (channel, count) in statistics.channel_message_counts {
                        if let Some(channel) = self.names.channels.get(&channel) {
                            let entry = expected.entry(channel.topic.clone()).or_insert(0u64);
                            *entry = entry.saturating_add(count);
                        }
                    }
                    self.walk.expected = Some(expected);
                }
                Ok(Record::ChunkIndex(index)) => self.chunks.push(index.chunk_start_offset),
                Ok(record) => self.names.learn(record),
                Err(_) => return Ok(false),
            }
            at += HEAD + length;
        }
        Ok(true)
    }

    /// All records of the data section.
    fn records(&mut self, visit: &mut Visit<'_>) -> Result<(), DatasetError> {
        let mut at = MAGIC.len() as u64;
        while let Some((op, length)) = self.head(at)? {
            let there = self.input.length() - at - HEAD;
            let is_cut = length > there;
            let next = match op {
                op::DATA_END | op::FOOTER => return Ok(()),
                _ if is_cut && (self.is_closed || !matches!(op, op::CHUNK | op::MESSAGE)) => {
                    let (found, allowed) = (format!("{there} bytes"), format!("{length} bytes"));
                    self.walk.note(at, Fault::new("a record", found, allowed));
                    None
                }
                op::CHUNK => {
                    if self.chunk(at, length.min(there), is_cut, visit)?.is_break() {
                        return Ok(());
                    }
                    Some(length)
                }
                op::MESSAGE => {
                    let content = self.input.read(at + HEAD, length)?;
                    if self.message(at, &content, is_cut, visit)?.is_break() {
                        return Ok(());
                    }
                    Some(length)
                }
                op::SCHEMA | op::CHANNEL if length <= MAX_DESCRIPTION => {
                    let content = self.input.read(at + HEAD, length)?;
                    self.learn(at, op, &content);
                    Some(length)
                }
                0 => {
                    self.walk.note(at, Fault::new("the opcode", "0", "1 to 255"));
                    None
                }
                // Indices, attachments and metadata say nothing of what was recorded.
                _ => Some(length),
            };
            let known = || self.chunks.iter().copied().find(|&chunk| chunk > at);
            let next = next.map(|length| (at + HEAD).saturating_add(length));
            let Some(next) = next.or_else(known) else { return Ok(()) };
            at = next;
        }
        Ok(())
    }

    /// A schema or a channel.
    fn learn(&mut self, at: u64, op: u8, content: &[u8]) {
        match parse(op, content) {
            Ok(record) => self.names.learn(record),
            Err(error) => self.walk.note(at, error),
        }
    }

    /// A message, in a chunk or outside of chunks.
    fn message(
        &mut self,
        at: u64,
        content: &[u8],
        is_cut: bool,
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let (header, data) = match parse(op::MESSAGE, content) {
            Ok(Record::Message { header, data }) => (header, data),
            Err(error) if !is_cut => {
                self.walk.note(at, error);
                return Ok(ControlFlow::Continue(()));
            }
            // Of a message that is cut not even the channel is known.
            _ => return Ok(ControlFlow::Continue(())),
        };
        let id = header.channel_id;
        match self.names.channels.get(&id) {
            Some(channel) if is_cut => self.walk.note_cut(channel),
            Some(channel) => {
                return visit(&Message { channel, time_ns: header.log_time, data: &data });
            }
            None => {
                self.walk.note(at, format!("a message is of channel {id}, which is not described"));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The chunk at `at`, `length` bytes of which are there.
    fn chunk(
        &mut self,
        at: u64,
        length: u64,
        is_cut: bool,
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let mut content = self.input.read(at + HEAD, length)?;
        let head = match ChunkHead::parse(&content) {
            Ok(head) => head,
            Err(fault) => {
                self.walk.note(at, fault);
                return Ok(ControlFlow::Continue(()));
            }
        };
        content.drain(..head.length);
        if (content.len() as u64) < head.packed && !is_cut {
            let found = format!("{} bytes", content.len());
            self.walk.note(at, Fault::new("the chunk", found, format!("{} bytes", head.packed)));
            return Ok(ControlFlow::Continue(()));
        }
        content.truncate(usize::try_from(head.packed).unwrap_or(usize::MAX));
        if is_cut {
            let (there, whole) = (content.len(), head.packed);
            let what = format!("the file ends, {there} of {whole} bytes of a chunk are there");
            self.walk.note(self.input.length(), what);
        }
        let limit = self.input.unpack_limit();
        let unpacked = unpack(&head.compression, Cow::Owned(content), head.size, limit);
        if !is_cut {
            let crc = if head.crc == 0 { 0 } else { crc32fast::hash(&unpacked.bytes) };
            let fault = unpacked.fault.or_else(|| {
                (crc != head.crc).then(|| {
                    let (found, allowed) = (format!("{crc:08x}"), format!("{:08x}", head.crc));
                    Fault::new("the CRC of the unpacked chunk", found, allowed)
                })
            });
            // Records of a damaged chunk cannot be trusted; those before a cut can.
            if let Some(fault) = fault {
                self.walk.note(at, fault);
                return Ok(ControlFlow::Continue(()));
            }
        }
        self.chunk_records(at, &unpacked.bytes, is_cut, visit)
    }

    fn chunk_records(
        &mut self,
        at: u64,
        bytes: &[u8],
        is_cut: bool,
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let mut rest = bytes;
        while let Some(([op, length @ ..], behind)) = rest.split_first_chunk::<{ HEAD as usize }>()
        {
            let length = u64::from_le_bytes(*length);
            let there = behind.len() as u64;
            if length > there && !is_cut {
                let fault = Fault::new(
                    "a record of the chunk",
                    format!("{there} bytes"),
                    format!("{length} bytes"),
                );
                self.walk.note(at, fault);
                break;
            }
            let (content, behind) = behind.split_at(length.min(there) as usize);
            if *op == op::MESSAGE {
                if self.message(at, content, length > there, visit)?.is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            } else if matches!(*op, op::SCHEMA | op::CHANNEL)
                && length <= MAX_DESCRIPTION.min(there)
            {
                self.learn(at, *op, content);
            }
            rest = behind;
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// What stands before a chunk's packed records.
struct ChunkHead {
    /// Bytes of the head itself.
    length: usize,
    compression: String,
    /// Bytes of the records, unpacked and packed.
    size: u64,
    packed: u64,
    /// CRC-32 of the unpacked records; 0 says that there is none.
    crc: u32,
}

impl ChunkHead {
    /// `mcap` reads whole chunks only; a chunk that the end of the file cuts off has a head too.
    fn parse(content: &[u8]) -> Result<Self, Fault> {
        let short =
            || Fault::new("the head of a chunk", format!("{} bytes", content.len()), "more");
        let number = |at: usize| {
            let bytes = content.get(at..).and_then(|rest| rest.first_chunk::<8>());
            bytes.copied().map(u64::from_le_bytes).ok_or_else(short)
        };
        let short_number = |at: usize| {
            let bytes = content.get(at..).and_then(|rest| rest.first_chunk::<4>());
            bytes.copied().map(u32::from_le_bytes).ok_or_else(short)
        };
        // Two times, size, CRC, name of the compression behind its length, packed size.
        let (size, crc, name) = (number(16)?, short_number(24)?, short_number(28)? as usize);
        let compression = content.get(32..32usize.saturating_add(name)).ok_or_else(short)?;
        let packed = number(32 + name)?;
        let compression = String::from_utf8_lossy(compression).into_owned();
        Ok(Self { length: 40 + name, compression, size, packed, crc })
    }
}
