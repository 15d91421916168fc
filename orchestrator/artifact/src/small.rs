//! Artifacts with attributes alone, without the HDF5 library.
//!
//! Starting the library costs about 1.2 ms of CPU, more than all the rest of a trivial step. An artifact
//! without meshes and arrays is one group with a few attributes: a superblock (version 3) and two object
//! headers (version 2) of the HDF5 file format specification 3.0, which this module writes and reads
//! itself. What is too long for that, or not written like that, is left to the library.

/// An attribute of the group `/plyflow`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Value {
    Text(String),
    Integer(i64),
}

const SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";
const SUPERBLOCK: usize = 48;
const UNDEFINED: [u8; 8] = [0xff; 8];
const GROUP: &str = "plyflow";

const LINK_INFO: u8 = 0x02;
const LINK: u8 = 0x06;
const GROUP_INFO: u8 = 0x0a;
const ATTRIBUTE: u8 = 0x0c;
const ATTRIBUTE_INFO: u8 = 0x15;

/// The file's bytes, or `None` when an attribute is too long for this form.
pub(crate) fn write(attributes: &[(&str, Value)]) -> Option<Vec<u8>> {
    // The root's header: links tracked and indexed by order of creation, as the library does for us.
    let mut info = vec![0, 3];
    info.extend(1u64.to_le_bytes());
    info.extend([UNDEFINED; 3].concat());
    let link = |address: u64| {
        let mut link = vec![1, 4];
        link.extend(0u64.to_le_bytes());
        link.push(GROUP.len() as u8);
        link.extend(GROUP.as_bytes());
        link.extend(address.to_le_bytes());
        link
    };
    let root = |address: u64| {
        header(&[
            (LINK_INFO, info.clone()),
            (GROUP_INFO, vec![0, 0]),
            (LINK, link(address)),
        ])
    };
    let address = SUPERBLOCK + root(0)?.len();

    let mut none = info.clone();
    none[2..10].copy_from_slice(&0u64.to_le_bytes());
    let mut messages = vec![(LINK_INFO, none), (GROUP_INFO, vec![0, 0])];
    for (name, value) in attributes {
        messages.push((ATTRIBUTE, attribute(name, value)?));
    }
    let group = header(&messages)?;

    let mut file = SIGNATURE.to_vec();
    file.extend([3, 8, 8, 0]);
    file.extend(0u64.to_le_bytes());
    file.extend(UNDEFINED);
    file.extend(((address + group.len()) as u64).to_le_bytes());
    file.extend((SUPERBLOCK as u64).to_le_bytes());
    file.extend(lookup3(&file).to_le_bytes());
    file.extend(root(address as u64)?);
    file.extend(group);
    Some(file)
}

/// An object header with its messages in one chunk.
fn header(messages: &[(u8, Vec<u8>)]) -> Option<Vec<u8>> {
    let size: usize = messages.iter().map(|(_, m)| 4 + m.len()).sum();
    let mut out = b"OHDR".to_vec();
    out.extend([2, 2]);
    out.extend(u32::try_from(size).ok()?.to_le_bytes());
    for (kind, message) in messages {
        out.push(*kind);
        out.extend(u16::try_from(message.len()).ok()?.to_le_bytes());
        out.push(0);
        out.extend(message);
    }
    out.extend(lookup3(&out).to_le_bytes());
    Some(out)
}

fn attribute(name: &str, value: &Value) -> Option<Vec<u8>> {
    let (datatype, data) = match value {
        Value::Text(text) => {
            // Class 3 (text), padded with zeros, UTF-8; HDF5 has no text of no bytes.
            let mut data = text.as_bytes().to_vec();
            data.resize(data.len().max(1), 0);
            let mut datatype = vec![0x13, 0x11, 0, 0];
            datatype.extend(u32::try_from(data.len()).ok()?.to_le_bytes());
            (datatype, data)
        }
        Value::Integer(i) => {
            // Class 0 (integer), little-endian, signed, 8 bytes, 64 bits from bit 0.
            let datatype = vec![0x10, 8, 0, 0, 8, 0, 0, 0, 0, 0, 64, 0];
            (datatype, i.to_le_bytes().to_vec())
        }
    };
    let mut out = vec![3, 0];
    out.extend((name.len() as u16 + 1).to_le_bytes());
    out.extend((datatype.len() as u16).to_le_bytes());
    out.extend([4, 0, 0]);
    out.extend(name.as_bytes());
    out.push(0);
    out.extend(datatype);
    out.extend([2, 0, 0, 0]);
    out.extend(data);
    (out.len() <= usize::from(u16::MAX)).then_some(out)
}

