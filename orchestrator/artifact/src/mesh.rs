//! One body of an artifact, laid out as a VTKHDF block (`UnstructuredGrid`, version 2.2).
//!
//! `Points` holds the rows of all frames one after another; a body that does not move has its rows once
//! and every step points at them. Cells are written once. The reference of a moving body lies at
//! `/plyflow/reference/<body>`. Pitfalls that this layout heeds: `Offsets` has its last entry, `Types`
//! are bytes, every field has its own offsets, chunks are the rows of one step, and a file with a single
//! step (where VTK ignores all offsets) has that step's rows first.

use crate::contents::{BodyInfo, FieldInfo, On};
use crate::error::{Result, bad_order, bad_shape, bad_value};
use crate::h5::{DType, Dataset, File, Location, bytes};

const VTK_TRIANGLE: u8 = 5;
const VTK_QUAD: u8 = 9;

#[derive(Debug)]
struct FieldWriter {
    data: Dataset,
    /// Rows and components per frame, multiplied.
    count: usize,
    in_frame: bool,
}

#[derive(Debug)]
pub(crate) struct BodyWriter {
    pub(crate) info: BodyInfo,
    /// Until it is known whether the body moves.
    reference: Option<Vec<f64>>,
    points: Option<Dataset>,
    in_frame: bool,
    fields: Vec<FieldWriter>,
    single: Vec<f32>,
}

impl BodyWriter {
    /// Makes the block and writes what does not change: cells.
    pub(crate) fn define(
        file: &File,
        index: usize,
        info: BodyInfo,
        points: &[f64],
        cells: &[u32],
    ) -> Result<Self> {
        let root = format!("/VTKHDF/{}", info.name);
        let group = file.create_group(&root)?;
        group.write_i64("Version", &[2], &[2, 2])?;
        group.write_text("Type", "UnstructuredGrid", true)?;
        group.write_i64("Index", &[], &[index as i64])?;
        file.soft_link(&root, &format!("/VTKHDF/Assembly/{}", info.name))?;
        let (n, m, k) = (info.points, info.cells, u64::from(info.nodes_per_cell));
        let one = |name: &str, value: u64| {
            file.write(
                &format!("{root}/{name}"),
                DType::I64,
                &[1],
                bytes(&[value as i64]),
            )
        };
        one("NumberOfPoints", n)?;
        one("NumberOfCells", m)?;
        one("NumberOfConnectivityIds", m * k)?;
        let connectivity: Vec<i64> = cells.iter().map(|c| i64::from(*c)).collect();
        let path = format!("{root}/Connectivity");
        file.write(&path, DType::I64, &[m * k], bytes(&connectivity))?;
        let offsets: Vec<i64> = (0..=m).map(|i| (i * k) as i64).collect();
        file.write(
            &format!("{root}/Offsets"),
            DType::I64,
            &[m + 1],
            bytes(&offsets),
        )?;
        let vtk = if k == 3 { VTK_TRIANGLE } else { VTK_QUAD };
        file.write(
            &format!("{root}/Types"),
            DType::U8,
            &[m],
            &vec![vtk; m as usize],
        )?;
        file.create_group(&format!("{root}/PointData"))?;
        file.create_group(&format!("{root}/CellData"))?;
        Ok(Self {
            info,
            reference: Some(points.to_vec()),
            points: None,
            in_frame: false,
            fields: Vec::new(),
            single: Vec::new(),
        })
    }

    fn rows(&self, on: On) -> u64 {
        match on {
            On::Points => self.info.points,
            On::Cells => self.info.cells,
        }
    }

    pub(crate) fn points(&mut self, file: &File, frame: u64, points: &[f64]) -> Result<()> {
        let name = &self.info.name;
        if points.len() as u64 != 3 * self.info.points {
            return bad_shape(format!(
                "frame {frame}: body '{name}' has {} points, was given {} coordinates",
                self.info.points,
                points.len()
            ));
        }
        if self.in_frame {
            return bad_order(format!(
                "frame {frame}: points of body '{name}' were given before"
            ));
        }
        if let Some(i) = points.iter().position(|x| !x.is_finite()) {
            return bad_value(format!(
                "frame {frame}: body '{name}': coordinate {} of point {} is {}",
                i % 3,
                i / 3,
                points[i]
            ));
        }
        if self.points.is_none() {
            if frame > 0 {
                return bad_order(format!(
                    "frame {frame}: body '{name}' had no points of its own in frame 0; \
                     a body moves in all frames or in none"
                ));
            }
            let path = format!("/VTKHDF/{name}/Points");
            self.points = Some(file.growing(&path, DType::F64, &[3], self.info.points)?);
            self.info.moving = true;
        }
        self.in_frame = true;
        self.points
            .as_mut()
            .expect("made above")
            .append(bytes(points))
    }

