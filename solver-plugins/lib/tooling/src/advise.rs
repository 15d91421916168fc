//! What words would put a tool that is refused in its place: found by trying them.

use crate::checks::{checks, speck, thinnest_ply};
use crate::mesh::ToolMesh;
use crate::{input, stl};
use plyflow_geometry::vec3::Vec3;
use plyflow_model::scene::{Scene, SheetKind, Tool};
use plyflow_model::tool::place::{Auto, Axis, Centre, Direction, Foot, Place, Rotation};
use plyflow_model::tool::placed::Placed;
use plyflow_model::tool::stand::{Stand, stands};
use plyflow_model::units::{Angle, Length, si_number};
use std::f64::consts::FRAC_PI_2;

/// Units that files have, the likeliest first: (m), and as it is written.
const UNITS: [(f64, &str); 5] = [
    (1e-3, "1 mm"),
    (0.0254, "1 in"),
    (1e-2, "1 cm"),
    (1.0, "1 m"),
    (0.3048, "1 ft"),
];

/// Most placements that are tried out on all of a tool's triangles.
const MOST_TRIED: usize = 6;

/// Times that the largest ply is as long as a tool whose unit is guessed, at least and at most.
const LIKELY: [f64; 2] = [0.6, 4.0];

/// A tool of facets that somebody else made.
struct Given<'a> {
    scene: &'a Scene,
    facets: Vec<[Vec3; 3]>,
    unit: f64,
    place: Place,
}

/// A placement that may do.
#[derive(Debug, Clone, PartialEq)]
struct Candidate {
    unit: f64,
    place: Place,
}

/// What to say of a placement with which a scene's tool passes all checks; `None` without one, and of a tool that is made from parameters. To be
/// asked of a tool that does not pass as it is; `spacing` (m) as for the checks.
pub(crate) fn advice(scene: &Scene, spacing: f64) -> Option<String> {
    let (facets, unit, place) = match &scene.tool {
        Tool::Stl(t) => (stl::facets(&t.file).ok()?, t.unit.si(), t.place()),
        Tool::Input(t) => (input::facets(t)?, 1.0, t.place()),
        _ => return None,
    };
    let given = Given {
        scene,
        facets,
        unit,
        place,
    };
    let mut likely = given.candidates(spacing).into_iter().take(MOST_TRIED);
    let (found, size) = likely.find_map(|candidate| {
        let mut scene = scene.clone();
        scene.tool = candidate.of(&scene.tool);
        let mesh = checks(&scene, spacing).ok()?;
        let [low, high] = mesh.bounds();
        Some((scene.tool, [0, 1, 2].map(|k| high[k] - low[k])))
    })?;
    let [x, y, z] = size.map(|s| si_number((s * 1e5).round() / 1e2));
    Some(format!(
        ". This would do: `tool: {}`; it is {x} mm long, {y} mm wide and {z} mm high then",
        words(&found)
    ))
}