/// The attributes of a file in this form, in order; `None` for every other file.
pub(crate) fn read(file: &[u8]) -> Option<Vec<(String, Value)>> {
    let superblock = file.get(..SUPERBLOCK)?;
    if superblock[..12] != [&SIGNATURE[..], &[3, 8, 8, 0]].concat()
        || u32_at(superblock, 44)? != lookup3(&superblock[..44])
        || u64_at(superblock, 28)? != file.len() as u64
        || u64_at(superblock, 36)? != SUPERBLOCK as u64
    {
        return None;
    }
    let mut group = None;
    for (kind, message) in messages(file, SUPERBLOCK)? {
        match kind {
            LINK_INFO | GROUP_INFO => {}
            LINK if group.is_none() => {
                let name = GROUP.as_bytes();
                let fixed = message.get(..2)? == [1, 4] && *message.get(10)? == name.len() as u8;
                if !fixed || message.get(11..11 + name.len())? != name {
                    return None;
                }
                group = Some(usize::try_from(u64_at(message, 11 + name.len())?).ok()?);
            }
            _ => return None,
        }
    }
    let mut attributes = Vec::new();
    for (kind, message) in messages(file, group?)? {
        match kind {
            LINK_INFO | GROUP_INFO => {}
            ATTRIBUTE => attributes.push(parse_attribute(message)?),
            _ => return None,
        }
    }
    Some(attributes)
}

/// Kind and bytes of every message of a header in one chunk.
fn messages(file: &[u8], at: usize) -> Option<Vec<(u8, &[u8])>> {
    let header = file.get(at..)?;
    if header.get(..6)? != b"OHDR\x02\x02" {
        return None;
    }
    let size = u32_at(header, 6)? as usize;
    let end = 10usize.checked_add(size)?;
    if u32_at(header, end)? != lookup3(header.get(..end)?) {
        return None;
    }
    let (mut out, mut at) = (Vec::new(), 10);
    while at + 4 <= end {
        let length = usize::from(u16::from_le_bytes(header[at + 1..at + 3].try_into().ok()?));
        let message = header.get(at + 4..at + 4 + length)?;
        if at + 4 + length > end || header[at] == ATTRIBUTE_INFO || header[at + 3] != 0 {
            return None;
        }
        out.push((header[at], message));
        at += 4 + length;
    }
    (at == end).then_some(out)
}

fn parse_attribute(m: &[u8]) -> Option<(String, Value)> {
    let size = |at: usize| {
        Some(usize::from(u16::from_le_bytes(
            m.get(at..at + 2)?.try_into().ok()?,
        )))
    };
    if m.get(..2)? != [3, 0] || size(6)? != 4 {
        return None;
    }
    let (name, datatype) = (size(2)?, size(4)?);
    let text = m.get(9..(9 + name).checked_sub(1)?)?;
    let text = std::str::from_utf8(text).ok()?.to_owned();
    let at = 9 + name;
    let t = m.get(at..at + datatype)?;
    if m.get(at + datatype..at + datatype + 4)? != [2, 0, 0, 0] {
        return None;
    }
    let data = &m[at + datatype + 4..];
    match (t.get(..4)?, datatype) {
        ([0x13, 0x11, 0, 0], 8) if u32_at(t, 4)? as usize == data.len() => {
            let end = data.iter().position(|b| *b == 0).unwrap_or(data.len());
            Some((
                text,
                Value::Text(std::str::from_utf8(&data[..end]).ok()?.to_owned()),
            ))
        }
        ([0x10, 8, 0, 0], 12) => Some((
            text,
            Value::Integer(i64::from_le_bytes(data.try_into().ok()?)),
        )),
        _ => None,
    }
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(
        bytes.get(at..at.checked_add(4)?)?.try_into().ok()?,
    ))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(
        bytes.get(at..at.checked_add(8)?)?.try_into().ok()?,
    ))
}

