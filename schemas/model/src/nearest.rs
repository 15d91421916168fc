//! The valid name nearest to a mistyped one.

/// The candidate nearest to `given` by edit distance (insertions, deletions, substitutions and swaps of
/// neighbours, capitals ignored), when near enough to be meant: at most a third of its length, and at
/// least one edit is always allowed. Ties go to the one that also agrees in capitals, then to the first.
pub fn nearest<'a, I>(given: &str, candidates: I) -> Option<&'a str>
where
    I: IntoIterator<Item = &'a str>,
{
    // Beyond any name of ours; keeps the quadratic distance away from pasted garbage.
    if given.is_empty() || given.len() > 80 {
        return None;
    }
    let fold = |s: &str| s.to_lowercase().replace(['-', ' '], "_");
    let folded = fold(given);
    let limit = (folded.chars().count() / 3).max(1);
    candidates
        .into_iter()
        .map(|c| {
            let distance = strsim::damerau_levenshtein(&folded, &fold(c));
            ((distance, strsim::damerau_levenshtein(given, c)), c)
        })
        .filter(|((distance, _), _)| *distance <= limit)
        .min_by_key(|(distances, _)| *distances)
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_swap_of_letters_is_found() {
        assert_eq!(nearest("elemnet", ["element", "scene"]), Some("element"));
    }

    #[test]
    fn dashes_and_underscores_count_as_equal() {
        assert_eq!(
            nearest("element-size", ["element", "element_size"]),
            Some("element_size")
        );
    }

    #[test]
    fn nothing_is_suggested_when_all_are_far() {
        assert_eq!(nearest("banana", ["element", "scene"]), None);
    }
}
