//! Puts the pages of the book, and the files to which they link, into one folder, in their places of the repository.
//!
//! Chapters of mdBook lie in one folder. Ours do not: the README, the workflows and the contracts stand where their readers look for
//! them. So `docs/SUMMARY.md` may list pages outside of `docs`, and pages to which others link but which it does not list are
//! added at its end.

use std::collections::{BTreeSet, VecDeque};
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use pulldown_cmark::{Event, Tag};

use crate::markdown;

const SUMMARY: &str = "docs/SUMMARY.md";
/// Files that every build needs.
const ALWAYS: [&str; 1] = ["docs/builder/book.css"];

/// Fills `stage` with the book's `SUMMARY.md`, its pages and the files to which these link.
///
/// # Errors
/// Links that lead nowhere, with file and line; files that cannot be read or written.
pub fn stage(root: &Path, stage: &Path) -> Result<()> {
    if stage.exists() {
        fs::remove_dir_all(stage).with_context(|| format!("cannot empty {}", stage.display()))?;
    }
    let mut dead = Vec::new();
    let summary_text = read(root, Path::new(SUMMARY))?;
    let summary = page(
        root,
        Path::new(SUMMARY),
        &summary_text,
        Links::FromRoot,
        &mut dead,
    );

    let mut seen: BTreeSet<PathBuf> = summary.links.iter().cloned().collect();
    let listed = seen.clone();
    let mut further = Vec::new();
    let mut files: BTreeSet<PathBuf> = ALWAYS.iter().map(PathBuf::from).collect();
    let mut queue: VecDeque<PathBuf> = summary.links.into();
    while let Some(path) = queue.pop_front() {
        if path.extension().is_none_or(|extension| extension != "md") {
            files.insert(path);
            continue;
        }
        let text = read(root, &path)?;
        let page = page(root, &path, &text, Links::AsWritten, &mut dead);
        write(stage, &path, page.text.as_bytes())?;
        if !listed.contains(&path) {
            further.push(format!("- [{}]({})", title(&text, &path), path.display()));
        }
        for link in page.links {
            // A link to the summary is a link to the page's margin.
            if seen.insert(link.clone()) {
                queue.push_back(link);
            }
        }
    }
    if !dead.is_empty() {
        bail!("links that lead nowhere:\n{}", dead.join("\n"));
    }
    for path in files {
        let bytes = fs::read(root.join(&path))
            .with_context(|| format!("cannot read {}", path.display()))?;
        write(stage, &path, &bytes)?;
    }
    let mut summary = summary.text;
    if !further.is_empty() {
        further.sort();
        summary.push_str(&format!("\n# Further pages\n\n{}\n", further.join("\n")));
    }
    write(stage, Path::new("SUMMARY.md"), summary.as_bytes())
}

/// How the links of a page are written into the stage.
#[derive(Clone, Copy, PartialEq)]
enum Links {
    /// Relative to the page.
    AsWritten,
    /// Relative to the repository: for the summary, which moves there.
    FromRoot,
}

/// A page as it is staged, and the files of the repository to which it links.
struct Page {
    text: String,
    links: Vec<PathBuf>,
}

/// Reads the links of a page. A link to a folder leads to its README; where it has none, only the link's words are left.
fn page(root: &Path, path: &Path, text: &str, how: Links, dead: &mut Vec<String>) -> Page {
    let mut edits = Vec::new();
    let mut links = Vec::new();
    for (event, range) in markdown::parser(text).into_offset_iter() {
        let (Event::Start(Tag::Link { dest_url, .. }) | Event::Start(Tag::Image { dest_url, .. })) =
            event
        else {
            continue;
        };
        let (file, fragment) = dest_url.split_once('#').unwrap_or((&dest_url, ""));
        if file.is_empty() || file.starts_with("mailto:") || file.contains("://") {
            continue;
        }
        let here = || format!("{}:{}", path.display(), markdown::line(text, range.start));
        let Some(mut target) = resolve(path, file) else {
            dead.push(format!("{}: {file} lies outside of the repository", here()));
            continue;
        };
        let mut written = file.to_owned();
        let source = &text[range.clone()];
        if root.join(&target).is_dir() {
            target.push("README.md");
            if !root.join(&target).is_file() {
                // [words](folder) -> words
                let words = source.rfind("](").map_or(source, |end| &source[1..end]);
                edits.push((range, words.to_owned()));
                continue;
            }
            written = format!("{}/README.md", file.trim_end_matches('/'));
        }
        if !root.join(&target).is_file() {
            dead.push(format!("{}: there is no {file}", here()));
            continue;
        }
        if target == Path::new(SUMMARY) {
            // The summary is the margin of every page and no page itself.
            written = "index.html".to_owned();
            let up = path
                .parent()
                .map_or(0, |folder| folder.components().count());
            written.insert_str(0, &"../".repeat(up));
        } else {
            links.push(target.clone());
        }
        if how == Links::FromRoot {
            written = target.display().to_string();
        }
        if written != file
            && let Some(begin) = source.rfind("](")
        {
            let hash = if fragment.is_empty() { "" } else { "#" };
            let at = range.start + begin + 2..range.end;
            edits.push((at, format!("{written}{hash}{fragment})")));
        }
    }
    Page {
        text: markdown::replace(text, &edits),
        links,
    }
}

