//! With how many threads a step may go on: a number that the engine writes while the step runs.
//!
//! It stands behind the job, in the file in memory that is the worker's standard input and that the engine keeps open: no signal, no thread that
//! listens, no message that could be late. A worker whose job comes from elsewhere keeps to the threads that its job has.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::fd::FromRawFd;
use std::os::unix::fs::FileExt;

/// Ends the job; no byte of a JSON text.
const END: u8 = 0;

/// The engine's side.
#[derive(Debug)]
pub struct Lender {
    file: File,
    at: u64,
}

impl Lender {
    /// A file to be read from its beginning as a worker's standard input, which holds `job`, and what tells the worker more.
    ///
    /// # Errors
    /// When the system has no memory for it.
    pub fn with_job(job: &[u8]) -> io::Result<(File, Self)> {
        // A file in memory instead of a pipe: any size, no partner needed, gone with its last user.
        // SAFETY: a text that ends with a zero, and a number.
        let number = unsafe { libc::memfd_create(c"plyflow-job".as_ptr(), libc::MFD_CLOEXEC) };
        if number < 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: the number of a file that was just made, which nobody else has.
        let mut memory = unsafe { File::from_raw_fd(number) };
        memory.write_all(job)?;
        memory.write_all(&[END])?;
        io::Seek::rewind(&mut memory)?;
        let file = memory.try_clone()?;
        let at = job.len() as u64 + 1;
        Ok((memory, Self { file, at }))
    }

    /// Tells the worker with how many threads it may go on.
    pub fn tell(&self, threads: u32) {
        // A step that does not hear of it is slower, and right.
        let _ = self.file.write_all_at(&threads.to_le_bytes(), self.at);
    }
}

/// The worker's side.
#[derive(Debug, Default)]
pub(crate) struct Lent {
    from: Option<(File, u64)>,
}

impl Lent {
    /// The job in what was read from `source`, and what follows it there.
    pub(crate) fn split(document: &[u8], source: impl AsFd) -> (&[u8], Self) {
        let Some(end) = document.iter().position(|b| *b == END) else {
            return (document, Self::default());
        };
        // A number of its own: a plugin may close the standard input.
        let file = source.as_fd().try_clone_to_owned().map(File::from);
        let from = file.ok().map(|f| (f, end as u64 + 1));
        (&document[..end], Self { from })
    }

    /// What the engine has written last.
    pub(crate) fn threads(&self) -> Option<u32> {
        let (file, at) = self.from.as_ref()?;
        let mut number = [0; 4];
        file.read_exact_at(&mut number, *at).ok()?;
        Some(u32::from_le_bytes(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn a_worker_hears_what_the_engine_has_told_last_and_only_from_a_file_that_the_engine_has() {
        let (mut memory, lender) = Lender::with_job(b"{}").unwrap();
        let mut read = Vec::new();
        memory.read_to_end(&mut read).unwrap();
        let (job, lent) = Lent::split(&read, &memory);
        assert_eq!((job, lent.threads()), (&b"{}"[..], None), "nothing told");
        for threads in [3, 200, 1] {
            lender.tell(threads);
            assert_eq!(lent.threads(), Some(threads));
        }
        // Told before the job was read.
        io::Seek::rewind(&mut memory).unwrap();
        read.clear();
        memory.read_to_end(&mut read).unwrap();
        let (job, lent) = Lent::split(&read, &memory);
        assert_eq!((job, lent.threads()), (&b"{}"[..], Some(1)));
        let (job, lent) = Lent::split(b"{} ", &memory);
        assert_eq!((job, lent.threads()), (&b"{} "[..], None), "a job by hand");
    }
}
