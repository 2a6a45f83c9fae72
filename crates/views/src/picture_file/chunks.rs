//! The chunks of a PNG file.

use anyhow::ensure;

/// Bytes of the signature.
const SIGNATURE: usize = 8;
/// Offset of the colour type in the first chunk, and the type with a palette.
const COLOUR_TYPE: usize = 9;
const PALETTED: u8 = 3;
/// Bytes per palette entry, and the most entries.
const ENTRY: usize = 3;
const MOST_ENTRIES: usize = 256;

/// The content of the first complete chunk of a kind.
pub(super) fn find(png: &[u8], kind: [u8; 4]) -> Option<&[u8]> {
    all(png).find(|(found, _)| *found == kind).map(|(_, content)| content)
}

/// The palette, if pixels are indices into it.
///
/// # Errors
///
/// If it is invalid: the decoder requires a valid one.
pub(super) fn palette(png: &[u8]) -> anyhow::Result<Option<Vec<[u8; ENTRY]>>> {
    let head = find(png, *b"IHDR");
    let paletted = head.and_then(|head| head.get(COLOUR_TYPE)) == Some(&PALETTED);
    let mut first = None;
    for (_, palette) in all(png).filter(|(kind, _)| paletted && kind == b"PLTE") {
        let (entries, rest) = palette.as_chunks();
        ensure!(
            rest.is_empty() && (1..=MOST_ENTRIES).contains(&entries.len()),
            "its palette has {} bytes: a palette has 3 for each of 1 to {MOST_ENTRIES} colours",
            palette.len()
        );
        first.get_or_insert_with(|| entries.to_vec());
    }
    Ok(first)
}

/// Kinds and contents of all chunks up to the first truncated one.
fn all(png: &[u8]) -> impl Iterator<Item = ([u8; 4], &[u8])> {
    let mut rest = png.get(SIGNATURE..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (kind, after) = after.split_first_chunk::<4>()?;
        let (content, after) = after.split_at_checked(u32::from_be_bytes(*length) as usize)?;
        // A checksum of four bytes follows.
        rest = after.get(4..).unwrap_or_default();
        Some((*kind, content))
    })
}
