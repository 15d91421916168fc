//! The exit codes of `plyflow`. Stable: scripts may rely on them. `docs/exit-codes.md` explains them.

/// All went well.
pub const OK: u8 = 0;
/// Something in Plyflow or the machine failed (store not writable, executor broken).
pub const INTERNAL: u8 = 1;
/// The command line is wrong, or a file it names does not exist.
pub const USAGE: u8 = 2;
/// The workflow, scene or material file has errors, or a library needs consent; nothing was run.
pub const INVALID: u8 = 3;
/// At least one step failed; the rest ran as the failure policy says.
pub const STEP_FAILED: u8 = 4;
/// A stated expectation or a limit was missed or could not be judged (only with `--check`).
pub const EXPECTATION: u8 = 5;
/// Another process runs this workflow.
pub const LOCKED: u8 = 6;
/// A plugin does not keep the contract (`check-plugin`).
pub const NOT_CONFORMING: u8 = 7;
/// Something in the store is not what was written, and is not shown; or a step made again has other bytes (`verify --again`).
pub const DAMAGED: u8 = 8;
/// Two runs or two artifacts are not the same (`diff`).
pub const DIFFERENT: u8 = 9;
/// Stopped by the user (Ctrl-C), SIGTERM or SIGHUP.
pub const INTERRUPTED: u8 = 130;

/// All codes with their meaning, for `--help`.
pub const HELP: &str = "\
Exit codes:
    0  all went well
    1  Plyflow or the machine failed (disk full, store not writable)
    2  wrong command line
    3  the workflow has errors; nothing was run
    4  a step failed
    5  an expectation or a limit was missed (with --check)
    6  another process is running this workflow
    7  a plugin does not keep the contract (check-plugin)
    8  something in the store is damaged; the same run makes it again
    9  two runs or artifacts differ (diff)
  130  stopped by Ctrl-C; the same command resumes";
