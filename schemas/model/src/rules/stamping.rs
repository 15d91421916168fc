//! Rules of stamping: names and surfaces of parts, tables in order, forces that press, dies that leave the plies room.

use crate::fault::{Fault, Part, Path, Rule, Shown, mm};
use crate::material::MaterialEntry;
use crate::rules::friction::row_count;
use crate::rules::known::Known;
use crate::rules::sheets::RIGID;
use crate::scene::{MirrorPlane, Sheet, SheetKind};
use crate::stamping::{
    ForceCourse, Gripper, MatchingDie, PartMotion, Pressed, Side, Stamping, StampingPart, TOOL,
};
use crate::text::{WORD, is_word};
use crate::tool::{DoubleDomeTool, Tool, rules};
use crate::units::{ForcePerLength, si_number};

/// Lengths (m) and times (s) that differ by less are the same: what decimals of a scene leave.
const SAME: f64 = 1e-9;

fn at() -> Path {
    Path::to("process").key("stamping")
}

fn seconds(s: f64) -> String {
    format!("{} ms", si_number((s * 1e9).round() / 1e6 + 0.0))
}

/// All that is wrong with a stamping.
pub fn check(known: &Known<'_>, stamping: &Stamping, found: &mut Vec<Fault>) {
    let end = stamping.forming_time.si();
    if !(end > 0.0 && end.is_finite()) {
        let fault = Fault::given(Rule::Press, at().key("forming_time"), seconds(end));
        found.push(fault.expected("more than 0 s"));
    }
    names(known, stamping, found);
    for (k, part) in stamping.parts.iter().enumerate() {
        let path = at().key("parts").item(k);
        surface(known, part, &path, found);
        found.extend(part.place().check(&path).err());
        let direction = part.direction.filter(|d| d.unit().is_none());
        if direction.is_some() {
            let fault = Fault::text(
                Rule::Press,
                path.key("direction"),
                "the vector has no length",
            );
            found.push(fault.expected("an axis such as `-z`, or a vector such as `[0, 0.5, 1]`"));
        }
        found.extend(along_planes(known, part, &path));
        let path = path.key("motion");
        match &part.motion {
            None => {}
            Some(PartMotion::Table(rows)) => {
                let rows: Vec<f64> = rows.iter().map(|r| r.time.si()).collect();
                found.extend(times(&rows, &path.key("table"), end));
            }
            Some(PartMotion::Pressed(pressed)) => press(pressed, &path.key("pressed"), end, found),
        }
    }
    for (k, gripper) in stamping.grippers.iter().enumerate() {
        let path = at().key("grippers").item(k);
        grips(known, gripper, &path, found);
    }
    if !stamping.grippers.is_empty() && !known.symmetry.is_empty() {
        let text = "grippers pull at single places, and their mirror images are not looked for";
        let fault = Fault::text(Rule::Symmetry, at().key("grippers"), text);
        found.push(fault.shown(Shown::Key).help("leave out `symmetry`"));
    }
    found.extend(still(stamping));
}

/// Something must move.
fn still(stamping: &Stamping) -> Option<Fault> {
    let moves = |part: &StampingPart| match &part.motion {
        None => false,
        Some(PartMotion::Pressed(_)) => true,
        Some(PartMotion::Table(rows)) => {
            let first = rows.first().map_or(0.0, |r| r.way.si());
            rows.iter().any(|r| (r.way.si() - first).abs() > SAME)
        }
    };
    (!stamping.parts.iter().any(moves)).then(|| {
        Fault::text(Rule::Press, at().key("parts"), "no part moves")
            .shown(Shown::Key)
            .expected("a part with `motion: {table: [..]}` whose ways differ, or with `motion: {pressed: ..}`")
            .help("an entry with the name `tool` and without a surface moves the scene's own tool")
    })
}

/// Names are words, and each is that of one part.
fn names(known: &Known<'_>, stamping: &Stamping, found: &mut Vec<Fault>) {
    for (k, part) in stamping.parts.iter().enumerate() {
        let path = at().key("parts").item(k).key("name");
        let name = part.name.as_str();
        let twice = stamping.parts[..k].iter().any(|p| p.name == name);
        // The sheet is told where the name is one of the usual rigid parts.
        let sheet =
            (known.sheets.iter().flatten()).any(|s| s.name == name && !RIGID.contains(&name));
        if twice || sheet || name == "bed" {
            let of = if sheet { " by a sheet" } else { "" };
            let fault = Fault::text(Rule::Name, path, format!("the name `{name}` is taken{of}"));
            found.push(fault.expected("a name of its own for every part, other than `bed`"));
        } else if !is_word(name) {
            let fault = Fault::text(Rule::Name, path, format!("`{name}` cannot name a body"));
            found.push(fault.expected(WORD));
        }
    }
}

