//! How far ties of plies give way.

use crate::forming::Forming;
use plyflow_model::scene::Sheet;

/// How far tied nodes are from the points that they were laid on, the farthest: way (m), and way over the length of an element; `None` where none is
/// tied.
pub fn tie_stretch(forming: &Forming) -> Option<[f64; 2]> {
    let ties = forming.model.sheet_contacts().iter().map(|c| &c.ties);
    let ties = ties.filter(|t| !t.items.is_empty());
    let both = ties.map(|t| [t.stretch(), t.stretch_share()]);
    both.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
}

/// What to tell of plies that are tied to one on which they lie nowhere. A zone need not have what lies on it.
pub fn untied(forming: &Forming) -> Vec<String> {
    if forming.zone.is_some() {
        return Vec::new();
    }
    let sheets: Vec<Sheet> = forming.stack.iter().map(|s| s.scene.clone()).collect();
    let has_ties = |(upper, lower): &(&str, &str)| {
        let contacts = forming.model.sheet_contacts().iter();
        let name = format!("{lower}/{upper}");
        contacts
            .filter(|c| c.name == name)
            .any(|c| !c.ties.items.is_empty())
    };
    let without = Sheet::ties(&sheets).filter(|two| !has_ties(two));
    let told = without.map(|(upper, lower)| {
        format!(
            "ply '{upper}' is tied to '{lower}', and no node of it lies on that ply as laid: nothing ties them. Look at `centre`, the sizes and the order of \
             the plies"
        )
    });
    told.collect()
}
