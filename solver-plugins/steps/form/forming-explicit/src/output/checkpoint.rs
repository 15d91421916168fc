//! Checkpoints: the state of a run between two frames, and the frames that it has written.
//!
//! The artifact of a run that is killed is lost, so its frames are kept here and written again. Every file ends with the
//! hash of its name, that of its folder (the key of the step), and what is before it: a torn one, or one of another step, is as good as none.

use crate::course::Course;
use crate::forming::Forming;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::archive::Archive;
use plyflow_sdk::{Host, Log, On, StepError};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Bytes of the hash at the end of a file.
const SEAL: usize = blake3::OUT_LEN;

/// A file that is written under another name, and gets its own when it is whole. The other name is this attempt's alone: on a cluster an earlier
/// attempt, of which nobody hears any more, may still write into the folder. What both write is the same.
struct Sealed {
    file: BufWriter<NamedTempFile>,
    hash: blake3::Hasher,
    path: PathBuf,
}

/// A hash that has begun with what a file is: a whole file of another key, or another frame, must not pass for it.
fn hasher(path: &Path) -> blake3::Hasher {
    let mut hash = blake3::Hasher::new();
    for name in [path.parent().and_then(Path::file_name), path.file_name()] {
        let name = name.unwrap_or_default().as_encoded_bytes();
        hash.update(&(name.len() as u64).to_le_bytes());
        hash.update(name);
    }
    hash
}

impl Sealed {
    fn create(path: &Path) -> io::Result<Self> {
        let folder = path.parent().ok_or(io::ErrorKind::InvalidInput)?;
        // Whoever may read the store may go on with the run.
        let begun = tempfile::Builder::new()
            .prefix("begun-")
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder)?;
        Ok(Self {
            file: BufWriter::new(begun),
            hash: hasher(path),
            path: path.to_owned(),
        })
    }

    /// With `sync`, only when the disk has it.
    fn close(mut self, sync: bool) -> io::Result<()> {
        let seal = self.hash.finalize();
        self.file.write_all(seal.as_bytes())?;
        let file = self
            .file
            .into_inner()
            .map_err(io::IntoInnerError::into_error)?;
        if sync {
            file.as_file().sync_all()?;
        }
        file.persist(&self.path)?;
        Ok(())
    }
}

impl Write for Sealed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.file.write(bytes)?;
        self.hash.update(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Opens a file, and nothing else: to open a pipe waits for a writer for ever.
fn open(path: &Path) -> io::Result<File> {
    if !std::fs::symlink_metadata(path)?.is_file() {
        let text = format!("{} is no file", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidData, text));
    }
    File::open(path)
}

/// What a file holds, if it is whole.
fn read_sealed(path: &Path) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path).ok()?.read_to_end(&mut bytes).ok()?;
    let end = bytes.len().checked_sub(SEAL)?;
    let hash = hasher(path).update(&bytes[..end]).finalize();
    let whole = *hash.as_bytes() == bytes[end..];
    bytes.truncate(end);
    whole.then_some(bytes)
}

/// One call that writes a frame.
#[derive(Serialize, Deserialize)]
pub enum Part<'a> {
    /// Time (s).
    Begin(f64),
    /// Points of a body (m).
    Points(Cow<'a, str>, Cow<'a, [Vec3]>),
    /// A field of a body: whether on its cells, name, unit, values.
    Field(
        Cow<'a, str>,
        bool,
        Cow<'a, str>,
        Cow<'a, str>,
        Cow<'a, [f64]>,
    ),
    /// The frame is whole.
    End,
}

impl Part<'_> {
    /// Does the call.
    fn write_to(&self, host: &Host) -> Result<(), StepError> {
        match self {
            Self::Begin(time) => host.begin_frame(*time),
            Self::Points(body, points) => host.write_points(body, points),
            Self::Field(body, on_cells, name, unit, values) => {
                let on = if *on_cells { On::Cells } else { On::Points };
                host.write_field(body, on, name, 1, unit, values)
            }
            Self::End => host.end_frame(),
        }
    }
}

