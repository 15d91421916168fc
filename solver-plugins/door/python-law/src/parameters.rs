//! The parameters of a sheet, as the code takes them: doubles in a row.

use serde::Deserialize;
use serde_json::Value as Json;

/// One parameter. In the row it takes one place, and a list two: where its values begin and end, which stand behind all others.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Value {
    /// Its name; for a field of an object the names from the outside inwards.
    path: Vec<String>,
    form: Form,
    /// The words of a choice, which becomes their index.
    #[serde(default)]
    words: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Form {
    /// Also an integer, which a double holds up to 2^53.
    Number,
    Boolean,
    Choice,
    List,
}

/// The row of doubles.
///
/// # Errors
/// A parameter is missing or of another kind than the manifest says; for the user.
pub fn row(values: &[Value], parameters: &Json) -> Result<Vec<f64>, String> {
    let places = values.iter().map(|v| 1 + usize::from(v.form == Form::List));
    let (mut row, mut lists) = (Vec::new(), Vec::new());
    let first = places.sum::<usize>();
    for value in values {
        let given = value
            .path
            .iter()
            .try_fold(parameters, |at, name| at.get(name))
            .unwrap_or(&Json::Null);
        if value.form == Form::List {
            let list = given
                .as_array()
                .and_then(|l| l.iter().map(Json::as_f64).collect::<Option<Vec<f64>>>());
            let list = list.ok_or_else(|| value.refused(given))?;
            row.push((first + lists.len()) as f64);
            lists.extend(list);
            row.push((first + lists.len()) as f64);
        } else {
            row.push(value.one(given).ok_or_else(|| value.refused(given))?);
        }
    }
    row.extend(lists);
    Ok(row)
}

impl Value {
    fn one(&self, given: &Json) -> Option<f64> {
        match self.form {
            Form::Number => given.as_f64(),
            Form::Boolean => given.as_bool().map(|yes| f64::from(u8::from(yes))),
            Form::Choice => {
                let word = given.as_str()?;
                let index = self.words.iter().position(|w| w == word)?;
                Some(index as f64)
            }
            Form::List => None,
        }
    }

    fn refused(&self, given: &Json) -> String {
        let expected = match self.form {
            Form::Number => "a number".to_owned(),
            Form::Boolean => "true or false".to_owned(),
            Form::Choice => format!("one of {}", self.words.join(", ")),
            Form::List => "a list of numbers".to_owned(),
        };
        format!(
            "parameter {}: given {given}; expected {expected}",
            self.path.join(".")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn values() -> Vec<Value> {
        serde_json::from_value(json!([
            {"path": ["modulus"], "form": "number"},
            {"path": ["strains"], "form": "list"},
            {"path": ["bending", "locks"], "form": "boolean"},
            {"path": ["bending", "kind"], "form": "choice", "words": ["linear", "cubic"]},
            {"path": ["stresses"], "form": "list"},
        ]))
        .unwrap()
    }

    #[test]
    fn lists_stand_behind_all_other_values_and_say_where() {
        let given = json!({"modulus": 2e9, "strains": [1, 2.5, 4], "bending": {"locks": true, "kind": "cubic"}, "stresses": []});
        let row = row(&values(), &given).unwrap();
        assert_eq!(row, [2e9, 7.0, 10.0, 1.0, 1.0, 10.0, 10.0, 1.0, 2.5, 4.0]);
    }

    #[test]
    fn a_parameter_that_is_missing_or_wrong_is_named_with_what_was_expected() {
        let good = json!({"modulus": 1, "strains": [1], "bending": {"locks": true, "kind": "cubic"}, "stresses": [1]});
        let with = |pointer: &str, value: Json| {
            let mut other = good.clone();
            *other.pointer_mut(pointer).unwrap() = value;
            row(&values(), &other).unwrap_err()
        };
        let told = "parameter modulus: given \"x\"; expected a number";
        assert_eq!(with("/modulus", json!("x")), told);
        let told = "parameter bending.locks: given null; expected true or false";
        assert_eq!(with("/bending", json!({})), told);
        let told = "parameter bending.kind: given \"cubed\"; expected one of linear, cubic";
        assert_eq!(with("/bending/kind", json!("cubed")), told);
        let told = "parameter strains: given [1,\"a\"]; expected a list of numbers";
        assert_eq!(with("/strains", json!([1, "a"])), told);
    }
}
