//! Bodies of the artifact: sheets, with their mirror images.

use crate::error::Result;
use crate::stack::place::SheetIndex;
use crate::stack::sheet::StackSheet;
use crate::stack::symmetry;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::component::ElementField;
use plyflow_mechanics::mirror::{Image, Planes, Whole};
use plyflow_model::artifact::MeshQuality;
use plyflow_model::scene::Families;

/// A sheet as a body of the artifact.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Its number in the model.
    pub sheet: SheetIndex,
    /// `[m]` cells in mesh-local numbers, of the whole body.
    pub cells: Vec<[u32; 4]>,
    /// Where mirror planes bound what is computed: the whole, of which that is the beginning.
    pub mirrored: Option<MirroredBody>,
    /// Quality of a mesh that follows an outline.
    pub quality: Option<MeshQuality>,
}

impl Body {
    /// The body of a sheet of the stack, with these cells.
    pub fn new(sheet: &StackSheet, index: SheetIndex, cells: Vec<[u32; 4]>) -> Self {
        Self {
            name: sheet.scene.name.clone(),
            sheet: index,
            cells,
            mirrored: None,
            quality: None,
        }
    }

    /// The same of its part between mirror planes, which has the points `points` (m) and `cells` in their numbers, and of its images.
    ///
    /// # Errors
    /// When its fibres lie askew to the planes.
    pub fn mirrored(
        sheet: &StackSheet,
        index: SheetIndex,
        points: &[Vec3],
        cells: &[[u32; 4]],
        planes: Planes,
    ) -> Result<Self> {
        let mut body = Self::new(sheet, index, cells.to_vec());
        if planes.any() {
            let whole = Whole::new(points, cells, planes);
            body.cells.clone_from(&whole.cells);
            body.mirrored = Some(MirroredBody {
                whole,
                families: symmetry::families(sheet)?,
            });
        }
        Ok(body)
    }
}

/// A body of which a part is computed, and its mirror images.
#[derive(Debug, Clone)]
pub struct MirroredBody {
    /// The whole.
    pub whole: Whole,
    /// What the planes do to its fibres.
    pub families: Families,
}

impl MirroredBody {
    /// Values of field `f` of an element that has the fields `all`, on the whole; `of` gives the part's by row. A name that
    /// ends with `_1` or `_2` is that of a family; fields of shear and twist (`shear` or `twist` in the name, or `_12` at
    /// its end) change their sign where the families are kept.
    pub fn field(
        &self,
        f: &ElementField,
        all: &[ElementField],
        of: impl Fn(&ElementField) -> Vec<f64>,
    ) -> Vec<f64> {
        let own = of(f);
        let image = match self.families {
            Families::Exchanged => partner(f, all).map(of),
            Families::Kept => is_odd(&f.name).then(|| own.iter().map(|v| -v).collect()),
        };
        let value = |n: usize, [x, y]: Image| match &image {
            // Mirrored twice, it is what it was.
            Some(image) if x != y => image[n],
            _ => own[n],
        };
        if f.patch {
            self.whole.at_nodes(value)
        } else {
            self.whole.at_cells(value)
        }
    }
}

/// The same field of the other family.
fn partner<'a>(f: &ElementField, all: &'a [ElementField]) -> Option<&'a ElementField> {
    let (stem, other) = match (f.name.strip_suffix("_1"), f.name.strip_suffix("_2")) {
        (Some(stem), _) => (stem, "_2"),
        (_, Some(stem)) => (stem, "_1"),
        _ => return None,
    };
    let is_it = |g: &&ElementField| g.patch == f.patch && g.name == format!("{stem}{other}");
    all.iter().find(is_it)
}

fn is_odd(name: &str) -> bool {
    name.contains("shear") || name.contains("twist") || name.ends_with("_12")
}
