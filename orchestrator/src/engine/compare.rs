//! A step that is made again to be compared with what the store has of it.

use super::{ENDING, Flaw, Id, Known, Session};
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

/// Where two files first differ (bytes from the beginning); `None` when they are equal.
///
/// # Errors
/// When one cannot be read.
fn first_difference(a: &Utf8Path, b: &Utf8Path) -> io::Result<Option<u64>> {
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

impl Session<'_> {
    /// Compares what was made again with what the store has; `None` when that is nothing whole, and the new one is to take its place.
    pub(super) fn compare(
        &mut self,
        id: Id,
        artifact: &Utf8Path,
        record: &Utf8Path,
    ) -> Result<Option<Known>, String> {
        let label = self.core.label(id);
        let Some(key) = self.core.instances()[id].key else {
            return Ok(None);
        };
        let stored = match self.read_whole(id) {
            Ok(stored) => stored,
            Err(flaw) => {
                if let Flaw::Damaged(text) = flaw {
                    let place = self.store.set_key_aside(&key);
                    self.told.push(format!("{label}: {text}; {place}"));
                    self.summary.damaged += 1;
                }
                self.compared.push((label, Compared::New));
                return Ok(None);
            }
        };
        let there = self.store.artifact(&key);
        let cannot = |e: io::Error| format!("{artifact} cannot be compared with {there}: {e}");
        let how = match first_difference(&there, artifact).map_err(cannot)? {
            None => Compared::Same {
                bytes: stored.bytes,
            },
            Some(at) => {
                let size = std::fs::metadata(artifact).map_err(cannot)?.len();
                let named = artifact.with_file_name(format!("{}-again{ENDING}", key.hex()));
                std::fs::rename(artifact, &named).map_err(cannot)?;
                let kept = self.store.set_aside(&named).map_err(cannot)?;
                let kept = kept.unwrap_or(named);
                Compared::Other {
                    at,
                    sizes: [stored.bytes, size],
                    kept,
                }
            }
        };
        self.compared.push((label, how));
        let _ = (std::fs::remove_file(artifact), std::fs::remove_file(record));
        Ok(Some(Known {
            bytes: stored.bytes,
            labels: stored.collection,
            stamp: self.store.look(&key).ok().map(|seen| seen.stamp),
        }))
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
