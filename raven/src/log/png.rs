//! Whether the end of a PNG file is there, told without decoding it.
//!
//! After the signature follow chunks `length(4) type(4) content check(4)`, of which `IEND`, without content, is the last (ISO/IEC 15948, 5).

const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const END: [u8; 12] = *b"\0\0\0\0IEND\xae\x42\x60\x82";

/// Whether the last bytes of a PNG, zeros aside, are not its end chunk.
pub(super) fn is_truncated(bytes: &[u8]) -> bool {
    let end = bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    bytes.starts_with(&SIGNATURE) && !bytes.get(..end).is_some_and(|whole| whole.ends_with(&END))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_chunks() {
        let mut png = Vec::new();
        image::RgbImage::new(9, 7).write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        assert!(!is_truncated(&png));
        assert!(!is_truncated(&[png.as_slice(), &[0, 0]].concat()));
        assert!((SIGNATURE.len()..png.len()).all(|length| is_truncated(&png[..length])));
        assert!(!is_truncated(b"no picture") && !is_truncated(&[]));
    }
}