/// Writes frames to the artifact and keeps what a later attempt needs to go on.
pub struct Recorder<'a> {
    host: &'a Host,
    /// None when the host keeps nothing, or when a file could not be written.
    folder: Option<PathBuf>,
    frame: Option<Sealed>,
    frames: usize,
    /// Frames that the disk has.
    synced: usize,
}

fn frame_file(folder: &Path, frame: usize) -> PathBuf {
    folder.join(format!("frame-{frame}"))
}

impl<'a> Recorder<'a> {
    pub fn new(host: &'a Host) -> Self {
        Self {
            host,
            folder: host.checkpoint().map(PathBuf::from),
            frame: None,
            frames: 0,
            synced: 0,
        }
    }

    /// No checkpoint is worth the run: without them it goes on.
    fn give_up(&mut self, e: &dyn std::fmt::Display) {
        let text = format!(
            "no more checkpoints: {e}; a killed run goes on from the last one, or begins anew"
        );
        self.host.log(Log::Warn, &text);
        self.folder = None;
        self.frame = None;
    }

    /// A part of a frame.
    pub fn put(&mut self, part: &Part<'_>) -> Result<(), StepError> {
        part.write_to(self.host)?;
        if let Err(e) = self.keep(part) {
            self.give_up(&e);
        }
        if matches!(part, Part::End) {
            self.frames += 1;
        }
        Ok(())
    }