/// Each part but the scene's own tool has one surface.
fn surface(known: &Known<'_>, part: &StampingPart, path: &Path, found: &mut Vec<Fault>) {
    let own = part.name == TOOL;
    let given = [
        ("tool", part.tool.is_some()),
        ("matching", part.matching.is_some()),
    ];
    let count = given.iter().filter(|g| g.1).count();
    if own {
        own_tool(part, given, path, found);
    } else if count != 1 {
        let text = match count {
            0 => format!("the part `{}` has no surface", part.name),
            _ => format!("the part `{}` has two surfaces", part.name),
        };
        let fault = Fault::text(Rule::Press, path.key("name"), text);
        found.push(fault.expected("`tool: ..` or `matching: ..`, one of them"));
    }
    if let Some(tool) = &part.tool
        && let Err(fault) = rules::check(tool)
    {
        let place = fault
            .path
            .parts()
            .iter()
            .fold(path.clone(), |path, part| match part {
                Part::Key(key) => path.key(key),
                Part::Item(item) => path.item(*item),
            });
        found.push(fault.at(place));
    }
    if let Some(die) = &part.matching {
        found.extend(matching(known, part, die, &path.key("matching")));
    }
}

/// The scene's own tool has its surface and place from the scene, is below the plies, and ends where it is drawn: there all that measures distances
/// to it takes it.
fn own_tool(part: &StampingPart, given: [(&str, bool); 2], path: &Path, found: &mut Vec<Fault>) {
    if let Some((key, _)) = given.iter().find(|g| g.1) {
        let text = format!("`{key}` stands at the part `tool`, which is the scene's own tool");
        let fault = Fault::text(Rule::Press, path.key(key), text);
        found.push(
            fault
                .shown(Shown::Key)
                .help("leave it out, or give the part another name if it is a further one"),
        );
    }
    if !part.place().only_moves() || part.translate.iter().any(|t| t.si() != 0.0) {
        let text = "the scene's own tool has its place from the words beside its surface";
        let fault = Fault::text(Rule::Press, path.key("name"), text);
        found.push(fault.help("leave out `translate`, `up`, `rotate`, `centre` and `foot` here"));
    }
    if part.side == Side::Above {
        let fault = Fault::given(Rule::Press, path.key("side"), "above");
        found.push(fault.expected("`below`: the sheets of a scene stand over its tool"));
    }
    match &part.motion {
        Some(PartMotion::Pressed(_)) => {
            let text = "the scene's own tool is pressed, so that nobody knows where it ends";
            let fault = Fault::text(Rule::Press, path.key("motion").key("pressed"), text);
            found.push(fault.shown(Shown::Key).expected("`table: [..]`, or no motion").help(
                "what measures distances takes the tool where it is drawn: press the parts on the other side instead",
            ));
        }
        Some(PartMotion::Table(rows)) => {
            if let Some((k, way)) = rows.iter().map(|r| r.way.si()).enumerate().next_back()
                && way.abs() > SAME
            {
                let path = path.key("motion").key("table").item(k).key("way");
                found.push(Fault::given(Rule::Press, path, mm(way)).expected(
                    "`0 mm` in the last row: what measures distances takes the tool where it is drawn",
                ));
            }
        }
        None => {}
    }
}

/// A die that closes over a double dome: above it, as its walls allow, with room for the plies.
fn matching(
    known: &Known<'_>,
    part: &StampingPart,
    die: &MatchingDie,
    path: &Path,
) -> Option<Fault> {
    let text = |text: &str| Fault::text(Rule::Press, path.clone(), text).shown(Shown::Key);
    if part.side == Side::Below {
        return Some(
            text("a matching die below the plies")
                .expected("`side: above`: the scene's tool, which it closes over, is below"),
        );
    }
    if !part.place().only_moves() || part.translate.iter().any(|t| t.si() != 0.0) {
        return Some(
            text("a matching die has its place from the tool")
                .help("leave out `translate`, `up`, `rotate`, `centre` and `foot` of this part"),
        );
    }
    let Tool::DoubleDome(dome) = known.tool? else {
        return Some(text("the scene's tool is no `double_dome`").help(
            "only a double dome's die is made from its words; draw another one and give it as `tool: {stl: ..}`",
        ));
    };
    sizes(dome, die, path).or_else(|| {
        let (gap, thickness) = (die.gap.si(), stack_thickness(known)?);
        (gap < thickness * (1.0 - SAME)).then(|| {
            Fault::given(Rule::Press, path.key("gap"), mm(gap)).expected(format!(
                "a gap that the plies fit into, which are {} thick",
                mm(thickness)
            ))
        })
    })
}

