//! Changes of inputs that know of lines and words.

/// Numbers by chance from a seed: xorshift of 64 bits (Marsaglia 2003).
#[derive(Debug)]
pub struct Dice(u64);

impl Dice {
    /// From a seed.
    #[must_use]
    pub fn new(seed: u32) -> Self {
        Self((u64::from(seed) << 32) ^ 0x9e37_79b9_7f4a_7c15)
    }

    /// A number below `most`; 0 where that is 0.
    pub fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % most.max(1) as u64) as usize
    }
}

/// Changes a text by whole lines or whole values: a line is taken out, doubled, moved, put further in or out, or its key or value becomes another
/// word.
pub fn by_lines(text: &mut Vec<u8>, words: &[String], dice: &mut Dice) {
    let mut lines: Vec<Vec<u8>> = text.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    let (i, j) = (dice.below(lines.len()), dice.below(lines.len()));
    let word = |dice: &mut Dice| match words.is_empty() {
        true => Vec::new(),
        false => words[dice.below(words.len())].clone().into_bytes(),
    };
    match dice.below(8) {
        0 => drop(lines.remove(i)),
        1 => lines.insert(j, lines[i].clone()),
        2 => lines.swap(i, j),
        3 => lines[i].splice(0..0, *b"  ").for_each(drop),
        4 => {
            let blank = lines[i].iter().take(2).take_while(|b| **b == b' ').count();
            lines[i].drain(..blank);
        }
        5 => {
            // Another value.
            let line = &mut lines[i];
            let behind = line.iter().rposition(|b| matches!(b, b':' | b',' | b';'));
            line.truncate(behind.map_or(0, |at| at + 1));
            line.push(b' ');
            line.extend(word(dice));
        }
        6 => {
            // Another key.
            let line = &mut lines[i];
            let from = line.iter().take_while(|b| **b == b' ').count();
            let to = line.iter().position(|b| *b == b':').unwrap_or(line.len());
            line.splice(from.min(to)..to, word(dice)).for_each(drop);
        }
        _ => {
            // A new entry below, as far in.
            let blank = lines[i].iter().take_while(|b| **b == b' ').count();
            let mut new = vec![b' '; blank];
            new.extend(word(dice));
            new.extend(b": ");
            new.extend(word(dice));
            lines.insert(i + 1, new);
        }
    }
    *text = lines.join(&b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_by_lines_is_possible_of_every_text() {
        let words = ["5 mm".to_owned(), "kind".to_owned()];
        for text in ["", "\n", "a: 1\n  b: [x, y]\n", ":", "  "] {
            for seed in 0..500 {
                let mut changed = text.as_bytes().to_vec();
                by_lines(&mut changed, &words, &mut Dice::new(seed));
            }
        }
    }
}
