//! A small orthographic rasteriser: triangles with a depth buffer, smooth colours and light, to PNG.

use crate::draw::colour::{Rgb, Scale};
use crate::plain::{Cells, Vec3};
use base64::Engine;

/// Samples per pixel and direction.
const FINE: usize = 2;
/// Where a field has no value, as in the 3D view.
const UNKNOWN: Rgb = [184.0, 184.0, 184.0];
/// Cosine of the angle from which on two faces meet at a sharp edge: 35 degrees.
const CREASE: f64 = 0.819_152_044_288_992;

// As in the geometry of the plugins, which what draws runs cannot use: orchestrator and plugins share the schemas alone.
fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: Vec3) -> Vec3 {
    let n = dot(a, a).sqrt();
    if n > 0.0 {
        a.map(|x| x / n)
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// An orthographic view: where a place in space (m) falls on the picture (px, y down) and how near it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Camera {
    right: Vec3,
    up: Vec3,
    towards: Vec3,
    /// Pixels per metre.
    pub(crate) scale: f64,
    origin: [f64; 2],
}

impl Camera {
    /// Straight down on the x-y plane, x to the right.
    pub(crate) fn plan() -> Self {
        Self::along([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    }

    /// From an azimuth about z (0: from +x) and an elevation above the x-y plane (rad).
    pub(crate) fn oblique(azimuth: f64, elevation: f64) -> Self {
        let ((s, c), (se, ce)) = (azimuth.sin_cos(), elevation.sin_cos());
        Self::along([-s, c, 0.0], [-se * c, -se * s, ce], [ce * c, ce * s, se])
    }

    fn along(right: Vec3, up: Vec3, towards: Vec3) -> Self {
        Self {
            right,
            up,
            towards,
            scale: 1.0,
            origin: [0.0; 2],
        }
    }

    /// The same view, scaled to `width` px so that all `points` lie inside with a margin (px), no higher
    /// than `highest` px. Gives the view and the picture's size.
    pub(crate) fn fit<'a>(
        mut self,
        points: impl Iterator<Item = &'a Vec3>,
        size: [f64; 2],
        margin: f64,
    ) -> (Self, [usize; 2]) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            for (d, axis) in [self.right, self.up].into_iter().enumerate() {
                low[d] = low[d].min(dot(*p, axis));
                high[d] = high[d].max(dot(*p, axis));
            }
        }
        if low[0] > high[0] {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        let extent = [0, 1].map(|d| (high[d] - low[d]).max(1e-9));
        self.scale = ((size[0] - 2.0 * margin) / extent[0])
            .min((size[1] - 2.0 * margin) / extent[1])
            .max(1e-6);
        let height = (extent[1] * self.scale + 2.0 * margin).ceil();
        let spare = (size[0] - 2.0 * margin - extent[0] * self.scale) / 2.0;
        self.origin = [
            margin + spare - low[0] * self.scale,
            margin + high[1] * self.scale,
        ];
        (self, [size[0] as usize, height as usize])
    }

    /// Place on the picture: right, down (px), towards the viewer (m).
    pub(crate) fn project(&self, p: Vec3) -> Vec3 {
        [
            self.origin[0] + self.scale * dot(p, self.right),
            self.origin[1] - self.scale * dot(p, self.up),
            dot(p, self.towards),
        ]
    }

    fn light(&self) -> Vec3 {
        let mix = |d: usize| -0.45 * self.right[d] + 0.55 * self.up[d] + 0.7 * self.towards[d];
        unit([mix(0), mix(1), mix(2)])
    }
}

/// How a surface is coloured.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Paint<'a> {
    /// One colour for all.
    Plain(Rgb),
    /// By a value per point.
    Field(&'a [f64], Scale),
}

/// Triangles of a mesh whose quads are cut in four about their centre, so that no diagonal shows.
#[derive(Debug, Clone)]
pub(crate) struct Triangles {
    points: usize,
    centres: Vec<[u32; 4]>,
    corners: Vec<[u32; 3]>,
}

impl Triangles {
    /// Of cells with 3 or 4 nodes on `points` points.
    pub(crate) fn new(points: usize, cells: &Cells) -> Self {
        Self::of_nodes(points, &cells.nodes, cells.each)
    }

    /// Of quads.
    pub(crate) fn of_quads(points: usize, cells: &[[u32; 4]]) -> Self {
        Self::of_nodes(points, cells.as_flattened(), 4)
    }

    fn of_nodes(points: usize, nodes: &[u32], each: usize) -> Self {
        let (mut centres, mut corners) = (Vec::new(), Vec::new());
        for cell in nodes.chunks_exact(each.max(1)) {
            match *cell {
                [a, b, c] => corners.push([a, b, c]),
                [a, b, c, d] => {
                    let m = (points + centres.len()) as u32;
                    centres.push([a, b, c, d]);
                    corners.extend([[a, b, m], [b, c, m], [c, d, m], [d, a, m]]);
                }
                _ => {}
            }
        }
        Self {
            points,
            centres,
            corners,
        }
    }

    /// Values at the points, with those at the centres of quads appended.
    fn extended<T: Copy>(&self, values: &[T], mean: impl Fn([T; 4]) -> T) -> Vec<T> {
        let mut all = values[..self.points].to_vec();
        all.extend((self.centres.iter()).map(|c| mean(c.map(|i| values[i as usize]))));
        all
    }
}

/// A mesh that is drawn.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface<'a> {
    points: &'a [Vec3],
    mesh: &'a Triangles,
    paint: Paint<'a>,
    /// Of a lit one: how far (m) it is moved towards the viewer.
    lift: Option<f64>,
}