/// Sizes of a die that make no block with a hollow and a rounded edge.
fn sizes(dome: &DoubleDomeTool, die: &MatchingDie, path: &Path) -> Option<Fault> {
    let fault = |key: &str, value: f64| Fault::given(Rule::Press, path.key(key), mm(value));
    for (key, value) in [
        ("gap", die.gap),
        ("edge_radius", die.edge_radius),
        ("length", die.length),
        ("width", die.width),
    ] {
        if !(value.si() > 0.0 && value.si().is_finite()) {
            return Some(fault(key, value.si()).expected("more than 0 mm"));
        }
    }
    let (gap, edge, face) = (die.gap.si(), die.edge_radius.si(), die.face.si());
    if !(face >= 0.0 && face + edge <= dome.wall.si() + SAME) {
        return Some(fault("face", face).expected(format!(
            "from 0 mm to the `wall` of the double dome ({}) less `edge_radius` ({}): the hollow's wall ends in the rounding",
            mm(dome.wall.si()),
            mm(edge)
        )));
    }
    if gap + edge >= dome.waist_radius.si() {
        return Some(fault("edge_radius", edge).expected(format!(
            "less than `waist_radius` ({}) less `gap`: there the rounding meets itself",
            mm(dome.waist_radius.si())
        )));
    }
    let least = least_block(dome, gap + edge);
    let sides = [
        ("length", die.length, least[0]),
        ("width", die.width, least[1]),
    ];
    let small = sides
        .into_iter()
        .find(|(_, value, least)| value.si() <= *least);
    small.map(|(key, value, least)| {
        fault(key, value.si()).expected(format!(
            "more than {}, what the hollow takes with its rounded edge",
            mm(least)
        ))
    })
}

/// Length and width (m) of the outline of a double dome with `around` (m) around it.
fn least_block(dome: &DoubleDomeTool, around: f64) -> [f64; 2] {
    let radius = dome.dome_radius.si() + around;
    [dome.dome_distance.si() + 2.0 * radius, 2.0 * radius]
}

/// Thickness of all sheets (m), where every material is known.
fn stack_thickness(known: &Known<'_>) -> Option<f64> {
    let thickness = |sheet: &&Sheet| match &sheet.material {
        MaterialEntry::Inline(material) => Some(material.thickness.si()),
        _ => None,
    };
    let all: Option<Vec<f64>> = known.whole_stack()?.iter().map(thickness).collect();
    all.map(|all| all.iter().sum())
}

/// A part beside a mirror plane must not move across it.
fn along_planes(known: &Known<'_>, part: &StampingPart, path: &Path) -> Option<Fault> {
    let across = |plane: &&MirrorPlane| {
        let k = usize::from(**plane == MirrorPlane::Y);
        part.outwards()[k].abs() > SAME
    };
    let plane = known.symmetry.iter().find(across)?;
    let word = plane.word();
    let text = format!("`{}` moves across the mirror plane {word} = 0", part.name);
    let fault = Fault::text(Rule::Symmetry, path.key("direction"), text);
    Some(fault.help(format!(
        "leave `{word}` out of `symmetry`, or let it move along the plane"
    )))
}

/// Rows begin at 0, grow, and end within the forming time.
fn times(rows: &[f64], path: &Path, end: f64) -> Option<Fault> {
    if rows.len() < 2 {
        let text = format!("the table has {}", row_count(rows.len()));
        let fault = Fault::text(Rule::Press, path.clone(), text);
        return Some(fault.expected("two or more, from `time: 0 s` on"));
    }
    let mut before = f64::NEG_INFINITY;
    for (k, time) in rows.iter().enumerate() {
        let expected = if k == 0 && *time != 0.0 {
            "`0 s` in the first row, where the process begins".to_owned()
        } else if time.is_nan() || *time <= before {
            format!("more than the {} of the row before", seconds(before))
        } else if *time > end * (1.0 + SAME) {
            format!("at most `forming_time` ({})", seconds(end))
        } else {
            before = *time;
            continue;
        };
        let fault = Fault::given(Rule::Press, path.item(k).key("time"), seconds(*time));
        return Some(fault.expected(expected));
    }
    None
}

