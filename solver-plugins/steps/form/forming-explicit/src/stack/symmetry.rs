//! Mirror symmetry of a scene: which planes, whether everything is its own mirror image, and how fields are mirrored.
//!
//! In a plane that is square to one fibre family, both families are their own mirror images and shear changes its sign; at
//! 45 degrees to them the plane exchanges the families and shear keeps its sign.

use crate::error::{FormingError, Result};
use crate::stack::sheet::StackSheet;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::LANES;
use plyflow_mechanics::component::{ElementInstance, MaterialInstance};
use plyflow_mechanics::mirror::{Planes, reflect};
use plyflow_mechanics::sheet::Aligned;
use plyflow_model::rules;
use plyflow_model::scene::{Families, MirrorPlane, Scene, first_axis};
use plyflow_sdk::{BendingBatch, MembraneBatch};
use plyflow_tooling::{SurfaceTree, ToolMesh};

/// How far (share of the box's diagonal) a tool's corners may lie from its mirror image: facets follow the same surface
/// with other chords on either side.
const TOOL_APART: f64 = 1e-4;
/// Largest difference of mirrored responses of a material, over its largest response.
const RESPONSE_APART: f64 = 1e-9;

/// The planes of a scene.
pub fn planes(scene: &Scene) -> Planes {
    let has = |plane| scene.symmetry.contains(&plane);
    Planes([has(MirrorPlane::X), has(MirrorPlane::Y)])
}

/// The mirror planes of a model.
pub fn mirror_planes(planes: Planes) -> Vec<MirrorPlane> {
    let all = [MirrorPlane::X, MirrorPlane::Y].into_iter().zip(planes.0);
    all.filter(|p| p.1).map(|p| p.0).collect()
}

fn given(planes: Planes) -> String {
    let words = mirror_planes(planes).into_iter().map(MirrorPlane::word);
    format!("symmetry: [{}]", words.collect::<Vec<_>>().join(", "))
}

/// What the planes of a scene do to the fibre families of a sheet.
///
/// # Errors
/// When its fibres lie askew to them.
pub fn families(sheet: &StackSheet) -> Result<Families> {
    Ok(rules::symmetry::families(&sheet.scene)?)
}

/// The mirror image of components 11, 22 and 12 (of a metric, a curvature, a stress or a moment).
fn image_of(families: Families, [a, b, c]: [f64; 3]) -> [f64; 3] {
    match families {
        Families::Kept => [a, b, -c],
        Families::Exchanged => [b, a, c],
    }
}

/// Whether the triangles of a tool are their own mirror images. Frame, bed, die and holder always are; materials are looked at where
/// they are made, all else by the rules of scenes.
///
/// # Errors
/// Which point has no image, and how far it is off.
pub fn check_tool(planes: Planes, tool: &ToolMesh) -> Result<()> {
    let [low, high] = tool.bounds();
    let most = TOOL_APART * norm(sub(high, low));
    let tree = SurfaceTree::new(tool);
    for k in (0..2).filter(|k| planes.0[*k]) {
        let off = |p: &Vec3| {
            let image = reflect(*p, [k == 0, k == 1]);
            (norm(sub(tree.closest(image).point, image)), *p)
        };
        let worst = tool
            .points
            .iter()
            .map(off)
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((apart, at)) = worst
            && apart > most
        {
            let plane = ["x", "y"][k];
            let [x, y, z] = at.map(|c| 1e3 * c);
            return Err(FormingError::Symmetry(format!(
                "{}: the tool is not its own mirror image in the plane {plane} = 0: the image of its point ({x:.1}, {y:.1}, \
                 {z:.1}) mm lies {:.3} mm off its surface; expected at most {:.3} mm. Leave `{plane}` out of `symmetry`",
                given(planes),
                1e3 * apart,
                1e3 * most
            )));
        }
    }
    Ok(())
}

