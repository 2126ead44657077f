//! ROS bags, version 2.0: what `rosbag record` and the RealSense viewer write.
//!
//! A record is a header of named fields and data, each with its length in front. A bag header is
//! followed by chunks, packed runs of connections and messages; the index at the end repeats the
//! connections and says where each chunk stands and how many messages of each connection it holds.
//! A recorder that was stopped hard leaves no index (`index_pos` is 0); its chunks are read in turn.
//!
//! Reference: <http://wiki.ros.org/Bags/Format/2.0>.

mod fields;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use self::fields::{Cut, Fields};
use super::format::MessageFormat;
use super::unpack::unpack;
use super::visit::{Channel, Message, Visit, Walk};
use crate::DatasetError;
use crate::fault::Fault;
use crate::input::Input;

/// The first line of a bag.
const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// ROS 1 bag, version 2.0.
pub(super) const FORMAT: MessageFormat = MessageFormat { name: "ROS 1 bag", magic: MAGIC, walk };

/// A header beyond this `[B]` is a damaged length: it holds a topic's name and some numbers.
const MAX_HEADER: u64 = 1 << 20;
/// A connection's data hold the definition of its type, with all types in it.
const MAX_CONNECTION: u64 = 4 << 20;

const OP_MESSAGE: u8 = 2;
const OP_BAG: u8 = 3;
const OP_INDEX: u8 = 4;
const OP_CHUNK: u8 = 5;
const OP_CHUNK_INFO: u8 = 6;
const OP_CONNECTION: u8 = 7;

fn walk(input: &mut Input<'_>, visit: &mut Visit<'_>) -> Result<Walk, DatasetError> {
    let (connections, walk) = (BTreeMap::new(), Walk::default());
    let mut bag = Bag { input, connections, is_closed: false, whole_chunks: 0, walk };
    bag.read(visit)?;
    Ok(bag.walk)
}

/// The head of a record at `offset` of the file: its header, and where its data stand.
struct Record {
    header: Vec<u8>,
    data: u64,
    length: u64,
}

impl Record {
    fn end(&self) -> u64 {
        self.data.saturating_add(self.length)
    }
}

struct Bag<'a, 'b> {
    input: &'a mut Input<'b>,
    connections: BTreeMap<u32, Channel>,
    /// Whether the index is there; a record that is too long is then a damaged length.
    is_closed: bool,
    /// Chunks that could be unpacked.
    whole_chunks: u32,
    walk: Walk,
}

/// What the index at the end of a bag says.
#[derive(Default)]
struct Index {
    /// Where chunks begin, rising.
    chunks: Vec<u64>,
    /// Messages of each connection.
    counts: BTreeMap<u32, u64>,
}

impl Bag<'_, '_> {
    fn read(&mut self, visit: &mut Visit<'_>) -> Result<(), DatasetError> {
        let first = MAGIC.len() as u64;
        let Some(header) = self.record(first)? else { return Ok(()) };
        let (index_pos, chunk_count) = match bag_header(&header.header) {
            Ok(parsed) => parsed,
            Err(fault) => {
                self.walk.note(first, fault);
                (0, 0)
            }
        };
        let length = self.input.length();
        let index = if index_pos == 0 {
            self.walk.note(first, "the bag was not closed and has no index");
            None
        } else if index_pos >= length {
            let missing = index_pos - length;
            self.walk.note(
                length,
                format!(
                    "the file ends, the last {missing} bytes of messages and the index are missing"
                ),
            );
            self.walk.missing = Some((missing, length.saturating_sub(header.end())));
            None
        } else {
            self.index(index_pos, chunk_count)?
        };
        if let Some(index) = &index {
            let mut expected = BTreeMap::new();
            for (connection, count) in &index.counts {
                if let Some(channel) = self.connections.get(connection) {
                    *expected.entry(channel.topic.clone()).or_default() += count;
                }
            }
            self.walk.expected = Some(expected);
        }
        self.is_closed = index.is_some();
        let end = if index.is_some() { index_pos } else { length };
        let chunks = index.map_or_else(Vec::new, |index| index.chunks);
        self.chunks(header.end(), end, &chunks, visit)?;
        if !self.is_closed && index_pos != 0 && self.whole_chunks == chunk_count {
            // It is the index that is cut off: all messages come before it.
            self.walk.missing = Some((0, index_pos));
        }
        Ok(())
    }

