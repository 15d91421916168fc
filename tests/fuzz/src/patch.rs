//! Artifacts from few bytes: a sound file, and what is written over it.
//!
//! The first byte says which of the [`BASES`]. Behind it come pieces: place (two bytes, little-endian, modulo the length of the file), number
//! of bytes, and these. Then the checksums of the superblock and of the object headers are put right, so that what was changed is read, and
//! not only found to be changed. Bytes that begin as HDF5 does are taken as they are.

use crate::fixture::REPOSITORY;
use crate::mutate::Dice;
use std::sync::LazyLock;

/// Sound artifacts: attributes alone; arrays; bodies with frames and fields; long texts. `fuzz-tool bases` makes them anew, after
/// which patches of the corpus mean something else.
pub static BASES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let read = |name| {
        let path = REPOSITORY.join(format!("tests/fuzz/fixture/artifacts/{name}.vtkhdf"));
        std::fs::read(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
    };
    ["attributes", "arrays", "bodies", "long"]
        .map(read)
        .to_vec()
});

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// The file that some bytes mean.
#[must_use]
pub fn apply(bytes: &[u8]) -> Vec<u8> {
    let [base, rest @ ..] = bytes else {
        return Vec::new();
    };
    if bytes.starts_with(&SIGNATURE[..4]) {
        return bytes.to_vec();
    }
    let mut file = BASES[usize::from(*base) % BASES.len()].clone();
    let mut rest = rest;
    while let [low, high, count, behind @ ..] = rest {
        let at = usize::from(u16::from_le_bytes([*low, *high])) % file.len();
        let count = usize::from(*count).min(behind.len()).min(file.len() - at);
        file[at..at + count].copy_from_slice(&behind[..count]);
        rest = &behind[count..];
    }
    put_right(&mut file);
    file
}

/// Adds a piece to a patch: over digits of a text in the file, or over any bytes.
pub fn grow(patch: &mut Vec<u8>, dice: &mut Dice) {
    if patch.is_empty() {
        patch.push(dice.below(BASES.len()) as u8);
    }
    let base = &BASES[usize::from(patch[0]) % BASES.len()];
    let digits: Vec<usize> = (0..base.len().min(1 << 16))
        .filter(|i| base[*i].is_ascii_digit())
        .collect();
    let (at, piece) = if dice.below(2) == 0 && !digits.is_empty() {
        let at = digits[dice.below(digits.len())];
        let count = base[at..].iter().take_while(|b| b.is_ascii_digit()).count();
        let count = 1 + dice.below(count);
        (
            at,
            (0..count).map(|_| b'0' + dice.below(10) as u8).collect(),
        )
    } else {
        const TELLING: [&[u8]; 8] = [
            &[0],
            &[0xff],
            &[0xff; 8],
            &[0; 8],
            &[1],
            &[0, 0, 0, 0x80],
            &[0xff, 0xff, 0xff, 0x7f],
            &[0x10, 0, 0, 0],
        ];
        let at = dice.below(base.len().min(1 << 16));
        let piece = match dice.below(2) {
            0 => TELLING[dice.below(TELLING.len())].to_vec(),
            _ => vec![base[at] ^ (1 << dice.below(8))],
        };
        (at, piece)
    };
    patch.extend((at as u16).to_le_bytes());
    patch.push(piece.len() as u8);
    patch.extend(piece);
}

/// Puts the checksums of the superblock and of all object headers right, as far as they are where their sizes say.
fn put_right(file: &mut [u8]) {
    if file.len() >= 48 && file.starts_with(SIGNATURE) && matches!(file[8], 2 | 3) {
        sum(file, 0, 44);
    }
    let mut at = 0;
    while let Some(next) = file[at..].windows(4).position(|w| w == b"OHDR") {
        at += next;
        header(file, at);
        at += 4;
    }
}

/// Writes the checksum of `from..to` behind it.
fn sum(file: &mut [u8], from: usize, to: usize) {
    let Some(end) = to.checked_add(4).filter(|e| *e <= file.len() && from <= to) else {
        return;
    };
    let sum = lookup3(&file[from..to]).to_le_bytes();
    file[to..end].copy_from_slice(&sum);
}

/// An object header of version 2 and the chunks in which it goes on.
fn header(file: &mut [u8], at: usize) {
    let Some(flags) = file.get(at + 5).copied() else {
        return;
    };
    let width = 1usize << (flags & 3);
    let times = if flags & 0x20 == 0 { 0 } else { 16 };
    let phases = if flags & 0x10 == 0 { 0 } else { 4 };
    let first = at + 6 + times + phases;
    let Some(size) = number(file, first, width) else {
        return;
    };
    let (start, head) = (first + width, if flags & 4 == 0 { 4 } else { 6 });
    let Some(end) = start.checked_add(size).filter(|e| *e <= file.len()) else {
        return;
    };
    let mut more = Vec::new();
    let mut message = start;
    while message + head <= end {
        let length = number(file, message + 1, 2).unwrap_or(0);
        if file[message] == 0x10
            && let (Some(from), Some(length)) = (
                number(file, message + head, 8),
                number(file, message + head + 8, 8),
            )
        {
            more.push((from, length));
        }
        message += head + length;
    }
    sum(file, at, end);
    for (from, length) in more {
        if let Some(to) = from.checked_add(length).and_then(|e| e.checked_sub(4)) {
            sum(file, from, to);
        }
    }
}

fn number(file: &[u8], at: usize, width: usize) -> Option<usize> {
    let mut bytes = [0; 8];
    bytes[..width].copy_from_slice(file.get(at..at.checked_add(width)?)?);
    usize::try_from(u64::from_le_bytes(bytes)).ok()
}

/// The checksum of HDF5's metadata: Bob Jenkins' lookup3 (`hashlittle`) with the initial value 0.
fn lookup3(bytes: &[u8]) -> u32 {
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let (mut a, mut b, mut c) = (start, start, start);
    let count = bytes.len().div_ceil(12);
    for (i, piece) in bytes.chunks(12).enumerate() {
        let mut words = [0u8; 12];
        words[..piece.len()].copy_from_slice(piece);
        let [x, y, z] = [0, 4, 8].map(|k| number(&words, k, 4).unwrap_or(0) as u32);
        a = a.wrapping_add(x);
        b = b.wrapping_add(y);
        c = c.wrapping_add(z);
        if i + 1 < count {
            // Three to a turn of the ring, twice around.
            for turn in [4, 6, 8, 16, 19, 4] {
                a = a.wrapping_sub(c) ^ c.rotate_left(turn);
                c = c.wrapping_add(b);
                (a, b, c) = (b, c, a);
            }
        } else {
            for turn in [14, 11, 25, 16, 4, 14, 24] {
                c = (c ^ b).wrapping_sub(b.rotate_left(turn));
                (a, b, c) = (b, c, a);
            }
            (a, b, c) = (c, a, b);
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_that_changes_nothing_is_the_sound_file() {
        for (i, base) in BASES.iter().enumerate() {
            assert!(
                apply(&[i as u8]) == *base,
                "base {i}: a checksum is put wrong"
            );
            let at = 12u16.to_le_bytes();
            let piece = [i as u8, at[0], at[1], 1, base[12]];
            assert!(apply(&piece) == *base, "base {i}");
        }
    }
}
