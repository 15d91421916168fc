//! Drawings (DXF of AutoCAD 2000): the flat plies with their fibre lines, and where both lie on the formed part.
//!
//! Written here: the crate `dxf` puts the time of day and random numbers into a file, and brings a decoder of pictures along.

mod drawing;

use crate::boundary::loops;
use crate::curves::laid_fibres;
use crate::error::ExportError;
use crate::file::File;
use crate::names::Names;
use crate::net::{Net, TooMany, rounded_up};
use crate::part::{Body, Part, Ply};
use crate::request::Request;
use crate::vec3::Vec3;
use drawing::Drawing;

/// Endings of the layers of a ply behind its name.
const LAYERS: [&str; 4] = ["", "-draped", "-fibres_1", "-fibres_2"];

/// Writes both drawings.
pub fn write(
    part: &Part,
    request: &Request,
    files: &mut Vec<File>,
    told: &mut Vec<String>,
) -> Result<(), ExportError> {
    let mut flat = Drawing::new(request.unit, &part.origin);
    let mut draped = Drawing::new(request.unit, &part.origin);
    // The first layer of every drawing.
    let mut taken = Names::default();
    taken.own("0");
    for body in &part.bodies {
        let ply = body.ply.as_ref().expect("plies alone are drawn");
        body.tell_missing(told);
        let (name, colour) = (
            taken.own_with(&body.name, &LAYERS),
            (ply.number % 6 + 1) as u8,
        );
        if name != body.name {
            told.push(format!(
                "{}: its layers are called `{name}`, `{name}{}` and so on, as another layer has the name",
                body.name, LAYERS[1]
            ));
        }
        let boundary = loops(body.usable().into_iter().map(|c| body.corners(c)));
        let pattern = pattern(body, ply, part.scale);
        let edge = flat.layer(&name, colour);
        for line in &pattern {
            flat.closed_plane(edge, line);
        }
        let reached = flat.layer(&format!("{name}{}", LAYERS[1]), colour);
        let edge = draped.layer(&name, colour);
        for line in boundary {
            let at = |points: &[Vec3]| -> Vec<Vec3> {
                line.iter().map(|i| points[*i as usize]).collect()
            };
            flat.closed_plane(reached, &at(&body.flat));
            draped.line(edge, &at(&body.points), true);
        }
        draw_fibres(
            (body, ply, &name),
            part.scale,
            request,
            [&mut flat, &mut draped],
        )?;
    }
    for (what, drawing) in [("flat", flat), ("draped", draped)] {
        files.push(File::of_text(
            format!("{}-{what}.dxf", request.stem),
            drawing.finish(),
        ));
    }
    Ok(())
}

/// Draws the fibre lines of a ply, flat and draped. That they are not known has been said with the fields already.
fn draw_fibres(
    (body, ply, name): (&Body, &Ply, &str),
    scale: f64,
    request: &Request,
    [flat, draped]: [&mut Drawing; 2],
) -> Result<(), ExportError> {
    let Some(laid) = &ply.laid else {
        return Ok(());
    };
    let through = body.usable();
    let net = Net {
        flat: &body.flat,
        formed: &body.points,
        cells: &body.cells,
        corners: body.k,
        through: &through,
    };
    let refused = |e: TooMany| ExportError::Net {
        given: request.net,
        ply: body.name.clone(),
        lines: e.lines,
        most: e.most,
        would: rounded_up(e.would / scale),
    };
    for family in 0..2 {
        let layer = format!("{name}{}", LAYERS[2 + family]);
        let (on_flat, on_draped) = (flat.layer(&layer, 8), draped.layer(&layer, 8));
        let lines = laid_fibres(&net, (laid, scale), family, scale * request.net);
        for fibre in lines.map_err(refused)? {
            flat.open_plane(on_flat, &fibre.flat, laid.straight().is_some());
            draped.line(on_draped, &fibre.formed, false);
        }
    }
    Ok(())
}

/// Edge and holes of the whole flat ply: as the scene has them where the artifact tells, else the boundary of the mesh.
fn pattern(body: &Body, ply: &Ply, scale: f64) -> Vec<Vec<Vec3>> {
    let placed = |line: &Vec<[f64; 2]>| {
        line.iter()
            .map(|p| [scale * p[0], scale * p[1], 0.0])
            .collect()
    };
    match &ply.sheet.outline {
        Some(outline) => std::iter::once(outline)
            .chain(&ply.sheet.holes)
            .map(placed)
            .collect(),
        None => {
            let of = |line: Vec<u32>| line.iter().map(|i| body.flat[*i as usize]).collect();
            loops((0..body.count()).map(|c| body.corners(c)))
                .into_iter()
                .map(of)
                .collect()
        }
    }
}
