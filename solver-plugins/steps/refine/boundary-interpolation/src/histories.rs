//! What presses on a zone and moves around it, as the coarse run recorded it.

use plyflow_mechanics::history::linear;
use plyflow_sdk::{Host, Input, Meshes, StepError};

/// Process histories at the frames; those that the coarse run does not have are left out.
pub(crate) fn write(host: &Host, input: &Input, times: &[f64]) -> Result<(), StepError> {
    let histories = [
        ("cavity_pressure", "Pa"),
        ("bag_pressure", "Pa"),
        ("frame_height", "m"),
    ];
    for (name, unit) in histories {
        let path = format!("history/{name}");
        if host.array_info(input, &path).is_none() {
            continue;
        }
        let (t, values) = rows(host, input, &path)?;
        let at_frames: Vec<f64> = times.iter().map(|&at| linear(&t, &values, at)).collect();
        host.write_f64(name, &[times.len()], unit, &at_frames)?;
    }
    Ok(())
}

/// Ways of rigid parts at the rows of the history, which are closer than frames: of each part of a stamping, and of a press's holder. `start`: when
/// the fine run begins (s), in the time of the coarse run, which it stretches by `slower`.
pub(crate) fn write_ways(
    host: &Host,
    input: &Input,
    meshes: &Meshes,
    start: f64,
    slower: f64,
) -> Result<(), StepError> {
    let of_body = |name: &str| [format!("history/parts/{name}/way"), name.to_owned()];
    let bodies = meshes.bodies.iter().map(|b| of_body(&b.name));
    let of_holder = ["history/holder_travel".to_owned(), "holder".to_owned()];
    let there = |[path, _]: &[String; 2]| host.array_info(input, path).is_some();
    let mut written = false;
    for [path, name] in bodies.chain([of_holder]).filter(there) {
        let (t, ways) = rows(host, input, &path)?;
        // The row before the beginning too: between rows ways are interpolated.
        let first = t.partition_point(|t| *t <= start).saturating_sub(1);
        let n = [t.len() - first];
        if !written {
            let own: Vec<f64> = t[first..].iter().map(|t| slower * t).collect();
            host.write_f64("parts/time", &n, "s", &own)?;
            written = true;
        }
        host.write_f64(&format!("parts/{name}/way"), &n, "m", &ways[first..])?;
    }
    Ok(())
}

/// Times (s) and values of a history.
fn rows(host: &Host, input: &Input, path: &str) -> Result<(Vec<f64>, Vec<f64>), StepError> {
    let (t, _) = host.array_f64(input, "history/time")?;
    let (values, _) = host.array_f64(input, path)?;
    if t.is_empty() || t.len() != values.len() {
        let (a, b) = (t.len(), values.len());
        return Err(format!("'{}': history/time has {a} values, {path} {b}", input.step).into());
    }
    Ok((t, values))
}