impl Given<'_> {
    /// What may do by its box and by what overhangs, the least changed first.
    fn candidates(&self, spacing: f64) -> Vec<Candidate> {
        let mut all = Vec::new();
        for unit in self.units() {
            for (up, rotate) in self.ways_up() {
                for (turned, centre) in [(false, false), (false, true), (true, true)] {
                    let mut place = self.place.clone();
                    (place.up, place.rotate) = (up, rotate.clone());
                    if turned {
                        place.rotate = Some(Rotation::AboutZ(Angle(FRAC_PI_2)));
                    }
                    if centre {
                        place.centre = Some(Centre::Auto(Auto::Auto));
                    }
                    if self.scene.process.frame().is_some() || centre {
                        place.foot = Some(Foot::Auto);
                    }
                    // Nothing of it is left where both are found.
                    if place.centre.is_some() && place.foot.is_some() {
                        place.translate = [0.0; 3];
                    }
                    let candidate = Candidate { unit, place };
                    if self.fits(&candidate, spacing) && !all.contains(&candidate) {
                        all.push(candidate);
                    }
                }
            }
        }
        all
    }

    /// The unit as it is; of a file then others.
    fn units(&self) -> Vec<f64> {
        let others = UNITS.iter().map(|u| u.0).filter(|u| *u != self.unit);
        let of_file = matches!(self.scene.tool, Tool::Stl(_));
        let others = others.filter(|_| of_file);
        std::iter::once(self.unit).chain(others).collect()
    }

    /// Ways up with about the least overhang, with how it is turned then: as it is first, if that is one.
    fn ways_up(&self) -> Vec<(Option<Direction>, Option<Rotation>)> {
        let own = self.place.turn()[2];
        let own = Stand::of(&self.facets, own);
        let all = stands(&self.facets);
        let least = all.first().map_or(0.0, |(_, s)| s.undercut);
        let few = |s: &Stand| s.undercut <= least + 0.02;
        let others = all.iter().filter(|(_, s)| few(s) && s.up != own.up);
        let others = others.map(|(axis, _)| (Some(Direction::Axis(*axis)), None));
        let own = few(&own).then(|| (self.place.up, self.place.rotate.clone()));
        own.into_iter().chain(others).collect()
    }

    /// Whether a tool that is put like that fits into the frame, is no speck, and beside the plies of a likely unit.
    fn fits(&self, candidate: &Candidate, spacing: f64) -> bool {
        let Some(placed) = Placed::of(
            &candidate.place,
            candidate.unit,
            self.facets.as_flattened().iter(),
        ) else {
            return false;
        };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in self.facets.as_flattened() {
            let p = placed.put(*p);
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        let size: Vec3 = std::array::from_fn(|k| high[k] - low[k]);
        if speck(size, spacing) || size[2] < thinnest_ply(self.scene).min(1e-3) {
            return false;
        }
        let process = &self.scene.process;
        if let Some(frame) = process.frame().filter(|_| !process.is_without_bed()) {
            let inside = |k: usize| low[k] > -0.5 * frame[k] && high[k] < 0.5 * frame[k];
            if !(0..2).all(inside) {
                return false;
            }
        }
        candidate.unit == self.unit || self.is_likely(size[0].max(size[1]))
    }

    /// Whether a tool of that length (m) goes with the plies.
    fn is_likely(&self, length: f64) -> bool {
        let plies = self.scene.sheets.iter();
        let plies = plies.filter(|s| s.kind == SheetKind::Ply);
        let boxes = plies.filter_map(|s| Some(s.footprint().ok()??.bounds()));
        let ply = boxes
            .map(|[x0, y0, x1, y1]| (x1 - x0).max(y1 - y0))
            .fold(0.0, f64::max);
        ply == 0.0 || (LIKELY[0]..=LIKELY[1]).contains(&(ply / length))
    }
}

impl Candidate {
    /// A tool with these words.
    fn of(&self, tool: &Tool) -> Tool {
        let Place {
            translate,
            up,
            rotate,
            centre,
            foot,
        } = self.place.clone();
        let translate = translate.map(Length);
        let mut tool = tool.clone();
        match &mut tool {
            Tool::Stl(t) => {
                t.unit = Length(self.unit);
                (t.translate, t.up, t.rotate) = (translate, up, rotate);
                (t.centre, t.foot) = (centre, foot);
            }
            Tool::Input(t) => {
                (t.translate, t.up, t.rotate) = (translate, up, rotate);
                (t.centre, t.foot) = (centre, foot);
            }
            _ => {}
        }
        tool
    }
}

