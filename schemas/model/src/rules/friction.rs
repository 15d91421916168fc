//! Rules of friction: what must be given, laws that make sense, and pairs of surfaces that touch.

use crate::fault::{Fault, Path, Phrase, Rule, Shown, degrees};
use crate::friction::{
    AngleLaw, Coefficient, Friction, FrictionLaw, FrictionPair, Place, PressureLaw,
};
use crate::manifest::one_of;
use crate::nearest::nearest;
use crate::process::Process;
use crate::regions::ALL;
use crate::rules::known::Known;
use crate::rules::surfaces::{Class, Contact, contacts, rigid_parts, same_pair};
use crate::scene::Sheet;
use crate::units::{Number, si_number};

/// Largest coefficient that is computed with.
pub const LARGEST: f64 = 2.0;

/// Most names or pairs that are listed as what was expected.
const MOST_LISTED: usize = 12;

/// A law with its place in a scene.
struct At {
    path: Path,
    /// Of its coefficient: the same where that is all.
    own: Path,
    law: FrictionLaw,
}

/// All that is wrong with the friction of a scene. `in_order`: whether the sheets make a stack, so that it is known what touches.
pub fn check(known: &Known<'_>, in_order: bool) -> Vec<Fault> {
    let mut found = Vec::new();
    for at in laws(known) {
        law(&at, &mut found);
    }
    if let (Some(friction), Some(process), Some(sheets)) =
        (known.friction, known.process, known.whole_stack())
    {
        let contacts = contacts(&sheets, process);
        classes(friction, &contacts, &mut found);
        let known_to_rub = if in_order { &contacts[..] } else { &[] };
        pairs(friction, process, &sheets, known_to_rub, &mut found);
        // Whose fibres count is asked only where all else is right.
        if in_order && found.is_empty() {
            fibres(known, friction, &contacts, &mut found);
        }
    }
    found
}

/// What a scene's friction says of a class.
pub fn of_class(friction: &Friction, class: Class) -> Option<&Coefficient> {
    match class {
        Class::ToolDiaphragm => &friction.tool_diaphragm,
        Class::ToolFabric => &friction.tool_fabric,
        Class::FabricDiaphragm => &friction.fabric_diaphragm,
        Class::FabricFabric => &friction.fabric_fabric,
        Class::DiaphragmDiaphragm => &friction.diaphragm_diaphragm,
    }
    .as_ref()
}

/// All laws and coefficients of a scene; a coefficient as a law that has nothing else.
fn laws(known: &Known<'_>) -> Vec<At> {
    let mut all = Vec::new();
    let mut add = |path: Path, given: &Coefficient| {
        let (own, law) = match given {
            Coefficient::Law(law) => (path.key("coefficient"), (**law).clone()),
            Coefficient::Constant(c) => {
                let law = FrictionLaw {
                    coefficient: Some(*c),
                    ..FrictionLaw::default()
                };
                (path.clone(), law)
            }
        };
        all.push(At { path, own, law });
    };
    for (s, sheet) in known.plies() {
        for (r, region) in sheet.regions.iter().enumerate() {
            let path = Path::to("sheets").item(s).key("regions").item(r);
            for (key, given) in &region.friction {
                add(path.key("friction").key(key), given);
            }
        }
    }
    let at = Path::to("friction");
    if let Some(friction) = known.friction {
        for class in Class::ALL {
            if let Some(given) = of_class(friction, class) {
                add(at.key(class.word()), given);
            }
        }
        for (k, pair) in friction.pairs.iter().enumerate() {
            let path = at.key("pairs").item(k);
            add(path, &Coefficient::Law(Box::new(pair.law())));
        }
    }
    all
}

/// Of a class that is not told, of which these two touch.
pub fn missing(class: Class, [lower, upper]: [&str; 2]) -> Fault {
    let name = class.word();
    let text = format!("`{name}` is missing in `friction`");
    Fault::text(Rule::Friction, Path::to("friction").key(name), text)
        .expected(format!("`{name}: ..`"))
        .help(format!(
            "it is needed because `{lower}` and `{upper}` touch"
        ))
}

