//! The tool with its size.

use crate::draw::{Drawn, Sharpness, tool_picture};
use crate::plain::Tool;
use crate::units::{number, quantity};
use maud::{Markup, html};
use serde_json::Value;

/// Width of the picture (px).
const WIDTH: f64 = 430.0;

/// The tool as a picture, with its size and the words of the scene.
///
/// # Errors
/// When the picture cannot be encoded.
pub(super) fn drawn(tool: Option<&Tool>, told: Option<&Value>, sharp: Sharpness) -> Drawn {
    let picture = tool.map(|t| tool_picture(t, WIDTH, sharp)).transpose()?;
    if picture.is_none() && told.is_none() {
        return Ok(html! {});
    }
    let mut words = Vec::new();
    if let Some(told) = told {
        listed(told, "", &mut words);
    }
    let kind = told
        .and_then(Value::as_object)
        .and_then(|t| t.keys().next());
    Ok(html! {
        h4 { "Tool" @if let Some(kind) = kind { " " code { (kind) } } }
        div class="row tool" {
            @if let Some((figure, size)) = &picture {
                figure class="map" { (figure) figcaption { (size_text(*size)) } }
            }
            (list(&words))
        }
    })
}

fn size_text(size: [f64; 3]) -> String {
    let [x, y, z] = size.map(|v| number(v * 1e3, 4));
    format!("{x} mm along x, {y} mm along y, {z} mm high")
}

fn list(words: &[(String, String)]) -> Markup {
    html! { @if !words.is_empty() {
        ul class="words-of-tool" { @for (name, value) in words { li { span { (name) } " " b { (value) } } } }
    } }
}

/// The values of a scene's words, one a line: `top_width`, `130 mm`.
fn listed(value: &Value, name: &str, all: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                // The word for the kind of tool stands in the heading.
                let deeper = match (name, value.is_object()) {
                    ("", true) => String::new(),
                    ("", false) => key.clone(),
                    _ => format!("{name}, {key}"),
                };
                listed(value, &deeper, all);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (k, value) in list.iter().enumerate() {
                listed(value, &format!("{name} {}", k + 1), all);
            }
        }
        Value::Array(list) => {
            let texts: Vec<String> = list.iter().map(told).collect();
            all.push((name.to_owned(), texts.join(", ")));
        }
        Value::Null => {}
        one => all.push((name.to_owned(), told(one))),
    }
}

/// A value in the units of the trade; of a path its last part.
fn told(value: &Value) -> String {
    let Some(text) = value.as_str() else {
        return value.to_string();
    };
    let quantity = text
        .split_once(' ')
        .and_then(|(n, unit)| Some(quantity(n.parse().ok()?, unit, 5)));
    quantity.unwrap_or_else(|| text.rsplit('/').next().unwrap_or(text).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn words_of_a_scene_are_listed_in_the_units_of_the_trade() {
        let tool = json!({"joggle_spar": {"draft": "0.13962634015954636 rad", "top_width": "0.13 m",
            "joggles": [{"rise": "0.01 m", "side_step": ["0.006 m", "0 m"]}]}});
        let mut all = Vec::new();
        listed(&tool, "", &mut all);
        let all: Vec<(&str, &str)> = all.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        assert_eq!(
            all,
            [
                ("draft", "8 deg"),
                ("joggles 1, rise", "10 mm"),
                ("joggles 1, side_step", "6 mm, 0 mm"),
                ("top_width", "130 mm")
            ]
        );
        assert_eq!(told(&json!("/somewhere/a tool.stl")), "a tool.stl");
    }
}
