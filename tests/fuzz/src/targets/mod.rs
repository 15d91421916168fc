//! The readers, each as a function of the bytes of a file.

mod artifacts;
mod drawings;
mod manifests;
mod store;
mod surfaces;
mod tables;
mod words;
mod workflows;

use crate::memory::{LONGEST, within_budget};

/// A reader and what must hold of it.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Name, also of its folder of the corpus.
    pub name: &'static str,
    /// Reads bytes.
    ///
    /// # Panics
    /// When what comes of it is not as it should be.
    run: fn(&[u8]),
    /// Whether its files are text of lines, which are then mutated as such.
    pub lines: bool,
    /// Longest input that the driver makes (bytes).
    pub longest: usize,
}

impl Target {
    const fn of_text(name: &'static str, run: fn(&[u8])) -> Self {
        let (lines, longest) = (true, 1 << 13);
        Self {
            name,
            run,
            lines,
            longest,
        }
    }

    const fn of_bytes(name: &'static str, run: fn(&[u8])) -> Self {
        let (lines, longest) = (false, 1 << 13);
        Self {
            name,
            run,
            lines,
            longest,
        }
    }

    /// Reads bytes within the budget of memory; longer inputs than [`LONGEST`] are passed over.
    ///
    /// # Panics
    /// When what comes of it is not as it should be.
    pub fn run(&self, bytes: &[u8]) {
        if bytes.len() <= LONGEST {
            within_budget(self.name, || (self.run)(bytes));
        }
    }
}

/// All targets.
pub const TARGETS: [Target; 23] = [
    Target::of_text("workflow", workflows::workflow),
    Target::of_text("scene", workflows::scene),
    Target::of_text("material", workflows::material),
    Target::of_text("expected", workflows::expected),
    Target::of_text("points", workflows::points),
    Target::of_text("override", workflows::overrides),
    Target::of_text("ply-book", drawings::book),
    Target::of_text("drawing", drawings::drawing),
    Target::of_text("steering", drawings::steering),
    Target::of_bytes("quantity", words::quantity),
    Target::of_bytes("expression", words::expression),
    Target::of_text("table", tables::table),
    Target::of_text("profile", tables::profile),
    Target::of_text("scan-points", tables::scan),
    Target::of_bytes("scan-facets", surfaces::scan),
    Target::of_bytes("stl", surfaces::stl),
    Target::of_bytes("artifact", artifacts::artifact),
    Target::of_text("manifest", manifests::manifest),
    Target::of_text("plugins", manifests::plugins),
    Target::of_text("record", store::record),
    Target::of_bytes("journal", store::journal),
    Target::of_bytes("resolved", store::resolved),
    Target::of_bytes("lock", store::lock),
];

/// The target of that name.
#[must_use]
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|t| t.name == name)
}
