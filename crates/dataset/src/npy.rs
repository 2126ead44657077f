//! NumPy's .npy format, as far as arrays of numbers and one word of text need it.
//!
//! Reference: NumPy enhancement proposal 1, versions 1 to 3 of the format.

mod header;

use std::io::Read;
use std::path::Path;

use nalgebra::Vector3;

use self::header::{MAGIC, Source};
use crate::input::Input;
use crate::{DatasetError, Form, files};

/// Bytes that are turned into numbers at a time; a multiple of all sizes of a number.
const BUFFER: usize = 8 << 10;
/// Bytes beyond which one word is none.
const MAX_WORD: usize = 1 << 16;
/// Number types that are read.
const NUMBERS: &str = "a number type (f4, f8, i1 to i8, u1 to u8)";

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length along each axis; empty for a scalar.
    pub shape: Vec<usize>,
    /// Values, last axis fastest.
    pub values: Vec<f64>,
}

/// Reads numbers from a .npy file. `array` names it within `file`, empty for the file itself; the
/// numbers take `limit` bytes at most.
pub(crate) fn parse(
    file: &Path,
    array: &str,
    reader: &mut dyn Read,
    limit: u64,
) -> Result<Array, DatasetError> {
    parse_typed(file, array, reader, limit).map(|(array, _)| array)
}

/// As [`parse`], with whether the numbers are whole by their type.
pub(crate) fn parse_typed(
    file: &Path,
    array: &str,
    reader: &mut dyn Read,
    limit: u64,
) -> Result<(Array, bool), DatasetError> {
    let mut source = Source::new(file, array, reader);
    let header = source.header()?;
    let bad_type = || source.place.error("the dtype", format!("{:?}", header.descr), NUMBERS);
    let (big, kind, size) = split_descr(&header.descr).ok_or_else(bad_type)?;
    let decode = decoder(kind, size).ok_or_else(bad_type)?;
    // Numbers in the other order stand twice in memory while they change places.
    let copies = if header.fortran_order { 2 } else { 1 };
    let needed = header.count.saturating_mul(8 * copies);
    if needed as u64 > limit {
        let (found, allowed) =
            (format!("{:?}", header.shape), format!("at most {limit} bytes as f64"));
        return Err(source.place.error("the shape", found, allowed));
    }
    let mut values = Vec::with_capacity(header.count);
    let mut buffer = [0u8; BUFFER];
    while values.len() < header.count {
        let wanted = size * (header.count - values.len()).min(BUFFER / size);
        let found = source.fill(&mut buffer[..wanted])?;
        if found < wanted {
            let found = values.len() * size + found;
            return Err(source.truncated_data(found, header.count * size));
        }
        for raw in buffer[..wanted].chunks_exact(size) {
            let mut number = [0u8; 8];
            number[..size].copy_from_slice(raw);
            if big {
                number[..size].reverse();
            }
            values.push(decode(number));
        }
    }
    source.end()?;
    if header.fortran_order {
        values = to_row_major(&values, &header.shape);
    }
    Ok((Array { shape: header.shape, values }, kind != 'f'))
}

/// Reads one word (`<U2` and its kin, or bytes) from a .npy file.
pub(crate) fn parse_text(
    file: &Path,
    array: &str,
    reader: &mut dyn Read,
) -> Result<String, DatasetError> {
    let mut source = Source::new(file, array, reader);
    let header = source.header()?;
    let bad = || {
        source.place.error("the dtype", format!("{:?}", header.descr), "one word of text (U or S)")
    };
    let (big, kind, size) = split_descr(&header.descr).ok_or_else(bad)?;
    if header.count != 1 {
        return Err(source.place.error("the shape", format!("{:?}", header.shape), "one value"));
    }
    let bytes = match kind {
        'U' => size.saturating_mul(4),
        'S' => size,
        _ => return Err(bad()),
    };
    if bytes > MAX_WORD {
        let allowed = format!("at most {MAX_WORD} bytes");
        return Err(source.place.error("the word", format!("{bytes} bytes"), allowed));
    }
    let mut data = vec![0; bytes];
    let found = source.fill(&mut data)?;
    if found < bytes {
        return Err(source.truncated_data(found, bytes));
    }
    source.end()?;
    let text: String = if kind == 'U' {
        let letter = |raw: &[u8; 4]| {
            let code = if big { u32::from_be_bytes(*raw) } else { u32::from_le_bytes(*raw) };
            char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
        };
        data.as_chunks().0.iter().map(letter).collect()
    } else {
        data.iter().map(|&byte| char::from(byte)).collect()
    };
    Ok(text.trim_end_matches('\0').to_owned())
}

