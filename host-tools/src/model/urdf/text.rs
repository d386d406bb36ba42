//! The text of a URDF, in whatever encoding it was written.

use std::io;
use std::path::Path;

/// Reads a file as its byte order mark or its bytes say: UTF-8, UTF-16, or else ISO 8859-1, in which every byte is a character. Names and
/// numbers of a URDF are ASCII; what differs is in comments.
pub(in crate::model) fn read(path: &Path) -> io::Result<String> {
    Ok(decoded(std::fs::read(path)?))
}

fn decoded(bytes: Vec<u8>) -> String {
    let utf16 = |bytes: &[u8], pair: fn([u8; 2]) -> u16| {
        let pairs = bytes.chunks_exact(2).map(|b| pair([b[0], b[1]]));
        String::from_utf16_lossy(&pairs.collect::<Vec<_>>())
    };
    match &bytes[..] {
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ => String::from_utf8(bytes)
            .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "<robot name=\"a\"><!-- ±170° --></robot>";
        let latin1: Vec<u8> = text.chars().map(|c| u8::try_from(c).unwrap()).collect();
        let units: Vec<u16> = text.encode_utf16().collect();
        let utf16 = |mark: [u8; 2], of: fn(u16) -> [u8; 2]| -> Vec<u8> {
            mark.into_iter()
                .chain(units.iter().flat_map(|u| of(*u)))
                .collect()
        };
        for bytes in [
            text.as_bytes().to_vec(),
            latin1,
            utf16([0xff, 0xfe], u16::to_le_bytes),
            utf16([0xfe, 0xff], u16::to_be_bytes),
        ] {
            assert_eq!(decoded(bytes), text);
        }
    }
}