    /// All chunks from `at` to `end`; where one cannot be read, on to the next of `known`.
    fn chunks(
        &mut self,
        mut at: u64,
        end: u64,
        known: &[u64],
        visit: &mut Visit<'_>,
    ) -> Result<(), DatasetError> {
        while at < end {
            let next = match self.record(at)? {
                Some(record) => match Fields::parse(&record.header).and_then(|f| f.u8("op")) {
                    Ok(OP_CHUNK) if self.is_closed && record.end() > end => {
                        let (found, most) = (record.length, end.saturating_sub(record.data));
                        let allowed = format!("at most {most} bytes");
                        self.walk
                            .note(at, Fault::new("a chunk", format!("{found} bytes"), allowed));
                        None
                    }
                    Ok(OP_CHUNK) => {
                        if self.chunk(at, &record, visit)?.is_break() {
                            return Ok(());
                        }
                        Some(record.end())
                    }
                    Ok(OP_INDEX | OP_CHUNK_INFO) => Some(record.end()),
                    Ok(OP_CONNECTION) => {
                        self.connection_at(at, &record)?;
                        Some(record.end())
                    }
                    Ok(op) => {
                        let fault = Fault::new("the record's op", op.to_string(), "2 to 7");
                        self.walk.note(at, fault);
                        None
                    }
                    Err(fault) => {
                        self.walk.note(at, fault);
                        None
                    }
                },
                None => None,
            };
            let resumed = || known.iter().copied().find(|&chunk| chunk > at);
            let Some(next) = next.or_else(resumed) else { return Ok(()) };
            at = next;
        }
        Ok(())
    }

    /// The head of the record at `at`; `None`, with a note, where there is none.
    fn record(&mut self, at: u64) -> Result<Option<Record>, DatasetError> {
        let Some(length) = self.length_at(at, "the header of a record", MAX_HEADER)? else {
            return Ok(None);
        };
        let header = self.input.read(at + 4, length)?;
        if (header.len() as u64) < length {
            self.walk.note(self.input.length(), "the file ends inside the header of a record");
            return Ok(None);
        }
        let at = at + 4 + length;
        let Some(length) = self.length_at(at, "the data of a record", u64::MAX)? else {
            return Ok(None);
        };
        Ok(Some(Record { header, data: at + 4, length }))
    }

    /// The length that stands at `at`.
    fn length_at(&mut self, at: u64, what: &str, most: u64) -> Result<Option<u64>, DatasetError> {
        let Some(length) = self.input.array(at)?.map(u32::from_le_bytes) else {
            self.walk.note(self.input.length(), format!("the file ends before {what}"));
            return Ok(None);
        };
        if u64::from(length) > most {
            let (found, allowed) = (format!("{length} bytes"), format!("at most {most} bytes"));
            self.walk.note(at, Fault::new(what, found, allowed));
            return Ok(None);
        }
        Ok(Some(u64::from(length)))
    }

    /// Reads the index; `None`, with a note, unless it is whole.
    fn index(&mut self, from: u64, chunks: u32) -> Result<Option<Index>, DatasetError> {
        let mut index = Index::default();
        let mut at = from;
        while at < self.input.length() {
            let Some(record) = self.record(at)? else { return Ok(None) };
            if record.end() > self.input.length() {
                self.walk.note(self.input.length(), "the file ends inside its index");
                return Ok(None);
            }
            match Fields::parse(&record.header).and_then(|f| f.u8("op")) {
                Ok(OP_CONNECTION) => self.connection_at(at, &record)?,
                Ok(OP_CHUNK_INFO) => {
                    let data = self.input.read(record.data, record.length)?;
                    if let Err(fault) = index.add(&record.header, &data) {
                        self.walk.note(at, fault);
                        return Ok(None);
                    }
                }
                Ok(op) => {
                    let fault =
                        Fault::new("the op of a record of the index", op.to_string(), "6 or 7");
                    self.walk.note(at, fault);
                    return Ok(None);
                }
                Err(fault) => {
                    self.walk.note(at, fault);
                    return Ok(None);
                }
            }
            at = record.end();
        }
        if index.chunks.len() as u64 != u64::from(chunks) {
            let (found, allowed) = (index.chunks.len().to_string(), chunks.to_string());
            self.walk.note(
                self.input.length(),
                Fault::new("the number of chunks in the index", found, allowed),
            );
            return Ok(None);
        }
        index.chunks.sort_unstable();
        Ok(Some(index))
    }

    fn connection_at(&mut self, at: u64, record: &Record) -> Result<(), DatasetError> {
        let data = self.input.read(record.data, record.length.min(MAX_CONNECTION))?;
        if let Err(fault) = self.connection(&record.header, &data) {
            self.walk.note(at, fault);
        }
        Ok(())
    }