/// The path from the repository's root of what a page at `from` calls `link`; `None` when it lies outside.
fn resolve(from: &Path, link: &str) -> Option<PathBuf> {
    let mut path = from.parent()?.to_path_buf();
    for component in Path::new(link).components() {
        match component {
            Component::Normal(name) => path.push(name),
            Component::ParentDir => {
                if !path.pop() {
                    return None;
                }
            }
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(path)
}

/// The first heading of a page, or its path.
fn title(text: &str, path: &Path) -> String {
    let heading = text.lines().find_map(|line| line.strip_prefix("# "));
    heading.map_or_else(
        || path.display().to_string(),
        |words| words.replace(['[', ']', '`'], ""),
    )
}

fn read(root: &Path, path: &Path) -> Result<String> {
    fs::read_to_string(root.join(path)).with_context(|| format!("cannot read {}", path.display()))
}

fn write(stage: &Path, path: &Path, bytes: &[u8]) -> Result<()> {
    let file = stage.join(path);
    let written = file
        .parent()
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| fs::write(&file, bytes));
    written.with_context(|| format!("cannot write {}", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A repository of the given files, and its stage.
    fn staged(files: &[(&str, &str)]) -> Result<tempfile::TempDir> {
        let folder = tempfile::tempdir()?;
        for (path, text) in files {
            write(folder.path(), Path::new(path), text.as_bytes())?;
        }
        write(folder.path(), Path::new(ALWAYS[0]), b"")?;
        stage(folder.path(), &folder.path().join("stage"))?;
        Ok(folder)
    }

    fn text(folder: &tempfile::TempDir, path: &str) -> String {
        fs::read_to_string(folder.path().join("stage").join(path)).unwrap()
    }

    #[test]
    fn pages_outside_of_docs_keep_their_places() {
        let folder = staged(&[
            (
                "docs/SUMMARY.md",
                "# Book\n\n- [About](../README.md)\n- [A guide](guide/a.md)\n",
            ),
            ("docs/guide/a.md", "[up](../../README.md#top)"),
            ("README.md", "# Top\n\n![picture](docs/p.png)"),
            ("docs/p.png", "bytes"),
        ])
        .unwrap();
        assert_eq!(
            text(&folder, "SUMMARY.md"),
            "# Book\n\n- [About](README.md)\n- [A guide](docs/guide/a.md)\n"
        );
        assert_eq!(
            text(&folder, "docs/guide/a.md"),
            "[up](../../README.md#top)"
        );
        assert_eq!(text(&folder, "docs/p.png"), "bytes");
    }

    #[test]
    fn pages_that_are_only_linked_are_added_to_the_summary() {
        let folder = staged(&[
            ("docs/SUMMARY.md", "- [About](../README.md)\n"),
            ("README.md", "[work](workflows/spar)"),
            ("workflows/spar/README.md", "# The spar\n"),
        ])
        .unwrap();
        assert!(
            text(&folder, "SUMMARY.md")
                .ends_with("# Further pages\n\n- [The spar](workflows/spar/README.md)\n")
        );
        assert_eq!(
            text(&folder, "README.md"),
            "[work](workflows/spar/README.md)"
        );
    }

    #[test]
    fn a_link_to_a_folder_without_a_page_leaves_its_words() {
        let folder = staged(&[
            ("docs/SUMMARY.md", "- [About](../README.md)\n"),
            ("README.md", "see [the `code`](code) there"),
            ("code/main.c", ""),
        ])
        .unwrap();
        assert_eq!(text(&folder, "README.md"), "see the `code` there");
    }

    #[test]
    fn dead_links_are_told_with_their_lines() {
        let error = staged(&[
            ("docs/SUMMARY.md", "- [About](../README.md)\n"),
            ("README.md", "one\n[two](gone.md)\n"),
        ])
        .unwrap_err();
        assert!(
            error
                .to_string()
                .contains("README.md:2: there is no gone.md"),
            "{error}"
        );
    }

    #[test]
    fn links_in_code_are_none() {
        assert!(
            staged(&[
                ("docs/SUMMARY.md", "- [About](../README.md)\n"),
                ("README.md", "`[a](b.md)`\n")
            ])
            .is_ok()
        );
    }
}