    fn keep(&mut self, part: &Part<'_>) -> io::Result<()> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        if matches!(part, Part::Begin(_)) {
            self.frame = Some(Sealed::create(&frame_file(folder, self.frames))?);
        }
        if let Some(file) = &mut self.frame {
            postcard::to_io(part, file).map_err(io::Error::other)?;
        }
        match self.frame.take_if(|_| matches!(part, Part::End)) {
            Some(file) => file.close(false),
            None => Ok(()),
        }
    }

    /// Takes up the last checkpoint of an earlier attempt, if there is one; its frames are in the artifact then.
    pub fn resume(
        &mut self,
        forming: &mut Forming,
        course: &mut Course,
    ) -> Result<bool, StepError> {
        let Some(folder) = self.folder.clone() else {
            return Ok(false);
        };
        let Some(state) = read_sealed(&folder.join("state")) else {
            return Ok(false);
        };
        let misfit = |e: &dyn std::fmt::Display| {
            StepError::from(format!(
                "the checkpoint in {} cannot be taken up: {e}; remove that folder to begin anew",
                folder.display()
            ))
        };
        let mut archive = Archive::Load(&state);
        let mut found = Course::default();
        found.archive(&mut archive).map_err(|e| misfit(&e))?;
        let files = || (0..found.frame).map(|k| frame_file(&folder, k));
        if let Some(torn) = files().find(|f| read_sealed(f).is_none()) {
            let text = format!("begins anew: {} is not whole", torn.display());
            self.host.log(Log::Warn, &text);
            return Ok(false);
        }
        forming.archive(&mut archive).map_err(|e| misfit(&e))?;
        if !archive.is_at_end() {
            return Err(misfit(&"it holds more than the model's state"));
        }
        for file in files() {
            let bytes = read_sealed(&file).ok_or_else(|| misfit(&"a frame has gone"))?;
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                let (part, left): (Part<'_>, _) =
                    postcard::take_from_bytes(rest).map_err(|e| misfit(&e))?;
                part.write_to(self.host)?;
                rest = left;
            }
        }
        (self.frames, self.synced) = (found.frame, found.frame);
        *course = found;
        let text = format!(
            "goes on from a checkpoint at t = {:.5} s, step {}",
            forming.model.time(),
            forming.model.cycle()
        );
        self.host.log(Log::Info, &text);
        Ok(true)
    }

    /// Keeps a checkpoint when it is time for one.
    pub fn checkpoint(&mut self, forming: &mut Forming, course: &mut Course) {
        let Some(folder) = self.folder.clone().filter(|_| self.host.checkpoint_due()) else {
            return;
        };
        match self.save(&folder, forming, course) {
            Ok(()) => self.host.checkpoint_saved(),
            Err(e) => self.give_up(&e),
        }
    }

    fn save(
        &mut self,
        folder: &Path,
        forming: &mut Forming,
        course: &mut Course,
    ) -> io::Result<()> {
        for frame in self.synced..self.frames {
            open(&frame_file(folder, frame))?.sync_all()?;
        }
        self.synced = self.frames;
        let mut file = Sealed::create(&folder.join("state"))?;
        let mut archive = Archive::Save(&mut file);
        course.archive(&mut archive).map_err(io::Error::other)?;
        forming.archive(&mut archive).map_err(io::Error::other)?;
        file.close(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torn_file_is_as_good_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let mut file = Sealed::create(&path).unwrap();
        file.write_all(b"what a run knows").unwrap();
        assert!(!path.exists(), "not before it is whole");
        file.close(true).unwrap();
        assert_eq!(read_sealed(&path).unwrap(), b"what a run knows");
        let whole = std::fs::read(&path).unwrap();
        for keep in [0, 5, SEAL, whole.len() - 1] {
            std::fs::write(&path, &whole[..keep]).unwrap();
            assert!(read_sealed(&path).is_none(), "{keep} bytes");
        }
        let mut turned = whole.clone();
        turned[3] ^= 1;
        std::fs::write(&path, turned).unwrap();
        assert!(read_sealed(&path).is_none());
    }

    #[test]
    fn a_whole_file_of_another_key_or_frame_is_as_good_as_none() {
        let place = tempfile::tempdir().unwrap();
        let at = |key: &str, name: &str| place.path().join(key).join(name);
        for key in ["a", "b"] {
            std::fs::create_dir(place.path().join(key)).unwrap();
            let mut file = Sealed::create(&at(key, "frame-1")).unwrap();
            file.write_all(key.as_bytes()).unwrap();
            file.close(false).unwrap();
        }
        std::fs::copy(at("a", "frame-1"), at("a", "frame-2")).unwrap();
        assert!(read_sealed(&at("a", "frame-2")).is_none());
        std::fs::copy(at("b", "frame-1"), at("a", "frame-1")).unwrap();
        assert!(read_sealed(&at("a", "frame-1")).is_none());
        assert_eq!(read_sealed(&at("b", "frame-1")).unwrap(), b"b");
    }

    #[test]
    fn two_attempts_that_write_the_same_file_leave_it_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame-3");
        // The successor begins while the one that is given up still writes, and each ends as if it were alone.
        let mut given_up = Sealed::create(&path).unwrap();
        given_up.write_all(b"half of").unwrap();
        let mut successor = Sealed::create(&path).unwrap();
        successor.write_all(b"half").unwrap();
        given_up.write_all(b" a frame").unwrap();
        given_up.close(true).unwrap();
        assert_eq!(read_sealed(&path).unwrap(), b"half of a frame");
        successor.write_all(b" of a frame").unwrap();
        successor.close(true).unwrap();
        assert_eq!(read_sealed(&path).unwrap(), b"half of a frame");
        // One that is killed in between takes nothing with it.
        drop(Sealed::create(&path).unwrap());
        assert_eq!(read_sealed(&path).unwrap(), b"half of a frame");
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 1, "what was only begun is gone");
    }

    #[test]
    fn a_pipe_in_the_place_of_a_file_is_no_file_and_is_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame-0");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        assert!(read_sealed(&path).is_none());
        assert!(open(&path).is_err());
        let mut file = Sealed::create(&path).unwrap();
        file.write_all(b"a frame").unwrap();
        file.close(false).unwrap();
        assert_eq!(read_sealed(&path).unwrap(), b"a frame");
    }
}
