//! A disk and a clock that misbehave on demand (`c/disk.c`), and the log of what was done to a disk.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::Study;

/// The library that is put before libc. Built on the first call.
///
/// # Panics
/// When there is no C compiler.
#[must_use]
pub fn shim() -> &'static Path {
    static SHIM: OnceLock<PathBuf> = OnceLock::new();
    SHIM.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("c/disk.c");
        let to = plyflow_faults::folder().join("disk-shim.so");
        let begun = to.with_extension(format!("so.{}", std::process::id()));
        let words = "-std=gnu11 -shared -fPIC -O1 -Wall -Wextra -Werror -pthread -ldl -o";
        let mut cc = Command::new("cc");
        cc.args(words.split(' ')).arg(&begun).arg(source);
        let status = cc.status().expect("a C compiler is needed for this test");
        assert!(status.success(), "the shim does not build");
        // Another test process may do the same: never a moment with half of it.
        std::fs::rename(begun, &to).expect("the shim in its place");
        to
    })
}

/// Whom a kill meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Victim {
    /// The process that runs the workflow.
    Head = 1,
    /// The process that is about to touch the file: the head or a worker.
    Doer = 2,
    /// Both.
    Both = 3,
}

/// Places of the orders in their file, as `struct orders` has them.
#[derive(Debug, Clone, Copy)]
enum Order {
    Operations,
    FailFrom,
    FailUntil,
    Error,
    KillAt,
    Victim,
    Torn,
    Head,
    Clock,
    Failures,
    Hold,
    Held,
}

/// What is to happen to the files under a folder.
#[derive(Debug)]
pub struct Disk {
    file: File,
    path: PathBuf,
    under: PathBuf,
}

impl Disk {
    /// A sound disk under `folder` (which need not be there yet); its orders lie in the file `orders`, beside or above it.
    ///
    /// # Panics
    /// When the file cannot be made.
    #[must_use]
    pub fn new(folder: &Path, orders: &Path) -> Self {
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(true);
        let disk = Self {
            file: options.open(orders).expect("a file of orders"),
            path: orders.to_owned(),
            under: folder.to_owned(),
        };
        disk.reset();
        disk
    }

    fn set(&self, order: Order, value: i64) {
        let place = 8 * order as u64;
        let done = self.file.write_all_at(&value.to_ne_bytes(), place);
        done.expect("room for an order");
    }

    fn get(&self, order: Order) -> i64 {
        let mut bytes = [0; 8];
        let done = self.file.read_exact_at(&mut bytes, 8 * order as u64);
        done.expect("the orders are whole");
        i64::from_ne_bytes(bytes)
    }

    /// Nothing goes wrong from now on, and operations are counted anew; the clock is right.
    pub fn reset(&self) {
        for order in [
            Order::Operations,
            Order::Error,
            Order::Victim,
            Order::Torn,
            Order::Head,
            Order::Failures,
            Order::Clock,
            Order::Hold,
            Order::Held,
        ] {
            self.set(order, 0);
        }
        for order in [Order::FailFrom, Order::FailUntil, Order::KillAt] {
            self.set(order, -1);
        }
    }

    /// From this operation on, and up to `until` without it, every operation fails with this `errno`. A full disk goes on to give free and
    /// to rename. `torn`: of the first, when it is a write, one half is done.
    pub fn fail(&self, from: u64, until: Option<u64>, errno: i32, torn: bool) {
        let whole = |n: u64| i64::try_from(n).expect("a number of an operation");
        self.set(Order::Error, errno.into());
        self.set(Order::Torn, torn.into());
        self.set(Order::FailUntil, until.map_or(-1, whole));
        self.set(Order::FailFrom, whole(from));
    }

    /// Before this operation (`torn`: in the middle of it, when it is a write) a process is killed.
    pub fn kill(&self, at: u64, victim: Victim, torn: bool) {
        self.set(Order::Victim, victim as i64);
        self.set(Order::Torn, torn.into());
        self.set(Order::KillAt, i64::try_from(at).expect("a number"));
    }

    /// The clock is wrong by so many seconds, now and for whoever starts later.
    pub fn move_clock(&self, seconds: i64) {
        self.set(Order::Clock, seconds);
    }

    /// Workers that start from now on wait before they do anything, or wait no longer.
    pub fn hold(&self, wait: bool) {
        self.set(Order::Hold, wait.into());
    }

    /// How many workers have had to wait since the last reset.
    ///
    /// # Panics
    /// When the orders cannot be read.
    #[must_use]
    pub fn held(&self) -> u64 {
        u64::try_from(self.get(Order::Held)).expect("a count")
    }

