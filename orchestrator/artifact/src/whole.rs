//! Files that are there whole or not at all: written under another name first, which the next writer clears away when its process was
//! killed before it came to give the right one.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Ending of a file that is only begun: `.NAME.PROCESS.partial`.
const BEGUN: &str = ".partial";

/// The name under which this process begins to write a file, in the same folder. What processes that live no more have left of the
/// same file is removed.
#[must_use]
pub fn begun(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default();
    if let Some(folder) = path.parent() {
        clear(folder, Some(name));
    }
    let name = name.to_string_lossy();
    path.with_file_name(format!(".{name}.{}{BEGUN}", std::process::id()))
}

/// Writes a file whole or not at all. It outlasts a killed process; a power cut in the next seconds may leave it empty or torn.
///
/// # Errors
/// When it cannot be written; what is there stays.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let begun = begun(path);
    let written = fs::write(&begun, bytes).and_then(|()| fs::rename(&begun, path));
    if written.is_err() {
        let _ = fs::remove_file(&begun);
    }
    written
}

/// Removes from a folder what processes that live no more have only begun to write.
pub fn clear_killed(folder: &Path) {
    clear(folder, None);
}

fn clear(folder: &Path, of: Option<&OsStr>) {
    // `with_file_name` of a bare name: the folder in which one stands.
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some((file, process)) = name.to_str().and_then(parts) else {
            continue;
        };
        let is_asked = of.is_none_or(|of| of == file);
        if is_asked && process != std::process::id() && !lives(process) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The name of the file and the number of the process in the name of a file that is only begun.
fn parts(name: &str) -> Option<(&str, u32)> {
    let (file, process) = (name.strip_prefix('.')?.strip_suffix(BEGUN)?).rsplit_once('.')?;
    Some((file, process.parse().ok()?))
}

/// Whether there is a process of this number. One in another container has none here: that it is taken for ended costs its writer the
/// file, never anybody a wrong one.
fn lives(process: u32) -> bool {
    Path::new("/proc/self").exists() && Path::new(&format!("/proc/{process}")).exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_whole_and_what_a_killed_process_left_of_it_goes() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mut gone = std::process::Command::new("true").spawn().unwrap();
        gone.wait().unwrap();
        let killed = format!(".report.html.{}.partial", gone.id());
        let others = [
            format!(".other.html.{}.partial", gone.id()),
            ".report.html.1.partial".into(),
            ".report.html.x.partial".into(),
            "report.html.partial".into(),
        ];
        for name in others.iter().chain([&killed]) {
            fs::write(at(name), "half").unwrap();
        }
        write(&at("report.html"), b"whole").unwrap();
        assert_eq!(fs::read(at("report.html")).unwrap(), b"whole");
        assert!(!at(&killed).exists());
        assert!(others.iter().all(|name| at(name).exists()));
        clear_killed(folder.path());
        let left: Vec<bool> = others.iter().map(|name| at(name).exists()).collect();
        assert_eq!(left, [false, true, true, true]);
    }

    #[test]
    fn what_cannot_be_written_leaves_what_is_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::create_dir(&path).unwrap();
        assert!(write(&path, b"x").is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
