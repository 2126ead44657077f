//! NumPy's .npy format, as far as arrays of numbers and one word of text need it.
//!
//! Reference: NumPy enhancement proposal 1, versions 1 to 3 of the format.

use std::path::Path;

use nalgebra::Vector3;

use crate::{DatasetError, files};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Values beyond this in one array are a slip or a damaged header, not a recording.
const MAX_VALUES: usize = 1 << 30;
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

/// What a .npy header says.
struct Parsed<'a> {
    descr: String,
    fortran_order: bool,
    shape: Vec<usize>,
    data: &'a [u8],
}

/// Names a fault of an array; `file` and `array` say where.
struct Place<'a> {
    file: &'a Path,
    array: &'a str,
}

impl Place<'_> {
    fn error(
        &self,
        what: &str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> DatasetError {
        let what = if self.array.is_empty() {
            what.to_owned()
        } else {
            format!("{what} of {}", self.array)
        };
        DatasetError::content(self.file, what, found, allowed)
    }
}

/// Reads numbers from the bytes of a .npy file. `array` names it within `file`, empty for the file itself.
pub(crate) fn parse(file: &Path, array: &str, bytes: &[u8]) -> Result<Array, DatasetError> {
    let place = Place { file, array };
    let parsed = parse_header(&place, bytes)?;
    let bad_type = || place.error("the dtype", format!("{:?}", parsed.descr), NUMBERS);
    let (big, kind, size) = split_descr(&parsed.descr).ok_or_else(bad_type)?;
    let decode = decoder(kind, size).ok_or_else(bad_type)?;
    let count = parsed.shape.iter().product::<usize>();
    let data = exact(&place, parsed.data, count * size)?;
    let mut values = Vec::with_capacity(count);
    let mut buffer = [0u8; 8];
    for raw in data.chunks_exact(size) {
        buffer[..size].copy_from_slice(raw);
        if big {
            buffer[..size].reverse();
        }
        values.push(decode(buffer));
    }
    if parsed.fortran_order {
        values = to_row_major(&values, &parsed.shape);
    }
    Ok(Array { shape: parsed.shape, values })
}

/// Reads one word (`<U2` and its kin, or bytes) from the bytes of a .npy file.
pub(crate) fn parse_text(file: &Path, array: &str, bytes: &[u8]) -> Result<String, DatasetError> {
    let place = Place { file, array };
    let parsed = parse_header(&place, bytes)?;
    let bad =
        || place.error("the dtype", format!("{:?}", parsed.descr), "one word of text (U or S)");
    let (big, kind, size) = split_descr(&parsed.descr).ok_or_else(bad)?;
    if parsed.shape.iter().product::<usize>() != 1 {
        return Err(place.error("the shape", format!("{:?}", parsed.shape), "one value"));
    }
    let text: String = match kind {
        'U' => {
            let data = exact(&place, parsed.data, size.saturating_mul(4))?;
            let letter = |raw: &[u8]| {
                let raw = [raw[0], raw[1], raw[2], raw[3]];
                let code = if big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) };
                char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
            };
            data.chunks_exact(4).map(letter).collect()
        }
        'S' => exact(&place, parsed.data, size)?.iter().map(|&b| char::from(b)).collect(),
        _ => return Err(bad()),
    };
    Ok(text.trim_end_matches('\0').to_owned())
}

fn parse_header<'a>(place: &Place, bytes: &'a [u8]) -> Result<Parsed<'a>, DatasetError> {
    let truncated = || {
        place.error("the .npy header", format!("truncated after {} bytes", bytes.len()), "complete")
    };
    if bytes.len() >= MAGIC.len() && !bytes.starts_with(MAGIC) {
        return Err(place.error("the array", "other bytes", "in .npy format"));
    }
    let version = *bytes.get(MAGIC.len()).ok_or_else(truncated)?;
    let (start, length): (usize, usize) = match (version, bytes) {
        (1, [_, _, _, _, _, _, _, _, a, b, ..]) => (10, usize::from(u16::from_le_bytes([*a, *b]))),
        (2 | 3, [_, _, _, _, _, _, _, _, a, b, c, d, ..]) => {
            (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize)
        }
        (1..=3, _) => return Err(truncated()),
        (other, _) => return Err(place.error("the .npy version", other.to_string(), "1, 2 or 3")),
    };
    let text = bytes.get(start..start.saturating_add(length)).ok_or_else(truncated)?;
    let text = String::from_utf8_lossy(text);
    let shown = || text.trim().to_owned();
    let parsed = (|| {
        let descr = text_of(after_key(&text, "descr")?)?;
        let fortran_order = match after_key(&text, "fortran_order")? {
            order if order.starts_with("True") => true,
            order if order.starts_with("False") => false,
            _ => return None,
        };
        let shape = shape_of(after_key(&text, "shape")?)?;
        Some((descr, fortran_order, shape))
    })();
    let allowed = "a dict of descr (one type), fortran_order and shape";
    let (descr, fortran_order, shape) =
        parsed.ok_or_else(|| place.error("the .npy header", shown(), allowed))?;
    let count = shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n));
    if count.is_none_or(|count| count > MAX_VALUES) {
        let allowed = format!("at most {MAX_VALUES} values");
        return Err(place.error("the shape", format!("{shape:?}"), allowed));
    }
    Ok(Parsed { descr, fortran_order, shape, data: &bytes[start + length..] })
}

/// The text behind `'key':` in a Python dict.
fn after_key<'a>(dict: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let at = quoted.iter().find_map(|q| dict.find(q.as_str()).map(|i| i + q.len()))?;
    Some(dict[at..].trim_start().strip_prefix(':')?.trim_start())
}

fn text_of(value: &str) -> Option<String> {
    let quote = value.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    value[1..].split_once(quote).map(|(text, _)| text.to_owned())
}

fn shape_of(value: &str) -> Option<Vec<usize>> {
    let (inner, _) = value.strip_prefix('(')?.split_once(')')?;
    let entries = inner.split(',').map(str::trim).filter(|entry| !entry.is_empty());
    entries.map(|entry| entry.parse().ok()).collect()
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

fn exact<'a>(place: &Place, data: &'a [u8], expected: usize) -> Result<&'a [u8], DatasetError> {
    if data.len() < expected {
        let found = format!("{} bytes, it is truncated", data.len());
        return Err(place.error("the data", found, format!("{expected} bytes")));
    }
    Ok(&data[..expected])
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

/// Reads any array of numbers.
///
/// # Errors
/// [`DatasetError::Io`], or [`DatasetError::Content`] for what is no array of numbers.
pub fn read(path: &Path) -> Result<Array, DatasetError> {
    parse(path, "", &files::read(path)?)
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
    files::write_file(path, &encode(&[points.len(), 3], values))
}

#[cfg(test)]
mod tests;