/// Whether the material of a sheet answers mirrored strains with the mirrored stresses, and where its element bends mirrored
/// curvatures with the mirrored moments.
///
/// # Errors
/// Which answer differs, by how much, and what to do.
pub fn check_material(element: &ElementInstance, sheet: &StackSheet, planes: Planes) -> Result<()> {
    if !planes.any() {
        return Ok(());
    }
    let material = &*element.material;
    let families = families(sheet)?;
    let refuse = |what: &str, share: f64| {
        let (how, other) = match families {
            Families::Kept => (
                "it differs with the sign of shear or twist",
                "at 45 deg to them",
            ),
            Families::Exchanged => ("its two fibre families differ", "along x and y"),
        };
        FormingError::Symmetry(format!(
            "{}: material '{}' of sheet '{}' is not its own mirror image: its {what} differs by {:.1} % ({how}). Leave out \
             `symmetry`, or lay the fibres {other} if the material allows that",
            given(planes),
            sheet.material.name,
            sheet.scene.name,
            1e2 * share
        ))
    };
    let apart = membrane_apart(material, families)?;
    if apart > RESPONSE_APART {
        return Err(refuse("stress in the plane", apart));
    }
    let bends = element.sizes.patch_nodes > 0 || element.rotates();
    if bends && material.reference().sizes().has_bending {
        let apart = bending_apart(material, families)?;
        if apart > RESPONSE_APART {
            return Err(refuse("bending moment", apart));
        }
    }
    Ok(())
}

/// Whether the material of a ply whose fibres the scene names clockwise treats its two families alike: its first family lies along the
/// axis that the other follows counter-clockwise ([`first_axis`](plyflow_model::scene::first_axis)), here the scene's second one.
///
/// # Errors
/// When it does not, and what to write instead.
pub fn check_order(element: &ElementInstance, sheet: &StackSheet) -> Result<()> {
    // The second family of a steered ply follows the first one everywhere.
    let clockwise = |[first, second]: &[f64; 2]| first_axis(*first, *second) != *first;
    let Some(fibres) = sheet.scene.fibres().filter(clockwise) else {
        return Ok(());
    };
    let material = &*element.material;
    let in_plane = membrane_apart(material, Families::Exchanged)?;
    let bends = material.reference().sizes().has_bending;
    let bending = match bends {
        true => bending_apart(material, Families::Exchanged)?,
        false => 0.0,
    };
    if in_plane.max(bending) <= RESPONSE_APART {
        return Ok(());
    }
    let [first, second] = fibres.map(f64::to_degrees);
    Err(FormingError::Symmetry(format!(
        "sheet '{}': fibre_2 ({second:.1} deg) lies clockwise from fibre_1 ({first:.1} deg), and material '{}' tells its families apart: its first \
         would lie along fibre_2. Expected fibre_2 a quarter turn counter-clockwise from fibre_1: for the stitch on the same side write \
         fibre_1: {second:.1} deg, fibre_2: {first:.1} deg and exchange the families in the material (`family_1` and `family_2`; with \
         `families: opposite` the other `positive_face`); without a stitch fibre_2: {:.1} deg",
        sheet.scene.name,
        sheet.material.name,
        first + 90.0
    )))
}

/// Samples; as many lanes hold their mirror images.
const SAMPLES: usize = LANES / 2;
/// States on the way to each sample, for materials that remember.
const STATES: usize = 4;

/// A number between -1 and 1, another one for every `k` and `row`.
fn spread(k: usize, row: usize) -> f64 {
    let t = (k as f64 + 1.0) * [0.754_877_666, 0.569_840_291, 0.430_159_709][row];
    2.0 * (t - t.floor()) - 1.0
}

/// Rows of samples and their images.
fn rows(families: Families, sample: impl Fn(usize) -> [f64; 3]) -> Aligned {
    let mut values = Aligned::zeros(3 * LANES);
    for k in 0..SAMPLES {
        let own = sample(k);
        let image = image_of(families, own);
        for r in 0..3 {
            values[r * LANES + k] = own[r];
            values[r * LANES + SAMPLES + k] = image[r];
        }
    }
    values
}

