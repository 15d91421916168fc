//! Looks through the built HTML for relative links, pictures and anchors that lead nowhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result};

/// What one HTML file offers and asks for.
#[derive(Debug, Default, PartialEq)]
struct Html {
    ids: BTreeSet<String>,
    links: BTreeSet<String>,
}

/// The links of all HTML files under `folder` for which there is no file or no anchor, one line each.
///
/// # Errors
/// Files that cannot be read.
pub fn dead_links(folder: &Path) -> Result<Vec<String>> {
    let mut pages = BTreeMap::new();
    let mut files = BTreeSet::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in
            fs::read_dir(&next).with_context(|| format!("cannot read {}", next.display()))?
        {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(folder).unwrap_or(&path).to_path_buf();
            if path
                .extension()
                .is_some_and(|extension| extension == "html")
            {
                let text = fs::read_to_string(&path)
                    .with_context(|| format!("cannot read {}", path.display()))?;
                pages.insert(name.clone(), read(&text));
            }
            files.insert(name);
        }
    }
    let mut dead = Vec::new();
    for (name, page) in &pages {
        for link in &page.links {
            if let Some(what) = fault(name, link, &pages, &files) {
                dead.push(format!("{}: {what}", name.display()));
            }
        }
    }
    Ok(dead)
}

/// Why a link of the page `name` leads nowhere; `None` when it leads somewhere, or out of the book.
fn fault(
    name: &Path,
    link: &str,
    pages: &BTreeMap<PathBuf, Html>,
    files: &BTreeSet<PathBuf>,
) -> Option<String> {
    if link.contains("://")
        || link.starts_with("mailto:")
        || link.starts_with("data:")
        || link.starts_with("javascript:")
    {
        return None;
    }
    let (file, fragment) = link.split_once('#').unwrap_or((link, ""));
    let file = decoded(file.split('?').next().unwrap_or(file));
    let mut target = name.to_path_buf();
    if !file.is_empty() {
        target.pop();
        for component in Path::new(&file).components() {
            match component {
                Component::Normal(part) => target.push(part),
                Component::ParentDir => {
                    if !target.pop() {
                        return Some(format!("{link} leaves the book"));
                    }
                }
                Component::CurDir => {}
                Component::RootDir | Component::Prefix(_) => {
                    return Some(format!("{link} is not relative"));
                }
            }
        }
    }
    if !files.contains(&target) {
        return Some(format!("there is no {link}"));
    }
    let page = pages.get(&target)?;
    let fragment = decoded(fragment);
    (!fragment.is_empty() && !page.ids.contains(&fragment))
        .then(|| format!("there is no heading for {link}"))
}

/// The links and anchors of a page. Scripts, styles and comments hold none.
fn read(html: &str) -> Html {
    let mut found = Html::default();
    let mut rest = html;
    while let Some(begin) = rest.find('<') {
        rest = &rest[begin + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        if !rest.starts_with(|first: char| first.is_ascii_alphabetic()) {
            continue;
        }
        let name_end = rest
            .find(|c: char| !c.is_ascii_alphanumeric())
            .unwrap_or(rest.len());
        let (name, after) = rest.split_at(name_end);
        rest = attributes(after, &mut found);
        if name == "script" || name == "style" {
            let end = format!("</{name}");
            rest = rest.find(&end).map_or("", |place| &rest[place..]);
        }
    }
    found
}

/// Reads the attributes of a tag; returns what follows it.
fn attributes<'a>(mut rest: &'a str, found: &mut Html) -> &'a str {
    loop {
        rest = rest.trim_start_matches(|c: char| c.is_whitespace() || c == '/');
        if rest.is_empty() {
            return rest;
        }
        if let Some(after) = rest.strip_prefix('>') {
            return after;
        }
        let end = rest
            .find(|c: char| c.is_whitespace() || matches!(c, '=' | '>' | '/'))
            .unwrap_or(rest.len());
        // A stray mark counts as a name of one character, so that there is an end.
        let (name, after) = rest.split_at(end.max(rest.chars().next().map_or(0, char::len_utf8)));
        let Some(value) = after.trim_start().strip_prefix('=') else {
            rest = after;
            continue;
        };
        let value = value.trim_start();
        let (value, after) = match value.chars().next() {
            Some(quote @ ('"' | '\'')) => value[1..].split_once(quote).unwrap_or((&value[1..], "")),
            _ => value.split_at(
                value
                    .find(|c: char| c.is_whitespace() || c == '>')
                    .unwrap_or(value.len()),
            ),
        };
        match name {
            "id" => drop(found.ids.insert(plain(value))),
            "href" | "src" => drop(found.links.insert(plain(value))),
            _ => {}
        }
        rest = after;
    }
}

/// An attribute's value without entities.
fn plain(value: &str) -> String {
    value
        .replace("&quot;", "\"")
        .replace("&#39;", "'")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&")
}

/// A link without per cent signs.
fn decoded(link: &str) -> String {
    let bytes = link.as_bytes();
    let mut result = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let pair = link.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        match pair.and_then(|pair| u8::from_str_radix(pair, 16).ok()) {
            Some(byte) => {
                result.push(byte);
                at += 3;
            }
            None => {
                result.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&result).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dead(files: &[(&str, &str)]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        dead_links(folder.path()).unwrap()
    }

    #[test]
    fn links_to_files_and_headings_are_found() {
        let found = dead(&[
            (
                "a/one.html",
                "<h1 id=top>x</h1><a href=\"../two.html#here\">t</a> <a href='#top'>u</a> <img src=\"p%20q.png\">",
            ),
            ("a/p q.png", ""),
            (
                "two.html",
                "<h2 class='x' id='here'><a href=\"https://example.org/gone\"></a></h2>",
            ),
        ]);
        assert_eq!(found, Vec::<String>::new());
    }

    #[test]
    fn what_leads_nowhere_is_told() {
        let found = dead(&[
            (
                "one.html",
                "<a href=\"gone.html\">a</a><img src=\"gone.png\"><a href=\"two.html#gone\">b</a><a href=\"../x\">c</a>",
            ),
            ("two.html", ""),
        ]);
        assert_eq!(
            found,
            [
                "one.html: ../x leaves the book",
                "one.html: there is no gone.html",
                "one.html: there is no gone.png",
                "one.html: there is no heading for two.html#gone",
            ]
        );
    }

    #[test]
    fn scripts_comments_and_text_hold_no_links() {
        let page = "<script>x = '<a href=\"gone\">'</script><!-- <a href=\"gone\"> --><code>&lt;a href=\"gone\"&gt;</code> 1 < 2 href=\"gone\"";
        assert_eq!(dead(&[("one.html", page)]), Vec::<String>::new());
    }
}
