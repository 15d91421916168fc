//! Artifacts: files of HDF5.

use crate::fixture::Folder;
use crate::patch;
use plyflow_artifact::{Artifact, Contents, differences};

thread_local! {
    static FOLDER: Folder = Folder::empty();
}

/// Most frames, bodies and arrays of which everything is read.
const MOST: usize = 6;

/// The bytes as a patch of a sound artifact ([`patch::apply`]), or as a file. What opens can be read whole or says what is wrong with it, is
/// the same as itself, and its cells are of points that it has.
pub(super) fn artifact(bytes: &[u8]) {
    let file = patch::apply(bytes);
    FOLDER.with(|folder| {
        let path = folder.write("a.vtkhdf", &file);
        match Artifact::open(path.as_std_path()) {
            Ok(artifact) => read(&artifact),
            Err(e) => assert!(!e.to_string().trim().is_empty(), "refused without a word"),
        }
    });
}

fn read(artifact: &Artifact) {
    let contents = artifact.contents();
    let text = serde_json::to_string(contents).expect("contents are JSON");
    let again: Contents = serde_json::from_str(&text).expect("contents that were written");
    assert_eq!(&again, contents, "contents are read as others");
    assert_eq!(artifact.times().len() as u64, contents.frames);
    for array in contents.arrays.iter().take(MOST) {
        if let Ok((values, shape)) = artifact.array_f64(&array.path) {
            assert_eq!(values.len(), shape.iter().product::<usize>());
        }
        let _ = artifact.array_u32(&array.path);
    }
    for body in contents.bodies.iter().take(MOST) {
        if let Ok((points, cells)) = artifact.mesh(&body.name) {
            let count = points.len() as u32;
            assert!(
                cells.iter().all(|i| *i < count),
                "a cell of '{}' has a corner that is no point",
                body.name
            );
        }
        for frame in 0..contents.frames.min(MOST as u64) {
            let _ = artifact.frame_points(&body.name, frame);
            for field in body.fields.iter().take(MOST) {
                let _ = artifact.frame_field(&body.name, frame, field.on, &field.name);
            }
        }
    }
    if let Ok(found) = differences(artifact, artifact) {
        assert!(found.is_empty(), "another than itself: {found:?}");
    }
}
