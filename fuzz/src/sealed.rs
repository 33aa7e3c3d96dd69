//! Bytes of a container with the checksum that fits them: what lies behind the checksum is reached by mutations too.

/// The same bytes with a checksum that fits, if they are a container with a description under `key` at all.
pub fn sealed(bytes: &[u8], key: &str) -> Option<Vec<u8>> {
    let length = usize::try_from(u64::from_le_bytes(*bytes.first_chunk()?)).ok()?;
    let payload = bytes.get(8usize.checked_add(length)?..)?;
    let mut description: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).ok()?;
    let about = description.get_mut("__metadata__")?.get_mut(key)?;
    let text = about.as_str()?;
    let body = &text[..text.rfind(",\"checksum\"")?];
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    checksum.update(payload);
    *about = format!("{body},\"checksum\":\"{:08x}\"}}", checksum.finalize()).into();
    let description = description.to_string();
    Some([&(description.len() as u64).to_le_bytes()[..], description.as_bytes(), payload].concat())
}
