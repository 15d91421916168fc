//! What is said of each defect, and of the answer as a whole.

use crate::Shares;
use crate::bounds::{Measured, bounds};
use crate::follow::{Followed, Seen, Tracks, place};
use crate::judged::judged;
use crate::runs::All;
use plyflow_defects::{Defect, Kind};
use plyflow_model::artifact::{
    Cell, Column, ConfirmVariant, Confirmation, ConfirmedDefect, ConfirmedSize, ConfirmedVerdict,
    HangsOn, NewDefect, Stands, Table, Variation,
};
use std::collections::BTreeMap;

/// A size of a defect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Of a wrinkle's ridge.
    Length,
    /// Largest distance from the tool.
    Amplitude,
    /// In the flat ply.
    Area,
}

impl Size {
    /// Its name in artifacts and results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "length",
            Self::Amplitude => "amplitude",
            Self::Area => "area",
        }
    }

    /// Its SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Area => "m2",
            _ => "m",
        }
    }

    pub(crate) fn of(self, d: &Defect) -> f64 {
        match self {
            Self::Length => d.length,
            Self::Amplitude => d.amplitude,
            Self::Area => d.area,
        }
    }

    /// Factor to millimetres, unit there, and digits that are shown.
    fn shown(self) -> (f64, &'static str, usize) {
        match self {
            Self::Length => (1e3, "mm", 1),
            Self::Amplitude => (1e3, "mm", 2),
            Self::Area => (1e6, "mm²", 0),
        }
    }

    fn text(self, value: f64) -> String {
        let (factor, unit, digits) = self.shown();
        format!("{} {unit}", number(factor * value, digits))
    }

    /// `46 to 48 mm`, or one value where both are shown alike.
    fn range(self, low: f64, high: f64) -> String {
        let (factor, unit, digits) = self.shown();
        let [low, high] = [low, high].map(|v| number(factor * v, digits));
        if low == high {
            format!("{low} {unit}")
        } else {
            format!("{low} to {high} {unit}")
        }
    }
}

/// Without digits that say nothing beside a large number.
fn number(value: f64, digits: usize) -> String {
    let digits = if value.abs() >= 10.0 {
        digits.saturating_sub(1)
    } else {
        digits
    };
    format!("{value:.digits$}")
}

/// The sizes of a kind of defect, the first being the one that it is called by, and how many of them decide whether it stays.
pub fn sizes(kind: Kind) -> (&'static [Size], usize) {
    match kind {
        Kind::Wrinkle => (&[Size::Length, Size::Amplitude, Size::Area], 2),
        Kind::Bridging => (&[Size::Area, Size::Amplitude], 2),
    }
}

/// All that is said.
pub(crate) fn told(all: &All, tracks: &Tracks, shares: Shares) -> Confirmation {
    let defects: Vec<ConfirmedDefect> = tracks
        .followed
        .iter()
        .map(|d| one(all, d, shares))
        .collect();
    let left_out: Vec<Variation> = (Variation::ALL.into_iter())
        .filter(|v| !all.zones.is_empty() && all.variants.iter().all(|o| o.variant != *v))
        .collect();
    let new: Vec<NewDefect> = new(all, tracks);
    let judged = judged(all, tracks, &defects);
    let verdict = verdict(all, tracks, &defects, &left_out);
    let mut tables = vec![table(all, tracks, &defects)];
    tables.extend((!new.is_empty()).then(|| table_of_new(&new)));
    Confirmation {
        tolerance: shares.tolerance,
        variants: (all.variants.iter().zip(&tracks.count))
            .map(|(v, count)| ConfirmVariant {
                variant: v.variant,
                steps: v.steps(),
                runs: v.runs.len(),
                wrinkles: count[0],
                bridging: count[1],
            })
            .collect(),
        left_out,
        defects,
        new,
        verdict,
        judged,
        tables,
    }
}

