//! What marks a file that granulcal wrote: one without it, or changed since, is not replaced.
//!
//! A photograph of the pile, a figure of a paper, a film of a pour and a height map have the endings of what granulcal
//! writes. Where programs that read a kind pass over it, the signature stands at the end: the hash of all before it.

/// The last chunk of a PNG.
const PNG_END: &[u8] = b"\0\0\0\0IEND\xae\x42\x60\x82";
/// What a signature begins with; the hash follows.
const NAME: &str = "granulcal ";
/// What an MCAP file begins with: eight bytes of magic, then the record of its header.
const MCAP_BEGIN: &[u8] = b"\x89MCAP0\r\n\x01";

/// Kinds of files that are signed.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Signature {
    Png,
    Gif,
    Npz,
    Mp4,
    Pdf,
    Svg,
}

impl Signature {
    /// A file with the signature; one that does not end as its kind does stays as it is.
    pub(crate) fn put(self, bytes: &[u8]) -> Vec<u8> {
        match bytes.strip_suffix(self.end()) {
            Some(body) => [body, &self.signed_end(&text(body))].concat(),
            None => bytes.to_vec(),
        }
    }

    /// Whether a file is as [`Signature::put`] gave it.
    pub(crate) fn is_on(self, bytes: &[u8]) -> bool {
        // The same number of bytes for every body.
        let length = self.signed_end(&text(&[])).len();
        bytes.len().checked_sub(length).is_some_and(|length| {
            let (body, found) = bytes.split_at(length);
            found == self.signed_end(&text(body))
        })
    }

    /// What a file of this kind ends with.
    fn end(self) -> &'static [u8] {
        match self {
            Self::Png => PNG_END,
            // The trailer.
            Self::Gif => b";",
            // The length of the archive's comment.
            Self::Npz => &[0, 0],
            Self::Mp4 | Self::Pdf | Self::Svg => b"",
        }
    }

    /// The same end with a signature in it.
    fn signed_end(self, text: &str) -> Vec<u8> {
        let length = text.len() as u8;
        match self {
            Self::Png => {
                let chunk = format!("tEXtSoftware\0{text}");
                let (size, sum) = (chunk.len() as u32 - 4, crc32fast::hash(chunk.as_bytes()));
                [&size.to_be_bytes(), chunk.as_bytes(), &sum.to_be_bytes(), PNG_END].concat()
            }
            // A comment of one block.
            Self::Gif => [&[0x21, 0xfe, length], text.as_bytes(), b"\0;"].concat(),
            Self::Npz => [&[length, 0], text.as_bytes()].concat(),
            // A box of space that is free.
            Self::Mp4 => [&[0, 0, 0, 8 + length], &b"free"[..], text.as_bytes()].concat(),
            Self::Pdf => format!("%{text}\n").into_bytes(),
            Self::Svg => format!("<!-- {text} -->\n").into_bytes(),
        }
    }
}

/// Whether an MCAP file of these first bytes is the film of a pour: its header names the library that wrote it.
pub(crate) fn is_film(head: &[u8]) -> bool {
    // The length of the header, then two texts, each after its length: profile and library.
    let after_text = |bytes: &[u8]| -> Option<usize> {
        let length = u32::from_le_bytes(*bytes.first_chunk()?);
        Some(4 + length as usize)
    };
    let library = || {
        let header = head.strip_prefix(MCAP_BEGIN)?.get(8..)?;
        header.get(after_text(header)?..)?.get(4..)
    };
    library().is_some_and(|library| library.starts_with(NAME.as_bytes()))
}

/// Whether a page says that it was made by granulcal, as the reports do.
pub(crate) fn is_page(bytes: &[u8]) -> bool {
    let made = b"by granulcal";
    bytes.windows(made.len()).any(|words| words == made)
}

fn text(body: &[u8]) -> String {
    format!("{NAME}{:016x}", xxhash_rust::xxh3::xxh3_64(body))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::{ImageBuffer, ImageFormat, Luma};

    use super::*;

    fn png() -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        ImageBuffer::<Luma<u16>, _>::from_raw(2, 2, vec![1u16, 2, 3, 4])
            .unwrap()
            .write_to(&mut bytes, ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn what_is_signed_is_known_until_it_is_changed() {
        for (kind, bytes) in [
            (Signature::Png, png()),
            (Signature::Gif, b"GIF89a-pixels-;".to_vec()),
            (Signature::Npz, b"PK-arrays-PK\x05\x06-end-\0\0".to_vec()),
            (Signature::Mp4, b"\0\0\0\x08ftyp".to_vec()),
            (Signature::Pdf, b"%PDF-1.4\n%%EOF\n".to_vec()),
            (Signature::Svg, b"<svg></svg>\n".to_vec()),
        ] {
            assert!(!kind.is_on(&bytes), "{kind:?}");
            let own = kind.put(&bytes);
            assert!(kind.is_on(&own), "{kind:?}");
            let mut changed = own.clone();
            changed[6] ^= 1;
            assert!(!kind.is_on(&changed), "{kind:?}");
            assert!(!kind.is_on(&[&*own, b"\n"].concat()), "{kind:?}");
            assert!(!kind.is_on(b""), "{kind:?}");
        }
        assert_eq!(Signature::Png.put(b"cut"), b"cut");
    }

    #[test]
    fn a_signed_picture_is_the_same_picture() {
        let plain = png();
        let own = Signature::Png.put(&plain);
        let read = image::load_from_memory(&own).unwrap().into_luma16();
        assert_eq!(read.into_raw(), [1, 2, 3, 4]);
        // Two chunks at the end, each with its sum.
        assert_eq!(own.len(), plain.len() + 12 + 9 + NAME.len() + 16);
    }

    #[test]
    fn a_film_names_its_library() {
        let file = |library: &str| {
            let mut header = vec![2, 0, 0, 0, b'r', b'2'];
            header.extend((library.len() as u32).to_le_bytes());
            header.extend(library.as_bytes());
            [MCAP_BEGIN, &(header.len() as u64).to_le_bytes(), &header].concat()
        };
        assert!(is_film(&file("granulcal 0.1.0")));
        assert!(!is_film(&file("libmcap 1.0.0")) && !is_film(&file("granulcal")));
        let whole = file("granulcal 0.1.0");
        assert!((0..20).all(|length| !is_film(&whole[..length])));
        // A length beyond the file.
        let mut endless = whole;
        endless[17..21].fill(0xff);
        assert!(!is_film(&endless));
    }
}
