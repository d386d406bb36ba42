//! The committed table: one part per study, each replaced when its study is run.

use std::path::PathBuf;

use super::Failure;

/// Where it is.
pub fn path() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/excitation.md"))
}

const TITLE: &str = "# What designed motions tell\n\nMade by `cargo run --release -p proprio-studies --bin excitation_study -- --write`; \
                     a study's name runs it alone.\n";

/// The table with `text` as the part of `heading`.
pub fn replaced(table: &str, heading: &str, text: &str) -> String {
    let own = format!("## {heading}\n\n{}\n", text.trim());
    let start = table.find(&format!("## {heading}\n"));
    match start {
        None => format!("{}\n\n{own}", table.trim_end()),
        Some(start) => {
            let after = table[start + 3..].find("\n## ").map(|n| start + 3 + n + 1);
            let rest = after.map_or("", |after| &table[after..]);
            let gap = if rest.is_empty() { "" } else { "\n" };
            format!("{}{own}{gap}{rest}", &table[..start])
        }
    }
}

/// Writes `text` as the part of `heading`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(heading: &str, text: &str) -> Result<(), Failure> {
    let table = std::fs::read_to_string(path()).unwrap_or_else(|_| TITLE.to_owned());
    Ok(std::fs::write(path(), replaced(&table, heading, text))?)
}

#[cfg(test)]
mod tests {
    use super::replaced;

    #[test]
    fn a_part_is_replaced_and_the_others_stay() {
        let table = replaced("# T\n", "one", "1");
        let table = replaced(&table, "two", "2");
        assert_eq!(table, "# T\n\n## one\n\n1\n\n## two\n\n2\n");
        let table = replaced(&table, "one", "new\n");
        assert_eq!(table, "# T\n\n## one\n\nnew\n\n## two\n\n2\n");
        assert_eq!(replaced(&table, "two", "2"), table);
    }
}
