//! Names that no two things have.

use std::collections::BTreeSet;

/// Names that are taken, without regard to capital and small letters: drawings, solvers and some file systems have none.
#[derive(Debug, Default)]
pub struct Names(BTreeSet<String>);

impl Names {
    /// The name, or with a number behind it where another has the same.
    pub fn own(&mut self, name: &str) -> String {
        self.own_with(name, &[""])
    }

    /// The same of a name that stands with each of these endings.
    pub fn own_with(&mut self, name: &str, endings: &[&str]) -> String {
        let numbered = (2..).map(|k| format!("{name}_{k}"));
        let mut all = std::iter::once(name.to_owned()).chain(numbered);
        let whole = |n: &str| {
            endings
                .iter()
                .map(move |e| format!("{n}{e}").to_lowercase())
                .collect::<Vec<_>>()
        };
        let free = |n: &String| whole(n).iter().all(|w| !self.0.contains(w));
        let found = all.find(free).expect("one is free");
        self.0.extend(whole(&found));
        found
    }
}

/// A name for each of some, no two alike.
pub fn apart<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken = Names::default();
    names.map(|n| taken.own(n)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_apart_where_capital_letters_do_not_count() {
        let names = ["a", "A", "b", "a_2", "\u{e4}", "\u{c4}"];
        assert_eq!(
            apart(names.into_iter()),
            ["a", "A_2", "b", "a_2_2", "\u{e4}", "\u{c4}_2"]
        );
    }
}
