//! The files of a new study.

use super::part::Part;
use super::plies::{Book, Plies};
use super::sizes;
use super::words::{mm, quoted};
use crate::cli::args::StudyProcess;
use std::fmt::Write;

/// A study that is to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// Its name.
    pub name: String,
    /// The tool's file, from the study's folder.
    pub tool: String,
    /// One unit of it, as a scene writes it.
    pub unit: String,
    /// What the file tells.
    pub part: Part,
    /// The plies.
    pub plies: Plies,
    /// Their material file, from the study's folder; of a book that of rows without one.
    pub material: String,
    /// Thickness (m) of the thickest and areal mass (kg/m2) of the lightest material, where they are known.
    pub sheet: [Option<f64>; 2],
    /// Angle from the first fibres of that material to its second ones (deg).
    pub crossing: f64,
    /// Direction of each ply's first fibres (deg), where they are of no book.
    pub angles: Vec<f64>,
    /// How it is formed.
    pub process: StudyProcess,
}

/// Of files that do not say their unit.
const NO_UNIT: &str =
    "A guess: `unit`, as a drawing does not say in which unit it is. It is the tool's.";

/// The films' material file, from the study's folder.
pub const FILM: &str = "materials/stretchlon-ht350.yaml";

/// A comment of lines no longer than a page is wide.
fn comment(indent: usize, text: &str) -> String {
    const WIDTH: usize = 120;
    let begin = format!("{}#", " ".repeat(indent));
    let (mut out, mut line) = (String::new(), begin.clone());
    for word in text.split_whitespace() {
        if line.len() > begin.len() && line.len() + 1 + word.chars().count() > WIDTH {
            out += &(std::mem::replace(&mut line, begin.clone()) + "\n");
        }
        line += &format!(" {word}");
    }
    out + &line + "\n"
}

impl Study {
    /// `scene.yaml`.
    pub fn scene(&self) -> String {
        let mut text = comment(
            0,
            "Written by `plyflow new study`. What a comment calls a guess is to be replaced by what is known.",
        );
        let _ = writeln!(text, "plyflow_scene: 1\nname: {}\n\ntool:", self.name);
        text += &self.tool_text();
        text += "\nsheets:                     # from the tool upwards\n";
        let film =
            |name: &str| format!("  - {{name: {name}, kind: diaphragm, material: {FILM}}}\n");
        if self.process == StudyProcess::DoubleDiaphragm {
            text += &film("lower_film");
        }
        text += &match &self.plies {
            Plies::Book(book) => self.book(book),
            _ => self.listed(),
        };
        text += &match self.process {
            StudyProcess::DoubleDiaphragm => film("upper_film"),
            StudyProcess::SingleDiaphragm => film("film"),
            StudyProcess::Press => String::new(),
        };
        text + "\n"
            + &if self.process.has_films() {
                self.bag()
            } else {
                self.press()
            }
    }

    /// A ply for each angle.
    fn listed(&self) -> String {
        let mut text = String::new();
        let size = match &self.plies {
            Plies::Drawn {
                file, layer, unit, ..
            } => {
                let mut words = vec![format!("file: {}", quoted(file))];
                words.extend(layer.iter().map(|l| format!("layer: {}", quoted(l))));
                words.extend(unit.iter().map(|u| format!("unit: {u}")));
                words.push("centred: true".to_owned());
                if unit.is_some() {
                    text += &comment(2, NO_UNIT);
                }
                text += &comment(
                    2,
                    "The middle of the outline is moved to (0, 0); `centre` of a ply moves it over the tool.",
                );
                format!("outline: {{drawing: {{{}}}}}", words.join(", "))
            }
            plies => {
                let [length, width] = plies.extent(self.part.size).0;
                format!("length: {}\n    width: {}", mm(length), mm(width))
            }
        };
        for (k, angle) in self.angles.iter().enumerate() {
            let _ = write!(
                text,
                "  - name: ply_{}\n    kind: ply\n    material: {}\n    {size}\n    fibre_1: {angle} deg\n    fibre_2: {} deg\n",
                k + 1,
                quoted(&self.material),
                (1e6 * (angle + self.crossing)).round() / 1e6
            );
        }
        text
    }

    /// The plies of a book.
    fn book(&self, book: &Book) -> String {
        let mut text = comment(
            2,
            "The plies of the book, its first row nearest to the tool. Angles count from x, counter-clockwise as seen from above.",
        );
        let _ = writeln!(text, "  - plies:\n      book: {}", quoted(&book.file));
        if let Some(material) = &book.material {
            text += &comment(6, "Of rows without a material.");
            let _ = writeln!(text, "      material: {}", quoted(material));
        }
        if !book.materials.is_empty() {
            let names = book.materials.iter();
            let names: Vec<String> = names
                .map(|(n, f)| format!("{}: {}", quoted(n), quoted(f)))
                .collect();
            text += &comment(6, "What the names of the book stand for.");
            let _ = writeln!(text, "      materials: {{{}}}", names.join(", "));
        }
        if let Some([length, width]) = book.size {
            text += &comment(6, "Of rows without an outline.");
            let _ = writeln!(
                text,
                "      length: {}\n      width: {}",
                mm(length),
                mm(width)
            );
        }
        if let Some(unit) = &book.unit {
            text += &comment(6, NO_UNIT);
            let _ = writeln!(text, "      unit: {unit}");
        }
        if let Some([x, y]) = book.read.centre(self.part.size) {
            text += &comment(
                6,
                "A guess: the plies are drawn elsewhere, so the middle of the box around them is moved over the middle of the tool.",
            );
            let _ = writeln!(text, "      centre: [{}, {}]", mm(x), mm(y));
        }
        text
    }

