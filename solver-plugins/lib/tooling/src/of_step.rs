//! What other steps give to a scene: artifacts of the kind `geometry` at the input of that name.

use plyflow_model::artifact::Geometry as About;
use plyflow_model::given::{AskedFor, Geometry, GivenOutline, asks, fill};
use plyflow_model::outline::{MOST_CORNERS, Point};
use plyflow_model::scene::Scene;
use plyflow_model::tool::GivenSurface;
use plyflow_sdk::{Host, Input, Log, Meshes, StepError};

/// The input at which such artifacts arrive.
pub const PORT: &str = "geometry";

/// Most holes of an outline that are looked for.
const MOST_HOLES: usize = 10_000;

/// Puts what the artifacts at the input [`PORT`] hold into a scene that asks for it, and warns of those that it does not ask for anything.
///
/// # Errors
/// When something that the scene asks for is not there, or is not what it is to be.
pub fn read(host: &Host, scene: &mut Scene) -> Result<(), StepError> {
    let inputs = host.inputs_of(PORT)?;
    let asked = asks(scene);
    if asked.is_empty() && inputs.is_empty() {
        return Ok(());
    }
    let mut given = Vec::new();
    for input in &inputs {
        given.push(Given {
            input,
            meshes: host.meshes(input)?,
            about: host.attributes(input)?,
        });
    }
    for g in &given {
        let holds = |(_, asked): &(_, AskedFor)| g.holds(host, asked);
        if !asked.iter().any(holds) {
            host.log(Log::Warn, &g.unused());
        }
    }
    fill(scene, &All { host, given }).map_err(StepError::from)
}

/// One artifact.
struct Given<'a> {
    input: &'a Input,
    meshes: Meshes,
    about: About,
}

impl Given<'_> {
    fn holds(&self, host: &Host, asked: &AskedFor) -> bool {
        match asked {
            AskedFor::Body(name) => self.meshes.bodies.iter().any(|b| b.name == *name),
            AskedFor::Outline(name) => host.array_info(self.input, &outline(name)).is_some(),
        }
    }

    /// What to say where the scene asks for nothing of it.
    fn unused(&self) -> String {
        let bodies = self.meshes.bodies.iter();
        let bodies = bodies.map(|b| format!("`tool: {{input: {{body: {}}}}}`", b.name));
        let outlines = self.about.outlines.iter();
        let outlines = outlines.map(|o| format!("`outline: {{input: {o}}}`"));
        let words: Vec<String> = bodies.chain(outlines).collect();
        let words = match words.is_empty() {
            true => String::new(),
            false => format!(" ({})", words.join(", ")),
        };
        format!(
            "geometry: step `{}` is wired to `{PORT}`, and no word of the scene asks for anything of it{words}",
            self.input.step
        )
    }

    /// Its step, and where that is fanned out, its place there.
    fn step(&self) -> String {
        match self.input.item.is_empty() {
            true => self.input.step.clone(),
            false => format!("{}{:?}", self.input.step, self.input.item),
        }
    }
}

/// Path of the corners of an outline.
fn outline(name: &str) -> String {
    format!("outlines/{name}/outline")
}

/// All artifacts.
struct All<'a> {
    host: &'a Host,
    given: Vec<Given<'a>>,
}

impl All<'_> {
    /// The artifact that holds it.
    fn holder(&self, asked: &AskedFor) -> Result<&Given<'_>, String> {
        let mut holders = self.given.iter().filter(|g| g.holds(self.host, asked));
        match (holders.next(), holders.next()) {
            (Some(one), None) => Ok(one),
            (Some(one), Some(other)) => Err(format!(
                "the steps `{}` and `{}`, both wired to `{PORT}`, have {asked}; expected one of them: wire the other to another step, or give it \
                 another name there",
                one.step(),
                other.step()
            )),
            (None, _) => Err(self.none(asked)),
        }
    }

    fn none(&self, asked: &AskedFor) -> String {
        if self.given.is_empty() {
            return format!(
                "{asked} is to come from another step, and none is wired to `{PORT}`; expected `from: {{{PORT}: <step that gives `geometry`>}}`"
            );
        }
        let there = |g: &Given<'_>| {
            let names: Vec<String> = match asked {
                AskedFor::Body(_) => g.meshes.bodies.iter().map(|b| b.name.clone()).collect(),
                AskedFor::Outline(_) => g.about.outlines.clone(),
            };
            let names = match names.is_empty() {
                true if matches!(asked, AskedFor::Body(_)) => "no body".to_owned(),
                true => "no outline that it lists".to_owned(),
                false => names.join(", "),
            };
            format!("`{}` has {names}", g.step())
        };
        let there: Vec<String> = self.given.iter().map(there).collect();
        format!(
            "no step that is wired to `{PORT}` has {asked}; expected a name of one of them: {}",
            there.join("; ")
        )
    }

    /// Corners of a contour.
    fn corners(&self, given: &Given<'_>, path: &str) -> Result<Vec<Point>, String> {
        let step = given.step();
        let info = self.host.array_info(given.input, path);
        let shape: Vec<u64> = info.map_or(Vec::new(), |i| i.shape[..i.rank as usize].to_vec());
        let fits = matches!(shape[..], [n, 2] if n <= MOST_CORNERS as u64);
        if !fits {
            return Err(format!(
                "the array `{path}` of step `{step}` has the shape {shape:?}; expected [n, 2]: x and y (m) of n corners, of 3 to {MOST_CORNERS}"
            ));
        }
        let (values, _) =
            (self.host.array_f64(given.input, path)).map_err(|e| e.text().to_owned())?;
        let corners = values.as_chunks::<2>().0.to_vec();
        match corners
            .iter()
            .position(|p| p.iter().any(|c| !c.is_finite()))
        {
            Some(k) => Err(format!(
                "corner {k}, counted from 0, of the array `{path}` of step `{step}` is ({}, {}); expected finite numbers (m)",
                corners[k][0], corners[k][1]
            )),
            None => Ok(corners),
        }
    }
}

impl Geometry for All<'_> {
    fn body(&self, name: &str) -> Result<GivenSurface, String> {
        let given = self.holder(&AskedFor::Body(name.into()))?;
        let (step, text) = (given.step(), |e: StepError| e.text().to_owned());
        let body = given.meshes.body(name).map_err(text)?;
        if body.nodes_per_cell != 3 {
            return Err(format!(
                "the cells of the body `{name}` of step `{step}` have {} nodes; expected triangles: split its quads in the step",
                body.nodes_per_cell
            ));
        }
        let (points, cells) = self.host.mesh(given.input, body).map_err(text)?;
        Ok(GivenSurface {
            step,
            points,
            triangles: cells.as_chunks::<3>().0.to_vec(),
        })
    }

    fn outline(&self, name: &str) -> Result<GivenOutline, String> {
        let given = self.holder(&AskedFor::Outline(name.into()))?;
        let hole = |i: usize| format!("outlines/{name}/hole_{i}");
        let there = |i: &usize| self.host.array_info(given.input, &hole(*i)).is_some();
        let holes = (0..MOST_HOLES).take_while(there);
        Ok(GivenOutline {
            step: given.step(),
            outline: self.corners(given, &outline(name))?,
            holes: holes
                .map(|i| self.corners(given, &hole(i)))
                .collect::<Result<_, _>>()?,
        })
    }
}
