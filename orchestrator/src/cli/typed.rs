//! Commands as one types them.

use super::args::Workflow;

/// The command that makes the results of a workflow again, as one types it.
pub fn command(given: &Workflow) -> String {
    format!("plyflow run {}", arguments(given))
}

/// The workflow file with its options, as one types them behind a command.
pub fn arguments(given: &Workflow) -> String {
    let mut words = vec![given.workflow.to_string()];
    let places = &given.places;
    let folders = places.plugins.iter().map(|p| ("--plugins", p.as_str()));
    let store = places.store.iter().map(|p| ("--store", p.as_str()));
    let set = given.set.iter().map(|s| ("--set", s.as_str()));
    for (option, value) in set.chain(store).chain(folders) {
        words.extend([option.to_owned(), value.to_owned()]);
    }
    // As it was typed: `--trust` alone, or with what it names.
    let trust = places.trust.iter().map(|t| match t.as_str() {
        "" => "--trust".to_owned(),
        named => format!("--trust={named}"),
    });
    words.extend(trust);
    // As it was typed: alone, or with some of the variants.
    words.extend(given.confirm.iter().map(|v| match v.as_str() {
        "all" => "--confirm".to_owned(),
        some => format!("--confirm={some}"),
    }));
    words
        .iter()
        .map(|w| quoted(w))
        .collect::<Vec<_>>()
        .join(" ")
}

/// A word as one types it for a shell.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_a_report_repeats_overrides_so_that_a_shell_takes_them() {
        let given = Workflow {
            workflow: "a/workflow.yaml".into(),
            places: crate::cli::args::Places::default(),
            set: vec!["detect.over_shear_positive=9 deg".into(), "a.b=it's".into()],
            confirm: Some("finer,wider".into()),
        };
        let expected = "plyflow run a/workflow.yaml --set 'detect.over_shear_positive=9 deg' --set 'a.b=it'\\''s' --confirm=finer,wider";
        assert_eq!(command(&given), expected);
    }
}
