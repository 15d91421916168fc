//! The plies of a scene on their way to the formed state.

use super::body::Body;
use super::pack::{Extent, Stream};
use super::thin::Thinned;
use crate::draw::legend::{Field, Legend};
use crate::plain::{Frame, Frames, Ply, PlyShape, Vec3};
use serde::Serialize;

/// Points of all plies in all moments on a page at full sharpness; about 6 bytes each, with their fields.
pub(super) const POINTS: f64 = 80_000.0;
/// Fewer moments than this are no way.
const LEAST: usize = 3;
/// Places of a coordinate along the largest side of the scene: on the way a quarter of a millimetre is enough.
const PLACES: f64 = 4095.0;

/// The moments before the last one. In `data`, for each moment and each body: its points, as places of [`PLACES`], and its fields.
#[derive(Debug, Serialize)]
pub(super) struct ToldWay {
    /// (s), with that of the formed state.
    pub(super) times: Vec<f64>,
    /// Indices of the bodies.
    bodies: Vec<usize>,
    /// Indices of the fields that are known at every moment.
    fields: Vec<usize>,
    /// How far the tool is from where it is shown (m).
    tool: Vec<Vec3>,
    /// Places of a coordinate.
    places: f64,
}

/// Half of the distance between two places (m).
pub(super) fn exact(extent: &Extent) -> f64 {
    extent.size.iter().copied().fold(0.0, f64::max) / PLACES / 2.0
}

/// What may be shown of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Way<'a> {
    pub(super) frames: Option<&'a Frames>,
    pub(super) plies: &'a [Ply],
}

impl<'a> Way<'a> {
    /// All places that the plies pass.
    pub(super) fn points(self) -> impl Iterator<Item = &'a Vec3> {
        let frames = self.frames.into_iter().flat_map(|f| &f.all);
        frames.flat_map(|f| &f.plies).flat_map(|p| &p.formed)
    }

    /// Writes as many moments as there is room for.
    pub(super) fn write(
        self,
        stream: &mut Stream,
        extent: &Extent,
        (bodies, thinned): (&[Body<'_>], &[Thinned]),
        legends: &[Legend],
        most: usize,
    ) -> Option<ToldWay> {
        let frames = self.frames?;
        let is = |(_, b): &(usize, &Body<'_>)| b.ply.is_some() && b.zone.is_none();
        let own: Vec<usize> = bodies.iter().enumerate().filter(is).map(|b| b.0).collect();
        let points: usize = own.iter().map(|b| thinned[*b].points.len()).sum();
        let (all, count) = (frames.all.len(), most / points.max(1));
        let count = count.min(all);
        if count < LEAST.min(all) || own.len() != self.plies.len() {
            return None;
        }
        let chosen: Vec<&Frame> = (0..count).map(|k| &frames.all[k * all / count]).collect();
        let on_way = |l: &&(usize, &Legend)| l.1.field.is_some_and(Field::is_known_on_the_way);
        let shaded: Vec<(usize, &Legend)> = legends.iter().enumerate().collect();
        let shaded: Vec<_> = shaded.iter().filter(on_way).copied().collect();
        for frame in &chosen {
            for (k, body) in own.iter().enumerate() {
                let ply = at(&self.plies[k], frame, k);
                let found = &thinned[*body].points;
                stream.coarse_points(
                    extent,
                    PLACES,
                    found.iter().map(|i| ply.formed[*i as usize]),
                );
                for (_, legend) in &shaded {
                    let values = legend.at_points(&ply);
                    let of = |i: &u32| {
                        values
                            .as_ref()
                            .map_or(f64::NAN, |v| legend.scale.place(v[*i as usize]))
                    };
                    stream.places(found.iter().map(of));
                }
            }
        }
        let times = chosen.iter().map(|f| f.time).chain([frames.end]);
        Some(ToldWay {
            times: times.collect(),
            bodies: own,
            fields: shaded.iter().map(|l| l.0).collect(),
            tool: chosen.iter().map(|f| f.tool).collect(),
            places: PLACES,
        })
    }
}

/// A ply at a moment, with what follows from its shape.
fn at(ply: &Ply, frame: &Frame, k: usize) -> Ply {
    let now = &frame.plies[k];
    let draped = ply.draped.as_deref();
    let told = (ply.fibres.as_ref(), ply.thickness);
    Ply {
        shape: PlyShape::of((&ply.flat, &now.formed), &ply.cells, draped, told),
        flat: ply.flat.clone(),
        formed: now.formed.clone(),
        cells: ply.cells.clone(),
        shear: now.shear.clone(),
        ..Ply::default()
    }
}
