//! Encodings, lines, and what a message may show.

use plyflow_model::text::{one_line, shortened};
use std::borrow::Cow;

/// The text of a file: UTF-8, UTF-16 (with a byte order mark, or plainly so) or, where it is neither, Latin-1, in which every byte is a
/// character. A byte order mark and what some systems put behind the end (`Ctrl-Z`, zeros) are left out.
///
/// # Errors
/// A sentence on what it is instead of text.
pub fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let utf32 = bytes.starts_with(&[0xff, 0xfe, 0, 0]) || bytes.starts_with(&[0, 0, 0xfe, 0xff]);
    if utf32 {
        return Err("it is text in UTF-32; save it as UTF-8".into());
    }
    if let Some(read) = wide(bytes) {
        return wide_text(bytes, read).map(Cow::Owned);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = bytes.iter().rposition(|b| !matches!(b, 0 | 0x1a));
    let bytes = &bytes[..end.map_or(0, |e| e + 1)];
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        return Err(format!(
            "it is no text: byte {} is zero; save it as text (UTF-8)",
            at + 1
        ));
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()),
    })
}

type Pair = fn([u8; 2]) -> u16;

/// How the two bytes of a character are read, where a text has two for each.
fn wide(bytes: &[u8]) -> Option<Pair> {
    let (little, big): (Pair, Pair) = (u16::from_le_bytes, u16::from_be_bytes);
    if bytes.starts_with(&[0xff, 0xfe]) {
        return Some(little);
    }
    if bytes.starts_with(&[0xfe, 0xff]) {
        return Some(big);
    }
    // Without a mark: each other byte of plain words is zero.
    let pairs = bytes.get(..32)?.as_chunks::<2>().0;
    let plain = |b: u8| matches!(b, 9 | 10 | 13 | 32..127);
    if pairs.iter().all(|p| plain(p[0]) && p[1] == 0) {
        return Some(little);
    }
    if pairs.iter().all(|p| p[0] == 0 && plain(p[1])) {
        return Some(big);
    }
    None
}

fn wide_text(bytes: &[u8], read: Pair) -> Result<String, String> {
    let (pairs, odd) = bytes.as_chunks::<2>();
    if !odd.is_empty() {
        return Err("it is text in UTF-16 and ends within a character; it was cut off".into());
    }
    let text: String = char::decode_utf16(pairs.iter().map(|p| read(*p)))
        .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect();
    let text = text.trim_end_matches(['\0', '\u{1a}']);
    if text.contains('\0') {
        return Err("it is no text: there are zeros in it; save it as text (UTF-8)".into());
    }
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// Lines with their numbers from 1; they end as those of Unix, of Windows or of old Macs (`\n`, `\r\n`, `\r`).
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let text = rest.filter(|t| !t.is_empty())?;
        let Some(end) = text.find(['\n', '\r']) else {
            rest = None;
            return Some(text);
        };
        let next = if text[end..].starts_with("\r\n") {
            2
        } else {
            1
        };
        rest = Some(&text[end + next..]);
        Some(&text[..end])
    })
    .enumerate()
    .map(|(i, line)| (i + 1, line))
}

/// Longest word of a user that a message shows (characters).
pub const LONGEST_WORD: usize = 60;

/// Longest message (characters).
pub const LONGEST_MESSAGE: usize = 1200;

/// A word or a line of a file as a message may show it: of bounded length, and without characters that a terminal obeys.
pub fn shown(text: &str) -> String {
    excerpt(text, LONGEST_WORD)
}

/// A text of at most about `most` characters ([`shortened`]) in one line. What steers a terminal is written out, as `\u001b`
/// ([`one_line`]); a tab is a blank.
pub fn excerpt(text: &str, most: usize) -> String {
    one_line(&shortened(text, most).replace('\t', " ")).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_read_in_the_encodings_of_the_field() {
        let text = "gr\u{f6}\u{df}e [\u{b0}]\nzwei";
        let wide = |big: bool, mark: bool| -> Vec<u8> {
            let bom = mark.then_some(0xfeff);
            bom.into_iter()
                .chain(text.encode_utf16())
                .flat_map(|u| {
                    if big {
                        u.to_be_bytes()
                    } else {
                        u.to_le_bytes()
                    }
                })
                .collect()
        };
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            ["\u{feff}", text].concat().into_bytes(),
            latin,
            wide(false, true),
            wide(true, true),
            [text.as_bytes(), b"\x1a\0\0"].concat(),
        ] {
            assert_eq!(decode(&bytes).unwrap(), text, "{bytes:?}");
        }
        let plain: Vec<u8> = ("displacement [mm]\n1".encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(decode(&plain).unwrap(), "displacement [mm]\n1");
        for bytes in [&b"\xff\xfe\0\0a\0\0\0"[..], b"1,2\0\n3", b"\xff\xfea"] {
            assert!(decode(bytes).is_err());
        }
    }

    #[test]
    fn lines_are_counted_whatever_ends_them() {
        for text in ["a\n\nb\n", "a\r\n\r\nb\r\n", "a\r\rb", "a\n\rb"] {
            let found: Vec<(usize, &str)> = lines(text).filter(|l| !l.1.is_empty()).collect();
            assert_eq!(found, [(1, "a"), (3, "b")], "{text:?}");
        }
    }

    #[test]
    fn what_is_shown_is_short_and_harmless() {
        assert_eq!(shown("a\tb\u{1b}[31m\u{202e}"), "a b\\u001b[31m\\u202e");
        let long = "x".repeat(10_000_000) + "end";
        let short = shown(&long);
        assert!(
            short.chars().count() < 110 && short.ends_with("end"),
            "{short}"
        );
        assert!(short.contains("(9999943 characters left out)"), "{short}");
        assert_eq!(shown(&"\u{f6}".repeat(60)), "\u{f6}".repeat(60));
    }
}