/// What is said of a defect.
fn one(all: &All, of: &Followed, shares: Shares) -> ConfirmedDefect {
    let (names, deciding) = sizes(of.defect.kind);
    let mut hangs_on = Vec::new();
    for (variant, seen) in all.variants.iter().zip(&of.seen) {
        let variant = variant.variant;
        let Some(Seen::Same(there)) = seen.last() else {
            let instead = match seen.last() {
                Some(Seen::Instead(kind)) => Some(*kind),
                _ => None,
            };
            hangs_on.push(HangsOn {
                variant,
                size: None,
                change: None,
                instead,
            });
            continue;
        };
        for size in &names[..deciding] {
            let value = size.of(&of.defect);
            let change = (size.of(there) - value) / value;
            if change.abs() > shares.tolerance {
                hangs_on.push(HangsOn {
                    variant,
                    size: Some(size.name().into()),
                    change: Some(change),
                    instead: None,
                });
            }
        }
    }
    let stands = match &hangs_on[..] {
        [] => Stands::Stays,
        all if all.iter().any(|h| h.size.is_none()) => Stands::Gone,
        _ => Stands::Hangs,
    };
    let sizes: BTreeMap<String, ConfirmedSize> = (names.iter())
        .map(|s| (s.name().to_owned(), size(all, of, *s, shares.shared_error)))
        .collect();
    let main = &sizes[names[0].name()];
    let text = format!(
        "{}, {}",
        names[0].range(main.low, main.high),
        word(stands, &hangs_on)
    );
    ConfirmedDefect {
        id: of.id.clone(),
        zone: all.zones[of.zone].name.clone(),
        ply: of.ply.clone(),
        kind: of.defect.kind,
        centre: of.defect.centre,
        stands,
        text,
        hangs_on,
        sizes,
    }
}

/// A size with its bounds.
fn size(all: &All, of: &Followed, size: Size, shared: f64) -> ConfirmedSize {
    let value = size.of(&of.defect);
    let mut measured = Measured {
        by_elements: vec![[all.base[of.zone].element_size, value]],
        others: Vec::new(),
        shared,
    };
    let mut by = BTreeMap::new();
    for (variant, seen) in all.variants.iter().zip(&of.seen) {
        let runs = variant.of_zone[of.zone].iter().map(|&k| &variant.runs[k]);
        for (run, there) in runs.zip(seen).filter_map(|(r, s)| Some((r, s.same()?))) {
            let value = size.of(there);
            if variant.variant == Variation::Finer {
                measured.by_elements.push([run.element_size, value]);
            } else {
                measured.others.push(value);
            }
            by.insert(variant.variant.name().to_owned(), value);
        }
    }
    let bounds = bounds(&measured);
    ConfirmedSize {
        value,
        low: bounds.low,
        high: bounds.high,
        order: bounds.order,
        by,
        reference: (of.reference.as_ref())
            .and_then(Seen::same)
            .map(|there| size.of(there)),
    }
}

/// `stays`, `hangs on the element size (length +12 %)`, `gone with smaller elements`.
fn word(stands: Stands, hangs_on: &[HangsOn]) -> String {
    if stands == Stands::Stays {
        return "stays".into();
    }
    let gone = hangs_on.iter().filter(|h| h.size.is_none());
    let gone: Vec<String> = gone
        .map(|h| match h.instead {
            Some(kind) => format!("{} ({} instead)", h.variant.how(), kind.name()),
            None => h.variant.how().to_owned(),
        })
        .collect();
    let mut parts = Vec::new();
    if !gone.is_empty() {
        parts.push(format!("gone {}", gone.join(" and ")));
    }
    let mut hangs = Vec::new();
    for variant in Variation::ALL {
        let own = hangs_on.iter().filter(|h| h.variant == variant);
        let changes: Vec<String> = own
            .filter_map(|h| Some(format!("{} {:+.0} %", h.size.as_ref()?, 100.0 * h.change?)))
            .collect();
        if !changes.is_empty() {
            hangs.push(format!(
                "the {} ({})",
                variant.of_what(),
                changes.join(", ")
            ));
        }
    }
    if !hangs.is_empty() {
        parts.push(format!("hangs on {}", hangs.join(" and ")));
    }
    parts.join("; ")
}

fn new(all: &All, tracks: &Tracks) -> Vec<NewDefect> {
    let told = tracks.new.iter().map(|n| NewDefect {
        variant: all.variants[n.variant].variant,
        step: n.step.clone(),
        zone: n.zone.map(|z| all.zones[z].name.clone()),
        ply: n.ply.clone(),
        kind: n.defect.kind,
        centre: n.defect.centre,
        length: n.defect.length,
        amplitude: n.defect.amplitude,
        area: n.defect.area,
    });
    told.collect()
}

/// Whether there are wrinkles, and whether there is bridging, in words.
fn answer([wrinkles, bridging]: [usize; 2]) -> &'static str {
    match (wrinkles > 0, bridging > 0) {
        (true, true) => "there are wrinkles and bridging",
        (true, false) => "there are wrinkles and no bridging",
        (false, true) => "there is bridging and no wrinkle",
        (false, false) => "there are neither wrinkles nor bridging",
    }
}