impl<'a> Surface<'a> {
    /// In its colours alone, as values are read off.
    pub(crate) fn new(points: &'a [Vec3], mesh: &'a Triangles, paint: Paint<'a>) -> Self {
        Self {
            points,
            mesh,
            paint,
            lift: None,
        }
    }

    /// Lit from the upper left, moved by `lift` (m) towards the viewer. Colours that stand for values keep most of their lightness.
    pub(crate) fn lit(self, lift: f64) -> Self {
        let lift = Some(lift);
        Self { lift, ..self }
    }
}

/// A picture in the making.
#[derive(Debug)]
pub(crate) struct Canvas {
    size: [usize; 2],
    colour: Vec<[f32; 3]>,
    depth: Vec<f32>,
}

impl Canvas {
    /// An empty picture of `size` px.
    pub(crate) fn new(size: [usize; 2]) -> Self {
        let n = size[0] * size[1] * FINE * FINE;
        Self {
            size,
            colour: vec![[0.0; 3]; n],
            depth: vec![f32::NEG_INFINITY; n],
        }
    }

    /// Draws a surface.
    pub(crate) fn surface(&mut self, camera: &Camera, surface: &Surface<'_>) {
        let Surface {
            points,
            mesh,
            paint,
            lift,
        } = *surface;
        let mean = |q: [Vec3; 4]| [0, 1, 2].map(|d| (q[0][d] + q[1][d] + q[2][d] + q[3][d]) / 4.0);
        let points = mesh.extended(points, mean);
        let plain = matches!(paint, Paint::Plain(_));
        let shade = match (lift.is_some(), plain) {
            (false, _) => vec![[1.0; 3]; mesh.corners.len()],
            // What stands for no value is shaded face by face at its sharp edges, so that these are seen.
            (true, true) => shades(&points, mesh, camera.light(), 0.42, CREASE),
            (true, false) => shades(&points, mesh, camera.light(), 0.75, -1.0),
        };
        let place: Vec<f64> = match paint {
            Paint::Plain(_) => vec![0.0; points.len()],
            Paint::Field(values, scale) => {
                let values = mesh.extended(values, |q| (q[0] + q[1] + q[2] + q[3]) / 4.0);
                values.iter().map(|v| scale.place(*v)).collect()
            }
        };
        let on_screen: Vec<[f32; 5]> = (0..points.len())
            .map(|i| {
                let [x, y, z] = camera.project(points[i]);
                let s = FINE as f64;
                [
                    (x * s) as f32,
                    (y * s) as f32,
                    (z + lift.unwrap_or(0.0)) as f32,
                    place[i] as f32,
                    1.0,
                ]
            })
            .collect();
        // Of each sample, and so without `map` over arrays, which the compiler leaves as calls here: a third of the time of a report.
        let colour = |t: f32, shade: f32| -> [f32; 3] {
            let [r, g, b] = match paint {
                Paint::Plain(c) => c,
                Paint::Field(..) if t.is_nan() => UNKNOWN,
                Paint::Field(_, scale) => scale.palette.at(t),
            };
            [r * shade, g * shade, b * shade]
        };
        for (t, shade) in mesh.corners.iter().zip(&shade) {
            let mut corners = t.map(|i| on_screen[i as usize]);
            (0..3).for_each(|k| corners[k][4] = shade[k]);
            self.triangle(corners, &colour);
        }
    }

