//! Tables of values, and the points of a study.

use crate::expression::{Expression, ExpressionError, Names};
use crate::number::Quantity;
use crate::problem::Problem;
use crate::value::{Kind, Value};
use std::collections::HashMap;

/// Most points of a study.
pub const MOST_POINTS: usize = 100_000;

/// Columns of values, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub names: Vec<String>,
    /// One value for each column.
    pub rows: Vec<Vec<Value>>,
}

/// A variable of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// The unit of its values; empty for plain numbers and for what is no number.
    pub unit: String,
    /// What it is.
    pub kind: Kind,
}

/// A point: a value for each variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its name, `angle=45deg,mu=0.1`: its values, in the order of the variables.
    pub name: String,
    /// Its values.
    pub values: Vec<Value>,
}

/// The points of a study, each once.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// The variables.
    pub variables: Vec<Variable>,
    /// The points, in the order in which the study names them first.
    pub all: Vec<Point>,
}

fn too_many(n: usize) -> Problem {
    Problem::new(format!("the study has {n} points"))
        .expected(format!("at most {MOST_POINTS}"))
        .help("a coarser range, or a sample")
}

impl Table {
    /// All combinations of the values, the last variable changing fastest.
    ///
    /// # Errors
    /// When there are too many.
    pub fn vary(columns: Vec<(String, Vec<Value>)>) -> Result<Self, Problem> {
        let one = |(name, values): (String, Vec<Value>)| Self {
            names: vec![name],
            rows: values.into_iter().map(|v| vec![v]).collect(),
        };
        Self::product(columns.into_iter().map(one).collect())
    }

    /// The values side by side: the first of each, the second of each. A single value stands beside every other.
    ///
    /// # Errors
    /// When the columns are not equally long.
    pub fn zip(columns: Vec<(String, Vec<Value>)>) -> Result<Self, Problem> {
        let n = columns.iter().map(|c| c.1.len()).max().unwrap_or(0);
        if let Some(odd) = columns.iter().find(|c| c.1.len() != n && c.1.len() != 1) {
            let longest = columns.iter().find(|c| c.1.len() == n);
            let longest = longest.map_or("", |c| c.0.as_str());
            return Err(Problem::new(format!(
                "`{}` has {} values and `{longest}` {n}",
                odd.0,
                odd.1.len()
            ))
            .expected("as many values of each")
            .help("for all combinations, use `vary`"));
        }
        let at = |values: &Vec<Value>, i: usize| values[i.min(values.len() - 1)].clone();
        Ok(Self {
            names: columns.iter().map(|c| c.0.clone()).collect(),
            rows: (0..n)
                .map(|i| columns.iter().map(|c| at(&c.1, i)).collect())
                .collect(),
        })
    }

    /// Every row of each with every row of the others, the last table changing fastest.
    ///
    /// # Errors
    /// When two have a variable in common, or there are too many rows.
    pub fn product(tables: Vec<Table>) -> Result<Self, Problem> {
        let mut all = Self {
            names: Vec::new(),
            rows: vec![Vec::new()],
        };
        for table in tables {
            if let Some(twice) = table.names.iter().find(|n| all.names.contains(n)) {
                return Err(
                    Problem::new(format!("`{twice}` is given by two parts of a product"))
                        .expected("each variable in one part"),
                );
            }
            let n = all.rows.len().saturating_mul(table.rows.len());
            if n > MOST_POINTS {
                return Err(too_many(n));
            }
            all.names.extend(table.names);
            let pair = |a: &Vec<Value>, b: &Vec<Value>| a.iter().chain(b).cloned().collect();
            all.rows = (all.rows.iter())
                .flat_map(|a| table.rows.iter().map(move |b| pair(a, b)))
                .collect();
        }
        Ok(all)
    }

    /// The rows of one behind those of the other.
    ///
    /// # Errors
    /// When they do not have the same variables, or there are too many rows.
    pub fn union(tables: Vec<Table>) -> Result<Self, Problem> {
        let mut tables = tables.into_iter();
        let Some(mut all) = tables.next() else {
            return Err(Problem::new("a union of nothing").expected("at least one part"));
        };
        for (i, table) in tables.enumerate() {
            let place = |name: &String| table.names.iter().position(|n| n == name);
            let places: Option<Vec<usize>> = all.names.iter().map(place).collect();
            let Some(places) = places.filter(|p| p.len() == table.names.len()) else {
                return Err(Problem::new(format!(
                    "part {} of the union has the variables {}, and part 1 has {}",
                    i + 2,
                    table.names.join(", "),
                    all.names.join(", ")
                ))
                .expected("the same variables in every part")
                .help("give what a part does not vary as one value, such as `vary: {mu: 0.1}`"));
            };
            let row = |r: &Vec<Value>| places.iter().map(|p| r[*p].clone()).collect();
            all.rows.extend(table.rows.iter().map(row));
            if all.rows.len() > MOST_POINTS {
                return Err(too_many(all.rows.len()));
            }
        }
        Ok(all)
    }

    /// Keeps the rows for which a condition holds.
    ///
    /// # Errors
    /// When the condition cannot be read or computed, with the place in its text.
    pub fn keep(&mut self, condition: &str) -> Result<(), ExpressionError> {
        let names = Names {
            all: &self.names,
            bare: true,
        };
        let condition = Expression::read(condition, names)?;
        let mut kept = Vec::with_capacity(self.rows.len());
        for row in std::mem::take(&mut self.rows) {
            if condition.holds(&row)? {
                kept.push(row);
            }
        }
        self.rows = kept;
        Ok(())
    }
}