/// Byte order (true for big), kind and size of a type such as `<f8`.
fn split_descr(descr: &str) -> Option<(bool, char, usize)> {
    let mut letters = descr.chars();
    let order = letters.next()?;
    let big = match order {
        '<' | '|' => false,
        '>' => true,
        '=' => cfg!(target_endian = "big"),
        _ => return None,
    };
    let kind = letters.next()?;
    Some((big, kind, letters.as_str().parse().ok()?))
}

/// From eight little-endian bytes, of which the first `size` count, to a number.
fn decoder(kind: char, size: usize) -> Option<fn([u8; 8]) -> f64> {
    Some(match (kind, size) {
        ('f', 8) => f64::from_le_bytes,
        ('f', 4) => |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ('u', 1) => |b| f64::from(b[0]),
        ('u', 2) => |b| f64::from(u16::from_le_bytes([b[0], b[1]])),
        ('u', 4) => |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ('u', 8) => |b| u64::from_le_bytes(b) as f64,
        ('i', 1) => |b| f64::from(b[0].cast_signed()),
        ('i', 2) => |b| f64::from(i16::from_le_bytes([b[0], b[1]])),
        ('i', 4) => |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ('i', 8) => |b| i64::from_le_bytes(b) as f64,
        _ => return None,
    })
}

/// First axis fastest to last axis fastest.
fn to_row_major(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = index.iter().zip(shape).rev().fold(0, |at, (&i, &n)| at * n + i);
        ordered.push(values[at]);
        for (i, &n) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < n {
                break;
            }
            *i = 0;
        }
    }
    ordered
}

fn encode_header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let axes: Vec<_> = shape.iter().map(usize::to_string).collect();
    // A tuple of one wants its comma.
    let axes = axes.join(", ") + if shape.len() == 1 { "," } else { "" };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({axes}), }}");
    // The data begin at a multiple of 64 bytes: 10 bytes before, one newline after.
    let padding = (64 - (10 + header.len() + 1) % 64) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.into_bytes());
    bytes
}

/// The bytes of a .npy file of f64.
pub(crate) fn encode(shape: &[usize], values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let mut bytes = encode_header("<f8", shape);
    values.into_iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

/// The bytes of a .npy file of whole numbers.
pub(crate) fn encode_integers(shape: &[usize], values: impl IntoIterator<Item = i64>) -> Vec<u8> {
    let mut bytes = encode_header("<i8", shape);
    values.into_iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}

/// The bytes of a .npy file of one word.
pub(crate) fn encode_text(word: &str) -> Vec<u8> {
    let mut bytes = encode_header(&format!("<U{}", word.chars().count().max(1)), &[]);
    let letters = if word.is_empty() { "\0" } else { word };
    letters.chars().for_each(|letter| bytes.extend(u32::from(letter).to_le_bytes()));
    bytes
}

/// Most bytes `[B]` that the numbers of a file of `length` bytes may take: 16-bit numbers take four
/// times as many as 64-bit ones, and small files may be packed well.
pub(crate) fn array_limit(length: u64) -> u64 {
    length.saturating_mul(4).max(64 << 20)
}

/// Whether a file begins as a .npy file does.
pub(crate) fn is_npy(first: &[u8]) -> bool {
    first.starts_with(MAGIC)
}

/// Reads any array of numbers.
///
/// # Errors
/// [`DatasetError::Io`], or [`DatasetError::Content`] for what is no array of numbers.
pub fn read(path: &Path) -> Result<Array, DatasetError> {
    let input = Input::open(path)?;
    let limit = array_limit(input.length());
    parse(path, "", &mut input.into_reader()?, limit)
}

/// Reads points `[m]` from an array of shape (n, 3).
///
/// # Errors
/// As [`read`], and for another shape or a coordinate that is not finite.
pub fn read_points(path: &Path) -> Result<Vec<Vector3<f64>>, DatasetError> {
    let array = read(path)?;
    let [_, 3] = array.shape[..] else {
        let found = format!("{:?}", array.shape);
        return Err(DatasetError::content(path, "the shape", found, "(n, 3)"));
    };
    if let Some(at) = array.values.iter().position(|value| !value.is_finite()) {
        let what = format!("the value at [{}, {}]", at / 3, at % 3);
        return Err(DatasetError::content(path, what, array.values[at].to_string(), "finite"));
    }
    let (points, _) = array.values.as_chunks::<3>();
    Ok(points.iter().map(|&point| Vector3::from(point)).collect())
}

/// Writes points as an array of shape (n, 3) of f64.
///
/// # Errors
/// [`DatasetError::Io`].
pub fn write_points(path: &Path, points: &[Vector3<f64>]) -> Result<(), DatasetError> {
    let values = points.iter().flat_map(|point| [point.x, point.y, point.z]);
    files::write_file(path, Form::Npy, &encode(&[points.len(), 3], values))
}

#[cfg(test)]
mod tests;