    /// Corners are x, y (samples), depth (m), place on the scale, light.
    fn triangle(&mut self, t: [[f32; 5]; 3], colour: &impl Fn(f32, f32) -> [f32; 3]) {
        let [a, b, c] = t;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (w, h) = (self.size[0] * FINE, self.size[1] * FINE);
        let (top, bottom) = (a[1].min(b[1]).min(c[1]), a[1].max(b[1]).max(c[1]));
        let (y0, y1) = samples(top, bottom, h);
        // The weight of a corner is linear: how it grows with x and y, and its value at the corner a.
        let weight = |p: [f32; 5], q: [f32; 5]| {
            let (dx, dy) = ((p[1] - q[1]) / area, (q[0] - p[0]) / area);
            (dx, dy, (a[0] - p[0]) * dx + (a[1] - p[1]) * dy)
        };
        let weights = [weight(b, c), weight(c, a), weight(a, b)];
        for y in y0..y1 {
            let from_a = y as f32 + 0.5 - a[1];
            let (mut left, mut right) = (f32::NEG_INFINITY, f32::INFINITY);
            for (dx, dy, at_a) in weights {
                // Where along the row the weight is zero, with a hair of overlap, so that no seam opens
                // between neighbours.
                let on_row = at_a + dy * from_a + 1e-4;
                let zero = a[0] - on_row / dx;
                match dx {
                    d if d > 0.0 => left = left.max(zero),
                    d if d < 0.0 => right = right.min(zero),
                    _ if on_row < 0.0 => right = f32::NEG_INFINITY,
                    _ => {}
                }
            }
            let (x0, x1) = samples(left, right, w);
            for x in x0..x1 {
                let along = x as f32 + 0.5 - a[0];
                let at = |(dx, dy, at_a): (f32, f32, f32)| at_a + dx * along + dy * from_a;
                let (u, v, s) = (at(weights[0]), at(weights[1]), at(weights[2]));
                let mix = |d: usize| u * a[d] + v * b[d] + s * c[d];
                let (depth, at) = (mix(2), y * w + x);
                if depth > self.depth[at] {
                    self.depth[at] = depth;
                    self.colour[at] = colour(mix(3), mix(4));
                }
            }
        }
    }

    /// Whether a place on the picture (px) at a depth (m) is not hidden by more than `tolerance` (m).
    pub(crate) fn visible(&self, p: Vec3, tolerance: f64) -> bool {
        let (w, h) = (self.size[0] * FINE, self.size[1] * FINE);
        let at = [p[0], p[1]].map(|v| (v * FINE as f64).floor());
        if at[0] < 0.0 || at[1] < 0.0 || at[0] >= w as f64 || at[1] >= h as f64 {
            return false;
        }
        f64::from(self.depth[at[1] as usize * w + at[0] as usize]) <= p[2] + tolerance
    }

    /// The picture as a `data:` address of a PNG, transparent where nothing was drawn.
    ///
    /// # Errors
    /// When the encoder refuses, for instance a picture without pixels.
    pub(crate) fn data_url(&self) -> Result<String, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size[0] as u32, self.size[1] as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels())?;
        writer.finish()?;
        let text = base64::engine::general_purpose::STANDARD.encode(&bytes);
        Ok(format!("data:image/png;base64,{text}"))
    }

    /// RGBA, samples averaged.
    fn pixels(&self) -> Vec<u8> {
        let w = self.size[0] * FINE;
        let mut out = Vec::with_capacity(self.size[0] * self.size[1] * 4);
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                let (mut sum, mut drawn) = ([0.0f32; 3], 0.0f32);
                for s in 0..FINE * FINE {
                    let at = (y * FINE + s / FINE) * w + x * FINE + s % FINE;
                    if self.depth[at] > f32::NEG_INFINITY {
                        drawn += 1.0;
                        (0..3).for_each(|c| sum[c] += self.colour[at][c]);
                    }
                }
                let mean = |v: f32| {
                    if drawn > 0.0 {
                        (v / drawn).round() as u8
                    } else {
                        0
                    }
                };
                let opaque = (255.0 * drawn / (FINE * FINE) as f32).round() as u8;
                out.extend([mean(sum[0]), mean(sum[1]), mean(sum[2]), opaque]);
            }
        }
        out
    }
}

/// The samples of 0..`end` whose centres lie between `low` and `high`.
fn samples(low: f32, high: f32, end: usize) -> (usize, usize) {
    let first = (low - 0.5).ceil().max(0.0) as usize;
    (
        first,
        ((high - 0.5).floor() + 1.0).clamp(0.0, end as f32) as usize,
    )
}