/// Classes that are not told, and of which two surfaces that touch are no pair with a law of their own.
fn classes(friction: &Friction, contacts: &[Contact<'_>], found: &mut Vec<Fault>) {
    for class in Class::ALL {
        let named = |c: &&Contact<'_>| friction.pairs.iter().any(|p| c.is_of(p.names()));
        let mut of_it = contacts.iter().filter(|c| c.next && c.class == class);
        if of_class(friction, class).is_none() {
            found.extend(of_it.find(|c| !named(c)).map(|c| missing(class, c.parts)));
        }
    }
}

fn number(path: Path, value: f64) -> Fault {
    Fault::given(Rule::Friction, path, si_number(value))
}

/// Whether a coefficient is one.
fn coefficient(path: Path, Number(value): Number) -> Option<Fault> {
    let expected = format!("a coefficient from 0 to {LARGEST}");
    (!(0.0..=LARGEST).contains(&value)).then(|| number(path, value).expected(expected))
}

/// "no row", "one row": what a table with too few of them has.
pub fn row_count(rows: usize) -> &'static str {
    if rows == 0 { "no row" } else { "one row" }
}

/// Two or more rows in which `key` grows: values in SI with their texts.
fn rows(table: &Path, key: &str, rows: &[(f64, String)], found: &mut Vec<Fault>) {
    if rows.len() < 2 {
        let text = format!("the table has {}", row_count(rows.len()));
        let fault = Fault::text(Rule::Friction, table.clone(), text);
        found.push(fault.expected(format!("two or more rows with growing `{key}`")));
        return;
    }
    let at = |k: usize| table.item(k).key(key);
    if let Some(k) = (0..rows.len()).find(|k| !(rows[*k].0 >= 0.0 && rows[*k].0.is_finite())) {
        let fault = Fault::given(Rule::Friction, at(k), rows[k].1.clone());
        found.push(fault.expected("0 or more"));
    } else if let Some(k) = (1..rows.len()).find(|k| rows[*k].0 <= rows[k - 1].0) {
        let before = (at(k - 1), rows[k - 1].1.clone());
        let fault = Fault::given(Rule::Friction, at(k), rows[k].1.clone());
        found.push(fault.expected(Phrase::with_value(
            "more than the ",
            before,
            " of the row before",
        )));
    }
}

/// A law by pressure and direction: one coefficient or a table of them, tables in order.
fn law(At { path, own, law }: &At, found: &mut Vec<Fault>) {
    let mut largest = law.coefficient.map_or(0.0, |c| c.0);
    match (&law.pressure, law.coefficient) {
        (Some(PressureLaw::Table(_)), Some(_)) => found.push(
            Fault::text(
                Rule::Friction,
                own.clone(),
                "`coefficient` stands beside a table by pressure, which says it all",
            )
            .shown(Shown::Key)
            .help("remove one of the two"),
        ),
        (Some(PressureLaw::Table(table)), None) => {
            let at = path.key("pressure").key("table");
            let pressures = table
                .iter()
                .map(|r| (r.pressure.si(), r.pressure.to_string()));
            rows(&at, "pressure", &pressures.collect::<Vec<_>>(), found);
            for (k, row) in table.iter().enumerate() {
                found.extend(coefficient(at.item(k).key("coefficient"), row.coefficient));
                largest = largest.max(row.coefficient.0);
            }
        }
        (_, None) => found.push(
            Fault::text(
                Rule::Friction,
                own.clone(),
                "the law of friction has no `coefficient`",
            )
            .expected("`coefficient: ..`, a number from 0 to 2")
            .help("only a table by pressure says it in another place"),
        ),
        (_, Some(c)) => found.extend(coefficient(own.clone(), c)),
    }
    if let Some(PressureLaw::Power(power)) = &law.pressure {
        let at = path.key("pressure").key("power");
        if !(power.reference.si() > 0.0 && power.reference.si().is_finite()) {
            let fault = Fault::given(
                Rule::Friction,
                at.key("reference"),
                power.reference.to_string(),
            );
            found.push(fault.expected("more than 0 Pa"));
        }
        let exponent = power.exponent.0;
        if !(exponent > -1.0 && exponent <= 1.0) {
            found.push(
                number(at.key("exponent"), exponent).expected(
                    "more than -1, as friction would not grow with pressure, and at most 1",
                ),
            );
        }
    }
    if let Some(law) = &law.angle {
        angle(&path.key("angle"), law, largest, found);
    }
}

