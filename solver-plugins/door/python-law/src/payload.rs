//! What is appended to a copy of the library: a header in JSON and object code.
//!
//! From the end of the file: 16 bytes [`MAGIC`], the length of the payload (u64, little-endian), the payload. The payload: the length of
//! the header (u64, little-endian), the header, and the pieces of object code that it names.

use crate::parameters::Value;
use serde::Deserialize;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::os::unix::fs::MetadataExt;

/// The last bytes of a law.
const MAGIC: &[u8; 16] = b"PLYFLOW-PY-LAW-1";
/// What [`Header::layout`] must say: both sides are of one version of Plyflow.
const LAYOUT: u32 = 1;

/// What a law is, but for its code.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    layout: u32,
    /// JSON, see `schemas/manifest.md`.
    pub manifest: String,
    /// Doubles per membrane point.
    pub membrane_history: usize,
    /// Doubles per bending point.
    pub bending_history: usize,
    /// The parameters, in the order in which the code takes them.
    pub values: Vec<Value>,
    /// Object code of one function for one kind of processor each.
    pub code: Vec<Piece>,
    /// By which versions it was made. It is there to be part of the bytes, and for people who look.
    #[serde(rename = "made")]
    _made: serde_json::Value,
}

/// Where a piece of code lies behind the header.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// `membrane` or `bending`.
    pub function: String,
    /// The level of the x86-64 ABI that it needs.
    pub level: String,
    at: usize,
    length: usize,
}

/// A payload as it was read.
#[derive(Debug)]
pub struct Payload {
    /// What it says of itself.
    pub header: Header,
    code: Vec<u8>,
}

impl Payload {
    /// That of the library in which `inside` lies.
    ///
    /// # Errors
    /// There is none, or it cannot be read.
    pub fn of_library(inside: usize) -> Result<Self, String> {
        let maps = std::fs::read_to_string("/proc/self/maps");
        let maps = maps.map_err(|e| format!("/proc/self/maps cannot be read: {e}"))?;
        let (path, inode) = mapped(&maps, inside).ok_or("this library has no file")?;
        let mut file = File::open(path).map_err(|e| format!("{path} cannot be read: {e}"))?;
        // Under the same name may lie another file by now, whose bytes nobody has consented to.
        if file.metadata().map_err(|e| e.to_string())?.ino() != inode {
            return Err(format!(
                "{path} is another file than the one that was loaded"
            ));
        }
        Self::parse(&tail(&mut file).map_err(|e| format!("{path}: {e}"))?)
    }

    /// Reads a payload without its trailer.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (length, rest) = bytes.split_first_chunk::<8>().ok_or("it is cut off")?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|e| e.to_string())?;
        if length > rest.len() {
            return Err("the header is cut off".into());
        }
        let (header, code) = rest.split_at(length);
        let header: Header = serde_json::from_slice(header).map_err(|e| format!("header: {e}"))?;
        if header.layout != LAYOUT {
            return Err(format!(
                "layout {}, expected {LAYOUT}: make the law anew with this version of Plyflow",
                header.layout
            ));
        }
        let code = code.to_vec();
        Ok(Self { header, code })
    }

    /// The object code of a piece.
    ///
    /// # Errors
    /// It is cut off.
    pub fn code(&self, piece: &Piece) -> Result<&[u8], String> {
        let end = piece.at.checked_add(piece.length);
        let found = end.and_then(|end| self.code.get(piece.at..end));
        found.ok_or_else(|| format!("the code of {} is cut off", piece.function))
    }
}

/// The file that is mapped at an address, by a text such as `/proc/self/maps`: path and inode.
fn mapped(maps: &str, address: usize) -> Option<(&str, u64)> {
    maps.lines().find_map(|line| {
        let mut words = line.splitn(6, ' ');
        let (from, to) = words.next()?.split_once('-')?;
        let number = |text| usize::from_str_radix(text, 16).ok();
        if !(number(from)?..number(to)?).contains(&address) {
            return None;
        }
        // Rights, offset and device stand between.
        let inode = words.nth(3)?.parse().ok()?;
        let path = words.next()?.trim_start();
        path.starts_with('/').then_some((path, inode))
    })
}

/// The payload at the end of a file.
fn tail(file: &mut File) -> Result<Vec<u8>, String> {
    const TRAILER: u64 = 8 + MAGIC.len() as u64;
    let said = |e: std::io::Error| e.to_string();
    let whole = file.metadata().map_err(said)?.len();
    let none = || {
        "there is no law in it: this is the bare carrier, of which `python -m plyflow.laws` makes copies".to_owned()
    };
    let before = whole.checked_sub(TRAILER).ok_or_else(none)?;
    file.seek(SeekFrom::Start(before)).map_err(said)?;
    let mut length = [0; 8];
    let mut magic = [0; MAGIC.len()];
    file.read_exact(&mut length).map_err(said)?;
    file.read_exact(&mut magic).map_err(said)?;
    if magic != *MAGIC {
        return Err(none());
    }
    let length = u64::from_le_bytes(length);
    let start = before.checked_sub(length).ok_or("the law is cut off")?;
    file.seek(SeekFrom::Start(start)).map_err(said)?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).map_err(said)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_of_an_address_is_found_with_spaces_in_its_path() {
        let maps = "7f00-8000 r--p 00000000 fe:01 77                         /a b/lib c.so\n\
                    8000-9000 r-xp 00001000 fe:01 78   /d.so\n9000-a000 rw-p 00000000 00:00 0 \n";
        assert_eq!(mapped(maps, 0x7f10), Some(("/a b/lib c.so", 77)));
        assert_eq!(mapped(maps, 0x8000), Some(("/d.so", 78)));
        assert_eq!(mapped(maps, 0x9000), None);
        assert_eq!(mapped(maps, 0xb000), None);
    }

    #[test]
    fn a_payload_that_is_cut_off_anywhere_is_refused() {
        let header = br#"{"layout": 1, "manifest": "{}", "membrane_history": 0, "bending_history": 0, "values": [], "made": {},
            "code": [{"function": "membrane", "level": "x86-64", "at": 0, "length": 4}]}"#;
        let mut whole = (header.len() as u64).to_le_bytes().to_vec();
        whole.extend_from_slice(header);
        whole.extend_from_slice(b"code");
        let code = |bytes: &[u8]| {
            let payload = Payload::parse(bytes)?;
            payload.code(&payload.header.code[0]).map(<[u8]>::to_vec)
        };
        assert_eq!(code(&whole), Ok(b"code".to_vec()));
        for length in 0..whole.len() {
            assert!(code(&whole[..length]).is_err(), "{length} bytes were taken");
        }
    }

    #[test]
    fn a_payload_of_another_layout_says_what_to_do() {
        let header = br#"{"layout": 2, "manifest": "", "membrane_history": 0, "bending_history": 0, "values": [], "made": 0, "code": []}"#;
        let mut whole = (header.len() as u64).to_le_bytes().to_vec();
        whole.extend_from_slice(header);
        let why = Payload::parse(&whole).unwrap_err();
        assert!(why.contains("make the law anew"), "{why}");
    }

    #[test]
    fn a_library_without_a_law_says_that_it_has_none() {
        // The program of these tests itself.
        let why =
            Payload::of_library(a_library_without_a_law_says_that_it_has_none as fn() as usize)
                .unwrap_err();
        assert!(why.contains("bare carrier"), "{why}");
    }
}
