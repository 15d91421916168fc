//! Runs jobs as worker processes of this machine: one thread, one `poll` for all of them.

use super::executor::{Executor, Outcome, Report, Task};
use camino::Utf8PathBuf;
use plyflow_model::job::{FailureKind, LogLevel, Message};
use plyflow_plugin_host::{Lender, Orphans};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::process::{Pid, PidfdFlags, Signal};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How long a worker has between SIGTERM and SIGKILL, unless it is said.
const GRACE: Duration = Duration::from_secs(5);
/// Reads (of 16 KiB) of one pipe before the others, the time limits and the user get their turn: a plugin may talk without end.
const READS: usize = 64;
/// Reads of the pipe of a worker that has ended: more than a pipe can hold.
const READS_AT_END: usize = 4096;
/// Most bytes of a log: what comes after them is dropped.
const LONGEST_LOG: u64 = 64 << 20;
/// A worker that says this much without a line end is not talking the protocol.
const LONGEST_LINE: usize = 64 << 20;

/// How it begins what is said of a step that came to its bound of memory.
pub(crate) const WANTED_MEMORY: &str = "it wanted more memory than its bound";

/// Worker processes of this machine.
pub struct Local {
    program: Utf8PathBuf,
    workers: BTreeMap<usize, Worker>,
    queued: Vec<Report>,
    wake: Option<OwnedFd>,
    grace: Duration,
}

struct Worker {
    process: Child,
    exit: OwnedFd,
    lender: Lender,
    stdout: Option<ChildStdout>,
    stderr: Option<ChildStderr>,
    line: Vec<u8>,
    verdict: Option<Message>,
    log: Log,
    time_limit: f64,
    memory_limit: u64,
    /// It said that memory was refused to it.
    wants_memory: bool,
    /// A signal has ended it, so that it may have left something behind.
    was_killed: bool,
    deadline: Option<Instant>,
    kill_at: Option<Instant>,
    stop: Option<Stop>,
}

#[derive(Clone, Copy, PartialEq)]
enum Stop {
    Cancelled,
    TimedOut,
}

/// A log file that is made when there is something to write.
struct Log {
    path: Utf8PathBuf,
    file: Option<File>,
    written: u64,
}

impl Log {
    fn write(&mut self, bytes: &[u8]) {
        let before = self.written;
        self.written += bytes.len() as u64;
        if self.written <= LONGEST_LOG {
            self.append(bytes);
        } else if before <= LONGEST_LOG {
            self.append(b"\n(the log is longer than 64 MiB; the rest was dropped)\n");
        }
    }

    fn append(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        if self.file.is_none() {
            if let Some(folder) = self.path.parent() {
                let _ = std::fs::create_dir_all(folder);
            }
            self.file = File::create(&self.path).ok();
        }
        // A log that cannot be written must not fail the step it tells about.
        if let Some(file) = &mut self.file {
            let _ = file.write_all(bytes);
        }
    }
}

/// What becomes readable when a worker ends; its pipes no longer make a reader wait.
fn watch(process: &Child) -> io::Result<OwnedFd> {
    let exit = rustix::process::pidfd_open(Pid::from_child(process), PidfdFlags::empty())?;
    let out = process.stdout.as_ref().map(AsFd::as_fd);
    let err = process.stderr.as_ref().map(AsFd::as_fd);
    for pipe in [out, err].into_iter().flatten() {
        rustix::fs::fcntl_setfl(pipe, OFlags::NONBLOCK)?;
    }
    Ok(exit)
}

impl Local {
    /// Workers are started as `program step-worker -`. `wake`: when it becomes readable, waiting ends.
    pub fn new(program: Utf8PathBuf, wake: Option<OwnedFd>) -> Self {
        Self {
            program,
            workers: BTreeMap::new(),
            queued: Vec::new(),
            wake,
            grace: GRACE,
        }
    }

    /// How long a worker has to stop when it is asked to, before it is killed.
    #[must_use]
    pub fn with_grace(mut self, grace: Duration) -> Self {
        self.grace = grace;
        self
    }

