//! Content keys: what an artifact depends on, hashed. Same key, same bytes.

use plyflow_model::job::DATA_MODEL_VERSION;
use plyflow_workflow::resolved::ResolvedStep;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;
use std::hash::{BuildHasher, Hasher};

/// A BLAKE3 content key.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Key(pub [u8; 32]);

impl Key {
    /// 64 hex digits.
    pub fn hex(&self) -> String {
        blake3::Hash::from_bytes(self.0).to_hex().to_string()
    }

    /// The first 12 hex digits, for people.
    pub fn short(&self) -> String {
        self.hex()[..12].to_owned()
    }

    /// Reads 64 hex digits.
    pub fn from_hex(text: &str) -> Option<Self> {
        blake3::Hash::from_hex(text)
            .ok()
            .map(|h| Self(*h.as_bytes()))
    }
}

/// Hashes keys for maps: they are hashes already.
#[derive(Debug, Clone, Copy, Default)]
pub struct ByKey;

/// See [`ByKey`].
#[derive(Debug, Default)]
pub struct FirstBytes(u64);

impl BuildHasher for ByKey {
    type Hasher = FirstBytes;

    fn build_hasher(&self) -> FirstBytes {
        FirstBytes::default()
    }
}

impl Hasher for FirstBytes {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        // Of a key 32 bytes; of a slot 8, as a whole number.
        if let Some(first) = bytes.first_chunk::<8>() {
            self.0 ^= u64::from_le_bytes(*first);
        }
    }

    fn write_usize(&mut self, _: usize) {}
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.hex())
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.short())
    }
}

/// A library in a recipe: its content, not its place.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Binary {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// BLAKE3 of its bytes, hex.
    pub hash: String,
}

/// What all instances of a step have in common in their keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ingredients {
    /// Name of the step in the file: it is in the artifact, and later steps see it.
    pub step: String,
    /// The plugin.
    pub plugin: Binary,
    /// Components, in order of their place in the parameters.
    pub components: Vec<Binary>,
    /// Resolved parameters (SI); a file's path is replaced by its name and hash.
    pub parameters: Value,
    /// Other files: JSON pointer and hash.
    pub files: Vec<(String, String)>,
    /// Version of the data model.
    pub data_model: u32,
}

impl Ingredients {
    /// Those of a step.
    pub fn of(step: &ResolvedStep) -> Self {
        let mut parameters = step.parameters.clone_value();
        let mut files = Vec::with_capacity(step.files.len());
        for file in &step.files {
            // Where a file lies must not matter, only what is in it.
            if let Some(slot) = parameters.pointer_mut(&file.pointer)
                && slot.is_string()
            {
                let name = file.path.file_name().unwrap_or_default();
                *slot = Value::String(format!("{name} (blake3 {})", file.hash));
            }
            files.push((file.pointer.clone(), file.hash.clone()));
        }
        let binary = |p: &plyflow_workflow::resolved::PluginId| Binary {
            name: p.name.clone(),
            version: p.version.clone(),
            hash: p.hash.clone(),
        };
        Self {
            step: step.in_file().to_owned(),
            plugin: binary(&step.plugin),
            components: step.components.iter().map(binary).collect(),
            parameters,
            files,
            data_model: DATA_MODEL_VERSION,
        }
    }

    /// The step's recipe: BLAKE3 of their canonical JSON.
    pub fn digest(&self) -> Key {
        let mut text = String::with_capacity(512);
        // Field by field, so that no serialiser's choice of key order can move the key.
        let mut line = |value: &Value| {
            write_canonical(value, &mut text);
            text.push('\n');
        };
        let binary = |b: &Binary| serde_json::json!([b.name, b.hash]);
        line(&Value::from(self.step.as_str()));
        line(&binary(&self.plugin));
        line(&Value::Array(self.components.iter().map(binary).collect()));
        line(&self.parameters);
        line(&serde_json::json!(self.files));
        line(&Value::from(self.data_model));
        Key(*blake3::hash(text.as_bytes()).as_bytes())
    }
}

/// JSON with sorted keys and no white space: equal values have equal text.
pub fn canonical_json(value: &Value) -> String {
    let mut text = String::new();
    write_canonical(value, &mut text);
    text
}

fn write_canonical(value: &Value, out: &mut String) {
    match value {
        Value::Object(map) => {
            let mut keys: Vec<&String> = map.keys().collect();
            keys.sort_unstable();
            out.push('{');
            for (at, key) in keys.into_iter().enumerate() {
                if at > 0 {
                    out.push(',');
                }
                out.push_str(&Value::from(key.as_str()).to_string());
                out.push(':');
                write_canonical(&map[key], out);
            }
            out.push('}');
        }
        Value::Array(items) => {
            out.push('[');
            for (at, item) in items.iter().enumerate() {
                if at > 0 {
                    out.push(',');
                }
                write_canonical(item, out);
            }
            out.push(']');
        }
        scalar => out.push_str(&scalar.to_string()),
    }
}

