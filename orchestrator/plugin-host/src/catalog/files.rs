//! What is asked of files and of the processes that look at them.

use crate::breach::Breach;
use crate::load::hash_of;
use crate::supervise::Orphans;
use crate::trust::Stranger;
use camino::Utf8Path;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;

/// How long a library may take to load and describe itself.
pub(super) const LOAD_LIMIT: Duration = Duration::from_secs(30);

/// Most bytes that a library may say of itself: what a plugin's manifest takes, many times over.
pub(super) const LONGEST_ANSWER: u64 = 16 << 20;

/// What tells one version of a library file from another, without reading it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    size: u64,
    modified: i64,
    modified_ns: i64,
    changed: i64,
    changed_ns: i64,
    inode: u64,
}

/// Runs a command to its end: its standard output and its status, or no status when it had to be killed after
/// [`LOAD_LIMIT`] or [`LONGEST_ANSWER`].
pub(super) fn answer(command: Command) -> std::io::Result<(Vec<u8>, Option<ExitStatus>)> {
    answer_within(LOAD_LIMIT, command)
}

/// [`answer`] with another limit of time.
pub(super) fn answer_within(
    limit: Duration,
    mut command: Command,
) -> std::io::Result<(Vec<u8>, Option<ExitStatus>)> {
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()?;
    let mut pipe = child.stdout.take().expect("piped above");
    let (send, receive) = std::sync::mpsc::channel();
    // A reader of its own, because the pipe alone tells when the child has ended.
    std::thread::spawn(move || {
        let mut said = Vec::new();
        let read = (&mut pipe).take(LONGEST_ANSWER).read_to_end(&mut said);
        let whole = read.is_ok() && said.len() < LONGEST_ANSWER as usize;
        let _ = send.send(whole.then_some(said));
    });
    match receive.recv_timeout(limit) {
        Ok(Some(said)) => Ok((said, Some(child.wait()?))),
        // One that goes on to talk is stopped as one that hangs.
        Ok(None) | Err(_) => {
            // What the library started goes too, also where it has left the group.
            if let Ok(group) = libc::pid_t::try_from(child.id()) {
                // SAFETY: numbers alone. The group of a child that has not been waited for: its number is no other's.
                unsafe { libc::kill(-group, libc::SIGKILL) };
            }
            child.kill()?;
            child.wait()?;
            Orphans::end(&[]);
            Ok((Vec::new(), None))
        }
    }
}

pub(super) fn stamp(path: &Utf8Path) -> std::io::Result<Stamp> {
    let m = std::fs::metadata(path)?;
    Ok(Stamp {
        size: m.size(),
        modified: m.mtime(),
        modified_ns: m.mtime_nsec(),
        changed: m.ctime(),
        changed_ns: m.ctime_nsec(),
        inode: m.ino(),
    })
}

/// The path and the hash of a library's bytes.
pub(super) fn read_stranger(path: &Utf8Path) -> Result<Stranger, Breach> {
    if !path.is_file() {
        return Err(Breach::Missing);
    }
    Ok(Stranger {
        path: path.to_owned(),
        hash: hash_of(path)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_without_end_is_cut_off_and_its_command_killed() {
        let shell = |text: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", text]);
            answer(command).unwrap()
        };
        let (said, status) = shell("echo short");
        assert_eq!(
            (said.as_slice(), status.and_then(|s| s.code())),
            (&b"short\n"[..], Some(0))
        );
        let begun = std::time::Instant::now();
        let (said, status) = shell("yes");
        assert!(said.is_empty() && status.is_none());
        assert!(begun.elapsed() < LOAD_LIMIT / 2);
    }
}