/// Largest difference of the images of the first lanes' answers from the others' answers, over the largest answer.
fn difference(families: Families, answers: &[f64], energy: &[f64]) -> f64 {
    let lane = |k: usize| [0, 1, 2].map(|r| answers[r * LANES + k]);
    let mut apart = [0.0f64; 4];
    let mut size = [f64::MIN_POSITIVE; 4];
    for k in 0..SAMPLES {
        let (image, other) = (image_of(families, lane(k)), lane(SAMPLES + k));
        for r in 0..3 {
            apart[r] = apart[r].max((image[r] - other[r]).abs());
            size[r] = size[r].max(image[r].abs()).max(other[r].abs());
        }
        apart[3] = apart[3].max((energy[k] - energy[SAMPLES + k]).abs());
        size[3] = size[3].max(energy[k].abs());
    }
    let of = |r: usize| {
        if apart[r].is_nan() {
            f64::INFINITY
        } else {
            apart[r] / size[r]
        }
    };
    (0..4).map(of).fold(0.0, f64::max)
}

fn failed(code: i32) -> Result<()> {
    match code {
        plyflow_abi::PF_OK => Ok(()),
        _ => Err(FormingError::Symmetry(format!(
            "the material returned status {code} while its symmetry was looked at"
        ))),
    }
}

fn membrane_apart(material: &MaterialInstance, families: Families) -> Result<f64> {
    let sizes = material.reference().sizes();
    let mut history = Aligned::zeros(sizes.membrane_history * LANES);
    let (mut stress, mut energy) = (Aligned::zeros(3 * LANES), Aligned::zeros(LANES));
    let mut apart = 0.0f64;
    for state in 1..=STATES {
        let share = state as f64 / STATES as f64;
        let metric = rows(families, |k| {
            // Half of the samples are pure shear: the stress of strained fibres would hide its own.
            let strain = if k.is_multiple_of(2) {
                0.0
            } else {
                0.01 * share
            };
            let [f1, f2] = [0, 1].map(|r| 1.0 + strain * spread(k, r));
            // As far as plies are sheared: up to 80 deg.
            let shear = 1.4 * share * spread(k, 2);
            [f1 * f1, f2 * f2, f1 * f2 * shear.fixed_sin()]
        });
        failed(material.reference().membrane(&mut MembraneBatch {
            lanes: LANES,
            dt: 1e-5,
            metric: &metric,
            history: &mut history,
            stress: &mut stress,
            energy: &mut energy,
            stiffness: None,
        }))?;
        apart = apart.max(difference(families, &stress, &energy));
    }
    Ok(apart)
}

fn bending_apart(material: &MaterialInstance, families: Families) -> Result<f64> {
    let sizes = material.reference().sizes();
    let mut history = Aligned::zeros(sizes.bending_history * LANES);
    let (mut moment, mut energy) = (Aligned::zeros(3 * LANES), Aligned::zeros(LANES));
    let metric = rows(families, |_| [1.0, 1.0, 0.0]);
    let mut apart = 0.0f64;
    for state in 1..=STATES {
        // From the small curvatures at which a ply is stiff to folds.
        let size = 300.0 * (state as f64 / STATES as f64).powi(3);
        let curvature = rows(families, |k| [0, 1, 2].map(|r| size * spread(k, r)));
        failed(material.reference().bending(&mut BendingBatch {
            lanes: LANES,
            dt: 1e-5,
            metric: &metric,
            curvature: &curvature,
            history: &mut history,
            moment: &mut moment,
            energy: &mut energy,
            tangent: None,
        }))?;
        apart = apart.max(difference(families, &moment, &energy));
    }
    Ok(apart)
}