/// A tool of a file or of another step, as a scene has it in one line.
fn words(tool: &Tool) -> String {
    let (kind, mut all, place) = match tool {
        Tool::Stl(t) => {
            let unit = UNITS.iter().find(|u| u.0 == t.unit.si());
            let unit = unit.map_or_else(|| t.unit.to_string(), |u| u.1.to_owned());
            let all = vec![
                format!("file: {}", quoted(&t.file)),
                format!("unit: {unit}"),
            ];
            ("stl", all, t.place())
        }
        Tool::Input(t) => {
            let all = vec![format!("body: {}", quoted(&t.body))];
            ("input", all, t.place())
        }
        _ => return String::new(),
    };
    if place.translate != [0.0; 3] {
        let [x, y, z] = place.translate.map(|t| si_number(1e3 * t));
        all.push(format!("translate: [{x} mm, {y} mm, {z} mm]"));
    }
    all.extend(place.up.map(|up| format!("up: {}", direction(&up))));
    all.extend(place.rotate.as_ref().map(|r| match r {
        Rotation::AboutZ(angle) => format!("rotate: {}", degrees(*angle)),
        Rotation::Turns(turns) => {
            let turns = turns.iter().map(|t| {
                let (axis, angle) = (direction(&t.axis), degrees(t.angle));
                format!("{{axis: {axis}, angle: {angle}}}")
            });
            format!("rotate: [{}]", turns.collect::<Vec<_>>().join(", "))
        }
    }));
    all.extend(place.centre.map(|centre| match centre {
        Centre::Auto(_) => "centre: auto".to_owned(),
        Centre::At(at) => {
            let [x, y] = at.map(|c| si_number(1e3 * c.si()));
            format!("centre: [{x} mm, {y} mm]")
        }
    }));
    all.extend(place.foot.map(|foot| match foot {
        Foot::Auto => "foot: auto".to_owned(),
        Foot::At(z) => format!("foot: {} mm", si_number(1e3 * z.si())),
    }));
    format!("{{{kind}: {{{}}}}}", all.join(", "))
}

fn direction(direction: &Direction) -> String {
    match direction {
        Direction::Axis(axis) => axis.word().to_owned(),
        Direction::Vector(v) => format!("[{}]", v.map(|c| si_number(c.0)).join(", ")),
    }
}

fn degrees(angle: Angle) -> String {
    // What ninety degrees come to and back is not always ninety.
    format!(
        "{} deg",
        si_number((angle.si().to_degrees() * 1e9).round() / 1e9)
    )
}

/// A text as YAML has it in a mapping in one line.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./".contains(c);
    match !text.is_empty() && text.chars().all(plain) {
        true => text.to_owned(),
        false => format!("{text:?}"),
    }
}

/// What to say of a tool of facets that would clearly be formed over better another way up: `mesh` is it as it is placed.
pub fn other_way_up(scene: &Scene, mesh: &ToolMesh) -> Option<String> {
    let place = match &scene.tool {
        Tool::Stl(t) => t.place(),
        Tool::Input(t) => t.place(),
        _ => return None,
    };
    let facets: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
    let own = Stand::of(&facets, Axis::PlusZ.vector());
    let (axis, best) = *stands(&facets).first()?;
    if !own.is_worse_than(&best) {
        return None;
    }
    // The direction as its file has it.
    let turn = place.turn();
    let z = axis.vector();
    let up: Vec3 = std::array::from_fn(|k| (0..3).map(|j| turn[j][k] * z[j]).sum());
    let close = |a: &Axis| (0..3).all(|k| (a.vector()[k] - up[k]).abs() < 1e-9);
    let up = match Axis::ALL.iter().find(|a| close(a)) {
        Some(axis) => axis.word().to_owned(),
        None => format!("[{}]", up.map(|c| format!("{c:.6}")).join(", ")),
    };
    let share = |s: &Stand| (100.0 * s.undercut).round();
    Some(format!(
        "scene.tool: {} % of it, as seen from above, overhangs, where no sheet can be laid on it; with `up: {up}` it would be {} %: does it stand on \
         its head?",
        share(&own),
        share(&best)
    ))
}
