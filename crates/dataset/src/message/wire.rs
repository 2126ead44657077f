//! Numbers, text and arrays as ROS messages are serialised: ROS 1 packs them, CDR (ROS 2) aligns them.
//!
//! References: ROS 1 "wire format" of <http://wiki.ros.org/msg>; OMG DDS-XTypes 1.3, clauses 7.4.1
//! and 7.6.3.1.2 (encapsulation, plain CDR of version 1 and 2).

use crate::fault::Fault;

/// Bytes of the CDR encapsulation header: two of its kind, two of options.
const ENCAPSULATION: usize = 4;

/// A message being read from front to back.
pub(crate) struct Wire<'a> {
    data: &'a [u8],
    at: usize,
    /// Largest alignment; 1 for ROS 1.
    align: usize,
    is_big_endian: bool,
    /// Texts end with a zero that is counted in their length.
    has_terminator: bool,
}

impl<'a> Wire<'a> {
    /// A ROS 1 message.
    pub(crate) fn ros1(data: &'a [u8]) -> Self {
        Self { data, at: 0, align: 1, is_big_endian: false, has_terminator: false }
    }

    /// A ROS 2 message in CDR, which says itself how its numbers stand.
    pub(crate) fn cdr(data: &'a [u8]) -> Result<Self, Fault> {
        let (kind, body) = match data {
            [0, kind, _, _, body @ ..] => (*kind, body),
            [a, b, _, _, ..] => return Err(not_plain(&format!("{a:02x}{b:02x}"))),
            short => {
                return Err(ends("the CDR encapsulation", 0, ENCAPSULATION, short.len()));
            }
        };
        let (is_big_endian, align) = match kind {
            0 => (true, 8),
            1 => (false, 8),
            6 => (true, 4),
            7 => (false, 4),
            other => return Err(not_plain(&format!("00{other:02x}"))),
        };
        Ok(Self { data: body, at: 0, align, is_big_endian, has_terminator: true })
    }

    fn take(&mut self, what: &str, count: usize) -> Result<&'a [u8], Fault> {
        let rest = self.data.get(self.at..).unwrap_or_default();
        let Some(bytes) = rest.get(..count) else {
            return Err(ends(what, self.at, count, rest.len()));
        };
        self.at += count;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Fault> {
        self.at = self.at.next_multiple_of(N.min(self.align));
        let bytes = self.take(what, N)?;
        let mut number = [0; N];
        number.copy_from_slice(bytes);
        if self.is_big_endian {
            number.reverse();
        }
        Ok(number)
    }

    pub(crate) fn u8(&mut self, what: &str) -> Result<u8, Fault> {
        self.number(what).map(u8::from_le_bytes)
    }

    pub(crate) fn u32(&mut self, what: &str) -> Result<u32, Fault> {
        self.number(what).map(u32::from_le_bytes)
    }

    pub(crate) fn f32(&mut self, what: &str) -> Result<f32, Fault> {
        self.number(what).map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self, what: &str) -> Result<f64, Fault> {
        self.number(what).map(f64::from_le_bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self, what: &str) -> Result<[f64; N], Fault> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(what)?;
        }
        Ok(values)
    }

    /// An array with its length in front.
    pub(crate) fn f64_list(&mut self, what: &str) -> Result<Vec<f64>, Fault> {
        let count = self.u32(what)?;
        // Not reserved: the length is only a claim until the numbers are there.
        (0..count).map(|_| self.f64(what)).collect::<Result<Vec<_>, _>>()
    }

    /// Bytes with their length in front.
    pub(crate) fn bytes(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        let count = self.u32(what)? as usize;
        self.take(what, count)
    }

    pub(crate) fn text(&mut self, what: &str) -> Result<&'a str, Fault> {
        let mut bytes = self.bytes(what)?;
        if self.has_terminator {
            bytes = bytes.strip_suffix(b"\0").unwrap_or(bytes);
        }
        str::from_utf8(bytes).map_err(|_| Fault::new(what, format!("{bytes:02x?}"), "UTF-8 text"))
    }

    /// A `std_msgs/Header`; returns its frame.
    pub(crate) fn header(&mut self) -> Result<&'a str, Fault> {
        if !self.has_terminator {
            self.u32("header.seq")?;
        }
        self.u32("header.stamp")?;
        self.u32("header.stamp")?;
        self.text("header.frame_id")
    }
}

fn ends(what: &str, at: usize, needed: usize, found: usize) -> Fault {
    Fault::new(what, format!("{found} at its byte {at}, where it ends"), format!("{needed} bytes"))
}

fn not_plain(found: &str) -> Fault {
    let allowed = "plain CDR (0000, 0001, 0006 or 0007)";
    Fault::new("the CDR encapsulation", format!("kind {found}"), allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_aligns_after_its_encapsulation_and_ros_1_does_not() {
        let packed = [1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
        let mut ros1 = Wire::ros1(&packed);
        assert_eq!((ros1.u8("a").unwrap(), ros1.u32("b").unwrap()), (1, 2));
        assert_eq!(ros1.f64("c").unwrap(), 1.0);

        let aligned = [0, 1, 0, 0, 1, 9, 9, 9, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
        let mut cdr = Wire::cdr(&aligned).unwrap();
        assert_eq!((cdr.u8("a").unwrap(), cdr.u32("b").unwrap()), (1, 2));
        assert_eq!(cdr.f64("c").unwrap(), 1.0);

        let big = [0, 0, 0, 0, 1, 9, 9, 9, 0, 0, 0, 2, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0];
        let mut cdr = Wire::cdr(&big).unwrap();
        assert_eq!((cdr.u8("a").unwrap(), cdr.u32("b").unwrap()), (1, 2));
        assert_eq!(cdr.f64("c").unwrap(), 1.0);

        // Version 2 aligns to four bytes at most.
        let tight = [0, 7, 0, 0, 1, 9, 9, 9, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f];
        let mut cdr = Wire::cdr(&tight).unwrap();
        assert_eq!((cdr.u8("a").unwrap(), cdr.f64("c").unwrap()), (1, 1.0));
    }

    #[test]
    fn texts_lose_their_terminator() {
        let mut cdr = Wire::cdr(&[0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0]).unwrap();
        assert_eq!(cdr.text("t").unwrap(), "ab");
        let mut ros1 = Wire::ros1(&[2, 0, 0, 0, b'a', b'b']);
        assert_eq!(ros1.text("t").unwrap(), "ab");
    }

    #[test]
    fn what_is_missing_is_named() {
        let error = |data: &[u8]| Wire::ros1(data).text("frame_id").unwrap_err().to_string();
        assert!(error(&[0]).contains("frame_id must be 4 bytes"), "{}", error(&[0]));
        assert!(error(&[9, 0, 0, 0, b'a']).contains("9 bytes, found 1"));
        assert!(error(&[1, 0, 0, 0, 0xff]).contains("UTF-8"));
        let kind = Wire::cdr(&[0, 3, 0, 0]).err().unwrap().to_string();
        assert!(kind.contains("plain CDR") && kind.contains("0003"), "{kind}");
        assert!(Wire::cdr(&[0, 1]).is_err());
        // A length that no message can hold costs nothing.
        assert!(Wire::ros1(&[0xff; 12]).f64_list("d").is_err());
    }
}
