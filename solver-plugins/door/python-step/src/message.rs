//! One message: the length of a header (u32, little-endian), the header (JSON), and as many bytes as its `bytes` says.
//!
//! The bytes are arrays in the machine's own order: both ends are on one machine.

use serde_json::{Value, json};
use std::io::{self, Read, Write};

/// Longest header (bytes): an attribute text of an artifact many times over.
const LONGEST_HEADER: usize = 256 << 20;

/// Most bytes behind a header: what memory holds is asked of the system, a wrong number is not.
const MOST_BYTES: u64 = 1 << 40;

/// Bytes that lie as doubles do, so that they can be read as numbers of any type.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Bytes {
    words: Vec<u64>,
    len: usize,
}

impl Bytes {
    /// Zeros.
    ///
    /// # Errors
    /// When there is not so much memory.
    pub fn zeros(len: usize) -> io::Result<Self> {
        let count = len.div_ceil(8);
        let mut words = Vec::new();
        words
            .try_reserve_exact(count)
            .map_err(|_| io::Error::new(io::ErrorKind::OutOfMemory, format!("{len} bytes")))?;
        words.resize(count, 0);
        Ok(Self { words, len })
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Where they begin, aligned for every number.
    pub fn pointer(&self) -> *const u8 {
        self.words.as_ptr().cast()
    }

    /// As [`Bytes::pointer`], to write to.
    pub fn pointer_mut(&mut self) -> *mut u8 {
        self.words.as_mut_ptr().cast()
    }

    /// All as doubles.
    pub fn doubles(&self) -> Option<Vec<f64>> {
        (self.len.is_multiple_of(8))
            .then(|| self.words.iter().map(|w| f64::from_bits(*w)).collect())
    }
}

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        // SAFETY: `words` has at least `len` bytes, all of them written.
        unsafe { std::slice::from_raw_parts(self.pointer(), self.len) }
    }
}

impl AsMut<[u8]> for Bytes {
    fn as_mut(&mut self) -> &mut [u8] {
        let (pointer, len) = (self.pointer_mut(), self.len);
        // SAFETY: as above, and borrowed for this alone.
        unsafe { std::slice::from_raw_parts_mut(pointer, len) }
    }
}

/// Sends a message.
///
/// # Errors
/// When the other end is gone.
pub fn send(to: &mut impl Write, mut header: Value, bytes: &Bytes) -> io::Result<()> {
    header["bytes"] = json!(bytes.len());
    let text = header.to_string();
    let length = u32::try_from(text.len()).map_err(io::Error::other)?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(text.as_bytes())?;
    to.write_all(bytes.as_ref())?;
    to.flush()
}

/// Waits for a message; `None`: the other end has ended between two.
///
/// # Errors
/// When it ends within one, or says what is no message.
pub fn receive(from: &mut impl Read) -> io::Result<Option<(Value, Bytes)>> {
    let mut length = [0u8; 4];
    match from.read_exact(&mut length) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let wrong = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
    let length = u32::from_le_bytes(length) as usize;
    if length > LONGEST_HEADER {
        return Err(wrong("the header of a message is too long"));
    }
    let mut text = vec![0u8; length];
    from.read_exact(&mut text)?;
    let header: Value = serde_json::from_slice(&text).map_err(io::Error::other)?;
    let count = header["bytes"].as_u64().filter(|n| *n <= MOST_BYTES);
    let count = count.ok_or_else(|| wrong("a message does not say how many bytes follow"))?;
    let mut bytes = Bytes::zeros(count as usize)?;
    from.read_exact(bytes.as_mut())?;
    Ok(Some((header, bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_arrives_as_it_was_sent() {
        let mut wire = Vec::new();
        let mut bytes = Bytes::zeros(16).unwrap();
        bytes.as_mut()[8..].copy_from_slice(&(-1.5f64).to_ne_bytes());
        send(&mut wire, json!({"op": "frame"}), &bytes).unwrap();
        send(&mut wire, json!({"op": "end"}), &Bytes::default()).unwrap();
        let mut wire = wire.as_slice();
        let (header, got) = receive(&mut wire).unwrap().unwrap();
        assert_eq!((header["op"].as_str(), &got), (Some("frame"), &bytes));
        assert_eq!(got.doubles(), Some(vec![0.0, -1.5]));
        assert_eq!(receive(&mut wire).unwrap().unwrap().0["op"], "end");
        assert!(receive(&mut wire).unwrap().is_none());
    }

    #[test]
    fn what_is_torn_or_no_message_is_an_error() {
        let mut wire = Vec::new();
        send(&mut wire, json!({"op": "x"}), &Bytes::zeros(8).unwrap()).unwrap();
        assert!(receive(&mut &wire[..wire.len() - 1]).is_err());
        assert!(receive(&mut &b"\xff\xff\xff\xff{}"[..]).is_err());
        assert!(receive(&mut &b"\x02\0\0\0{}"[..]).is_err());
        assert!(receive(&mut &b"\x14\0\0\0{\"bytes\": 9999999999999999}"[..]).is_err());
    }
}
