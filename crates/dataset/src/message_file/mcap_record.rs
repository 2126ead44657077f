//! Records of an MCAP file, read only where their strings lie within them.
//!
//! `mcap` allocates what the length of a string says before it looks whether so many bytes are there: four damaged
//! bytes would ask for gigabytes.

use mcap::records::{Record, op};
use mcap::{McapError, McapResult};

/// What `mcap::parse_record` says of a record whose strings lie within it. Of records without use here (attachments,
/// metadata, indices of messages) only the opcode is examined.
pub(super) fn parse(op: u8, content: &[u8]) -> McapResult<Record<'_>> {
    let holds = match op {
        // Number; name, encoding.
        op::SCHEMA => skip(content, 2).and_then(string).and_then(string).is_some(),
        // Number, schema; topic, encoding; a map of strings.
        op::CHANNEL => {
            skip(content, 4).and_then(string).and_then(string).and_then(map).is_some_and(strings)
        }
        // Two times, place and length of the chunk; indices of messages; their length; compression.
        op::CHUNK_INDEX => skip(content, 32)
            .and_then(string)
            .and_then(|rest| skip(rest, 8))
            .and_then(string)
            .is_some(),
        op::MESSAGE | op::STATISTICS | op::FOOTER => true,
        _ => return Ok(Record::Unknown { opcode: op, data: [].as_slice().into() }),
    };
    if holds { mcap::parse_record(op, content) } else { Err(McapError::UnexpectedEof) }
}

fn skip(content: &[u8], bytes: usize) -> Option<&[u8]> {
    content.get(bytes..)
}

/// The bytes that stand here behind their length, and what comes after them.
fn sized(content: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = content.split_first_chunk()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

/// What comes after a string, or a map, that begins here.
fn string(content: &[u8]) -> Option<&[u8]> {
    sized(content).map(|(_, after)| after)
}

/// The bytes of a map that begins here.
fn map(content: &[u8]) -> Option<&[u8]> {
    sized(content).map(|(bytes, _)| bytes)
}

/// Whether there is one whole string after the other.
fn strings(mut content: &[u8]) -> bool {
    while !content.is_empty() {
        match string(content) {
            Some(rest) => content = rest,
            None => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    /// A schema and a channel as they should be.
    fn whole() -> [(u8, Vec<u8>); 2] {
        let schema = [&[1, 0], &*text("Image"), &text("ros2msg"), &text("uint8 x")].concat();
        let map = [text("key"), text("value")].concat();
        let map = [&(map.len() as u32).to_le_bytes(), &*map].concat();
        let channel = [&[2, 0, 1, 0], &*text("/depth"), &text("cdr"), &map].concat();
        [(op::SCHEMA, schema), (op::CHANNEL, channel)]
    }

    #[test]
    fn whole_records_are_read_as_mcap_reads_them() {
        for (op, content) in whole() {
            let (ours, theirs) = (parse(op, &content), mcap::parse_record(op, &content));
            assert_eq!(format!("{:?}", ours.unwrap()), format!("{:?}", theirs.unwrap()));
        }
    }

    #[test]
    fn lengths_beyond_the_record_are_refused_before_they_are_allocated() {
        // Where lengths stand: name, encoding; topic, encoding, map, key, value.
        let places = [&[2, 11][..], &[4, 14, 21, 25, 32][..]];
        for ((op, content), places) in whole().into_iter().zip(places) {
            for &at in places {
                let mut damaged = content.clone();
                damaged[at..at + 4].copy_from_slice(&0x7000_0000_u32.to_le_bytes());
                let refused = parse(op, &damaged);
                assert!(matches!(refused, Err(McapError::UnexpectedEof)), "{op} {at} {refused:?}");
            }
            for length in 0..content.len() {
                assert!(parse(op, &content[..length]).is_err(), "{op} {length}");
            }
        }
    }
}