/// The checksum of HDF5's metadata: Bob Jenkins' lookup3 (`hashlittle`) with the initial value 0.
fn lookup3(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let (mut a, mut b, mut c) = (start, start, start);
    let mut rest = bytes;
    while rest.len() > 12 {
        let word = |i: usize| u32::from_le_bytes(rest[i..i + 4].try_into().expect("4 bytes"));
        a = a.wrapping_add(word(0));
        b = b.wrapping_add(word(4));
        c = c.wrapping_add(word(8));
        a = a.wrapping_sub(c) ^ c.rotate_left(4);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(6);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(8);
        b = b.wrapping_add(a);
        a = a.wrapping_sub(c) ^ c.rotate_left(16);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(19);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(4);
        b = b.wrapping_add(a);
        rest = &rest[12..];
    }
    if rest.is_empty() {
        return c;
    }
    let mut tail = [0u8; 12];
    tail[..rest.len()].copy_from_slice(rest);
    let word = |i: usize| u32::from_le_bytes(tail[i..i + 4].try_into().expect("4 bytes"));
    a = a.wrapping_add(word(0));
    b = b.wrapping_add(word(4));
    c = c.wrapping_add(word(8));
    c = (c ^ b).wrapping_sub(b.rotate_left(14));
    a = (a ^ c).wrapping_sub(c.rotate_left(11));
    b = (b ^ a).wrapping_sub(a.rotate_left(25));
    c = (c ^ b).wrapping_sub(b.rotate_left(16));
    a = (a ^ c).wrapping_sub(c.rotate_left(4));
    b = (b ^ a).wrapping_sub(a.rotate_left(14));
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::h5::{File, Location};

    fn attributes() -> Vec<(&'static str, Value)> {
        vec![
            ("data_model", Value::Integer(1)),
            ("kind", Value::Text("test".into())),
            ("empty", Value::Text(String::new())),
            ("results", Value::Text("[{\"name\": \"Å\"}]".into())),
            ("negative", Value::Integer(-7)),
        ]
    }

    #[test]
    fn the_library_reads_what_is_written_without_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.h5");
        std::fs::write(&path, write(&attributes()).unwrap()).unwrap();
        let file = File::open(&path).unwrap();
        let group = file.open_group("/plyflow").unwrap();
        for (name, value) in attributes() {
            match value {
                Value::Text(t) => assert_eq!(group.read_text(name).unwrap(), Some(t), "{name}"),
                Value::Integer(i) => {
                    assert_eq!(group.read_integer(name).unwrap(), Some(i), "{name}");
                }
            }
        }
        assert!(!file.exists("/VTKHDF"));
    }

    #[test]
    fn what_is_written_is_read_back_in_order() {
        let read = read(&write(&attributes()).unwrap()).unwrap();
        let read: Vec<(&str, Value)> = read.iter().map(|(n, v)| (n.as_str(), v.clone())).collect();
        assert_eq!(read, attributes());
    }

    #[test]
    fn damaged_bytes_are_left_to_the_library_wherever_they_are() {
        let good = write(&attributes()).unwrap();
        for i in 0..good.len() {
            let mut bad = good.clone();
            bad[i] ^= 0x10;
            assert_eq!(read(&bad), None, "byte {i}");
            assert_eq!(read(&good[..i]), None, "cut at {i}");
        }
    }

    #[test]
    fn a_text_too_long_for_a_message_is_left_to_the_library() {
        let long = |n: usize| write(&[("t", Value::Text("x".repeat(n)))]);
        assert!(long(65_000).is_some());
        assert!(long(65_536).is_none());
    }
}