    pub(crate) fn field(
        &mut self,
        file: &File,
        frame: u64,
        field: FieldInfo,
        values: &[f64],
    ) -> Result<()> {
        let what = format!(
            "frame {frame}: body '{}': field '{}'",
            self.info.name, field.name
        );
        let count = self.rows(field.on) * u64::from(field.components);
        if field.components == 0 || values.len() as u64 != count {
            return bad_shape(format!(
                "{what}: {} rows of {} components are {count} values, was given {}",
                self.rows(field.on),
                field.components,
                values.len()
            ));
        }
        let known = self
            .info
            .fields
            .iter()
            .position(|f| f.name == field.name && f.on == field.on);
        let index = match known {
            Some(i) if self.info.fields[i] != field => {
                let before = &self.info.fields[i];
                return bad_shape(format!(
                    "{what}: has {} components in {} here, {} in {} in frame 0",
                    field.components, field.unit, before.components, before.unit
                ));
            }
            Some(i) => i,
            None => self.add_field(file, frame, field, &what)?,
        };
        let writer = &mut self.fields[index];
        if writer.in_frame {
            return bad_order(format!("{what}: was given before in this frame"));
        }
        self.single.clear();
        self.single.extend(values.iter().map(|x| *x as f32));
        if let Some(i) = self.single.iter().position(|x| !x.is_finite()) {
            let components = self.info.fields[index].components as usize;
            return bad_value(format!(
                "{what}: is {} at row {}, component {} (fields are finite, in single precision)",
                values[i],
                i / components,
                i % components
            ));
        }
        debug_assert_eq!(self.single.len(), writer.count);
        writer.in_frame = true;
        writer.data.append(bytes(&self.single))
    }

    fn add_field(
        &mut self,
        file: &File,
        frame: u64,
        field: FieldInfo,
        what: &str,
    ) -> Result<usize> {
        if frame > 0 {
            return bad_order(format!(
                "{what}: was not in frame 0; every frame has the same fields"
            ));
        }
        let rows = self.rows(field.on);
        let components = u64::from(field.components);
        let row: &[u64] = if components == 1 { &[] } else { &[components] };
        let path = format!(
            "/VTKHDF/{}/{}/{}",
            self.info.name,
            group(field.on),
            field.name
        );
        let data = file.growing(&path, DType::F32, row, rows)?;
        data.write_text("unit", &field.unit, false)?;
        let count = (rows * components) as usize;
        self.fields.push(FieldWriter {
            data,
            count,
            in_frame: false,
        });
        self.info.fields.push(field);
        Ok(self.fields.len() - 1)
    }

    pub(crate) fn end_frame(&mut self, file: &File, frame: u64) -> Result<()> {
        let name = self.info.name.clone();
        if self.info.moving && !self.in_frame {
            return bad_order(format!(
                "frame {frame}: points of body '{name}' are missing"
            ));
        }
        for (info, field) in self.info.fields.iter().zip(&mut self.fields) {
            if !field.in_frame {
                return bad_order(format!(
                    "frame {frame}: body '{name}': field '{}' is missing; it was in frame 0",
                    info.name
                ));
            }
            field.in_frame = false;
        }
        self.in_frame = false;
        if frame == 0 {
            self.write_reference(file)?;
        }
        Ok(())
    }

    fn write_reference(&mut self, file: &File) -> Result<()> {
        let Some(points) = self.reference.take() else {
            return Ok(());
        };
        let name = &self.info.name;
        let shape = [self.info.points, 3];
        let path = if self.info.moving {
            for group in ["/plyflow", "/plyflow/reference"] {
                file.ensure_group(group)?;
            }
            format!("/plyflow/reference/{name}")
        } else {
            format!("/VTKHDF/{name}/Points")
        };
        file.write(&path, DType::F64, &shape, bytes(&points))?;
        Ok(())
    }

    /// Writes the steps and returns the description.
    pub(crate) fn finish(mut self, file: &File, times: &[f64]) -> Result<BodyInfo> {
        self.write_reference(file)?;
        if !times.is_empty() {
            self.write_steps(file, times)?;
        }
        Ok(self.info)
    }

    fn write_steps(&self, file: &File, times: &[f64]) -> Result<()> {
        let steps = format!("/VTKHDF/{}/Steps", self.info.name);
        let s = times.len() as u64;
        let g = file.create_group(&steps)?;
        g.write_i64("NSteps", &[], &[s as i64])?;
        file.write(&format!("{steps}/Values"), DType::F64, &[s], bytes(times))?;
        let put = |name: &str, shape: &[u64], stride: u64, first: i64| {
            let values: Vec<i64> = (0..s).map(|i| first + (i * stride) as i64).collect();
            file.write(
                &format!("{steps}/{name}"),
                DType::I64,
                shape,
                bytes(&values),
            )
            .map(drop)
        };
        put("PartOffsets", &[s], 0, 0)?;
        put("NumberOfParts", &[s], 0, 1)?;
        put(
            "PointOffsets",
            &[s],
            if self.info.moving {
                self.info.points
            } else {
                0
            },
            0,
        )?;
        put("CellOffsets", &[s, 1], 0, 0)?;
        put("ConnectivityIdOffsets", &[s, 1], 0, 0)?;
        for on in [On::Points, On::Cells] {
            let offsets = format!("{}Offsets", group(on));
            file.create_group(&format!("{steps}/{offsets}"))?;
            for field in self.info.fields.iter().filter(|f| f.on == on) {
                put(&format!("{offsets}/{}", field.name), &[s], self.rows(on), 0)?;
            }
        }
        Ok(())
    }
}

/// VTK's name of the group of fields.
pub(crate) fn group(on: On) -> &'static str {
    match on {
        On::Points => "PointData",
        On::Cells => "CellData",
    }
}
