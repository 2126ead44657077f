//! The parts of a bag's record: a header of named fields, and data.

use crate::fault::Fault;

/// A record within a chunk, and the bytes behind it.
pub(super) struct Split<'a> {
    pub(super) header: &'a [u8],
    pub(super) data: &'a [u8],
    pub(super) behind: &'a [u8],
}

/// A record that is not whole; its header, if at least that is there.
pub(super) struct Cut<'a> {
    pub(super) header: Option<&'a [u8]>,
    pub(super) fault: Fault,
}

/// Splits the first record off.
pub(super) fn split(bytes: &[u8]) -> Result<Split<'_>, Cut<'_>> {
    let (header, rest) = block(bytes, "the header").map_err(|fault| Cut { header: None, fault })?;
    let (data, behind) =
        block(rest, "the data").map_err(|fault| Cut { header: Some(header), fault })?;
    Ok(Split { header, data, behind })
}

/// Splits off bytes that stand behind their length.
fn block<'a>(bytes: &'a [u8], what: &str) -> Result<(&'a [u8], &'a [u8]), Fault> {
    let ends = |needed: usize, found: usize| {
        Fault::new(what, format!("{found} bytes"), format!("{needed} bytes"))
    };
    let (length, rest) = bytes.split_first_chunk().ok_or_else(|| ends(4, bytes.len()))?;
    let length = u32::from_le_bytes(*length) as usize;
    rest.split_at_checked(length).ok_or_else(|| ends(length, rest.len()))
}

/// The fields of a header, `name=value`, each behind its length.
pub(super) struct Fields<'a>(Vec<(&'a [u8], &'a [u8])>);

impl<'a> Fields<'a> {
    pub(super) fn parse(header: &'a [u8]) -> Result<Self, Fault> {
        let mut fields = Vec::new();
        let mut rest = header;
        while !rest.is_empty() {
            let (field, behind) = block(rest, "a field of a header")?;
            let Some(at) = field.iter().position(|&byte| byte == b'=') else {
                let found = String::from_utf8_lossy(field);
                return Err(Fault::new("a field of a header", format!("{found:?}"), "name=value"));
            };
            fields.push((&field[..at], &field[at + 1..]));
            rest = behind;
        }
        Ok(Self(fields))
    }

    fn get(&self, name: &str) -> Result<&'a [u8], Fault> {
        let found = self.0.iter().find(|(key, _)| *key == name.as_bytes());
        found.map(|(_, value)| *value).ok_or_else(|| Fault::new(name, "none", "in the header"))
    }

    fn number<const N: usize>(&self, name: &str) -> Result<[u8; N], Fault> {
        let value = self.get(name)?;
        value
            .try_into()
            .map_err(|_| Fault::new(name, format!("{} bytes", value.len()), format!("{N} bytes")))
    }

    pub(super) fn u8(&self, name: &str) -> Result<u8, Fault> {
        self.number(name).map(u8::from_le_bytes)
    }

    pub(super) fn u32(&self, name: &str) -> Result<u32, Fault> {
        self.number(name).map(u32::from_le_bytes)
    }

    pub(super) fn u64(&self, name: &str) -> Result<u64, Fault> {
        self.number(name).map(u64::from_le_bytes)
    }

    /// A time in seconds and nanoseconds, as nanoseconds.
    pub(super) fn time(&self, name: &str) -> Result<u64, Fault> {
        let [s0, s1, s2, s3, n0, n1, n2, n3] = self.number(name)?;
        let seconds = u64::from(u32::from_le_bytes([s0, s1, s2, s3]));
        Ok(seconds * 1_000_000_000 + u64::from(u32::from_le_bytes([n0, n1, n2, n3])))
    }

    pub(super) fn text(&self, name: &str) -> Result<&'a str, Fault> {
        let value = self.get(name)?;
        str::from_utf8(value).map_err(|_| Fault::new(name, format!("{value:02x?}"), "UTF-8 text"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_by_name() {
        let header = b"\x04\0\0\0op=\x05\x09\0\0\0size=\x01\x02\0\0";
        let fields = Fields::parse(header).unwrap();
        assert_eq!((fields.u8("op").unwrap(), fields.u32("size").unwrap()), (5, 0x201));
        assert!(
            fields.text("topic").unwrap_err().to_string().contains("topic must be in the header")
        );
        assert!(fields.u64("size").unwrap_err().to_string().contains("8 bytes, found 4 bytes"));
        assert!(Fields::parse(&header[..9]).is_err());
        assert!(Fields::parse(b"\x02\0\0\0ab").is_err());
    }

    #[test]
    fn a_cut_record_keeps_its_header() {
        let record = b"\x02\0\0\0hh\x03\0\0\0ddd!";
        let split_ok = split(record).ok().unwrap();
        assert_eq!(
            (split_ok.header, split_ok.data, split_ok.behind),
            (&b"hh"[..], &b"ddd"[..], &b"!"[..])
        );
        let cut = split(&record[..11]).err().unwrap();
        assert_eq!(cut.header, Some(&b"hh"[..]));
        assert!(cut.fault.to_string().contains("3 bytes, found 1 bytes"));
        assert!(split(&record[..5]).err().unwrap().header.is_none());
    }
}