/// A force that presses, or a spring.
fn press(pressed: &Pressed, path: &Path, end: f64, found: &mut Vec<Fault>) {
    let newtons = |f: f64| format!("{} N", si_number(f));
    let forces: Vec<(Path, f64)> = match &pressed.force {
        ForceCourse::Value(force) => vec![(path.key("force"), force.si())],
        ForceCourse::Course(course) => {
            let path = path.key("force").key("table");
            let rows: Vec<f64> = course.table.iter().map(|r| r.time.si()).collect();
            found.extend(times(&rows, &path, end));
            let rows = course.table.iter().enumerate();
            rows.map(|(k, r)| (path.item(k).key("force"), r.force.si()))
                .collect()
        }
    };
    if let Some((path, force)) = forces.iter().find(|f| !(f.1 >= 0.0 && f.1.is_finite())) {
        let fault = Fault::given(Rule::Press, path.clone(), newtons(*force));
        found.push(fault.expected("0 N or more: it presses towards the sheets"));
    }
    spring(pressed.spring, path, found);
    let pushes = pressed.spring.is_some_and(|s| s.si() > 0.0) || forces.iter().any(|f| f.1 > 0.0);
    if !pushes && !forces.is_empty() {
        let text = "neither a force nor a spring presses the part";
        let fault = Fault::text(Rule::Press, path.key("force"), text);
        found.push(fault.help("give a force of more than 0 N, or a `spring`"));
    }
    let travel = pressed.travel.map(|t| t.si());
    if let Some(travel) = travel.filter(|t| !(*t >= 0.0 && t.is_finite())) {
        let fault = Fault::given(Rule::Press, path.key("travel"), mm(travel));
        found.push(fault.expected("0 mm or more"));
    }
    if let Some(mass) = pressed
        .mass
        .filter(|m| !(m.si() > 0.0 && m.si().is_finite()))
    {
        let fault = Fault::given(
            Rule::Press,
            path.key("mass"),
            format!("{} kg", si_number(mass.si())),
        );
        found.push(fault.expected("more than 0 kg"));
    }
}

fn spring(spring: Option<ForcePerLength>, path: &Path, found: &mut Vec<Fault>) {
    if let Some(s) = spring.filter(|s| !(s.si() >= 0.0 && s.si().is_finite())) {
        let given = format!("{} N/m", si_number(s.si()));
        let fault = Fault::given(Rule::Press, path.key("spring"), given);
        found.push(fault.expected("0 N/m or more"));
    }
}

/// A gripper holds a place of a ply.
fn grips(known: &Known<'_>, gripper: &Gripper, path: &Path, found: &mut Vec<Fault>) {
    for (key, value) in [("length", gripper.length), ("width", gripper.width)] {
        if !(value.si() > 0.0 && value.si().is_finite()) {
            let fault = Fault::given(Rule::Press, path.key(key), mm(value.si()));
            found.push(fault.expected("more than 0 mm"));
        }
    }
    if !(gripper.force.si() >= 0.0 && gripper.force.si().is_finite()) {
        let given = format!("{} N", si_number(gripper.force.si()));
        let fault = Fault::given(Rule::Press, path.key("force"), given);
        found.push(fault.expected("0 N or more; `pull` says in which direction"));
    }
    spring(gripper.spring, path, found);
    if known.whole_stack().is_none() {
        return;
    }
    let plies = || known.plies().map(|(_, ply)| ply);
    let Some(ply) = plies().find(|ply| ply.name == gripper.ply) else {
        let names: Vec<String> = plies().map(|p| format!("`{}`", p.name)).collect();
        let text = format!("no ply of this scene is called `{}`", gripper.ply);
        let fault = Fault::text(Rule::Press, path.key("ply"), text);
        found.push(fault.expected(names.join(" or ")));
        return;
    };
    debug_assert!(ply.kind == SheetKind::Ply);
    let Ok(Some(region)) = ply.footprint() else {
        return;
    };
    let [x, y] = gripper.centre.map(|c| c.si());
    let [a, b] = [0.5 * gripper.length.si(), 0.5 * gripper.width.si()];
    let [x0, y0, x1, y1] = region.bounds();
    if x + a < x0 || x - a > x1 || y + b < y0 || y - b > y1 {
        let text = format!("the gripper holds no place of `{}`", ply.name);
        let fault = Fault::text(Rule::Press, path.key("centre"), text);
        found.push(fault.help("`centre` is a place over the tool, as the plies lie at the start; move it onto the ply"));
    }
}
