//! What a power cut can leave of what was done to a disk: names and bytes that nobody had asked the disk to keep may be there or not.

use crate::disk::Operation;
use crate::random::Random;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What of that which was not put on the disk gets there all the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// Nothing.
    All,
    /// Names do, bytes do not: files are there, and empty or as they were when they were last put on the disk.
    Bytes,
    /// Names and lengths do: where bytes are lost there are zeros.
    Zeros,
    /// Names do, and of each file a random part of what was written, the last piece of it torn at a sector.
    Torn,
    /// Some names and some pieces do, in any order.
    Some,
}

/// All kinds of loss.
pub const LOSSES: [Loss; 5] = [Loss::All, Loss::Bytes, Loss::Zeros, Loss::Torn, Loss::Some];

/// Bytes that a disk writes as one.
const SECTOR: usize = 512;

/// A piece of a file: written at an offset, or a new length.
#[derive(Debug, Clone)]
enum Piece {
    Bytes(u64, Vec<u8>),
    Length(u64),
}

#[derive(Debug, Clone, Default)]
struct Content {
    /// As it was when it was last put on the disk.
    kept: Vec<u8>,
    since: Vec<Piece>,
}

/// A change of names.
#[derive(Debug, Clone)]
enum Change {
    Link(PathBuf, usize),
    Rename(PathBuf, PathBuf, usize),
    Unlink(PathBuf),
    MakeFolder(PathBuf),
    RemoveFolder(PathBuf),
}

/// What a folder holds: `None` is a folder.
type Names = BTreeMap<PathBuf, Option<usize>>;

/// A disk, as far as it was asked to keep something.
#[derive(Debug, Clone, Default)]
pub struct Crash {
    files: Vec<Content>,
    /// Which file an inode is now: numbers are used again.
    inodes: BTreeMap<u64, usize>,
    live: Names,
    kept: Names,
    since: Vec<Change>,
}

fn apply(bytes: &mut Vec<u8>, piece: &Piece) {
    match piece {
        Piece::Length(n) => bytes.resize(usize::try_from(*n).expect("a length"), 0),
        Piece::Bytes(at, new) => {
            let at = usize::try_from(*at).expect("an offset");
            let end = at + new.len();
            if bytes.len() < end {
                bytes.resize(end, 0);
            }
            bytes[at..end].copy_from_slice(new);
        }
    }
}

fn change(names: &mut Names, change: &Change) {
    match change {
        Change::Link(path, file) => drop(names.insert(path.clone(), Some(*file))),
        Change::Rename(from, to, file) => {
            names.remove(from);
            names.insert(to.clone(), Some(*file));
        }
        Change::MakeFolder(path) => drop(names.insert(path.clone(), None)),
        Change::Unlink(path) | Change::RemoveFolder(path) => drop(names.remove(path)),
    }
}

impl Change {
    /// Whether putting this folder on the disk puts the change there: a rename goes with the folder of its new name.
    fn is_in(&self, folder: &Path) -> bool {
        let path = match self {
            Self::Link(path, _)
            | Self::Rename(_, path, _)
            | Self::Unlink(path)
            | Self::MakeFolder(path)
            | Self::RemoveFolder(path) => path,
        };
        path.parent() == Some(folder)
    }
}

impl Crash {
    /// One more operation is done.
    ///
    /// # Panics
    /// When it is of a file or name that is not known.
    pub fn take(&mut self, operation: &Operation) {
        match operation {
            Operation::Refused(_) => {}
            Operation::Create(path, inode) => {
                self.files.push(Content::default());
                let file = self.files.len() - 1;
                self.inodes.insert(*inode, file);
                self.names(Change::Link(path.clone(), file));
            }
            Operation::Write(inode, at, bytes) => {
                let piece = Piece::Bytes(*at, bytes.clone());
                self.file(*inode).since.push(piece);
            }
            Operation::Truncate(inode, length) => {
                self.file(*inode).since.push(Piece::Length(*length));
            }
            Operation::SyncFile(inode) => {
                let file = self.file(*inode);
                for piece in std::mem::take(&mut file.since) {
                    apply(&mut file.kept, &piece);
                }
            }
            Operation::SyncFolder(folder) => {
                let (kept, since) = std::mem::take(&mut self.since)
                    .into_iter()
                    .partition(|c| c.is_in(folder));
                self.since = since;
                let kept: Vec<Change> = kept;
                kept.iter().for_each(|c| change(&mut self.kept, c));
            }
            Operation::Rename(from, to) => {
                let file = self.live.get(from).copied().flatten();
                let file = file.expect("a file that was made");
                self.names(Change::Rename(from.clone(), to.clone(), file));
            }
            Operation::Unlink(path) => self.names(Change::Unlink(path.clone())),
            Operation::MakeFolder(path) => self.names(Change::MakeFolder(path.clone())),
            Operation::RemoveFolder(path) => self.names(Change::RemoveFolder(path.clone())),
        }
    }