    fn spawn(&self, task: &Task) -> io::Result<(Child, OwnedFd, Lender)> {
        let (memory, lender) = Lender::with_job(&serde_json::to_vec(&task.job)?)?;
        // No pre_exec: so the standard library can use posix_spawn, whatever the size of this process.
        let mut process = Command::new(&self.program)
            .arg0("plyflow")
            .args(["step-worker", "-", "--parent"])
            .arg(std::process::id().to_string())
            .stdin(Stdio::from(memory))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .process_group(0)
            .spawn()?;
        match watch(&process) {
            Ok(exit) => Ok((process, exit, lender)),
            Err(e) => {
                // Nobody would hear it: left alone it would run beside the next attempt, on the same checkpoints.
                let _ = process.kill();
                let _ = process.wait();
                Err(e)
            }
        }
    }

    fn poll(&mut self, timeout: Option<Duration>) -> io::Result<Vec<(usize, [bool; 3])>> {
        let mut fds = Vec::with_capacity(1 + 3 * self.workers.len());
        let mut owners = Vec::with_capacity(fds.capacity());
        if let Some(wake) = &self.wake {
            fds.push(PollFd::new(wake, PollFlags::IN));
            owners.push(None);
        }
        for (id, w) in &self.workers {
            fds.push(PollFd::new(&w.exit, PollFlags::IN));
            owners.push(Some((*id, 0)));
            if let Some(pipe) = &w.stdout {
                fds.push(PollFd::new(pipe, PollFlags::IN));
                owners.push(Some((*id, 1)));
            }
            if let Some(pipe) = &w.stderr {
                fds.push(PollFd::new(pipe, PollFlags::IN));
                owners.push(Some((*id, 2)));
            }
        }
        let timeout = timeout.map(|t| Timespec {
            tv_sec: t.as_secs() as i64,
            tv_nsec: i64::from(t.subsec_nanos()),
        });
        match poll(&mut fds, timeout.as_ref()) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(e) => return Err(e.into()),
        }
        let mut ready: Vec<(usize, [bool; 3])> = Vec::new();
        for (fd, owner) in fds.iter().zip(owners) {
            let Some((id, which)) = owner else { continue };
            if fd.revents().is_empty() {
                continue;
            }
            if ready.last().is_none_or(|r| r.0 != id) {
                ready.push((id, [false; 3]));
            }
            if let Some(last) = ready.last_mut() {
                last.1[which] = true;
            }
        }
        Ok(ready)
    }

    /// Time until the next time limit or the end of a grace.
    fn next_deadline(&self, now: Instant) -> Option<Duration> {
        let all = self
            .workers
            .values()
            .flat_map(|w| [w.deadline, w.kill_at])
            .flatten();
        all.min().map(|at| at.saturating_duration_since(now))
    }

    fn enforce_deadlines(&mut self) {
        if self
            .workers
            .values()
            .all(|w| w.deadline.is_none() && w.kill_at.is_none())
        {
            return;
        }
        let now = Instant::now();
        for worker in self.workers.values_mut() {
            if worker.deadline.is_some_and(|at| at <= now) {
                worker.deadline = None;
                worker.stop.get_or_insert(Stop::TimedOut);
                // One that hangs will not listen: no grace.
                worker.signal(Signal::KILL);
            }
            if worker.kill_at.is_some_and(|at| at <= now) {
                worker.kill_at = None;
                worker.signal(Signal::KILL);
            }
        }
    }
}

