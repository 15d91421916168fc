//! Plain tables, and how what stands in them is written.

use plyflow_model::text::one_line;
pub use plyflow_report::bytes;

/// Columns padded to their widest cell; columns listed in `right` are aligned to the right. A
/// cell is one line, whatever others have put into it.
pub fn table(head: &[&str], rows: &[Vec<String>], right: &[usize]) -> String {
    let safe = |row: &Vec<String>| row.iter().map(|c| one_line(c).into_owned()).collect();
    let rows: Vec<Vec<String>> = rows.iter().map(safe).collect();
    let width = |at: usize| {
        let cells = rows
            .iter()
            .filter_map(|r| r.get(at))
            .map(|c| c.chars().count());
        cells.chain([head[at].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let mut out = String::new();
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    for row in std::iter::once(&head).chain(&rows) {
        let mut line = String::new();
        for (at, width) in widths.iter().enumerate() {
            let cell = row.get(at).map_or("", String::as_str);
            let pad = " ".repeat(width - cell.chars().count());
            line += &if right.contains(&at) {
                pad + cell
            } else {
                cell.to_owned() + &pad
            };
            line += "  ";
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

/// A number as people read it: six significant digits, no trailing zeros.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let size = value.abs().log10().floor();
    if (-4.0..9.0).contains(&size) {
        let digits = (5.0 - size).clamp(0.0, 12.0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    format!("{value:.5e}")
}

/// A name with its unit, as in the head of a table: `angle [deg]`.
pub fn head(name: &str, unit: &str) -> String {
    match unit {
        "" | "1" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

/// Characters of a cause that a table shows.
const CAUSE: usize = 80;

/// The begin of a text.
pub fn shortened(text: &str) -> String {
    match text.char_indices().nth(CAUSE) {
        Some((end, _)) => format!("{}…", text[..end].trim_end()),
        None => text.to_owned(),
    }
}

/// A text as a cell of CSV.
pub fn csv_text(t: &str) -> String {
    if t.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", t.replace('"', "\"\""))
    } else {
        t.to_owned()
    }
}

/// The first line of a text.
pub fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

/// A text, or that there is none.
pub fn or_none(text: &str) -> &str {
    if text.is_empty() { "(none)" } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_whatever_the_cells() {
        let rows = vec![
            vec!["a".into(), "1".into()],
            vec!["bcd".into(), "22".into()],
        ];
        assert_eq!(
            table(&["x", "n"], &rows, &[1]),
            "x     n\na     1\nbcd  22\n"
        );
    }

    #[test]
    fn numbers_keep_six_digits_at_any_size() {
        assert_eq!(number(0.139_626_340_2), "0.139626");
        assert_eq!(number(12.5), "12.5");
        assert_eq!(number(1234567.0), "1234567");
        assert_eq!(number(-3.0e-9), "-3.00000e-9");
        assert_eq!(number(0.0), "0");
    }
}
