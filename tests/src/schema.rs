//! Whether a JSON value is what a JSON Schema says, for the part of draft 2020-12 that `docs/schema` uses. A keyword that is not known here is a
//! fault of the schema: nothing is passed over. A field that the schema does not describe is a fault too, though the schema allows it: a newer program
//! may print more, this one prints what is described.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

/// Keywords that say nothing of a value.
const NOTES: [&str; 4] = ["$schema", "$defs", "title", "description"];

/// A file of schemas, and those beside it that it refers to.
#[derive(Debug)]
pub struct Schema {
    folder: PathBuf,
    root: Value,
}

impl Schema {
    /// Reads a schema.
    ///
    /// # Panics
    /// If it is none.
    pub fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let root =
            serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let folder = path.parent().expect("a file lies in a folder").to_owned();
        Self { folder, root }
    }

    /// What of `value` is otherwise than the schema says, each with its place.
    pub fn faults(&self, value: &Value) -> Vec<String> {
        let mut faults = Vec::new();
        self.check(&self.root, value, "", &mut faults);
        faults
    }

    fn check(&self, schema: &Value, value: &Value, at: &str, faults: &mut Vec<String>) {
        let Some(keywords) = schema.as_object() else {
            // `true`, which anything is, and `false`, which nothing is.
            if *schema != Value::Bool(true) {
                faults.push(format!("{at}: not expected"));
            }
            return;
        };
        for (keyword, said) in keywords {
            let mut fault = |what: String| faults.push(format!("{at}: {what}"));
            match keyword.as_str() {
                note if NOTES.contains(&note) => {}
                "type" => {
                    let types = said
                        .as_array()
                        .map_or(std::slice::from_ref(said), Vec::as_slice);
                    if !types.iter().any(|name| is(name, value)) {
                        fault(format!("not {said} but {value:.80}"));
                    }
                }
                "const" if said == value => {}
                "const" => fault(format!("not {said} but {value}")),
                "enum" if said.as_array().is_some_and(|all| all.contains(value)) => {}
                "enum" => fault(format!("none of {said} but {value}")),
                // Of an object alone, as JSON Schema has it: where `type` lets null pass, it has nothing.
                "required" if !value.is_object() => {}
                "required" => {
                    let has =
                        |name: &Value| name.as_str().is_some_and(|name| value.get(name).is_some());
                    let missing = said
                        .as_array()
                        .into_iter()
                        .flatten()
                        .filter(|name| !has(name));
                    missing.for_each(|name| fault(format!("without {name}")));
                }
                "properties" => {
                    for (name, schema) in said.as_object().into_iter().flatten() {
                        if let Some(value) = value.get(name) {
                            self.check(schema, value, &format!("{at}/{name}"), faults);
                        }
                    }
                    if !keywords.contains_key("additionalProperties") {
                        others(keywords, value).for_each(|(name, _)| {
                            faults.push(format!("{at}/{name}: not described"));
                        });
                    }
                }
                "additionalProperties" => {
                    for (name, value) in others(keywords, value) {
                        self.check(said, value, &format!("{at}/{name}"), faults);
                    }
                }
                "items" => {
                    for (n, value) in value.as_array().into_iter().flatten().enumerate() {
                        self.check(said, value, &format!("{at}/{n}"), faults);
                    }
                }
                "anyOf" => {
                    let of = |schema| {
                        let mut faults = Vec::new();
                        self.check(schema, value, at, &mut faults);
                        faults
                    };
                    let all: Vec<Vec<String>> =
                        said.as_array().into_iter().flatten().map(of).collect();
                    // The nearest one says what is wrong.
                    if let Some(least) = all.into_iter().min_by_key(Vec::len) {
                        faults.extend(least);
                    }
                }
                "$ref" => match said.as_str().and_then(|name| name.split_once("#/$defs/")) {
                    Some((file, name)) => {
                        let other = (!file.is_empty()).then(|| Self::read(&self.folder.join(file)));
                        let home = other.as_ref().unwrap_or(self);
                        match home.root["$defs"].get(name) {
                            Some(schema) => home.check(schema, value, at, faults),
                            None => fault(format!("the schema has no {said}")),
                        }
                    }
                    None => fault(format!("{said} is no reference to $defs")),
                },
                _ => fault(format!("the keyword {keyword} is not known")),
            }
        }
    }
}

/// Fields of an object that its schema does not describe.
fn others<'a>(
    keywords: &Map<String, Value>,
    value: &'a Value,
) -> impl Iterator<Item = (&'a String, &'a Value)> {
    let known = keywords.get("properties").and_then(Value::as_object);
    let is_known = move |name: &str| known.is_some_and(|known| known.contains_key(name));
    let all = value.as_object().into_iter().flatten();
    all.filter(move |(name, _)| !is_known(name))
}

fn is(name: &Value, value: &Value) -> bool {
    match name.as_str() {
        Some("null") => value.is_null(),
        Some("boolean") => value.is_boolean(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("number") => value.is_number(),
        Some("string") => value.is_string(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn faults(schema: Value, value: Value) -> usize {
        let folder = PathBuf::new();
        Schema {
            folder,
            root: schema,
        }
        .faults(&value)
        .len()
    }

    #[test]
    fn each_keyword_finds_its_fault() {
        let table = [
            (json!({"type": "number"}), json!(1.5), json!("1.5")),
            (
                json!({"type": ["integer", "null"]}),
                json!(null),
                json!(1.5),
            ),
            (json!({"const": "a/1"}), json!("a/1"), json!("a/2")),
            (json!({"enum": ["a", "b"]}), json!("b"), json!("c")),
            (
                json!({"required": ["a"]}),
                json!({"a": null}),
                json!({"b": 1}),
            ),
            (
                json!({"properties": {"a": {"type": "string"}}}),
                json!({}),
                json!({"a": 1}),
            ),
            (
                json!({"properties": {"a": true}}),
                json!({"a": 1}),
                json!({"b": 1}),
            ),
            (
                json!({"properties": {"a": true}, "additionalProperties": false}),
                json!({"a": 1}),
                json!({"b": 1}),
            ),
            (
                json!({"additionalProperties": {"type": "null"}}),
                json!({"a": null}),
                json!({"a": 1}),
            ),
            (
                json!({"items": {"type": "boolean"}}),
                json!([true]),
                json!([true, 1]),
            ),
            (
                json!({"anyOf": [{"type": "null"}, {"type": "string"}]}),
                json!("a"),
                json!(1),
            ),
            (
                json!({"$ref": "#/$defs/a", "$defs": {"a": {"type": "null"}}}),
                json!(null),
                json!(1),
            ),
        ];
        for (schema, good, bad) in table {
            assert_eq!(faults(schema.clone(), good), 0, "{schema}");
            assert_eq!(faults(schema.clone(), bad), 1, "{schema}");
        }
        assert_eq!(faults(json!({"minimum": 1}), json!(2)), 1, "passed over");
    }
}