fn verdict(
    all: &All,
    tracks: &Tracks,
    defects: &[ConfirmedDefect],
    left_out: &[Variation],
) -> ConfirmedVerdict {
    let mut base = [0, 0];
    tracks
        .followed
        .iter()
        .for_each(|d| base[place(d.defect.kind)] += 1);
    let others: Vec<(Variation, [usize; 2])> = (all.variants.iter().zip(&tracks.count))
        .filter(|(_, count)| answer(**count) != answer(base))
        .map(|(v, count)| (v.variant, *count))
        .collect();
    let mut text = if all.zones.is_empty() {
        "there is no zone, and nothing to confirm".to_owned()
    } else if others.is_empty() {
        format!("the verdict stays: {}", answer(base))
    } else {
        let names: Vec<&str> = others.iter().map(|o| o.0.of_what()).collect();
        let told = others
            .iter()
            .map(|(v, count)| format!("{} {}", v.how(), answer(*count)));
        let told: Vec<String> = told.collect();
        format!(
            "the verdict hangs on the {}: {}; {}",
            names.join(" and the "),
            answer(base),
            told.join(", ")
        )
    };
    if !defects.is_empty() {
        let stay = defects.iter().filter(|d| d.stands == Stands::Stays).count();
        text += &format!("; {stay} of {} defects stay", defects.len());
    }
    let inside = tracks.new.iter().filter(|n| n.zone.is_some()).count();
    match inside {
        0 => {}
        1 => text += "; variants show 1 more",
        n => text += &format!("; variants show {n} more"),
    }
    if !left_out.is_empty() {
        let names: Vec<&str> = left_out.iter().map(|v| v.of_what()).collect();
        text += &format!("; not looked at: {}", names.join(", "));
    }
    ConfirmedVerdict {
        wrinkles: base[0],
        bridging: base[1],
        stays: others.is_empty(),
        hangs_on: others.into_iter().map(|o| o.0).collect(),
        text,
    }
}

/// Each defect with its bounds, and what it measures in each variant.
fn table(all: &All, tracks: &Tracks, defects: &[ConfirmedDefect]) -> Table {
    let mut columns = [
        "defect",
        "ply",
        "type",
        "verdict",
        "amplitude",
        "area",
        "as it is",
    ]
    .map(|l| Column::new(l, ""))
    .to_vec();
    columns.extend(
        all.variants
            .iter()
            .map(|v| Column::new(v.variant.how(), "")),
    );
    columns.extend((all.reference.iter()).map(|w| Column::new(format!("in `{}`", w.step), "")));
    let row = |(d, of): (&ConfirmedDefect, &Followed)| {
        let main = sizes(d.kind).0[0];
        let range = |s: Size| d.sizes.get(s.name()).map(|b| s.range(b.low, b.high));
        let mut row: Vec<Cell> = vec![
            (&d.id).into(),
            (&d.ply).into(),
            d.kind.name().into(),
            (&d.text).into(),
            range(Size::Amplitude).into(),
            range(Size::Area).into(),
            main.text(main.of(&of.defect)).into(),
        ];
        let seen = |seen: &Seen| match seen {
            Seen::Same(there) => Cell::from(main.text(main.of(there))),
            Seen::Instead(kind) => format!("{} instead", kind.name()).into(),
            Seen::Gone => "gone".into(),
        };
        row.extend((of.seen.iter()).map(|all| seen(all.last().unwrap_or(&Seen::Gone))));
        row.extend(of.reference.as_ref().map(seen));
        row
    };
    Table {
        name: "confirmed".into(),
        title: Some("Which defects stay".into()),
        columns,
        rows: defects.iter().zip(&tracks.followed).map(row).collect(),
    }
}

fn table_of_new(new: &[NewDefect]) -> Table {
    let columns = [
        ("step", ""),
        ("zone", ""),
        ("ply", ""),
        ("type", ""),
        ("x", "m"),
        ("y", "m"),
        ("length", "m"),
        ("amplitude", "m"),
        ("area", "m2"),
    ];
    let row = |d: &NewDefect| {
        let zone = d.zone.as_deref().unwrap_or("outside of the zones");
        let length = (d.kind == Kind::Wrinkle).then_some(d.length);
        vec![
            (&d.step).into(),
            zone.into(),
            (&d.ply).into(),
            d.kind.name().into(),
            d.centre[0].into(),
            d.centre[1].into(),
            length.into(),
            d.amplitude.into(),
            d.area.into(),
        ]
    };
    Table {
        name: "new".into(),
        title: Some("Defects that only variants show".into()),
        columns: columns
            .map(|(label, unit)| Column::new(label, unit))
            .to_vec(),
        rows: new.iter().map(row).collect(),
    }
}
