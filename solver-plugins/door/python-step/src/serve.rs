//! Answers what the interpreter asks: each request is one call of a service.
//!
//! An answer has `code`, a status of `plyflow.h`, and `cancelled`, whether the run is being stopped.

use crate::message::{Bytes, receive, send};
use crate::payload::Payload;
use plyflow_sdk::Host;
use plyflow_sdk::abi::*;
use serde_json::{Value, json};
use std::io;
use std::os::unix::net::UnixStream;

/// How a conversation ended.
#[derive(Debug, PartialEq, Eq)]
pub enum End {
    /// The step is done.
    Done,
    /// The step has failed: what the user is told.
    Failed(String),
    /// The step has stopped because it was told to.
    Cancelled,
    /// The other end is gone without a word.
    Lost,
}

/// Tells the interpreter what it is to run, and serves it until it has ended.
///
/// # Errors
/// When what it says is no request, or cannot be heard.
pub fn serve(host: &Host, payload: &Payload, stream: &mut UnixStream) -> io::Result<End> {
    let services = Services(host);
    let job = json!({
        "main": payload.main, "python": payload.python, "packages": payload.packages, "modules": payload.modules, "sources": payload.sources,
        "manifest": payload.manifest, "parameters": services.parameters(), "inputs": services.inputs(), "item": services.item(),
        "threads": host.threads(),
    });
    match send(stream, job, &Bytes::default()) {
        // It may have ended before it listened; what it was, its status tells.
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(End::Lost),
        sent => sent?,
    }
    loop {
        let Some((request, bytes)) = heard(stream)? else {
            return Ok(End::Lost);
        };
        let text = || request["text"].as_str().unwrap_or_default().to_owned();
        match request["op"].as_str() {
            Some("done") => return Ok(End::Done),
            Some("failed") => return Ok(End::Failed(text())),
            Some("cancelled") => return Ok(End::Cancelled),
            _ => {}
        }
        let (code, mut answer, back) = services.answer(&request, &bytes)?;
        answer["code"] = json!(code);
        answer["cancelled"] = json!(host.check_cancelled().is_err());
        match send(stream, answer, &back) {
            Err(e) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(End::Lost),
            sent => sent?,
        }
    }
}

/// A request; none where the other end is gone, however it went.
fn heard(stream: &mut UnixStream) -> io::Result<Option<(Value, Bytes)>> {
    match receive(stream) {
        Err(e)
            if matches!(
                e.kind(),
                io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset
            ) =>
        {
            Ok(None)
        }
        other => other,
    }
}

/// The status, what the answer says, and the bytes that follow it.
type Answer = (i32, Value, Bytes);

/// The host's services as they stand in the table.
struct Services<'a>(&'a Host);

macro_rules! call {
    ($self:ident . $f:ident ( $($a:expr),* )) => {
        // SAFETY: the table lives as long as the `Host` that is borrowed here. What is given with the call are texts, structs and arrays that are
        // borrowed through it, each array as long as the call says or, where the call says nothing, as was compared just before.
        unsafe { let s = &*$self.0.raw(); (s.$f)(s.host $(, $a)*) }
    };
}

/// What the request says under a name, as an error where it says nothing of that kind.
fn asked<T>(found: Option<T>, name: &str) -> io::Result<T> {
    found.ok_or_else(|| {
        io::Error::new(
            io::ErrorKind::InvalidData,
            format!("a request without a usable `{name}`"),
        )
    })
}

fn text<'a>(request: &'a Value, name: &str) -> io::Result<&'a str> {
    asked(request[name].as_str(), name)
}

fn count(request: &Value, name: &str) -> io::Result<u64> {
    asked(request[name].as_u64(), name)
}

fn small(request: &Value, name: &str) -> io::Result<u32> {
    asked(
        request[name].as_u64().and_then(|n| u32::try_from(n).ok()),
        name,
    )
}

/// Type and bytes of a number of an array.
fn number_type(name: &str) -> Option<(u32, u64)> {
    Some(match name {
        "f64" => (PF_F64, 8),
        "f32" => (PF_F32, 4),
        "i64" => (PF_I64, 8),
        "u32" => (PF_U32, 4),
        "u8" => (PF_U8, 1),
        _ => return None,
    })
}

fn type_name(dtype: u32) -> &'static str {
    match dtype {
        PF_F64 => "f64",
        PF_F32 => "f32",
        PF_I64 => "i64",
        PF_U32 => "u32",
        _ => "u8",
    }
}

/// Bytes that an array has, if that is a number.
fn size_of_array(shape: &[u64], each: u64) -> Option<usize> {
    let all = shape
        .iter()
        .try_fold(each, |size, n| size.checked_mul(*n))?;
    usize::try_from(all).ok()
}

fn plain(code: i32) -> io::Result<Answer> {
    Ok((code, json!({}), Bytes::default()))
}