    fn connection(&mut self, header: &[u8], data: &[u8]) -> Result<(), Fault> {
        let header = Fields::parse(header)?;
        let (id, topic) = (header.u32("conn")?, header.text("topic")?.to_owned());
        let schema = Fields::parse(data)?.text("type")?.to_owned();
        self.connections.insert(id, Channel { topic, schema, encoding: "ros1".to_owned() });
        Ok(())
    }

    fn chunk(
        &mut self,
        at: u64,
        record: &Record,
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let head = Fields::parse(&record.header)
            .and_then(|f| Ok((f.text("compression")?.to_owned(), f.u32("size")?)));
        let (compression, size) = match head {
            Ok(head) => head,
            Err(fault) => {
                self.walk.note(at, fault);
                return Ok(ControlFlow::Continue(()));
            }
        };
        let packed = self.input.read(record.data, record.length)?;
        let is_cut = (packed.len() as u64) < record.length;
        if is_cut {
            let (there, whole) = (packed.len(), record.length);
            let what = format!("the file ends, {there} of {whole} bytes of a chunk are there");
            self.walk.note(self.input.length(), what);
        }
        let limit = self.input.unpack_limit();
        let unpacked = unpack(&compression, Cow::Owned(packed), u64::from(size), limit);
        match unpacked.fault {
            // Records of a damaged chunk cannot be trusted; those before a cut can.
            Some(fault) if !is_cut => {
                self.walk.note(at, fault);
                Ok(ControlFlow::Continue(()))
            }
            _ => {
                self.whole_chunks += u32::from(!is_cut);
                self.records(at, &unpacked.bytes, is_cut, visit)
            }
        }
    }

    /// The records in a chunk.
    fn records(
        &mut self,
        chunk: u64,
        bytes: &[u8],
        is_cut: bool,
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let mut rest = bytes;
        while !rest.is_empty() {
            match fields::split(rest) {
                Ok(record) => {
                    if self.show(chunk, record.header, record.data, visit)?.is_break() {
                        return Ok(ControlFlow::Break(()));
                    }
                    rest = record.behind;
                }
                Err(Cut { header, fault }) => {
                    if !is_cut {
                        self.walk.note(chunk, fault.of("a record of the chunk"));
                    }
                    // Whose message it was is known when its header is there.
                    let head = header.and_then(|header| Fields::parse(header).ok());
                    let connection = head.and_then(|head| head.u32("conn").ok());
                    if let Some(channel) = connection.and_then(|id| self.connections.get(&id)) {
                        self.walk.note_cut(channel);
                    }
                    break;
                }
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// One whole record of the chunk at `chunk`.
    fn show(
        &mut self,
        chunk: u64,
        header: &[u8],
        data: &[u8],
        visit: &mut Visit<'_>,
    ) -> Result<ControlFlow<()>, DatasetError> {
        let head = Fields::parse(header).and_then(|fields| match fields.u8("op")? {
            OP_MESSAGE => Ok(Some((fields.u32("conn")?, fields.time("time")?))),
            OP_CONNECTION => self.connection(header, data).map(|()| None),
            op => Err(Fault::new("the op", op.to_string(), "2 or 7")),
        });
        match head {
            Ok(Some((id, time_ns))) => {
                if let Some(channel) = self.connections.get(&id) {
                    return visit(&Message { channel, time_ns, data });
                }
                self.walk.note(
                    chunk,
                    format!("a message is of connection {id}, which is not described"),
                );
            }
            Ok(None) => {}
            Err(fault) => self.walk.note(chunk, fault.of("a record of the chunk")),
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// Where the index begins (0 for none) and how many chunks there are.
fn bag_header(header: &[u8]) -> Result<(u64, u32), Fault> {
    let fields = Fields::parse(header)?;
    match fields.u8("op")? {
        OP_BAG => Ok((fields.u64("index_pos")?, fields.u32("chunk_count")?)),
        op => Err(Fault::new("the op of the first record", op.to_string(), OP_BAG.to_string())),
    }
}

impl Index {
    /// Adds what a chunk info record says.
    fn add(&mut self, header: &[u8], data: &[u8]) -> Result<(), Fault> {
        self.chunks.push(Fields::parse(header)?.u64("chunk_pos")?);
        for pair in data.chunks(8) {
            let [c0, c1, c2, c3, n0, n1, n2, n3] = pair else {
                let found = format!("{} bytes", data.len());
                return Err(Fault::new("the data of a chunk info", found, "pairs of u32"));
            };
            let count = u32::from_le_bytes([*n0, *n1, *n2, *n3]);
            let connection = u32::from_le_bytes([*c0, *c1, *c2, *c3]);
            *self.counts.entry(connection).or_default() += u64::from(count);
        }
        Ok(())
    }
}