impl Points {
    /// The points of a table. Values get the unit that their variable has first; what stands there twice is there once.
    ///
    /// # Errors
    /// When a variable has values of different kinds.
    pub fn new(table: Table) -> Result<Self, Problem> {
        let mut variables = Vec::new();
        let mut units: Vec<Option<Quantity>> = Vec::new();
        let first = table.rows.first();
        for (i, name) in table.names.iter().enumerate() {
            let value = first.map(|r| &r[i]);
            let unit = match value {
                Some(Value::Quantity(q)) => Some(q.clone()),
                _ => None,
            };
            variables.push(Variable {
                name: name.clone(),
                unit: unit.as_ref().map_or(String::new(), |q| q.unit.clone()),
                kind: value.map_or(Kind::Text, Value::kind),
            });
            units.push(unit);
        }
        let mut all: Vec<Point> = Vec::with_capacity(table.rows.len());
        let mut known: HashMap<String, usize> = HashMap::new();
        for row in table.rows {
            let mut values = Vec::with_capacity(row.len());
            for ((value, variable), unit) in row.into_iter().zip(&variables).zip(&units) {
                if value.kind() != variable.kind {
                    return Err(mixed(variable, &value));
                }
                values.push(match (value, unit) {
                    (Value::Quantity(q), Some(unit)) => Value::Quantity(q.in_unit_of(unit)?),
                    (value, _) => value,
                });
            }
            let name = name(&variables, &values);
            match known.get(&name) {
                Some(i) if all[*i].values == values => continue,
                Some(_) => {
                    return Err(Problem::new(format!(
                        "two points would have the name `{name}`"
                    )));
                }
                None => {}
            }
            known.insert(name.clone(), all.len());
            all.push(Point { name, values });
        }
        Ok(Self { variables, all })
    }
}

fn mixed(variable: &Variable, value: &Value) -> Problem {
    Problem::new(format!(
        "`{}` is {} at one point and {} at another (`{}`)",
        variable.name,
        variable.kind.in_words(),
        value.kind().in_words(),
        value.text()
    ))
    .expected("values of one kind")
}

/// The name of values, or of some of them.
fn name(variables: &[Variable], values: &[Value]) -> String {
    let parts = variables.iter().zip(values);
    let parts: Vec<String> = parts
        .map(|(v, x)| format!("{}={}", v.name, x.label()))
        .collect();
    parts.join(",")
}

impl Point {
    /// The name of some of its values, those of these variables (their positions, in order).
    #[must_use]
    pub fn part(&self, variables: &[Variable], of: &[usize]) -> String {
        let part = |i: &usize| format!("{}={}", variables[*i].name, self.values[*i].label());
        of.iter().map(part).collect::<Vec<_>>().join(",")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, values: &[&str]) -> (String, Vec<Value>) {
        let value = |t: &&str| Value::of_cell(t, "").unwrap();
        (name.to_owned(), values.iter().map(value).collect())
    }

    fn names(table: Table) -> Vec<String> {
        let points = Points::new(table).unwrap();
        points.all.into_iter().map(|p| p.name).collect()
    }

    #[test]
    fn points_are_named_by_their_values_in_the_order_of_the_variables() {
        let table = Table::vary(vec![
            column("angle", &["0 deg", "45 deg"]),
            column("mu", &["0.05", "0.10"]),
        ]);
        assert_eq!(
            names(table.unwrap()),
            [
                "angle=0deg,mu=0.05",
                "angle=0deg,mu=0.1",
                "angle=45deg,mu=0.05",
                "angle=45deg,mu=0.1"
            ]
        );
        let odd = Table::vary(vec![column("layup", &["a b,c=d", "x"])]).unwrap();
        assert_eq!(names(odd), ["layup=a%20b%2cc%3dd", "layup=x"]);
    }

    #[test]
    fn parts_are_multiplied_added_and_filtered() {
        let a = || Table::vary(vec![column("a", &["1", "2", "3"])]).unwrap();
        let b = || {
            Table::zip(vec![
                column("b", &["1", "2"]),
                column("c", &["x", "y"]),
                column("d", &["5"]),
            ])
            .unwrap()
        };
        let mut both = Table::product(vec![a(), b()]).unwrap();
        assert_eq!((both.rows.len(), both.names.len()), (6, 4));
        both.keep("a <= b or c == 'x'").unwrap();
        assert_eq!(
            names(both),
            [
                "a=1,b=1,c=x,d=5",
                "a=1,b=2,c=y,d=5",
                "a=2,b=1,c=x,d=5",
                "a=2,b=2,c=y,d=5",
                "a=3,b=1,c=x,d=5"
            ]
        );
        // The same point twice is one.
        let twice = Table::union(vec![
            a(),
            Table::vary(vec![column("a", &["3.0", "4"])]).unwrap(),
        ])
        .unwrap();
        assert_eq!(names(twice), ["a=1", "a=2", "a=3", "a=4"]);
        assert!(Table::product(vec![a(), a()]).is_err());
        assert!(Table::union(vec![a(), b()]).is_err());
        assert!(
            Table::zip(vec![
                column("a", &["1", "2", "3"]),
                column("b", &["1", "2"])
            ])
            .is_err()
        );
        let many: Vec<&str> = vec!["1"; 1000];
        assert!(Table::vary(vec![column("a", &many), column("b", &many)]).is_err());
    }

    #[test]
    fn values_of_a_variable_are_of_one_kind_and_have_its_first_unit() {
        let table = Table::vary(vec![column("x", &["1 cm", "5 mm"])]).unwrap();
        assert_eq!(names(table), ["x=1cm", "x=0.5cm"]);
        for other in ["5 s", "wide", "5"] {
            let table = Table::vary(vec![column("x", &["1 cm", other])]).unwrap();
            assert!(
                Points::new(table)
                    .unwrap_err()
                    .message
                    .contains("at another"),
                "{other}"
            );
        }
    }
}
