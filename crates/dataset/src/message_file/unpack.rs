//! Unpacking of chunks, never beyond a limit.

use std::borrow::Cow;
use std::io::{self, Read};

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};

use crate::fault::Fault;

/// Window `[B]` that every decoder of zstd must offer (RFC 8878, 3.1.1.1.2).
const ZSTD_WINDOW: u64 = 8 << 20;

/// A chunk's records, and what went wrong on the way.
pub(super) struct Unpacked<'a> {
    /// As far as they could be unpacked.
    pub(super) bytes: Cow<'a, [u8]>,
    /// Why that is not all, or not as it was written.
    pub(super) fault: Option<Fault>,
}

/// Unpacks `packed`, which should give `size` bytes; `limit` bytes are never exceeded.
pub(super) fn unpack<'a>(
    compression: &str,
    packed: Cow<'a, [u8]>,
    size: u64,
    limit: u64,
) -> Unpacked<'a> {
    let mut unpacked = match compression {
        "" | "none" => Unpacked { bytes: packed, fault: None },
        _ if size > limit => {
            let (found, allowed) = (format!("{size} bytes"), format!("at most {limit} bytes"));
            refused(Fault::new("the unpacked chunk", found, allowed))
        }
        "lz4" => drain(lz4_flex::frame::FrameDecoder::new(&*packed), size),
        "bz2" => drain(bzip2::read::BzDecoder::new(&*packed), size),
        "zstd" => {
            let mut decoder = FrameDecoder::new();
            decoder.set_max_window_size(size.max(ZSTD_WINDOW));
            match StreamingDecoder::new_with_decoder(&*packed, decoder) {
                Ok(decoder) => drain(decoder, size),
                Err(error) => refused(Fault::new("the chunk", error.to_string(), "zstd")),
            }
        }
        other => {
            let found = format!("{other:?}");
            refused(Fault::new("the compression", found, "none, bz2, lz4 or zstd"))
        }
    };
    if unpacked.fault.is_none() && unpacked.bytes.len() as u64 != size {
        let found = format!("{} bytes", unpacked.bytes.len());
        unpacked.fault = Some(Fault::new("the unpacked chunk", found, format!("{size} bytes")));
    }
    unpacked
}

fn refused(fault: Fault) -> Unpacked<'static> {
    Unpacked { bytes: Cow::Borrowed(&[]), fault: Some(fault) }
}

/// Reads what `decoder` gives, one byte more than `size` at most.
fn drain(decoder: impl Read, size: u64) -> Unpacked<'static> {
    let mut bytes = Vec::with_capacity(size as usize + 1);
    // What was unpacked before an error stays in the buffer.
    let result: io::Result<usize> = decoder.take(size + 1).read_to_end(&mut bytes);
    let fault = result.err().map(|error| Fault::new("the chunk", error.to_string(), "whole"));
    Unpacked { bytes: Cow::Owned(bytes), fault }
}