    fn tool_text(&self) -> String {
        let [x, y, z] = self.part.size.map(|s| mm((1e5 * s).round() * 1e-5));
        let mut told = format!("In its place it is {x} long, {y} wide and {z} high.");
        if self.part.undercut > 0.05 {
            let _ = write!(
                told,
                " Whichever way it is turned, {:.0} % of it overhangs at least, as seen from above: see whether `up` is right.",
                100.0 * self.part.undercut
            );
        }
        if self.part.sharp {
            told += " It has edges that are not rounded; a ply takes a small radius there.";
        }
        let mut words = vec![
            format!("file: {}", quoted(&self.tool)),
            format!("unit: {}", self.unit),
        ];
        words.extend(self.part.words.iter().cloned());
        comment(2, &told) + &format!("  stl: {{{}}}\n", words.join(", "))
    }

    fn bag(&self) -> String {
        let (extent, least) = self.plies.extent(self.part.size);
        let (frame, reason) = sizes::frame(&self.part, extent);
        let (elements, _) = sizes::elements(&self.part, least);
        let [lowering, drawing] = sizes::durations(&self.part);
        let single = self.process == StudyProcess::SingleDiaphragm;
        let mut text = comment(
            0,
            match single {
                true => {
                    "A guess: coefficients of a dry film and a dry fabric on each other and on aluminium."
                }
                false => "A guess: coefficients of a dry film on fabric and aluminium.",
            },
        );
        text += match single {
            true => {
                "friction: {tool_diaphragm: 0.51, tool_fabric: 0.23, fabric_diaphragm: 0.40, fabric_fabric: 0.35}\n\nprocess:\n  single_diaphragm:\n"
            }
            false => {
                "friction: {tool_diaphragm: 0.51, fabric_diaphragm: 0.40, fabric_fabric: 0.35, diaphragm_diaphragm: 0.32}\n\nprocess:\n  double_diaphragm:\n"
            }
        };
        text += &comment(4, &format!("A guess: {}.", reason.why));
        let _ = writeln!(
            text,
            "    frame_length: {}\n    frame_width: {}",
            mm(frame[0]),
            mm(frame[1])
        );
        text += match single {
            true => "    forming_pressure: 1 bar\n    clearance: 5 mm\n",
            false => "    bag_pressure: 1 bar\n    forming_pressure: 1 bar\n    clearance: 5 mm\n",
        };
        text += &comment(
            4,
            &format!(
                "Durations are not those of the workshop, but long enough for inertia not to matter (`kinetic_ratio`): {}.",
                lowering.why
            ),
        );
        let first = if single {
            "stretching_time: 40 ms"
        } else {
            "bagging_time: 80 ms"
        };
        let _ = write!(
            text,
            "    {first}\n    lowering_time: {}\n    drawing_time: {}\n    settling_time: 40 ms\n    film_pre_stretch: 0.01\n",
            lowering.value, drawing.value,
        );
        if single {
            text += &comment(4, "What holds the plies on the tool before the film does.");
            text += "    weight: tool\n";
        } else {
            let margin = mm((4.0 * elements.whole).max(0.03));
            let _ = writeln!(text, "    film_joint_margin: {margin}");
        }
        text
    }

    fn press(&self) -> String {
        let plies = match &self.plies {
            Plies::Book(book) => book.read.rows.len() as f64,
            _ => self.angles.len() as f64,
        };
        let thickness = self.sheet[0].unwrap_or(1e-3);
        // Rounded up to half a millimetre.
        let up = |m: f64| (2e3 * m - 1e-6).ceil() * 0.5e-3;
        let opening = up(self.part.reach + 1.5 * plies * thickness);
        let mut text = comment(0, "A guess: coefficients of a dry fabric on steel.");
        text += "friction: {tool_fabric: 0.23, fabric_fabric: 0.36}\n\nprocess:\n  press:\n";
        text += &comment(4, "All of the tool goes through the die.");
        let _ = writeln!(text, "    stroke: {}", mm(self.part.size[2]));
        text += &comment(4, "8 ms for each mm of the stroke.");
        let _ = writeln!(
            text,
            "    forming_time: {} ms\n    settling_time: 50 ms",
            (8e3 * self.part.size[2]).round()
        );
        text += &comment(
            4,
            "A guess: a round hole, as wide as the tool with its plies needs, and a holder that leaves half a millimetre.",
        );
        let _ = write!(
            text,
            "    die: {{opening_radius: {}, edge_radius: 6 mm}}\n    holder: {{hold: {{gap: {}}}}}\n",
            mm(opening),
            mm(up(plies * thickness + 5e-4))
        );
        text
    }

