//! What the user wishes while steps run: Ctrl-C, SIGTERM and SIGHUP.

use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Ctrl-C, SIGTERM and SIGHUP, counted, with something that becomes readable for `poll`.
pub struct Interrupts {
    wake: UnixStream,
    heard: Arc<AtomicU32>,
}

impl Interrupts {
    /// Begins to listen.
    ///
    /// # Errors
    /// When the system has no room for it.
    pub fn listen() -> std::io::Result<Self> {
        let (wake, write) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        write.set_nonblocking(true)?;
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::low_level::pipe::register(signal, write.try_clone()?)?;
        }
        Self::listen_to_hangups(write)?;
        Ok(Self {
            wake,
            heard: Arc::default(),
        })
    }

    /// A closed terminal counts once: the shell and the kernel may both tell of it, and the second would not let steps end in order.
    /// Whoever ignores it (`nohup`) goes on.
    fn listen_to_hangups(write: UnixStream) -> std::io::Result<()> {
        // SAFETY: zeros are an action without flags and mask.
        let mut before: libc::sigaction = unsafe { std::mem::zeroed() };
        // SAFETY: NULL for no new action, and a whole one of this function for that which is there.
        let asked = unsafe { libc::sigaction(libc::SIGHUP, std::ptr::null(), &raw mut before) };
        if asked == 0 && before.sa_sigaction == libc::SIG_IGN {
            return Ok(());
        }
        let told = AtomicBool::new(false);
        let tell = move || {
            if !told.swap(true, Ordering::Relaxed) {
                let _ = rustix::io::write(&write, b"X");
            }
        };
        // SAFETY: an atomic and a write to a socket that does not block: both are allowed in a handler.
        unsafe { signal_hook::low_level::register(signal_hook::consts::SIGHUP, tell) }?;
        Ok(())
    }

    /// What becomes readable.
    ///
    /// # Errors
    /// When the system has no room for it.
    pub fn poll_end(&self) -> std::io::Result<OwnedFd> {
        Ok(self.wake.try_clone()?.into())
    }

    /// How many there have been.
    pub fn count(&self) -> u32 {
        let mut buffer = [0u8; 16];
        while let Ok(n) = (&self.wake).read(&mut buffer) {
            if n == 0 {
                break;
            }
            self.heard.fetch_add(n as u32, Ordering::Relaxed);
        }
        self.heard.load(Ordering::Relaxed)
    }
}
