//! Small pictures of plies that are seen side by side: the same view, scale and colours.

use crate::draw::colour::{Palette, Rgb, Scale, end_of_scale};
use crate::draw::colour_bar::bar;
use crate::draw::error::DrawError;
use crate::draw::raster::{Camera, Canvas, Paint, Surface, Triangles};
use crate::plain::{Shade, Sheet, Vec3};
use crate::units::shown;
use maud::{Markup, html};

/// Height over width.
const SHAPE: f64 = 0.72;
/// Values of a ply that are looked at for the scale of colours.
const LOOKED_AT: usize = 4000;
/// Colour of a ply of which nothing is known but its shape.
const PLAIN: Rgb = [150.0, 158.0, 168.0];
/// From where the plies are seen (deg about z from +x, and above the plane).
const VIEW: [f64; 2] = [-65.0, 38.0];

fn camera() -> Camera {
    Camera::oblique(VIEW[0].to_radians(), VIEW[1].to_radians())
}

impl Shade {
    /// Title and SI unit.
    fn said(self) -> (&'static str, &'static str) {
        match self {
            Self::Distance => ("distance from the tool", "m"),
            Self::Shear => ("shear angle", "rad"),
            Self::Deflection => ("deflection along z", "m"),
            Self::Nothing => ("shape", "1"),
        }
    }

    fn scale(self, values: &[f64]) -> Scale {
        let (factor, _) = shown(self.said().1);
        let least = if self == Self::Shear { 0.02 } else { 1e-5 };
        let high = end_of_scale(values.iter().copied(), 0.995, least, factor);
        match self {
            Self::Distance | Self::Nothing => Scale::from_zero(high),
            Self::Shear => Scale::about_zero(Palette::BlueRed, high),
            Self::Deflection => Scale::about_zero(Palette::PurpleOrange, high),
        }
    }
}

/// What the first pass keeps of a ply.
pub(crate) struct Look {
    name: String,
    shade: Shade,
    /// The points that lie farthest to the left, right, bottom and top.
    corners: [Vec3; 4],
    values: Vec<f64>,
}

impl Look {
    pub(crate) fn of(sheet: &Sheet) -> Self {
        let camera = camera();
        let nodes = sheet.cells.as_flattened();
        let used = || nodes.iter().map(|i| *i as usize);
        let first = used().next().unwrap_or(0);
        let mut corners = [sheet.points[first]; 4];
        let place = |p: Vec3| camera.project(p);
        for p in used().map(|i| &sheet.points[i]) {
            let at = place(*p);
            for (k, (d, sign)) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)]
                .into_iter()
                .enumerate()
            {
                if sign * at[d] > sign * place(corners[k])[d] {
                    corners[k] = *p;
                }
            }
        }
        let apart = nodes.len().div_ceil(LOOKED_AT).max(1);
        Self {
            name: sheet.name.clone(),
            shade: sheet.shade,
            corners,
            values: used().step_by(apart).map(|i| sheet.values[i]).collect(),
        }
    }
}

/// What all pictures have in common.
pub(crate) struct Series {
    /// Places that lie on every picture.
    corners: Vec<Vec3>,
    /// Name of the ply, and what colours it: those of the first.
    name: String,
    shade: Shade,
    scale: Scale,
}

impl Series {
    /// Of plies; `None` without any.
    pub(crate) fn of(looks: &[Look]) -> Option<Self> {
        let Look { name, shade, .. } = looks.first()?;
        let values = looks.iter().flat_map(|l| l.values.iter().copied());
        let values: Vec<f64> = values.collect();
        Some(Self {
            corners: looks.iter().flat_map(|l| l.corners).collect(),
            name: name.clone(),
            shade: *shade,
            scale: shade.scale(&values),
        })
    }

    fn view(&self, width: f64) -> (Camera, [usize; 2]) {
        camera().fit(self.corners.iter(), [width, SHAPE * width], 3.0)
    }

    /// Pixels of a picture of this width.
    pub(crate) fn size(&self, width: f64) -> [usize; 2] {
        self.view(width).1
    }

    /// A picture as an address.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub(crate) fn picture(&self, sheet: &Sheet, width: f64) -> Result<String, DrawError> {
        let (camera, size) = self.view(width);
        let mut canvas = Canvas::new(size);
        let paint = match self.shade {
            Shade::Nothing => Paint::Plain(PLAIN),
            _ if sheet.shade == self.shade => Paint::Field(&sheet.values, self.scale),
            _ => Paint::Plain(PLAIN),
        };
        let mesh = Triangles::of_quads(sheet.points.len(), &sheet.cells);
        let surface = Surface::new(&sheet.points, &mesh, paint);
        canvas.surface(&camera, &surface.lit(0.0));
        Ok(canvas.data_url()?)
    }

    /// What colours them, with its unit.
    fn said(&self) -> String {
        let (what, unit) = self.shade.said();
        match shown(unit).1 {
            "" => what.to_owned(),
            unit => format!("{what} ({unit})"),
        }
    }

    /// What they show.
    pub(crate) fn title(&self, step: &str) -> String {
        let (name, said) = (&self.name, self.said());
        format!("ply {name} of the step {step}, {said}")
    }

    /// The scale of colours.
    pub(crate) fn bar(&self, id: &str) -> Markup {
        if self.shade == Shade::Nothing {
            return html! {};
        }
        let (factor, _) = shown(self.shade.said().1);
        let what = format!("Scale of the pictures: {}", self.said());
        bar(id, self.scale, factor, &[], &what)
    }
}