/// Factors by angle; `largest`: the coefficient that they are of.
fn angle(path: &Path, law: &AngleLaw, largest: f64, found: &mut Vec<Fault>) {
    let at = path.key("factors");
    let angles = law
        .factors
        .iter()
        .map(|r| (r.angle.si(), degrees(r.angle.si())));
    rows(&at, "angle", &angles.collect::<Vec<_>>(), found);
    for (k, row) in law.factors.iter().enumerate() {
        if row.angle.si() > std::f64::consts::FRAC_PI_2 + 1e-9 {
            let fault = Fault::given(
                Rule::Friction,
                at.item(k).key("angle"),
                degrees(row.angle.si()),
            );
            found.push(fault.expected("an angle from 0 to 90 deg: a fibre has no sense"));
        }
        let factor = row.factor.0;
        if !(factor >= 0.0 && factor * largest <= LARGEST) {
            let expected = match factor >= 0.0 {
                true => format!(
                    "a coefficient of at most {LARGEST} in all (here {})",
                    factor * largest
                ),
                false => "0 or more".into(),
            };
            found.push(number(at.item(k).key("factor"), factor).expected(expected));
        }
    }
    if !(1..=2).contains(&law.family) {
        found.push(number(path.key("family"), f64::from(law.family)).expected("1 or 2"));
    }
}

/// Those of two names of surfaces that a scene does not have.
fn unknown(between: [&str; 2], names: &[&str], path: &Path) -> Vec<Fault> {
    let missing = (0..2).filter(|i| !names.contains(&between[*i]));
    let told = missing.map(|i| {
        let name = between[i];
        let text = format!("no surface of this scene is called `{name}`");
        let mut fault = Fault::text(Rule::Pairs, path.item(i), text);
        if names.len() <= MOST_LISTED {
            fault = fault.expected(one_of(names.iter().copied()));
        }
        match nearest(name, names.iter().copied()) {
            Some(nearest) => fault.help(format!("did you mean `{nearest}`?")),
            None => fault,
        }
    });
    told.collect()
}