    fn names(&mut self, new: Change) {
        change(&mut self.live, &new);
        self.since.push(new);
    }

    fn file(&mut self, inode: u64) -> &mut Content {
        let file = self.inodes.get(&inode).expect("a file that was made");
        &mut self.files[*file]
    }

    /// What is there after a power cut now: files by their paths, and folders (`None`).
    #[must_use]
    pub fn after(&self, loss: Loss, random: &mut Random) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut names = match loss {
            Loss::All | Loss::Some => self.kept.clone(),
            _ => self.live.clone(),
        };
        if loss == Loss::Some {
            for new in &self.since {
                if random.unit() < 0.7 {
                    change(&mut names, new);
                }
            }
        }
        let mut contents: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        let mut found = BTreeMap::new();
        for (path, file) in &names {
            // A name in a folder that is not there leads nowhere.
            let mut above = path.ancestors().skip(1);
            let is_lost =
                |p: &Path| self.live.get(p).is_some_and(Option::is_none) && !names.contains_key(p);
            if above.any(is_lost) {
                continue;
            }
            let bytes = file.map(|file| {
                let content = contents.entry(file);
                content
                    .or_insert_with(|| self.files[file].after(loss, random))
                    .clone()
            });
            found.insert(path.clone(), bytes);
        }
        found
    }
}

impl Content {
    fn after(&self, loss: Loss, random: &mut Random) -> Vec<u8> {
        let mut bytes = self.kept.clone();
        match loss {
            Loss::All | Loss::Bytes => {}
            Loss::Zeros => {
                for piece in &self.since {
                    match piece {
                        Piece::Bytes(at, new) => {
                            apply(&mut bytes, &Piece::Bytes(*at, vec![0; new.len()]));
                        }
                        Piece::Length(_) => apply(&mut bytes, piece),
                    }
                }
            }
            Loss::Torn => {
                let whole = random.below(self.since.len() + 1);
                self.since[..whole]
                    .iter()
                    .for_each(|p| apply(&mut bytes, p));
                if let Some(Piece::Bytes(at, new)) = self.since.get(whole) {
                    let sectors = random.below(new.len() / SECTOR + 1);
                    let torn = Piece::Bytes(*at, new[..sectors * SECTOR].to_vec());
                    apply(&mut bytes, &torn);
                }
            }
            Loss::Some => {
                for piece in &self.since {
                    if random.unit() < 0.5 {
                        apply(&mut bytes, piece);
                    }
                }
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(operations: &[Operation], loss: Loss) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut crash = Crash::default();
        operations.iter().for_each(|o| crash.take(o));
        crash.after(loss, &mut Random::new(1, 1))
    }

    #[test]
    fn only_what_was_put_on_the_disk_is_sure_to_be_there() {
        let (new, name) = (PathBuf::from("/s/new"), PathBuf::from("/s/name"));
        let mut all = vec![
            Operation::Create(new.clone(), 7),
            Operation::Write(7, 0, b"ab".to_vec()),
            Operation::SyncFile(7),
            Operation::Write(7, 2, b"cd".to_vec()),
            Operation::Rename(new, name.clone()),
        ];
        assert!(after(&all, Loss::All).is_empty(), "no name was kept");
        let one = |loss, all: &[Operation]| after(all, loss)[&name].clone().expect("a file");
        assert_eq!(one(Loss::Bytes, &all), b"ab");
        assert_eq!(one(Loss::Zeros, &all), b"ab\0\0");
        all.push(Operation::SyncFolder("/s".into()));
        assert_eq!(one(Loss::All, &all), b"ab");
        all.push(Operation::SyncFile(7));
        assert_eq!(one(Loss::All, &all), b"abcd");
        all.push(Operation::Unlink(name.clone()));
        assert_eq!(
            one(Loss::All, &all),
            b"abcd",
            "the end of a name is not kept"
        );
        assert!(!after(&all, Loss::Bytes).contains_key(&name));
    }

    #[test]
    fn what_lies_in_a_folder_that_was_lost_is_lost() {
        let all = [
            Operation::MakeFolder("/s/a".into()),
            Operation::Create("/s/a/f".into(), 1),
            Operation::SyncFile(1),
            Operation::SyncFolder("/s/a".into()),
        ];
        assert!(after(&all, Loss::All).is_empty());
        assert_eq!(after(&all, Loss::Bytes).len(), 2);
    }
}
