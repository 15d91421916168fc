//! The end of a run: one self-contained HTML page that reads as a design-review document, and a table for
//! the terminal.
//!
//! [`write_report`] makes the page from what the engine knows ([`ReportInput`]) and what the artifacts hold. The page
//! needs no network and no fonts; pictures are drawn here and lie inside. Its scripts lie inside too: they turn the formed plies in 3D
//! and join tables with maps; without them everything else is there. Workflows with artifacts of
//! unknown kinds get a page with their steps, results and costs.

mod beside;
mod draw;
mod family;
mod input;
mod judge;
mod judged;
mod page;
mod plain;
mod read;
mod summary;
mod told;
mod units;

pub use draw::DrawError;
pub use family::{Family, Fate, Origin, Point, Response, Sampled, Value, Variable};
pub use input::{Expectation, Instance, ReportInput, Verdict};
pub use judge::judge;
pub use judged::{Finding, Judged, Kept};
pub use page::inputs::laws::{LawCurve, curves as law_curves};
pub use read::{COUNTS, Measure, OfClass, TARGETS, Way, Ways, advice, ways};
pub use summary::summary;
pub use told::{allowed_text, failing, found_text, in_short, reasons, table as limit_table};
pub use units::{bytes, in_users_units};

use camino::{Utf8Path, Utf8PathBuf};
use draw::Sharpness;
use page::content::Content;
use plyflow_artifact::seal;

/// A page larger than this is drawn again with coarser pictures (bytes).
const LARGEST: usize = 4_500_000;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file cannot be written.
    #[error("the report {path} cannot be written: {source}")]
    Write {
        /// Where.
        path: Utf8PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A picture cannot be made.
    #[error("a picture of the report cannot be drawn: {0}")]
    Picture(#[from] DrawError),
}

/// Writes the report to `out` (under a temporary name first, so that a whole one is there at any moment) and returns
/// its size in bytes. Artifacts that cannot be read are named among the warnings of the page.
///
/// # Errors
/// When the file cannot be written or a picture not be encoded.
pub fn write_report(input: &ReportInput, out: &Utf8Path) -> Result<u64, ReportError> {
    written(drawn(Content::read(input)?)?, out)
}

/// Seals a page and writes it; gives its size in bytes.
fn written(mut page: String, out: &Utf8Path) -> Result<u64, ReportError> {
    page += &sealed_by(&page);
    let wrong = |source| ReportError::Write {
        path: out.to_owned(),
        source,
    };
    if let Some(folder) = out.parent().filter(|f| !f.as_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(wrong)?;
    }
    plyflow_artifact::whole::write(out.as_std_path(), page.as_bytes()).map_err(wrong)?;
    Ok(page.len() as u64)
}

/// Writes the page of two runs side by side to `out`, as [`write_report`] does, and returns its size in bytes. Neither may be a study.
///
/// # Errors
/// When the file cannot be written or a picture not be encoded.
pub fn write_beside(inputs: [&ReportInput; 2], out: &Utf8Path) -> Result<u64, ReportError> {
    let sides = beside::Sides::read(inputs);
    let mut page = String::new();
    for sharp in Sharpness::ALL {
        page = page::beside::page(&sides, sharp)?;
        if page.len() <= LARGEST {
            break;
        }
    }
    written(page, out)
}

/// The page with the finest pictures for which there is room.
fn drawn(mut content: Content<'_>) -> Result<String, DrawError> {
    let (mut size, mut in_full) = (0, 0);
    for sharp in Sharpness::ALL {
        let page = page::page(&content, sharp, in_full)?;
        size = page.len();
        if size <= LARGEST {
            return Ok(page);
        }
        in_full = in_full.max(size);
    }
    let [size, bound] = [size, LARGEST].map(|n| units::bytes(n as u64));
    content.warn(format!(
        "this page of {size} is larger than {bound} even with its coarsest pictures"
    ));
    page::page(&content, Sharpness::ALL[Sharpness::ALL.len() - 1], in_full)
}

/// The last line of a page: the hash of all that is before it.
fn sealed_by(page: &str) -> String {
    format!("\n<!-- blake3 {} -->\n", seal::hash(page.as_bytes()))
}

/// Whether the report at `path` is the one of a fingerprint, as it was written: then it need not be written again.
#[must_use]
pub fn is_current(path: &Utf8Path, fingerprint: &str) -> bool {
    let Ok(bytes) = seal::read_document(path.as_std_path()) else {
        return false;
    };
    let Ok(text) = String::from_utf8(bytes) else {
        return false;
    };
    let length = sealed_by("").len();
    let Some((page, last)) =
        (text.len().checked_sub(length)).and_then(|at| text.split_at_checked(at))
    else {
        return false;
    };
    let mark = page::fingerprint_mark(fingerprint);
    let head = page.get(..512).unwrap_or(page);
    head.contains(&mark) && sealed_by(page) == last
}
