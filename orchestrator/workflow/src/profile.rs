//! A profile file -> [`Profile`], or everything that is wrong with it.

use crate::check::Checker;
use crate::diagnostics::{Diagnostics, Problems, Source};
use crate::yaml::Node;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_model::profile::Profile;
use plyflow_model::schema;
use serde_json::Value;
use std::sync::LazyLock;

static PROFILE: LazyLock<Value> = LazyLock::new(schema::profile);

/// Reads a profile file.
///
/// # Errors
/// All findings of one pass, each with its place.
pub fn load_profile(path: &Utf8Path) -> Result<Profile, Diagnostics> {
    let mut problems = Problems::default();
    match read(path, &mut problems) {
        Some(profile) if problems.count() == 0 => Ok(profile),
        _ => Err(problems.finish()),
    }
}

fn read(path: &Utf8Path, problems: &mut Problems) -> Option<Profile> {
    let full = camino::absolute_utf8(path).unwrap_or_else(|_| Utf8PathBuf::from(path));
    let bytes = match open::read(full.as_std_path(), MOST_WRITTEN) {
        Ok(bytes) => bytes,
        Err(why) => {
            let d = problems.add_unreadable(path, format!("cannot read the profile: {why}"));
            d.help("give the path of a profile, such as `--on cluster.yaml`; `plyflow schema profile --format text` says what it may hold");
            return None;
        }
    };
    let (source, root) = crate::scene::parse(problems, full, bytes)?;
    Checker::new(&PROFILE, &source, problems).check(&root, "the profile");
    if problems.count() > 0 {
        return None;
    }
    options(&root, &source, problems);
    match serde_json::from_value(root.to_json()) {
        Ok(profile) => Some(profile),
        Err(e) => {
            problems.add(&source, &root.span, format!("this is no profile: {e}"));
            None
        }
    }
}

/// Words of `sbatch` that the program gives itself.
const OWN: [&str; 12] = [
    "--job-name",
    "-J",
    "--array",
    "-a",
    "--output",
    "-o",
    "--error",
    "-e",
    "--time",
    "-t",
    "--requeue",
    "--wrap",
];

/// Options that would take from the program what it must know, and lines that would be no line.
fn options(root: &Node, source: &Source, problems: &mut Problems) {
    for item in root.get("options").map_or(&[][..], Node::items) {
        let text = item.text().unwrap_or_default();
        let word = text.split(['=', ' ']).next().unwrap_or_default();
        if OWN.contains(&word) {
            let d = problems.add(
                source,
                &item.span,
                format!("`{word}` is given by Plyflow itself"),
            );
            d.given(text).help("take it out; cores, memory, wall-clock time and GPUs stand under `each` and `plugins`");
        } else if !text.starts_with('-') || text.contains(['\n', '\r']) {
            let d = problems.add(source, &item.span, "this is no option of `sbatch`");
            d.given(text)
                .expected("one option on one line, such as `--constraint=skylake`");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(text: &str) -> Result<Profile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = Utf8PathBuf::from_path_buf(folder.path().join("p.yaml")).unwrap();
        std::fs::write(&path, text).unwrap();
        load_profile(&path).map_err(|d| d.render(false))
    }

    #[test]
    fn a_profile_has_what_it_says_and_defaults_for_the_rest() {
        let text = "plyflow_profile: 1\npartition: debug\nsetup: [module load x]\neach: {cores: 2, memory: 1 GiB, walltime: 10 min}\n\
                    plugins:\n  forming-explicit: {gpus: 1}\nidle: 5 s\n";
        let profile = loaded(text).unwrap();
        assert_eq!(profile.partition.as_deref(), Some("debug"));
        assert_eq!(profile.idle.si(), 5.0);
        assert_eq!(profile.granted("forming-explicit", 0, 0).gpus, 1);
        assert_eq!(profile.granted("x", 0, 0).walltime, 600.0);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, said) in [
            ("plyflow_profile: 1\neach: {core: 2}\n", "p.yaml:2"),
            ("plyflow_profile: 1\neach: {memory: 4}\n", "p.yaml:2"),
            ("plyflow_profile: 1\neach: {walltime: 3 s}\n", "1 min"),
            (
                "plyflow_profile: 1\noptions: [--array=1-9]\n",
                "`--array` is given by Plyflow itself",
            ),
            (
                "plyflow_profile: 1\noptions: [now]\n",
                "no option of `sbatch`",
            ),
            ("partition: x\n", "plyflow_profile"),
        ] {
            let found = loaded(text).unwrap_err();
            assert!(found.contains(said), "{text}: {found}");
        }
    }
}
