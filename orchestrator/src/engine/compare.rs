//! How a step that was made again compares with what the store has of it.

use camino::{Utf8Path, Utf8PathBuf};
use std::fs::File;
use std::io::{self, Read};

/// How an artifact that was made again compares with the one in the store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Compared {
    /// Byte for byte the same.
    Same {
        /// Their size (bytes).
        bytes: u64,
    },
    /// They differ.
    Other {
        /// Where the first byte differs (bytes from the beginning).
        at: u64,
        /// Size of the one in the store and of the new one (bytes).
        sizes: [u64; 2],
        /// Where the new one is kept.
        kept: Utf8PathBuf,
    },
    /// The store had none, or a damaged one: the new one was put there.
    New,
}

impl Compared {
    /// In words.
    pub fn text(&self) -> String {
        match self {
            Self::Same { bytes } => format!("made again, the same {bytes} bytes"),
            Self::Other { at, sizes, kept } => format!(
                "made again, and it is ANOTHER: the first of {} bytes that differs from the {} in the store is number {at}. The store is \
                 left as it is; the new one is kept as {kept}. Same key, same bytes is what plugins promise: the step depends on \
                 something that is not in its key (threads, the clock, the machine, a file that it does not declare)",
                sizes[1], sizes[0]
            ),
            Self::New => "made; the store had nothing whole to compare it with".into(),
        }
    }
}

/// Two artifacts that cannot be compared.
#[derive(Debug, thiserror::Error)]
#[error("{new} cannot be compared with {stored}: {source}")]
pub(super) struct NotCompared {
    pub(super) new: Utf8PathBuf,
    pub(super) stored: Utf8PathBuf,
    pub(super) source: io::Error,
}

/// Where two files first differ (bytes from the beginning); `None` when they are equal.
///
/// # Errors
/// When one cannot be read.
pub(super) fn first_difference(a: &Utf8Path, b: &Utf8Path) -> io::Result<Option<u64>> {
    let (mut a, mut b) = (File::open(a)?, File::open(b)?);
    let (mut x, mut y) = (Vec::new(), Vec::new());
    let mut before = 0;
    loop {
        for (file, piece) in [(&mut a, &mut x), (&mut b, &mut y)] {
            piece.clear();
            file.take(1 << 16).read_to_end(piece)?;
        }
        if x != y {
            let same = x.iter().zip(&y).take_while(|(x, y)| x == y).count();
            return Ok(Some(before + same as u64));
        }
        if x.is_empty() {
            return Ok(None);
        }
        before += x.len() as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_byte_that_differs_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| Utf8PathBuf::from_path_buf(dir.path().join(name)).unwrap();
        std::fs::write(at("a"), "abc").unwrap();
        for (text, expected) in [
            ("abc", None),
            ("abd", Some(2)),
            ("ab", Some(2)),
            ("abcd", Some(3)),
            ("", Some(0)),
        ] {
            std::fs::write(at("b"), text).unwrap();
            assert_eq!(first_difference(&at("a"), &at("b")).unwrap(), expected);
        }
    }
}