impl Services<'_> {
    fn read(&self, text: pf_str) -> &str {
        // SAFETY: the host's texts stay valid until `run` returns (plyflow.h), which this borrow does not outlive.
        unsafe { text.as_str() }.unwrap_or_default()
    }

    fn parameters(&self) -> &str {
        self.read(call!(self.parameters()))
    }

    fn inputs(&self) -> &str {
        self.read(call!(self.inputs()))
    }

    fn item(&self) -> &str {
        self.read(call!(self.item()))
    }

    fn answer(&self, request: &Value, bytes: &Bytes) -> io::Result<Answer> {
        match text(request, "op")? {
            "cancelled" => plain(PF_OK),
            "log" | "progress" | "scratch" | "checkpoint" | "checkpoint_due"
            | "checkpoint_saved" => self.about_the_run(request),
            "attributes" | "array_info" | "array_read" => self.about_an_input(request),
            "meshes" | "mesh_read" | "points_read" | "field_read" => self.about_a_mesh(request),
            "mesh_define" | "frame_begin" | "frame_points" | "frame_field" | "frame_end" => {
                self.mesh_written(request, bytes)
            }
            _ => self.written(request, bytes),
        }
    }

    fn about_the_run(&self, request: &Value) -> io::Result<Answer> {
        let said = |text: &str| Ok((PF_OK, json!({"text": text}), Bytes::default()));
        match text(request, "op")? {
            "log" => {
                let level = small(request, "level")?.clamp(PF_LOG_ERROR, PF_LOG_DEBUG);
                call!(self.log(level, pf_str::new(text(request, "text")?)));
            }
            "progress" => {
                let number = |name: &str| {
                    request[name]
                        .as_f64()
                        .filter(|x| x.is_finite())
                        .unwrap_or(-1.0)
                };
                let progress = pf_progress {
                    size: size_of::<pf_progress>() as u64,
                    fraction: number("fraction").clamp(0.0, 1.0),
                    simulated_time: number("simulated_time"),
                    rate: number("rate"),
                    energy_ratio: number("energy_ratio"),
                    phase: pf_str::new(request["phase"].as_str().unwrap_or_default()),
                };
                call!(self.progress(&raw const progress));
            }
            "scratch" => return said(self.read(call!(self.scratch()))),
            "checkpoint" => return said(self.read(call!(self.checkpoint()))),
            "checkpoint_due" => {
                let due = call!(self.checkpoint_due()) != 0;
                return Ok((PF_OK, json!({"due": due}), Bytes::default()));
            }
            _ => call!(self.checkpoint_saved()),
        }
        plain(PF_OK)
    }

    fn about_an_input(&self, request: &Value) -> io::Result<Answer> {
        let handle = small(request, "handle")?;
        if text(request, "op")? == "attributes" {
            let json_text = self.read(call!(self.attributes(handle)));
            return Ok((PF_OK, json!({"text": json_text}), Bytes::default()));
        }
        let path = pf_str::new(text(request, "path")?);
        let mut info = pf_array_info::default();
        let code = call!(self.array_info(handle, path, &raw mut info));
        if code != PF_OK {
            return plain(code);
        }
        let shape = &info.shape[..(info.rank as usize).min(info.shape.len())];
        let told = json!({"dtype": type_name(info.dtype), "shape": shape});
        if text(request, "op")? == "array_info" {
            return Ok((PF_OK, told, Bytes::default()));
        }
        let (dtype, each) = asked(number_type(text(request, "dtype")?), "dtype")?;
        let mut values = Bytes::zeros(asked(size_of_array(shape, each), "path")?)?;
        let (buffer, size) = (values.pointer_mut().cast(), values.len() as u64);
        let code = call!(self.array_read(handle, path, dtype, buffer, size));
        Ok((code, told, values))
    }

    /// Number of points, cells and nodes per cell of a body of an input; `None`: there is no such body.
    fn body_sizes(&self, handle: u32, name: &str) -> Option<[usize; 3]> {
        let meshes: Value = serde_json::from_str(self.read(call!(self.meshes(handle)))).ok()?;
        let body = meshes["bodies"]
            .as_array()?
            .iter()
            .find(|b| b["name"] == name)?;
        let number = |key: &str| usize::try_from(body[key].as_u64()?).ok();
        Some([
            number("points")?,
            number("cells")?,
            number("nodes_per_cell")?,
        ])
    }

    fn about_a_mesh(&self, request: &Value) -> io::Result<Answer> {
        let handle = small(request, "handle")?;
        if text(request, "op")? == "meshes" {
            let told = self.read(call!(self.meshes(handle)));
            return Ok((PF_OK, json!({"text": told}), Bytes::default()));
        }
        let name = text(request, "body")?;
        let Some([points, cells, nodes]) = self.body_sizes(handle, name) else {
            return plain(PF_NOT_FOUND);
        };
        let body = pf_str::new(name);
        match text(request, "op")? {
            "mesh_read" => {
                let mut places = Bytes::zeros(points * 24 + cells * nodes * 4)?;
                let at = places.pointer_mut();
                // SAFETY: the points' doubles come first, and the cells' numbers behind them, both within the bytes just made.
                let behind = unsafe { at.add(points * 24) };
                let code = call!(self.mesh_read(handle, body, at.cast(), behind.cast()));
                Ok((code, json!({}), places))
            }
            "points_read" => {
                let mut places = Bytes::zeros(points * 24)?;
                let frame = count(request, "frame")?;
                let at = places.pointer_mut().cast();
                let code = call!(self.frame_points_read(handle, body, frame, at));
                Ok((code, json!({}), places))
            }
            _ => {
                let on = asked(on(request), "on")?;
                let rows = if on == PF_ON_POINTS { points } else { cells };
                let components = small(request, "components")? as usize;
                let size = asked(
                    size_of_array(&[rows as u64, components as u64], 8),
                    "components",
                )?;
                let mut values = Bytes::zeros(size)?;
                let (frame, field) = (
                    count(request, "frame")?,
                    pf_str::new(text(request, "name")?),
                );
                let (at, number) = (values.pointer_mut().cast(), (size / 8) as u64);
                let code = call!(self.frame_field_read(handle, body, frame, on, field, at, number));
                Ok((code, json!({}), values))
            }
        }
    }

    fn mesh_written(&self, request: &Value, bytes: &Bytes) -> io::Result<Answer> {
        match text(request, "op")? {
            "frame_begin" => {
                let time = asked(bytes.doubles().filter(|t| t.len() == 1), "time")?[0];
                return plain(call!(self.frame_begin(time)));
            }
            "frame_end" => return plain(call!(self.frame_end())),
            _ => {}
        }
        let body = pf_str::new(text(request, "body")?);
        let at = bytes.pointer();
        match text(request, "op")? {
            "mesh_define" => self.mesh_defined(request, bytes),
            "frame_points" => {
                let points = count(request, "points")?;
                asked(
                    size_of_array(&[points, 3], 8).filter(|n| *n == bytes.len()),
                    "bytes",
                )?;
                plain(call!(self.frame_points(body, at.cast(), points)))
            }
            _ => {
                let on = asked(on(request), "on")?;
                asked(Some(()).filter(|()| bytes.len().is_multiple_of(8)), "bytes")?;
                let name = pf_str::new(text(request, "name")?);
                let unit = pf_str::new(text(request, "unit")?);
                let components = small(request, "components")?;
                let number = (bytes.len() / 8) as u64;
                plain(call!(self.frame_field(
                    body,
                    on,
                    name,
                    components,
                    unit,
                    at.cast(),
                    number
                )))
            }
        }
    }

    fn mesh_defined(&self, request: &Value, bytes: &Bytes) -> io::Result<Answer> {
        let (points, cells) = (count(request, "points")?, count(request, "cells")?);
        let nodes = small(request, "nodes_per_cell")?;
        let first = asked(size_of_array(&[points, 3], 8), "points")?;
        let second = asked(size_of_array(&[cells, nodes.into()], 4), "cells")?;
        let whole = first.checked_add(second);
        asked(whole.filter(|n| *n == bytes.len()), "bytes")?;
        let at = bytes.pointer();
        // SAFETY: the cells' numbers lie behind the points', within the bytes, as was just compared.
        let behind = unsafe { at.add(first) };
        let body = pf_str::new(text(request, "body")?);
        let attributes = pf_str::new(text(request, "attributes")?);
        let (at, behind) = (at.cast(), behind.cast());
        plain(call!(self.mesh_define(
            body, points, at, cells, nodes, behind, attributes
        )))
    }

    fn written(&self, request: &Value, bytes: &Bytes) -> io::Result<Answer> {
        match text(request, "op")? {
            "attributes_write" => plain(call!(
                self.attributes_write(pf_str::new(text(request, "text")?))
            )),
            "array_write" => {
                let (dtype, each) = asked(number_type(text(request, "dtype")?), "dtype")?;
                let given = asked(request["shape"].as_array(), "shape")?;
                let shape: Option<Vec<u64>> = given.iter().map(Value::as_u64).collect();
                let shape = asked(shape.filter(|s| s.len() <= 4), "shape")?;
                asked(
                    size_of_array(&shape, each).filter(|n| *n == bytes.len()),
                    "shape",
                )?;
                let mut info = pf_array_info {
                    dtype,
                    rank: shape.len() as u32,
                    ..Default::default()
                };
                info.shape[..shape.len()].copy_from_slice(&shape);
                let path = pf_str::new(text(request, "path")?);
                let unit = pf_str::new(text(request, "unit")?);
                let at = bytes.pointer().cast();
                plain(call!(self.array_write(path, &raw const info, unit, at)))
            }
            "result" => {
                let value = asked(bytes.doubles().filter(|v| v.len() == 1), "value")?[0];
                let name = pf_str::new(text(request, "name")?);
                let unit = pf_str::new(text(request, "unit")?);
                plain(call!(self.result(name, value, unit, 0)))
            }
            "collection" => {
                let names = pf_str::new(text(request, "text")?);
                plain(call!(self.collection(count(request, "count")?, names)))
            }
            other => Err(io::Error::new(
                io::ErrorKind::InvalidData,
                format!("a request `{other}` that this version does not know"),
            )),
        }
    }
}

/// Where a field sits.
fn on(request: &Value) -> Option<u32> {
    match request["on"].as_str()? {
        "points" => Some(PF_ON_POINTS),
        "cells" => Some(PF_ON_CELLS),
        _ => None,
    }
}
