//! What a size that a user writes may ask for. An element size a thousand times too small is a slip of a unit, not a wish
//! for a million times the elements: how many there would be is told before any of them is made.

use plyflow_fixed::FixedBits;

/// Most elements of one mesh: one square metre in elements of 0.25 mm, with room to spare.
pub const MOST_ELEMENTS: f64 = 2e7;
/// What an element of a sheet takes at least (bytes): its corners, constants, state and forces.
pub const ELEMENT_BYTES: f64 = 500.0;
/// Most facets of a tool that is made from parameters.
pub const MOST_FACETS: f64 = 2e7;
/// What a facet takes at least (bytes): its corners and half a point, and the tree that finds it.
pub const FACET_BYTES: f64 = 100.0;

/// Where a worker tells its libraries how much memory (bytes) the step may take.
pub const MEMORY_VARIABLE: &str = "PLYFLOW_MEMORY_BOUND";

/// Something whose size grows as one over a length that the user writes.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// What it is, with its name: `the mesh of ply 'a'`.
    pub what: &'a str,
    /// What it is made of: `elements`.
    pub of: &'a str,
    /// How many there would be.
    pub count: f64,
    /// Most that are made.
    pub most: f64,
    /// What one takes at least (bytes).
    pub bytes: f64,
    /// The parameter: `element_size`.
    pub parameter: &'a str,
    /// Its value (m).
    pub size: f64,
}

/// Whether it may be made: no more than the most, and no more than the step's memory holds.
///
/// # Errors
/// A sentence with the number that there would be, what that takes, the bound, and a size that would do. The count is taken to
/// grow with the square of one over the size.
pub fn allow(wanted: Wanted<'_>) -> Result<(), String> {
    let memory = std::env::var(MEMORY_VARIABLE).ok();
    allow_within(
        wanted,
        memory.and_then(|m| m.parse().ok()).filter(|m| *m > 0.0),
    )
}

fn allow_within(w: Wanted<'_>, memory: Option<f64>) -> Result<(), String> {
    let holds = memory.map_or(f64::INFINITY, |m| m / w.bytes);
    let most = w.most.min(holds);
    if w.count <= most {
        return Ok(());
    }
    let bound = match memory {
        Some(m) if holds < w.most => format!(
            "the step's bound of memory is {} (`resources: {{memory: ..}}`)",
            memory_text(m)
        ),
        _ => format!("expected at most {:.0e}", w.most),
    };
    // Rounded up to two figures, so that the size given would really do.
    let enough = w.size * (w.count / most).sqrt() * 1.01;
    let unit = 10f64.fixed_powf(enough.fixed_log10().floor() - 1.0);
    Err(format!(
        "{} would have {:.1e} {} at `{}` {:.3e} m and take at least {}; {bound}. Take `{}` of at least {:.2e} m, and look whether the unit is \
         the one that was meant",
        w.what,
        w.count,
        w.of,
        w.parameter,
        w.size,
        memory_text(w.count * w.bytes),
        w.parameter,
        (enough / unit).ceil() * unit
    ))
}

fn memory_text(bytes: f64) -> String {
    let gib = bytes / (1u64 << 30) as f64;
    if gib < 1024.0 {
        format!("{gib:.1} GiB")
    } else {
        format!("{:.0} TiB", gib / 1024.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(size: f64) -> Wanted<'static> {
        Wanted {
            what: "the mesh of ply 'a'",
            of: "elements",
            count: 0.08 / (size * size),
            most: MOST_ELEMENTS,
            bytes: ELEMENT_BYTES,
            parameter: "element_size",
            size,
        }
    }

    #[test]
    fn the_size_that_is_advised_would_do_and_a_tenth_less_would_not() {
        for memory in [None, Some(1e9), Some(3e8)] {
            let text = allow_within(wanted(1e-6), memory).unwrap_err();
            let advised = text.split("at least ").nth(2).unwrap();
            let advised: f64 = advised.split(" m").next().unwrap().parse().unwrap();
            assert!(allow_within(wanted(advised), memory).is_ok(), "{text}");
            assert!(
                allow_within(wanted(0.9 * advised), memory).is_err(),
                "{text}"
            );
        }
    }

    #[test]
    fn what_is_too_large_is_told_with_its_number_its_memory_and_the_bound() {
        let text = allow_within(wanted(1e-6), None).unwrap_err();
        for part in [
            "8.0e10 elements",
            "36 TiB",
            "at most 2e7",
            "`element_size` 1.000e-6 m",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let text = allow_within(wanted(1e-4), Some(1e9)).unwrap_err();
        assert!(text.contains("bound of memory is 0.9 GiB"), "{text}");
        assert!(allow_within(wanted(1e-3), Some(1e9)).is_ok());
    }
}
