//! What a new study is of: from options, or asked for on a terminal.

use crate::cli::args::{StudyProcess, StudyWords};
use crate::exit;
use crate::said::{Stop, warn};
use clap::ValueEnum;
use std::io::{BufRead, Write};

/// Who answers, if anybody does.
pub struct Asker<'a> {
    answers: Option<&'a mut dyn BufRead>,
    /// Options that are missing where nobody answers.
    missing: Vec<String>,
}

impl<'a> Asker<'a> {
    /// Answers come from there; `None`: nobody answers.
    pub fn new(answers: Option<&'a mut dyn BufRead>) -> Self {
        Self {
            answers,
            missing: Vec::new(),
        }
    }

    /// The value of an option: as it is given, or as it is answered, or, for an empty answer, `default`. `None` where nobody answers; then
    /// [`Self::complete`] says so.
    ///
    /// # Errors
    /// When the answer cannot be read, or is empty without a default.
    pub fn value(
        &mut self,
        given: Option<&str>,
        option: &str,
        question: &str,
        default: Option<&str>,
    ) -> Result<Option<String>, Stop> {
        if let Some(given) = given {
            return Ok(Some(given.to_owned()));
        }
        let Some(answers) = &mut self.answers else {
            self.missing.push(option.to_owned());
            return Ok(None);
        };
        let offered = default.map_or(String::new(), |d| format!(" [{d}]"));
        warn(&format!("{question}{offered} "));
        let _ = std::io::stderr().flush();
        let mut answer = String::new();
        let read = answers.read_line(&mut answer);
        read.map_err(Stop::machine("reading the answer"))?;
        let answer = answer.trim();
        match (answer.is_empty(), default) {
            (false, _) => Ok(Some(answer.to_owned())),
            (true, Some(default)) => Ok(Some(default.to_owned())),
            (true, None) => Err(Stop::new(
                exit::USAGE,
                format!("there was no answer; nothing was made. Say {option}"),
            )),
        }
    }

    /// Ends where something is missing and nobody could be asked.
    ///
    /// # Errors
    /// [`exit::USAGE`] with the options.
    pub fn complete(&self) -> Result<(), Stop> {
        if self.missing.is_empty() {
            return Ok(());
        }
        let text = format!(
            "a new study also needs {}; on a terminal it asks",
            self.missing.join(", ")
        );
        Err(Stop::new(exit::USAGE, text))
    }

    /// The process: by its option, or as it is answered; otherwise between films.
    ///
    /// # Errors
    /// When the answer is none.
    pub fn process(&mut self, words: &StudyWords) -> Result<StudyProcess, Stop> {
        if let Some(process) = words.process {
            return Ok(process);
        }
        if self.answers.is_none() {
            return Ok(StudyProcess::DoubleDiaphragm);
        }
        let question = "Which process, double-diaphragm, single-diaphragm or press?";
        let answer = self.value(None, "--process", question, Some("double-diaphragm"))?;
        let answer = answer.unwrap_or_default();
        StudyProcess::from_str(&answer, true).map_err(|_| {
            let text = format!(
                "{answer:?} is no process here; nothing was made. Say double-diaphragm, single-diaphragm or press"
            );
            Stop::new(exit::USAGE, text)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_is_not_asked_for_and_what_nobody_answers_is_named() {
        let mut nobody = Asker::new(None);
        let given = nobody.value(Some("hat.stl"), "--tool FILE", "?", None);
        assert_eq!(given.unwrap().as_deref(), Some("hat.stl"));
        nobody.complete().unwrap();
        assert_eq!(
            nobody.value(None, "--unit UNIT", "?", Some("mm")).unwrap(),
            None
        );
        assert_eq!(nobody.value(None, "--ply SIZE", "?", None).unwrap(), None);
        let stop = nobody.complete().unwrap_err();
        assert_eq!(stop.code, exit::USAGE);
        assert!(
            stop.text.contains("needs --unit UNIT, --ply SIZE;"),
            "{}",
            stop.text
        );

        let mut text = "\n\n press \n".as_bytes();
        let mut person = Asker::new(Some(&mut text));
        let unit = person.value(None, "--unit UNIT", "?", Some("mm")).unwrap();
        assert_eq!(
            unit.as_deref(),
            Some("mm"),
            "an empty answer takes what is offered"
        );
        let stop = person.value(None, "--ply SIZE", "?", None).unwrap_err();
        assert!(stop.text.contains("nothing was made"), "{}", stop.text);
        let process = person.process(&StudyWords::default()).unwrap();
        assert_eq!(process, StudyProcess::Press);
        person.complete().unwrap();
    }
}
