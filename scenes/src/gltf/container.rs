//! The GLB container: a header, a chunk of JSON and a chunk of bytes.

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// The two things a glTF file is made of.
#[derive(Debug)]
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    pub bin: Option<&'a [u8]>,
}

/// Takes a file apart; what does not begin as GLB is JSON.
pub(super) fn open(bytes: &[u8]) -> Result<Container<'_>, String> {
    if !bytes.starts_with(MAGIC) {
        return Ok(Container { json: bytes, bin: None });
    }
    let header = |at| word(bytes, at).ok_or_else(|| "it ends within the GLB header of 12 bytes".to_owned());
    let (version, length) = (header(4)?, header(8)?);
    if version != 2 {
        return Err(format!("it is GLB version {version}: only 2 is read"));
    }
    if length as usize != bytes.len() {
        return Err(format!("its GLB header says {length} bytes, but the file has {}", bytes.len()));
    }
    let mut rest = bytes.get(12..).unwrap_or_default();
    let (mut json, mut bin) = (None, None);
    let mut number = 0;
    while !rest.is_empty() {
        let (kind, body, after) = chunk(rest, number)?;
        match (number, kind) {
            (0, JSON) => json = Some(body),
            (0, _) => return Err("its first GLB chunk is not JSON".into()),
            (1, BIN) => bin = Some(body),
            // Later chunks belong to extensions and are to be passed over.
            _ => {}
        }
        rest = after;
        number += 1;
    }
    json.map(|json| Container { json, bin }).ok_or_else(|| "it is a GLB without a JSON chunk".into())
}

fn chunk(rest: &[u8], number: u32) -> Result<(u32, &[u8], &[u8]), String> {
    let (Some(length), Some(kind)) = (word(rest, 0), word(rest, 4)) else {
        return Err(format!("it ends within the header of GLB chunk {number}"));
    };
    let body = rest.get(8..).unwrap_or_default();
    body.split_at_checked(length as usize)
        .map(|(chunk, after)| (kind, chunk, after))
        .ok_or_else(|| format!("GLB chunk {number} says {length} bytes, but only {} are left", body.len()))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

/// Puts a GLB together; chunks are padded to four bytes as the format asks.
pub(super) fn pack(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>, String> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let Ok(total) = u32::try_from(length) else {
        return Err(format!("it would take {length} bytes, and a GLB holds at most 4 GiB"));
    };
    let mut out = Vec::with_capacity(length);
    out.extend(MAGIC);
    // No part is longer than the whole, which fits.
    for word in [2, total, json.len() as u32, JSON] {
        out.extend(word.to_le_bytes());
    }
    out.extend(json);
    for word in [bin.len() as u32, BIN] {
        out.extend(word.to_le_bytes());
    }
    out.extend(bin);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_opens_again() {
        let glb = pack(b"{}".to_vec(), vec![1, 2, 3]).unwrap();
        let open = open(&glb).unwrap();
        assert_eq!(open.json, b"{}  ");
        assert_eq!(open.bin, Some(&[1, 2, 3, 0][..]));
    }

    #[test]
    fn every_cut_of_a_glb_is_an_error() {
        let glb = pack(b"{}".to_vec(), vec![1, 2, 3]).unwrap();
        for end in 4..glb.len() {
            assert!(open(&glb[..end]).is_err(), "{end}");
        }
    }
}
