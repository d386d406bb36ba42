//! What `--json` prints: one object with the name of its schema, which `docs/schema` describes, and the errors of what was judged. A refusal
//! is such an object too.

use serde::Serialize;

use super::{Error, json};
use crate::diagnose::Diagnosis;
use crate::recording::LogGates;
use crate::summary::ErrorRange;

/// The number of a command's object: it grows when a key goes or changes its meaning.
fn format_of(command: &str) -> u32 {
    match command {
        "compare" => 2,
        _ => 1,
    }
}

#[derive(Serialize)]
struct Named<'a, T> {
    schema: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<ErrorRange>,
    #[serde(flatten)]
    result: &'a T,
}

#[derive(Serialize)]
struct Refusal {
    verdict: &'static str,
    reason: String,
    hint: Option<String>,
}

/// What `command` prints of a result that judges no model.
pub(super) fn result(command: &str, result: &impl Serialize) -> String {
    named(command, None, result)
}

/// What `command` prints of a result that judges one.
pub fn judged(command: &str, error: ErrorRange, result: &impl Serialize) -> String {
    named(command, Some(error), result)
}

/// What `diagnose` prints of a recording's diagnosis.
pub fn diagnosis(data: &[LogGates], diagnosis: &Diagnosis) -> String {
    super::diagnose::printed(data, diagnosis, None)
}

/// What `command` prints when it has no result.
pub(super) fn refused(command: &str, error: &Error, hint: Option<String>) -> String {
    let refusal = Refusal {
        verdict: "refused",
        reason: error.to_string(),
        hint,
    };
    named(command, None, &refusal)
}

fn named(command: &str, error: Option<ErrorRange>, result: &impl Serialize) -> String {
    json(&Named {
        schema: format!("proprio.{command}/{}", format_of(command)),
        error,
        result,
    })
}
