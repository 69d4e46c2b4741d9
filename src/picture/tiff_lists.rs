//! The lists of a TIFF file's first directory, held against the file's size before a
//! decoder takes memory for them.

/// Bytes of a value by its type (TIFF 6.0, section 2; BigTIFF's are 13 and 16 to 18).
fn bytes_of(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        // 1, 2, 6, 7, and what the decoder refuses.
        _ => 1,
    }
}

/// The numbers of a TIFF file, in its order of bytes.
struct Numbers<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl Numbers<'_> {
    /// The unsigned number of `length` bytes, 8 or fewer, at a place; None beyond the end.
    fn at(&self, place: u64, length: u64) -> Option<u64> {
        let from = usize::try_from(place).ok()?;
        let bytes = self.bytes.get(from..from.checked_add(length as usize)?)?;
        let add = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        Some(if self.little { bytes.iter().rev().fold(0, add) } else { bytes.iter().fold(0, add) })
    }
}

/// Where the first directory is.
struct Directory {
    /// Its first entry.
    first: u64,
    entries: u64,
    /// Bytes of an entry's counts and places.
    word: u64,
}

impl Directory {
    /// None where the file ends before it begins.
    fn of(numbers: &Numbers<'_>) -> Option<Self> {
        let big = numbers.at(2, 2)? == 43;
        // Places of the first directory, lengths of its count and of an entry's counts.
        let (place, count, word) = if big { (numbers.at(8, 8)?, 8, 8) } else { (numbers.at(4, 4)?, 2, 4) };
        Some(Directory { first: place.checked_add(count)?, entries: numbers.at(place, count)?, word })
    }

    /// The place of an entry, or of what follows the last one.
    fn entry(&self, i: u64) -> Option<u64> {
        self.first.checked_add(i.checked_mul(4 + 2 * self.word)?)
    }
}

fn numbers(bytes: &[u8]) -> Numbers<'_> {
    Numbers { bytes, little: bytes.starts_with(b"II") }
}

/// The tag of the first list that reaches beyond the end of the file. What is cut short
/// otherwise is left to the decoder.
pub(super) fn beyond_the_end(bytes: &[u8]) -> Option<u16> {
    let numbers = numbers(bytes);
    let directory = Directory::of(&numbers)?;
    let word = directory.word;
    for i in 0..directory.entries {
        let entry = directory.entry(i)?;
        let (tag, kind) = (numbers.at(entry, 2)?, numbers.at(entry + 2, 2)?);
        let length = numbers.at(entry + 4, word)?.saturating_mul(bytes_of(kind as u16));
        let place = numbers.at(entry + 4 + word, word)?;
        if length > word && place.saturating_add(length) > bytes.len() as u64 {
            return Some(tag as u16);
        }
    }
    None
}

/// Whether another directory follows the first one.
pub(super) fn has_further_pages(bytes: &[u8]) -> bool {
    let numbers = numbers(bytes);
    let next = Directory::of(&numbers).and_then(|d| numbers.at(d.entry(d.entries)?, d.word));
    next.is_some_and(|next| next != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat};
    use std::io::Cursor;

    #[test]
    fn lists_end_where_the_file_does() {
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::new_rgb8(5, 4).write_to(&mut bytes, ImageFormat::Tiff).unwrap();
        let mut bytes = bytes.into_inner();
        assert_eq!(beyond_the_end(&bytes), None);
        // BitsPerSample: three numbers become 2 ^ 28.
        let at = bytes.windows(4).position(|w| w == [2, 1, 3, 0]).unwrap();
        bytes[at + 7] = 16;
        assert_eq!(beyond_the_end(&bytes), Some(258));
        for end in 0..bytes.len() {
            beyond_the_end(&bytes[..end]);
        }
        // BigTIFF, big-endian: one entry of 2 ^ 60 doubles.
        let mut big = b"MM\0\x2b\0\x08\0\0".to_vec();
        big.extend([16u64, 1].map(u64::to_be_bytes).concat());
        big.extend([1, 17, 0, 12]);
        big.extend([1u64 << 60, 0].map(u64::to_be_bytes).concat());
        assert_eq!(beyond_the_end(&big), Some(273));
    }
}
