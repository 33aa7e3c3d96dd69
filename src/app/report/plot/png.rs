//! PNG images (W3C, Portable Network Graphics, second edition, 2003): small ones of at most 256 colours, and pictures of any colours.
//!
//! A grid of a heat map has a few thousand points; one uncompressed byte each is smaller than a compressor.

use crate::relativity::Image;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write as _;

/// Largest number of bytes in a stored block of a zlib stream.
const BLOCK: usize = 65_535;

/// PNG of `rows` from the top, each with an index into `palette` per pixel.
pub(super) fn indexed(rows: &[Vec<u8>], palette: &[[u8; 3]]) -> Vec<u8> {
    let (width, height) = (rows.first().map_or(0, Vec::len), rows.len());
    let mut image = begin(width, height, INDEXED);
    chunk(&mut image, b"PLTE", palette.as_flattened());
    // Every row begins with its filter type: none.
    let raw: Vec<u8> = rows.iter().flat_map(|row| std::iter::once(0).chain(row.iter().copied())).collect();
    chunk(&mut image, b"IDAT", &stored(&raw));
    chunk(&mut image, b"IEND", &[]);
    image
}

/// PNG of a picture, compressed.
pub fn png(picture: &Image) -> Vec<u8> {
    let mut image = begin(picture.width, picture.height, TRUE_COLOUR);
    let rows = picture.pixels.chunks_exact(picture.width.max(1));
    let raw: Vec<u8> = rows.flat_map(|row| std::iter::once(0).chain(row.as_flattened().iter().copied())).collect();
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    let compressed = encoder.write_all(&raw).and_then(|()| encoder.finish());
    // Writing to memory does not fail; if it did, stored data would still be a valid picture.
    chunk(&mut image, b"IDAT", &compressed.unwrap_or_else(|_| stored(&raw)));
    chunk(&mut image, b"IEND", &[]);
    image
}

/// Kinds of pixels in the header.
const INDEXED: u8 = 3;
const TRUE_COLOUR: u8 = 2;

/// Signature and header of an image.
fn begin(width: usize, height: usize, kind: u8) -> Vec<u8> {
    let mut image = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::with_capacity(13);
    header.extend((width as u32).to_be_bytes());
    header.extend((height as u32).to_be_bytes());
    // Eight bits, deflate, adaptive filters, not interlaced.
    header.extend([8, kind, 0, 0, 0]);
    chunk(&mut image, b"IHDR", &header);
    image
}

fn chunk(image: &mut Vec<u8>, kind: &[u8; 4], content: &[u8]) {
    image.extend((content.len() as u32).to_be_bytes());
    let start = image.len();
    image.extend(kind);
    image.extend(content);
    let checksum = crc32(&image[start..]);
    image.extend(checksum.to_be_bytes());
}

/// A zlib stream of stored blocks (RFC 1950, RFC 1951 section 3.2.4).
fn stored(raw: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01];
    let mut blocks = raw.chunks(BLOCK).peekable();
    while let Some(block) = blocks.next() {
        let length = block.len() as u16;
        stream.push(u8::from(blocks.peek().is_none()));
        stream.extend(length.to_le_bytes());
        stream.extend((!length).to_le_bytes());
        stream.extend(block);
    }
    let (mut a, mut b) = (1u32, 0u32);
    for &byte in raw {
        a = (a + u32::from(byte)) % 65_521;
        b = (b + a) % 65_521;
    }
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}

/// Cyclic redundancy check of ISO 3309, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read as _;

    #[test]
    fn checksums_are_the_standards() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        // An empty last chunk, as in every PNG.
        assert_eq!(crc32(b"IEND"), 0xae42_6082);
        assert_eq!(stored(b"Wikipedia")[16..], [0x11, 0xe6, 0x03, 0x98]);
    }

    #[test]
    fn images_hold_their_pixels() {
        let png = indexed(&[vec![0, 1], vec![2, 1]], &[[255, 0, 0], [0, 255, 0], [0, 0, 255]]);
        assert!(
            png.starts_with(b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x02\x08\x03")
                && png.ends_with(b"IEND\xae\x42\x60\x82")
        );
        assert!(png.windows(6).any(|w| w == [0, 0, 1, 0, 2, 1]));
        let wide = stored(&vec![7; BLOCK + 1]);
        assert_eq!((wide.len(), wide[2], wide[2 + 5 + BLOCK]), (2 + 5 + BLOCK + 5 + 1 + 4, 0, 1));
    }

    #[test]
    fn pictures_hold_their_pixels() {
        let picture = Image { width: 3, height: 2, pixels: (0..6).map(|k| [k, 2 * k, 7]).collect() };
        let file = png(&picture);
        assert!(file.starts_with(b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x03\0\0\0\x02\x08\x02"));
        let data = file.windows(4).position(|w| w == b"IDAT").unwrap();
        let length = u32::from_be_bytes(file[data - 4..data].try_into().unwrap()) as usize;
        let mut raw = Vec::new();
        flate2::read::ZlibDecoder::new(&file[data + 4..data + 4 + length]).read_to_end(&mut raw).unwrap();
        assert_eq!(raw, [0, 0, 0, 7, 1, 2, 7, 2, 4, 7, 0, 3, 6, 7, 4, 8, 7, 5, 10, 7]);
        // A single colour takes almost no space.
        let plain = Image { width: 400, height: 400, pixels: vec![[1, 2, 3]; 160_000] };
        assert!(png(&plain).len() < 2000);
    }
}
