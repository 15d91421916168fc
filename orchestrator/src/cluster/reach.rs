//! Who drives a run. The store's lock tells it on one machine; between machines it holds only where the file system passes locks on, so a
//! head also leaves a count that goes up, and one that finds another's count going up does not begin.

use super::folder::{Exchange, host, publish, read_sealed, to_sealed};
use camino::Utf8PathBuf;
use serde::{Deserialize, Serialize};
use std::io;
use std::time::{Duration, Instant};

/// Time between two counts.
const COUNT: Duration = Duration::from_secs(5);
/// How long a head of another machine is listened to before it is taken for dead: some counts, and what a file system's cache may hide.
const LISTEN: Duration = Duration::from_secs(15);

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Head {
    /// What makes it the only one.
    id: String,
    host: String,
    process: u32,
    count: u64,
}

/// The claim of this process on a run.
#[derive(Debug)]
pub struct Reach {
    path: Utf8PathBuf,
    own: Head,
    last: Instant,
}

/// Why a run cannot be driven from here.
#[derive(Debug, thiserror::Error)]
pub enum Taken {
    /// Another does.
    #[error(
        "process {process} on {host} runs this workflow already; stop it, or wait for it to end"
    )]
    Elsewhere {
        /// Its machine.
        host: String,
        /// Its number there.
        process: u32,
    },
    /// The disk refuses.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Reach {
    /// Takes a run over. The caller holds its lock, which keeps away heads of this machine. Waits some seconds when the last head was on
    /// another machine and did not end in order.
    ///
    /// # Errors
    /// When a head of another machine is alive.
    pub fn take(exchange: &Exchange, id: &str) -> Result<Self, Taken> {
        let path = exchange.root().join("head");
        let own = Head {
            id: id.to_owned(),
            host: host(),
            process: std::process::id(),
            count: 0,
        };
        let before = read_sealed::<Head>(&path).filter(|h| h.host != own.host);
        let until = Instant::now() + LISTEN;
        while before.is_some() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(200));
            match read_sealed::<Head>(&path) {
                now if now == before => {}
                Some(Head { host, process, .. }) => return Err(Taken::Elsewhere { host, process }),
                None => break,
            }
        }
        let mut reach = Self {
            path,
            own,
            last: Instant::now(),
        };
        reach.count()?;
        Ok(reach)
    }

    fn count(&mut self) -> io::Result<()> {
        self.own.count += 1;
        self.last = Instant::now();
        publish(&self.path, &to_sealed(&self.own)?, false)
    }

    /// Counts up when it is time to.
    ///
    /// # Errors
    /// When another has taken the run over meanwhile: this one was away for long.
    pub fn keep(&mut self) -> Result<(), Taken> {
        if self.last.elapsed() < COUNT {
            return Ok(());
        }
        match read_sealed::<Head>(&self.path) {
            Some(head) if head.id != self.own.id => Err(Taken::Elsewhere {
                host: head.host,
                process: head.process,
            }),
            // A full disk, or a server that is away, ends no run.
            _ => {
                let _ = self.count();
                Ok(())
            }
        }
    }

    /// Gives it up.
    pub fn leave(&self) {
        if read_sealed::<Head>(&self.path).is_some_and(|h| h.id == self.own.id) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Who drives a run, or drove it and did not end in order: machine and process.
pub fn driven_by(exchange: &Exchange) -> Option<(String, u32)> {
    let head: Head = read_sealed(&exchange.root().join("head"))?;
    Some((head.host, head.process))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exchange(folder: &tempfile::TempDir) -> Exchange {
        let exchange = Exchange::at(Utf8PathBuf::from_path_buf(folder.path().join("c")).unwrap());
        exchange.prepare().unwrap();
        exchange
    }

    fn another(exchange: &Exchange, count: u64) {
        let head = Head {
            id: "other".into(),
            host: "elsewhere".into(),
            process: 7,
            count,
        };
        publish(
            &exchange.root().join("head"),
            &to_sealed(&head).unwrap(),
            false,
        )
        .unwrap();
    }

    #[test]
    fn a_head_of_another_machine_that_lives_keeps_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let exchange = exchange(&folder);
        another(&exchange, 1);
        let beside = exchange.clone();
        let other = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(500));
            another(&beside, 2);
        });
        let error = Reach::take(&exchange, "me").unwrap_err().to_string();
        other.join().unwrap();
        assert!(error.contains("process 7 on elsewhere"), "{error}");
    }

    #[test]
    fn one_that_was_taken_over_is_told_so_and_does_not_take_the_other_away() {
        let folder = tempfile::tempdir().unwrap();
        let exchange = exchange(&folder);
        let mut first = Reach::take(&exchange, "first").unwrap();
        let second = Reach::take(&exchange, "second").unwrap();
        first.last = Instant::now().checked_sub(COUNT).unwrap();
        assert!(matches!(first.keep(), Err(Taken::Elsewhere { .. })));
        first.leave();
        assert!(exchange.root().join("head").exists());
        second.leave();
        assert!(!exchange.root().join("head").exists());
    }
}
