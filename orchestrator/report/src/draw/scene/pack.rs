//! Arrays of a scene as text: whole numbers, differences of neighbours, deflated, base64.
//!
//! The script of the page reads them in the order in which they were written (`script/scene3d.js`).

use crate::draw::error::DrawError;
use crate::plain::Vec3;
use base64::Engine;
use flate2::{Compression, write::ZlibEncoder};
use serde::Serialize;
use std::io::Write;

/// The box of all points; a coordinate is one of 65536 places in it, which in a metre is one every 15 µm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Extent {
    pub(super) low: Vec3,
    pub(super) size: Vec3,
}

impl Extent {
    /// Of points; `None` without any.
    pub(super) fn of<'a>(points: impl Iterator<Item = &'a Vec3>) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in points {
            for d in 0..3 {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let finite = low.iter().chain(&high).all(|v| v.is_finite());
        finite.then(|| Self {
            low,
            size: [0, 1, 2].map(|d| (high[d] - low[d]).max(1e-9)),
        })
    }

    fn place(&self, p: Vec3) -> [u16; 3] {
        let at = |d: usize| (p[d] - self.low[d]) / self.size[d] * 65535.0;
        [0, 1, 2].map(|d| at(d).round().clamp(0.0, 65535.0) as u16)
    }
}

/// The arrays, one behind the other.
#[derive(Debug, Default)]
pub(super) struct Stream(Vec<u8>);

impl Stream {
    /// Three u16 a point, each as the difference to the point before.
    pub(super) fn points(&mut self, extent: &Extent, points: impl Iterator<Item = Vec3>) {
        let mut last = [0u16; 3];
        for p in points {
            let at = extent.place(p);
            for d in 0..3 {
                let step = at[d].wrapping_sub(last[d]);
                self.0.extend(step.to_le_bytes());
            }
            last = at;
        }
    }

    /// As [`Stream::points`], with one of `places` places along the largest side of the box.
    pub(super) fn coarse_points(
        &mut self,
        extent: &Extent,
        places: f64,
        points: impl Iterator<Item = Vec3>,
    ) {
        let step = extent.size.iter().copied().fold(0.0, f64::max) / places;
        let mut last = [0u16; 3];
        for p in points {
            for d in 0..3 {
                let now = ((p[d] - extent.low[d]) / step).round().clamp(0.0, places) as u16;
                self.0.extend(now.wrapping_sub(last[d]).to_le_bytes());
                last[d] = now;
            }
        }
    }

    /// Four u32 a cell, each as the difference to the same corner of the cell before. The last corner of a triangle stands twice.
    pub(super) fn cells<'a>(&mut self, cells: impl Iterator<Item = &'a [u32]>) {
        let mut last = [0u32; 4];
        for cell in cells {
            for (k, before) in last.iter_mut().enumerate() {
                let now = cell[k.min(cell.len() - 1)];
                self.0.extend(now.wrapping_sub(*before).to_le_bytes());
                *before = now;
            }
        }
    }

    /// A u8 a value, as the difference to the value before: 0 where there is no value, else 1 and its place on the colour scale (0..1, clipped)
    /// in 254 steps.
    pub(super) fn places(&mut self, values: impl Iterator<Item = f64>) {
        let mut last = 0u8;
        for v in values {
            let now = match v.is_nan() {
                true => 0,
                false => 1 + (v.clamp(0.0, 1.0) * 254.0).round() as u8,
            };
            self.0.push(now.wrapping_sub(last));
            last = now;
        }
    }

    /// Deflated (zlib), in base64.
    pub(super) fn text(self) -> Result<String, DrawError> {
        let mut deflated = ZlibEncoder::new(Vec::new(), Compression::best());
        deflated.write_all(&self.0)?;
        let bytes = deflated.finish()?;
        Ok(base64::engine::general_purpose::STANDARD.encode(bytes))
    }
}

/// JSON that may stand in a `script` element: no text in it can end the element or begin another.
pub(super) fn script_json(value: &impl Serialize) -> Result<String, DrawError> {
    let text = serde_json::to_string(value)?;
    Ok(text
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026"))
}
