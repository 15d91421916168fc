//! What the tests with a stranger's folder share: the program, the folder, the library, and who still runs.

#![allow(dead_code)] // Each of the two test programs uses a part of it.

use plyflow_faults::program;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// An installation with one plugin, a home, and a stranger's folder, all in one temporary folder.
pub struct Place {
    pub root: tempfile::TempDir,
}

impl Place {
    /// The stranger's folder has a library and a workflow of these steps.
    pub fn new(steps: &str) -> Self {
        let place = Self {
            root: tempfile::tempdir().unwrap(),
        };
        for folder in ["bin/plugins", "home", "there"] {
            std::fs::create_dir_all(place.path(folder)).unwrap();
        }
        std::fs::hard_link(program(), place.path("bin/plyflow"))
            .or_else(|_| std::fs::copy(program(), place.path("bin/plyflow")).map(|_| ()))
            .unwrap();
        build("shipped", &place.path("bin/plugins/libshipped.so"));
        build("stranger", &place.path("there/libstranger.so"));
        place.write(
            "workflow.yaml",
            &format!("plyflow: 1\nname: study\n{steps}"),
        );
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    /// Writes a file of the stranger's folder.
    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path("there").join(name), text).unwrap();
    }

    /// `plyflow WORDS..` in the stranger's folder, by a user with an empty home.
    pub fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(self.path("bin/plyflow"));
        command
            .args(words)
            .current_dir(self.path("there"))
            .env("HOME", self.path("home"))
            .env("MARK", self.path("mark"))
            .env_remove("XDG_CONFIG_HOME")
            .env_remove("PLYFLOW_PLUGINS")
            .stdin(Stdio::null());
        command
    }

    pub fn call(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    /// Runs a command that must end well.
    pub fn good(&self, words: &[&str]) -> String {
        let output = self.call(words);
        let text = told(&output);
        assert_eq!(output.status.code(), Some(0), "{words:?}: {text}");
        text
    }

    /// Whether any library but the installation's was loaded since the last time that was asked.
    pub fn was_loaded(&self) -> bool {
        let loaded = std::fs::read_to_string(self.path("mark")).unwrap_or_default();
        let _ = std::fs::remove_file(self.path("mark"));
        loaded.lines().any(|name| name != "shipped")
    }

    /// BLAKE3 of the stranger's library as the program tells it.
    pub fn hash(&self) -> String {
        let text = told(&self.call(&["plugins", "./libstranger.so"]));
        let at = text.find("blake3 ").unwrap_or_else(|| panic!("{text}")) + 7;
        text[at..at + 64].to_owned()
    }
}

/// Standard output and standard error.
pub fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// The same as one line, however findings were broken into lines.
pub fn told_in_one_line(output: &Output) -> String {
    told(output).replace("\n  │ ", " ").replace('\n', " ")
}

/// Builds a library with this name in its manifest.
pub fn build(name: &str, to: &Path) {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let built = Command::new("cc")
        .args([
            "-std=gnu11",
            "-shared",
            "-fPIC",
            "-Wall",
            "-Wextra",
            "-Werror",
        ])
        .arg(format!("-DNAME=\"{name}\""))
        .arg("-I")
        .arg(here.join("../../schemas/abi"))
        .arg("-o")
        .args([to, &here.join("c/stranger.c")])
        .status()
        .expect("a C compiler is needed for this test");
    assert!(built.success());
}

/// Live processes with this word in their environment, which children inherit; zombies are none.
pub fn alive(token: &str) -> usize {
    let mark = format!("TOKEN={token}");
    let all = std::fs::read_dir("/proc").unwrap().flatten();
    let has = |p: &PathBuf| {
        let environment = std::fs::read(p.join("environ")).unwrap_or_default();
        environment.split(|b| *b == 0).any(|w| w == mark.as_bytes())
    };
    all.map(|e| e.path()).filter(has).count()
}

/// Waits for a condition; the limit ends a test that hangs.
pub fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(
            begun.elapsed() < Duration::from_secs(120),
            "waited too long for {what}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Sends a signal to a child that has not been waited for.
pub fn signal(child: &Child, number: i32) {
    let pid = i32::try_from(child.id()).unwrap();
    // SAFETY: numbers alone. A child that has not been waited for: its number is no other's.
    let code = unsafe { libc::kill(pid, number) };
    assert_eq!(code, 0);
}