/// Light at the corners of each triangle, from `dark` where it only grazes to 1; both sides are lit. Normals are sums over the triangles around a
/// point, by area, of those that meet the own one at less than the angle of cosine `crease`.
fn shades(points: &[Vec3], mesh: &Triangles, light: Vec3, dark: f64, crease: f64) -> Vec<[f32; 3]> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| points[i as usize]);
        cross(sub(b, a), sub(c, a))
    };
    let faces: Vec<Vec3> = mesh.corners.iter().map(normal).collect();
    let units: Vec<Vec3> = faces.iter().map(|n| unit(*n)).collect();
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (t, corners) in (0u32..).zip(&mesh.corners) {
        corners.iter().for_each(|i| around[*i as usize].push(t));
    }
    let shade = |n: Vec3| (dark + (1.04 - dark) * dot(unit(n), light).abs()).min(1.0) as f32;
    let corner = |t: usize, i: u32| {
        let own = |u: &&u32| dot(units[t], units[**u as usize]) >= crease || **u as usize == t;
        let mut sum = [0.0; 3];
        for u in around[i as usize].iter().filter(own) {
            (0..3).for_each(|d| sum[d] += faces[*u as usize][d]);
        }
        shade(sum)
    };
    let all = mesh.corners.iter().enumerate();
    all.map(|(t, corners)| corners.map(|i| corner(t, i)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::colour::Palette;

    fn square(z: f64) -> (Vec<Vec3>, Triangles) {
        let points = vec![[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        (points, Triangles::of_quads(4, &[[0, 1, 2, 3]]))
    }

    #[test]
    fn faces_that_meet_at_a_sharp_edge_are_shaded_each_by_itself() {
        let points = [
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 1.0, 1.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
        ];
        let mesh = Triangles {
            points: 6,
            centres: vec![],
            corners: vec![[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]],
        };
        let light = unit([0.0, 0.0, 1.0]);
        let sharp = shades(&points, &mesh, light, 0.5, CREASE);
        assert!(
            sharp[..2].as_flattened().iter().all(|s| *s == 1.0),
            "{sharp:?}"
        );
        assert!(
            sharp[2..].as_flattened().iter().all(|s| *s == 0.5),
            "{sharp:?}"
        );
        let smooth = shades(&points, &mesh, light, 0.5, -1.0);
        assert!(smooth[2][0] > 0.5 && smooth[0][1] < 1.0, "{smooth:?}");
    }

    #[test]
    fn the_nearer_surface_hides_the_farther_whatever_the_order() {
        for order in [[0.0, 1.0], [1.0, 0.0]] {
            let (camera, size) = Camera::plan().fit(square(0.0).0.iter(), [20.0, 20.0], 2.0);
            let mut canvas = Canvas::new(size);
            for z in order {
                let (points, mesh) = square(z);
                let grey = if z > 0.5 { 200.0 } else { 50.0 };
                let paint = Paint::Plain([grey; 3]);
                canvas.surface(&camera, &Surface::new(&points, &mesh, paint));
            }
            let pixels = canvas.pixels();
            assert_eq!(pixels[4 * (10 * 20 + 10)..][..4], [200, 200, 200, 255]);
            assert_eq!(pixels[3], 0, "nothing is drawn in the margin");
            assert!(!canvas.visible([10.0, 10.0, 0.0], 0.1));
            assert!(canvas.visible([10.0, 10.0, 1.0], 0.1));
        }
    }

    #[test]
    fn colours_run_linearly_across_a_cell_and_y_points_up() {
        let (points, mesh) = square(0.0);
        let (camera, size) = Camera::plan().fit(points.iter(), [64.0, 64.0], 0.0);
        let mut canvas = Canvas::new(size);
        let scale = Scale::from_zero(1.0);
        let values = [0.0, 0.0, 1.0, 1.0];
        let paint = Paint::Field(&values, scale);
        canvas.surface(&camera, &Surface::new(&points, &mesh, paint));
        let pixels = canvas.pixels();
        for y in [4usize, 20, 40, 60] {
            let expected = Palette::Viridis.at(1.0 - (y as f32 + 0.5) / 64.0);
            for c in 0..3 {
                let got = f32::from(pixels[4 * (y * 64 + 30) + c]);
                assert!(
                    (got - expected[c]).abs() < 2.0,
                    "row {y}: {got} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn an_oblique_view_shows_what_faces_it_and_keeps_lengths_across() {
        let camera = Camera::oblique(-std::f64::consts::FRAC_PI_2, 0.5);
        let [x0, y0, z0] = camera.project([0.0; 3]);
        let [x1, y1, _] = camera.project([1.0, 0.0, 0.0]);
        assert!((x1 - x0 - 1.0).abs() < 1e-12 && (y1 - y0).abs() < 1e-12);
        let nearer = camera.project([0.0, -1.0, 0.0]);
        assert!(
            nearer[2] > z0 && nearer[1] > y0,
            "what is nearer lies lower"
        );
    }
}