    /// Operations since the last reset.
    ///
    /// # Panics
    /// When the orders cannot be read.
    #[must_use]
    pub fn operations(&self) -> u64 {
        u64::try_from(self.get(Order::Operations)).expect("a count")
    }

    /// How many of them failed by order.
    ///
    /// # Panics
    /// When the orders cannot be read.
    #[must_use]
    pub fn failures(&self) -> u64 {
        u64::try_from(self.get(Order::Failures)).expect("a count")
    }

    /// Puts a command, and all that it starts, on this disk.
    pub fn under(&self, command: &mut Command) {
        let folder = self.under.canonicalize();
        command
            .env("LD_PRELOAD", shim())
            .env(
                "FAULTS_UNDER",
                folder.as_deref().unwrap_or(self.under.as_path()),
            )
            .env("FAULTS_ORDERS", &self.path);
    }
}

/// What was done to a disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Operation {
    /// One that the system refused.
    Refused(PathBuf),
    /// A file was made under this name.
    Create(PathBuf, u64),
    /// Bytes were written to a file (by its inode) at an offset.
    Write(u64, u64, Vec<u8>),
    /// A file was cut or grown to a length.
    Truncate(u64, u64),
    /// A file was put on the disk.
    SyncFile(u64),
    /// The names in a folder were put on the disk.
    SyncFolder(PathBuf),
    /// A name was exchanged for another.
    Rename(PathBuf, PathBuf),
    /// A name was removed.
    Unlink(PathBuf),
    /// A folder was made.
    MakeFolder(PathBuf),
    /// A folder was removed.
    RemoveFolder(PathBuf),
}

/// Reads a log that was written because of `FAULTS_LOG`.
///
/// # Panics
/// When it is not one.
#[must_use]
pub fn read_log(path: &Path) -> Vec<Operation> {
    let bytes = std::fs::read(path).expect("a log");
    let mut all = Vec::new();
    let mut rest = &bytes[..];
    while let Some((head, behind)) = rest.split_first_chunk::<32>() {
        let word = |k: usize| u32::from_ne_bytes(std::array::from_fn(|i| head[4 * k + i]));
        let long = |k: usize| u64::from_ne_bytes(std::array::from_fn(|i| head[16 + 8 * k + i]));
        let (path, behind) = behind.split_at(word(1) as usize);
        let (more, behind) = behind.split_at(word(2) as usize);
        rest = behind;
        let name = |bytes: &[u8]| PathBuf::from(std::str::from_utf8(bytes).expect("a UTF-8 path"));
        let (path, inode, at) = (name(path), long(0), long(1));
        all.push(match word(0) {
            0 => Operation::Refused(path),
            1 => Operation::Create(path, inode),
            2 => Operation::Write(inode, at, more.to_vec()),
            3 => Operation::Truncate(inode, at),
            4 if path.is_dir() || is_folder_of(&all, &path) => Operation::SyncFolder(path),
            4 => Operation::SyncFile(inode),
            5 => Operation::Rename(path, name(more)),
            6 => Operation::Unlink(path),
            7 => Operation::MakeFolder(path),
            8 => Operation::RemoveFolder(path),
            other => panic!("an operation of kind {other}"),
        });
    }
    assert!(rest.is_empty(), "the log is cut off");
    all
}

/// Whether a path was made as a folder.
fn is_folder_of(all: &[Operation], path: &Path) -> bool {
    all.iter()
        .any(|o| matches!(o, Operation::MakeFolder(p) if p == path))
}

/// A study on a disk that does as it is told.
pub struct Lab {
    /// The study.
    pub study: Study,
    /// The disk that its folder lies on.
    pub disk: Disk,
    _orders: tempfile::TempDir,
}

impl Lab {
    /// A study with these steps, on a sound disk.
    ///
    /// # Panics
    /// When its folder cannot be written.
    #[must_use]
    pub fn new(steps: &str) -> Self {
        let study = Study::new(steps);
        let orders = tempfile::tempdir().expect("a folder");
        let disk = Disk::new(&study.path(""), &orders.path().join("orders"));
        Self {
            study,
            disk,
            _orders: orders,
        }
    }

    /// `plyflow` with these words, on this disk.
    #[must_use]
    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = self.study.command(words);
        self.disk.under(&mut command);
        command
    }

    /// Runs it to its end.
    ///
    /// # Panics
    /// When it does not start.
    #[must_use]
    pub fn call(&self, words: &[&str]) -> Output {
        self.command(words).output().expect("plyflow starts")
    }
}
