//! Seals: what tells a file that is as it was written from one that is not.
//!
//! Artifacts are sealed from outside: their record holds the [hash](hash_file) of their bytes. Documents in JSON (records, caches, notes)
//! carry their seal themselves, as the last value of the object: the BLAKE3 of every byte before it. A seal tells what a disk, a
//! copy or an editor has done to a file. It holds no secret, so it does not tell who has written it.

use plyflow_files::open;
use std::io;
use std::path::Path;

/// What stands before the hash at the end of a sealed document.
const BEFORE: &str = ",\n  \"seal\": \"";
/// What stands behind it.
const BEHIND: &str = "\"\n}\n";
/// Digits of a hash.
const DIGITS: usize = 2 * blake3::OUT_LEN;
/// Largest document that is read (bytes): far more than any that is written.
const LARGEST: u64 = 256 << 20;

/// Why a sealed document is not what was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BrokenSeal {
    /// It does not end with a seal.
    #[error("it has no seal")]
    None,
    /// Its bytes are others than those that were sealed.
    #[error("its bytes are not those that were sealed")]
    Other,
}

/// A JSON object with its seal. `object` is the text of an object that is not empty.
#[must_use]
pub fn seal(object: &str) -> String {
    let body = object.trim_end();
    let body = body.strip_suffix('}').unwrap_or(body).trim_end();
    let hash = blake3::hash(body.as_bytes()).to_hex();
    format!("{body}{BEFORE}{hash}{BEHIND}")
}

/// The text of a document that [`seal`] has made, when not one bit of it has changed. It is JSON, with the seal as its last value.
///
/// # Errors
/// When it has no seal or is not what was sealed.
pub fn sealed(document: &[u8]) -> Result<&str, BrokenSeal> {
    let text = std::str::from_utf8(document).map_err(|_| BrokenSeal::Other)?;
    let rest = text.strip_suffix(BEHIND).ok_or(BrokenSeal::None)?;
    let at = rest.len().checked_sub(DIGITS).ok_or(BrokenSeal::None)?;
    let (front, hash) = rest.split_at_checked(at).ok_or(BrokenSeal::None)?;
    let body = front.strip_suffix(BEFORE).ok_or(BrokenSeal::None)?;
    if blake3::hash(body.as_bytes()).to_hex().as_str() == hash {
        Ok(text)
    } else {
        Err(BrokenSeal::Other)
    }
}

/// The BLAKE3 of some bytes (hex).
#[must_use]
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// The BLAKE3 of the bytes of a file (hex), and how many they are.
///
/// # Errors
/// When it is no plain file (links are followed) or cannot be read.
pub fn hash_file(path: &Path) -> io::Result<(String, u64)> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(open::open(path, u64::MAX)?)?;
    Ok((hasher.finalize().to_hex().to_string(), hasher.count()))
}

/// The bytes of a document.
///
/// # Errors
/// When it is no plain file (links are followed), is larger than any document, or cannot be read.
pub fn read_document(path: &Path) -> io::Result<Vec<u8>> {
    Ok(open::read(path, LARGEST)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_with_any_bit_turned_is_not_what_was_sealed() {
        for object in [
            "{\"a\":1,\"b\":[2]}",
            "{\n  \"a\": 1,\n  \"b\": \"\u{e4}\"\n}\n",
        ] {
            let text = seal(object);
            assert_eq!(sealed(text.as_bytes()), Ok(text.as_str()));
            let value: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(value["a"], 1);
            for bit in 0..8 * text.len() {
                let mut bytes = text.clone().into_bytes();
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert!(sealed(&bytes).is_err(), "bit {bit}");
            }
            for keep in 0..text.len() {
                assert!(sealed(&text.as_bytes()[..keep]).is_err(), "{keep} bytes");
            }
            assert_eq!(sealed(object.as_bytes()), Err(BrokenSeal::None));
        }
    }

    #[test]
    fn a_file_has_the_hash_of_its_bytes_and_what_is_no_file_has_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, vec![7; 200_000]).unwrap();
        let expected = blake3::hash(&vec![7; 200_000]).to_hex().to_string();
        assert_eq!(hash_file(&path).unwrap(), (expected, 200_000));
        assert!(hash_file(dir.path()).is_err());
        assert!(hash_file(&dir.path().join("none")).is_err());
        assert!(read_document(Path::new("/dev/zero")).is_err());
        assert_eq!(read_document(&path).unwrap().len(), 200_000);
    }
}