    /// `workflow.yaml`.
    pub fn workflow(&self) -> String {
        let mut text = comment(
            0,
            "Written by `plyflow new study`. Run it step by step (`--until`), look, and then go on: what is done is not done again.",
        );
        let _ = write!(text, "plyflow: 1\nname: {}\n\nsteps:\n", self.name);
        text + &match self.process.has_films() {
            true => self.bag_steps(),
            false => self.press_steps(),
        }
    }

    fn drape(&self, size: &str) -> String {
        comment(
            2,
            "In a second: geometry alone shows where the plies shear, and whether the tool stands as it should.",
        ) + &format!(
            "  drape:\n    plugin: forming-kinematic\n    with: {{scene: scene.yaml, element_size: {size}}}\n"
        )
    }

    fn bag_steps(&self) -> String {
        let least = self.plies.extent(self.part.size).1;
        let (_, [whole, zone]) = sizes::elements(&self.part, least);
        let mut text = self.drape(&whole.value);
        text += &comment(
            2,
            &format!(
                "In about a minute: the whole part in membranes, which do not bend. element_size: {}.",
                whole.why
            ),
        );
        let _ = writeln!(
            text,
            "  coarse:\n    plugin: forming-explicit\n    with: {{scene: scene.yaml, element: m4, element_size: {}}}",
            whole.value
        );
        text += &comment(
            2,
            "Where the plies are sheared too far or stand off the tool, and a rectangle around each such place.",
        );
        text += "  defects:\n    plugin: defect-detection\n    from: {formed: coarse}\n  zones:\n    plugin: zone-extraction\n    from: {defects: defects}\n";
        text += &comment(
            2,
            &format!(
                "In minutes: each zone in shells, which bend and can wrinkle. element_size: {}.",
                zone.why
            ),
        );
        let _ = write!(
            text,
            "  boundary:\n    plugin: boundary-interpolation\n    for_each: {{zone: zones}}\n    from: {{formed: coarse, zones: zones}}\n    with: {{element_size: {}, cut_stiffness: 10 MPa}}\n\
             \x20 local:\n    plugin: forming-explicit\n    for_each: {{zone: zones}}\n    from: {{boundary: boundary}}\n    with: {{scene: scene.yaml, element: rf4}}\n\
             \x20 comparison:\n    plugin: comparison\n    from: {{global: coarse, zones: zones, local: local, others: drape}}\n",
            zone.value
        );
        text + &expected(&[
            (
                "[coarse, local]",
                "kinetic_ratio",
                "0.05",
                "kinetic under 5 % of internal energy",
            ),
            (
                "[coarse, local]",
                "drift_ratio",
                "0.05",
                "5 % of the work unaccounted for; 1 % for a run that is to be trusted",
            ),
            (
                "coarse",
                "fibre_strain_max",
                "0.01",
                "fibre strain under 1 %",
            ),
        ])
    }

    fn press_steps(&self) -> String {
        let least = self.plies.extent(self.part.size).1;
        let (elements, [whole, _]) = sizes::elements(&self.part, least);
        let size = elements.zone.max(0.5 * elements.whole);
        let mass = self.sheet[1].unwrap_or(0.5);
        let mut text = self.drape(&whole.value);
        text += &comment(
            2,
            &format!(
                "In minutes: the whole part in shells. element_size: half of {}, {}. No mass is added, so the time step \
                 follows the elements; hourglass_floor: 0 N/m would be right for a woven fabric.",
                whole.value, whole.why
            ),
        );
        let _ = write!(
            text,
            "  formed:\n    plugin: forming-explicit\n    with:\n      scene: scene.yaml\n      element: {{plugin: rf4, with: {{hourglass_floor: 100 N/m, thickening: 2}}}}\n      \
             element_size: {}\n      time_step: {} us\n      least_areal_mass: {mass} kg/m2\n      contact_augmentation: 0\n\
             \x20 defects:\n    plugin: defect-measurement\n    from: {{formed: formed}}\n",
            mm(size),
            // What the hemisphere's ply of the same kind is run with.
            (5e3 * size).round() / 10.0
        );
        text + &expected(&[(
            "formed",
            "kinetic_ratio",
            "0.05",
            "kinetic under 5 % of internal energy",
        )])
    }
}

/// The bounds of a workflow: step, result, at most, and why.
fn expected(all: &[(&str, &str, &str, &str)]) -> String {
    let one = |(step, result, bound, why): &(&str, &str, &str, &str)| {
        format!(
            "  - {{step: {step}, result: {result}, maximum: {bound}, source: \"own bound: {why}\"}}\n"
        )
    };
    format!("\nexpect:\n{}", all.iter().map(one).collect::<String>())
}