impl Executor for Local {
    fn submit(&mut self, task: Task) {
        let (mut process, exit, lender) = match self.spawn(&task) {
            Ok(started) => started,
            Err(e) => {
                let outcome = Outcome::NotStarted(format!("{}: {e}", self.program));
                return self.queued.push(Report::Ended {
                    id: task.id,
                    outcome,
                });
            }
        };
        let limit = Some(task.time_limit).filter(|s| *s > 0.0);
        let deadline = limit
            .and_then(|s| Duration::try_from_secs_f64(s).ok())
            .and_then(|d| Instant::now().checked_add(d));
        let worker = Worker {
            stdout: process.stdout.take(),
            stderr: process.stderr.take(),
            process,
            exit,
            lender,
            line: Vec::new(),
            verdict: None,
            log: Log {
                path: task.log,
                file: None,
                written: 0,
            },
            time_limit: task.time_limit,
            memory_limit: task.job.memory_limit,
            wants_memory: false,
            was_killed: false,
            deadline,
            kill_at: None,
            stop: None,
        };
        self.workers.insert(task.id, worker);
    }

    fn wait(&mut self, timeout: Option<Duration>, out: &mut Vec<Report>) -> io::Result<()> {
        if !self.queued.is_empty() {
            out.append(&mut self.queued);
            return Ok(());
        }
        let next = self.next_deadline(Instant::now());
        let timeout = match (timeout, next) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        for (id, [exited, said, complained]) in self.poll(timeout)? {
            let Some(worker) = self.workers.get_mut(&id) else {
                continue;
            };
            let most = if exited { READS_AT_END } else { READS };
            if said || exited {
                worker.read_stdout(id, most, out);
            }
            if complained || exited {
                worker.read_stderr(most);
            }
            if exited && let Some(mut worker) = self.workers.remove(&id) {
                let outcome = worker.reap();
                if worker.was_killed {
                    let alive: Vec<u32> = self.workers.values().map(|w| w.process.id()).collect();
                    Orphans::end(&alive);
                }
                out.push(Report::Ended { id, outcome });
            }
        }
        self.enforce_deadlines();
        Ok(())
    }

    fn lend(&mut self, id: usize, threads: u32) {
        if let Some(worker) = self.workers.get(&id) {
            worker.lender.tell(threads);
        }
    }

    fn cancel(&mut self, id: usize, now: bool) {
        if let Some(worker) = self.workers.get_mut(&id) {
            worker.stop.get_or_insert(Stop::Cancelled);
            worker.signal(if now { Signal::KILL } else { Signal::TERM });
            worker.kill_at = Some(Instant::now() + self.grace);
        }
    }
}

impl Drop for Local {
    fn drop(&mut self) {
        for worker in self.workers.values_mut() {
            worker.signal(Signal::KILL);
            let _ = worker.process.wait();
        }
        Orphans::end(&[]);
    }
}

impl Worker {
    /// To the whole process group: what the plugin started goes too.
    fn signal(&self, signal: Signal) {
        let _ = rustix::process::kill_process_group(Pid::from_child(&self.process), signal);
    }

