//! What to do about a fault of the machine, by the words in which the system tells it.

/// Words of the system, and what is to be done.
const KNOWN: [(&[&str], &str); 4] = [
    (
        &[
            "os error 28)",
            "No space left on device",
            "os error 122)",
            "quota exceeded",
        ],
        "The disk is full, or the quota is used up: make room (`plyflow clean` removes what no workflow's last run uses), or name a store \
         on another disk with --store; then run the same command again. What is finished is kept.",
    ),
    (
        &["os error 30)", "Read-only file system"],
        "The disk may not be written to: mount it so that it may, or name a store elsewhere with --store. What is finished is kept, and \
         `plyflow results` shows it.",
    ),
    (
        &["os error 5)", "Input/output error"],
        "The system could not read or write: look after the disk (`dmesg` tells more) before the same command is run again. What is \
         finished is kept; `plyflow verify` reads all of it.",
    ),
    (
        &["os error 13)", "Permission denied"],
        "This user may not write or read there: change the mode or the owner, or name a store elsewhere with --store.",
    ),
];

/// What to do about a fault that a text tells of, if it is one of the machine; a line of its own.
pub fn on(text: &str) -> Option<&'static str> {
    let is_told = |words: &&(&[&str], &str)| words.0.iter().any(|w| text.contains(w));
    KNOWN.iter().find(is_told).map(|(_, advice)| *advice)
}

/// A text with what to do about it in a line below.
pub fn with(text: &str) -> String {
    match on(text) {
        Some(advice) => format!("{text}\n{advice}"),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_the_machine_come_with_what_to_do_and_others_do_not() {
        for (errno, word) in [
            (28, "make room"),
            (122, "make room"),
            (30, "--store"),
            (5, "dmesg"),
            (13, "owner"),
        ] {
            let text = format!("writing x: {}", std::io::Error::from_raw_os_error(errno));
            let with = with(&text);
            assert!(with.starts_with(&text) && with.contains(word), "{with}");
        }
        let other = std::io::Error::from_raw_os_error(2).to_string();
        assert_eq!(with(&other), other);
        assert_eq!(on("os error 283)"), None);
    }
}
