//! What the crate promises: each public name with its signature, in a committed list, so that no name changes unnoticed.

use std::path::Path;

/// The list. `PROPRIO_ACCEPT=1 cargo test -p proprio --test public_names` writes it anew.
const LIST: &str = "tests/public_names.txt";

/// Public items, fields and methods, variants of public enums, and traits, as rustfmt lays them out: what a line begins with `pub` (but
/// `pub(`), or with a variant's name, goes on to its body.
fn public(file: &str, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let (mut owner, mut in_enum) = (file.to_owned(), false);
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let declaration = line.trim_start();
        if line.starts_with("impl") {
            owner = line.trim_end_matches(" {").to_owned();
            if owner.contains(" for ") {
                found.push(owner.clone());
            }
        } else if line.starts_with("pub ") {
            owner = file.to_owned();
            in_enum = line.starts_with("pub enum");
        } else if line.starts_with('}') {
            (owner, in_enum) = (file.to_owned(), false);
        }
        let is_attribute = line.starts_with("#[derive") || line.starts_with("#[non_exhaustive");
        let is_member = in_enum && declaration.starts_with(|c: char| c.is_ascii_alphabetic());
        if !is_attribute && !is_member && !declaration.starts_with("pub ") {
            continue;
        }
        let ends: &[char] = match () {
            () if declaration.starts_with("pub use") => &[';'],
            () if declaration.contains("fn ") => &['{', ';'],
            () => &['{', ';', ',', ']'],
        };
        let mut declaration = declaration.to_owned();
        while !declaration.ends_with(ends) {
            let Some(more) = lines.next() else { break };
            declaration += more.trim();
        }
        let declaration = declaration.trim_end_matches(['{', ';', ',']).trim_end();
        found.push(format!("{owner}: {declaration}"));
    }
    found
}

#[test]
fn the_public_names_are_those_of_the_list() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut names = Vec::new();
    for file in [
        "lib",
        "dynamics",
        "error",
        "excite",
        "model",
        "recording",
        "results",
    ] {
        let text = std::fs::read_to_string(folder.join(format!("src/{file}.rs"))).unwrap();
        names.extend(public(file, &text));
    }
    let names = names.join("\n") + "\n";
    if std::env::var_os("PROPRIO_ACCEPT").is_some() {
        std::fs::write(folder.join(LIST), &names).unwrap();
    }
    let list = std::fs::read_to_string(folder.join(LIST)).unwrap();
    let gone = list
        .lines()
        .filter(|name| !names.lines().any(|n| n == *name));
    let new = names
        .lines()
        .filter(|name| !list.lines().any(|n| n == *name));
    let (gone, new): (Vec<_>, Vec<_>) = (gone.collect(), new.collect());
    assert!(
        gone.is_empty() && new.is_empty(),
        "what others build on changes; gone: {gone:#?}, new: {new:#?}"
    );
}

#[test]
fn declarations_are_found() {
    let text = "\
#[derive(Debug)]
pub enum E {
    /// Doc.
    #[error(\"x\")]
    A(u8),
    B {
        /// Doc.
        b: f64,
    },
}

pub(crate) fn hidden() {}

impl E {
    pub fn of(
        a: u8,
        b: u8,
    ) -> Self {
    }
}

impl Clone for T {
    fn clone(&self) -> Self {
    }
}

pub struct T(pub(crate) u8);
";
    let expected = [
        "f: #[derive(Debug)]",
        "f: pub enum E",
        "f: A(u8)",
        "f: B",
        "f: b: f64",
        "impl E: pub fn of(a: u8,b: u8,) -> Self",
        "impl Clone for T",
        "f: pub struct T(pub(crate) u8)",
    ];
    assert_eq!(public("f", text), expected);
}