/// One input in a key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputKey {
    /// Port.
    pub port: String,
    /// Giving step.
    pub step: String,
    /// Its index path.
    pub item: Vec<u64>,
    /// Its key.
    pub key: Key,
}

/// The key of one instance.
pub fn instance_key<'a>(
    recipe: &Key,
    item: &[u64],
    inputs: impl Iterator<Item = (&'a str, &'a str, &'a [u64], &'a Key)>,
) -> Key {
    let mut bytes = Vec::with_capacity(256);
    let text = |bytes: &mut Vec<u8>, t: &str| {
        bytes.extend_from_slice(&(t.len() as u64).to_le_bytes());
        bytes.extend_from_slice(t.as_bytes());
    };
    let path = |bytes: &mut Vec<u8>, p: &[u64]| {
        bytes.extend_from_slice(&(p.len() as u64).to_le_bytes());
        for i in p {
            bytes.extend_from_slice(&i.to_le_bytes());
        }
    };
    bytes.extend_from_slice(b"plyflow instance key 1");
    bytes.extend_from_slice(&recipe.0);
    path(&mut bytes, item);
    for (port, step, input_item, key) in inputs {
        text(&mut bytes, port);
        text(&mut bytes, step);
        path(&mut bytes, input_item);
        bytes.extend_from_slice(&key.0);
    }
    Key(*blake3::hash(&bytes).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::super::tests::step;
    use super::*;
    use plyflow_workflow::resolved::InputFile;
    use serde_json::json;

    fn key_of(change: impl FnOnce(&mut ResolvedStep)) -> Key {
        let mut s = step("a", &[], &[]);
        s.parameters = json!({"scene": {"tool": "/here/tool.stl"}, "angle": 0.5}).into();
        s.files = vec![InputFile {
            pointer: "/scene/tool".into(),
            path: "/here/tool.stl".into(),
            hash: "11".into(),
        }];
        change(&mut s);
        Ingredients::of(&s).digest()
    }

    #[test]
    fn the_key_follows_binary_components_parameters_and_file_content() {
        let base = key_of(|_| {});
        assert_ne!(base, key_of(|s| s.plugin.hash = "01".into()));
        assert_ne!(base, key_of(|s| s.components.push(s.plugin.clone())));
        assert_ne!(base, key_of(|s| s.parameters["angle"] = json!(0.25)));
        assert_ne!(base, key_of(|s| s.files[0].hash = "12".into()));
    }

    #[test]
    fn the_key_does_not_follow_the_name_of_a_point() {
        let base = key_of(|_| {});
        let at_point = key_of(|s| {
            s.base = Some(std::mem::replace(&mut s.name, "a@angle=45deg".into()));
        });
        assert_eq!(base, at_point);
    }

    #[test]
    fn the_key_does_not_follow_places_versions_or_the_order_of_parameters() {
        let base = key_of(|_| {});
        let moved = key_of(|s| {
            s.plugin.path = "/there/p.so".into();
            s.files[0].path = "/there/tool.stl".into();
            s.parameters = json!({"angle": 0.5, "scene": {"tool": "/there/tool.stl"}}).into();
            s.resources.cores = 7;
        });
        assert_eq!(base, moved);
    }

    #[test]
    fn the_instance_key_follows_item_port_step_and_order_of_inputs() {
        let (r, a, b) = (Key([1; 32]), Key([2; 32]), Key([3; 32]));
        let key = |item: &[u64], inputs: &[(&str, &str, &[u64], &Key)]| {
            instance_key(&r, item, inputs.iter().copied())
        };
        let base = key(&[0], &[("p", "s", &[0], &a), ("p", "s", &[1], &b)]);
        assert_ne!(
            base,
            key(&[1], &[("p", "s", &[0], &a), ("p", "s", &[1], &b)])
        );
        assert_ne!(
            base,
            key(&[0], &[("p", "s", &[0], &b), ("p", "s", &[1], &a)])
        );
        assert_ne!(
            base,
            key(&[0], &[("q", "s", &[0], &a), ("p", "s", &[1], &b)])
        );
        assert_ne!(base, key(&[0], &[("p", "s", &[0], &a)]));
        assert_eq!(
            base,
            key(&[0], &[("p", "s", &[0], &a), ("p", "s", &[1], &b)])
        );
    }

    #[test]
    fn canonical_json_sorts_keys_at_every_depth() {
        let a: Value =
            serde_json::from_str(r#"{"b": [1, {"d": 2, "c": 3.5}], "a": null}"#).unwrap();
        assert_eq!(canonical_json(&a), r#"{"a":null,"b":[1,{"c":3.5,"d":2}]}"#);
    }
}