/// Pairs that name what the scene does not have, what does not touch (where that is known), or the same twice.
fn pairs(
    friction: &Friction,
    process: &Process,
    sheets: &[&Sheet],
    contacts: &[Contact<'_>],
    found: &mut Vec<Fault>,
) {
    let sheets = sheets.iter().map(|s| s.name.as_str());
    let names: Vec<&str> = rigid_parts(process).into_iter().chain(sheets).collect();
    let at = Path::to("friction").key("pairs");
    for (k, pair) in friction.pairs.iter().enumerate() {
        let path = at.item(k).key("between");
        let between = pair.names();
        let unknown = unknown(between, &names, &path);
        if !unknown.is_empty() {
            found.extend(unknown);
            continue;
        }
        let [one, other] = between;
        let mut before = friction.pairs[..k].iter();
        let same = |p: &FrictionPair| same_pair(p.names(), between);
        if let Some(j) = before.position(same) {
            let text = format!("the pair of `{one}` and `{other}` is named twice");
            let first = at.item(j).key("between");
            found.push(
                Fault::text(Rule::Pairs, path, text).help(Phrase::with_place(
                    "it stands ",
                    first,
                    " already; remove one",
                )),
            );
        } else if !contacts.is_empty() && !contacts.iter().any(|c| c.is_of(between)) {
            let text = format!("`{one}` and `{other}` do not rub on each other in this scene");
            let mut fault = Fault::text(Rule::Pairs, path, text).help(
                "any two sheets rub, a bag's lowest film on what is rigid, and every ply of a press on its parts",
            );
            if contacts.len() <= MOST_LISTED {
                let all = contacts
                    .iter()
                    .map(|c| format!("[{}, {}]", c.parts[0], c.parts[1]));
                let all: Vec<String> = all.collect();
                fault = fault.expected(one_of(all.iter().map(String::as_str)));
            }
            found.push(fault);
        }
    }
}

/// The ply whose fibres a law by angle means in a contact of two surfaces, the lower one first; `plies`: the plies among them.
///
/// # Errors
/// When it is not clear which, or it has none.
pub fn whose<T>(law: &AngleLaw, parts: [&str; 2], plies: [Option<T>; 2]) -> Result<T, Fault> {
    let [lower, upper] = parts;
    let (text, expected) = match (law.of, plies) {
        (Some(Place::Lower), [Some(ply), _]) | (Some(Place::Upper), [_, Some(ply)]) => {
            return Ok(ply);
        }
        (None, [Some(ply), None] | [None, Some(ply)]) => return Ok(ply),
        (None, [Some(_), Some(_)]) => (
            format!("`{lower}` and `{upper}` both have fibres"),
            "`of: lower` or `of: upper`",
        ),
        (_, plies) => (
            format!("the surface meant of `{lower}` (lower) and `{upper}` (upper) has no fibres"),
            match plies {
                [None, None] => "a law without `angle`",
                _ => "no `of`, or that of the ply",
            },
        ),
    };
    Err(Fault::text(Rule::Friction, Path::to("friction"), text).expected(expected))
}

/// Laws by the angle to fibres: in every contact that has one it must be clear whose fibres count.
fn fibres(
    known: &Known<'_>,
    friction: &Friction,
    contacts: &[Contact<'_>],
    found: &mut Vec<Fault>,
) {
    let at = Path::to("friction");
    let mut look = |path: Path, law: &AngleLaw, parts: [&str; 2]| {
        let ply = |name: &str| known.plies().find(|(_, ply)| ply.name == name);
        let fault = whose(law, parts, parts.map(ply)).err();
        let fault = fault.map(|f| f.at(path.key("of")));
        // The first contact of a law tells enough.
        found.extend(fault.filter(|f| found.iter().all(|other| other.path != f.path)));
    };
    // A ply that folds rubs on itself as plies do on each other.
    let folding = known.plies().filter(|_| friction.fabric_fabric.is_some());
    let folds = folding.map(|(_, ply)| Contact {
        parts: [&ply.name, &ply.name],
        class: Class::FabricFabric,
        next: true,
    });
    for contact in contacts.iter().copied().chain(folds) {
        let mut own = friction.pairs.iter();
        if let Some(k) = own.position(|p| contact.is_of(p.names())) {
            if let Some(law) = &friction.pairs[k].angle {
                look(at.key("pairs").item(k).key("angle"), law, contact.parts);
            }
        } else if let Some(law) = of_class(friction, contact.class).and_then(by_angle) {
            let path = at.key(contact.class.word()).key("angle");
            look(path, law, contact.parts);
        }
        for (path, law) in in_regions(known, &contact) {
            look(path, law, contact.parts);
        }
    }
}

/// The part of what a scene gives for two surfaces that is by the angle to fibres.
pub fn by_angle(given: &Coefficient) -> Option<&AngleLaw> {
    match given {
        Coefficient::Law(law) => law.angle.as_ref(),
        Coefficient::Constant(_) => None,
    }
}

/// Laws by the angle to fibres that a contact has in regions of its plies.
fn in_regions<'a>(known: &Known<'a>, contact: &Contact<'_>) -> Vec<(Path, &'a AngleLaw)> {
    let mut found = Vec::new();
    let word = contact.class.word();
    for (s, sheet) in known.plies() {
        let Some(own) = contact.parts.iter().position(|name| *name == sheet.name) else {
            continue;
        };
        let keys = [contact.parts[1 - own], word, ALL];
        for (r, region) in sheet.regions.iter().enumerate() {
            let told = keys
                .into_iter()
                .find_map(|key| Some((key, region.friction.get(key)?)));
            if let Some((key, law)) = told.and_then(|(key, given)| Some((key, by_angle(given)?))) {
                let path = Path::to("sheets").item(s).key("regions").item(r);
                found.push((path.key("friction").key(key).key("angle"), law));
            }
        }
    }
    found
}