    fn read_stdout(&mut self, id: usize, most: usize, out: &mut Vec<Report>) {
        let mut buffer = [0u8; 16384];
        for _ in 0..most {
            let Some(pipe) = &mut self.stdout else { break };
            match pipe.read(&mut buffer) {
                Ok(0) => self.stdout = None,
                Ok(n) => {
                    self.line.extend_from_slice(&buffer[..n]);
                    self.take_lines(id, out);
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => break,
            }
        }
        if self.stdout.is_none() && !self.line.is_empty() {
            self.line.push(b'\n');
            self.take_lines(id, out);
        }
    }

    fn take_lines(&mut self, id: usize, out: &mut Vec<Report>) {
        let mut start = 0;
        while let Some(end) = self.line[start..].iter().position(|b| *b == b'\n') {
            let line = &self.line[start..start + end];
            start += end + 1;
            match serde_json::from_slice::<Message>(line) {
                Ok(m @ (Message::Done { .. } | Message::Failed { .. })) => self.verdict = Some(m),
                Ok(message) => {
                    if let Message::Log { level, text } = &message {
                        self.log
                            .write(format!("{} {text}\n", level_name(*level)).as_bytes());
                    }
                    out.push(Report::Message { id, message });
                }
                Err(_) => {
                    self.log.write(line);
                    self.log.write(b"\n");
                }
            }
        }
        self.line.drain(..start);
        if self.line.len() > LONGEST_LINE {
            self.log.write(
                b"(a line longer than 64 MiB on the worker's standard output was dropped)\n",
            );
            self.line.clear();
        }
    }

    fn read_stderr(&mut self, most: usize) {
        let mut buffer = [0u8; 16384];
        for _ in 0..most {
            let Some(pipe) = &mut self.stderr else { break };
            match pipe.read(&mut buffer) {
                Ok(0) => self.stderr = None,
                Ok(n) => {
                    self.wants_memory |= tells_of_memory(&buffer[..n]);
                    self.log.write(&buffer[..n]);
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => break,
            }
        }
    }

    /// Collects the exit status and judges. The pipes have been read to their end.
    fn reap(&mut self) -> Outcome {
        // The zombie still owns its number, so this can only hit what it left behind.
        self.signal(Signal::KILL);
        let status = match self.process.wait() {
            Ok(status) => status,
            Err(e) => return Outcome::NotStarted(format!("waiting for the worker: {e}")),
        };
        self.was_killed = status.signal().is_some();
        let outcome = self.judge(status);
        let text = match &outcome {
            Outcome::Failed { kind, message } => format!("failed ({kind:?}): {message}\n"),
            Outcome::Signal(name) => format!("the worker was killed by {name}\n"),
            Outcome::Silent(code) => format!("the worker ended with status {code} and no word\n"),
            Outcome::TimedOut(limit) => format!("stopped at its time limit of {limit} s\n"),
            _ => String::new(),
        };
        // However long the log is.
        self.log.append(text.as_bytes());
        outcome
    }

    fn judge(&mut self, status: ExitStatus) -> Outcome {
        match (self.verdict.take(), self.stop) {
            (Some(Message::Done { record }), _) if status.success() => Outcome::Done(record),
            (_, Some(Stop::TimedOut)) => Outcome::TimedOut(self.time_limit),
            (_, Some(Stop::Cancelled)) => Outcome::Cancelled,
            (
                Some(Message::Failed {
                    kind: FailureKind::Cancelled,
                    ..
                }),
                None,
            ) => {
                // Someone else sent it SIGTERM: a scheduler, an administrator.
                let message = "the worker was told to stop from outside".into();
                Outcome::Failed {
                    kind: FailureKind::Cancelled,
                    message,
                }
            }
            (Some(Message::Failed { kind, message }), None) => Outcome::Failed { kind, message },
            (_, None) if self.wants_memory && self.memory_limit > 0 => {
                let message = out_of_memory(self.memory_limit);
                Outcome::Failed {
                    kind: FailureKind::Error,
                    message,
                }
            }
            (_, None) => match status.signal() {
                Some(n) => Outcome::Signal(
                    signal_hook::low_level::signal_name(n)
                        .map_or_else(|| format!("signal {n}"), str::to_owned),
                ),
                None => Outcome::Silent(status.code().unwrap_or(-1)),
            },
        }
    }
}

/// Whether what a worker wrote as it died says that memory was refused to it: Rust's and C++'s words.
fn tells_of_memory(said: &[u8]) -> bool {
    let text = String::from_utf8_lossy(said);
    text.contains("memory allocation of ") || text.contains("std::bad_alloc")
}

/// What to say of a step that came to its bound of memory (bytes).
fn out_of_memory(bound: u64) -> String {
    format!(
        "{WANTED_MEMORY} of {:.1} GiB; give it more with `resources: {{memory: ..}}` of the step, or let it \
         compute less: larger elements, a coarser grid, fewer frames",
        bound as f64 / (1u64 << 30) as f64
    )
}

fn level_name(level: LogLevel) -> &'static str {
    match level {
        LogLevel::Error => "error:",
        LogLevel::Warn => "warning:",
        LogLevel::Info => "info:",
        LogLevel::Debug => "debug:",
    }
}
