//! The words of README, docs/, the commands' help and every text that the program prints: phrases that no roboticist uses, sentences that are
//! too long, pages that grow, references that lead nowhere, and the catalogue's page.

use std::fs;
use std::path::{Path, PathBuf};

use proprio_tests::command::{done, folder, json};

use crate::readme::{has_heading, pages, root, slug};

/// Phrases that are not the field's, and what is said instead. A phrase is matched whatever its case, at whole words.
const PHRASES: &[(&[&str], &str)] = &[
    (
        &[
            "is told",
            "are told",
            "be told",
            "been told",
            "was told",
            "were told",
            "not told",
            "stay told",
            "stays told",
            "it told",
            "told apart",
            "told by",
            "told in part",
            "told to be",
            "no motion tells",
            "motion that tells",
            "motions that tell",
            "motion that would tell",
            "motions that would tell",
        ],
        "identified, identifiable; separated by; reported, printed; informative motion",
    ),
    (
        &[
            "prior more than",
            "held by the prior",
            "as open as before",
            "come out as none",
            "comes out as none",
            "came out as none",
        ],
        "prior-dominated",
    ),
    (&["what is left"], "the residual"),
    (
        &[
            "the engine before",
            "an engine of",
            "earlier engine",
            "the engine was",
            ", as it was,",
            "nobody has seen",
            "nobody had seen",
            "nobody has measured",
            "nobody had measured",
            "that nobody",
        ],
        "the present state alone; robots not used for tuning",
    ),
    (
        &[
            "unseen data",
            "unseen time",
            "fit has not seen",
            "it has not seen",
        ],
        "held out, held-out error",
    ),
    (
        &[
            "a play",
            "a wide play",
            "plays of",
            "plays in",
            "plays between",
        ],
        "backlash, a gap",
    ),
    (
        &["contact forces leave", "may carry a force"],
        "contact forces eliminated; may be in stance",
    ),
    (
        &["something beyond the feet"],
        "supported by something else",
    ),
    (&["triangle", "triangles"], "R factor"),
    (&["sways"], "moves its trunk"),
    (&["gives way", "give way"], "deflects, is compliant"),
    (&["mend"], "correct, fix"),
    (&["by turns"], "interleaved, in turn"),
    (&["dear", "dearest"], "expensive"),
    (&["black box"], "non-parametric bound"),
];

/// Words of a sentence at most, and in the middle of a page's sentences.
const LONGEST: usize = 40;
const MEDIAN: usize = 20;
/// Words of a page at most, its blocks of code apart: what a reader of its question reads to the end.
const PAGE_WORDS: [(&str, usize); 20] = [
    ("README.md", 500),
    ("docs/guide.md", 900),
    ("docs/logs.md", 700),
    ("docs/diagnose.md", 700),
    ("docs/identify.md", 500),
    ("docs/report.md", 400),
    ("docs/walking.md", 900),
    ("docs/excite.md", 900),
    ("docs/other-robots.md", 400),
    ("docs/wiring.md", 900),
    ("docs/board.md", 1800),
    ("docs/faults.md", 600),
    ("docs/monitor.md", 900),
    ("docs/limits.md", 1100),
    ("docs/commands.md", 500),
    ("docs/files.md", 800),
    ("docs/catalogue.md", 1500),
    ("docs/design.md", 900),
    ("docs/how-right.md", 350),
    ("docs/how-fast.md", 500),
];
/// Lines of docs/limits.md at most: a table to act on.
const LIMITS_LINES: usize = 60;

/// The phrases that stand in `text`, each with what is said instead.
fn banned(text: &str) -> Vec<String> {
    let joined = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let joined = joined.to_lowercase();
    let is_word = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
    let mut found = Vec::new();
    for (phrases, instead) in PHRASES {
        for phrase in *phrases {
            for (at, _) in joined.match_indices(phrase) {
                let (before, after) = (&joined[..at], &joined[at + phrase.len()..]);
                let begins = !is_word(before.chars().next_back()) || phrase.starts_with(',');
                if begins && !is_word(after.chars().next()) {
                    found.push(format!("\"{phrase}\": say {instead}"));
                }
            }
        }
    }
    found
}

/// What is prose of a page, a paragraph or list item each: no table, code block, heading.
fn paragraphs(page: &str) -> Vec<String> {
    let (mut all, mut code) = (vec![String::new()], false);
    for line in page.lines() {
        let trimmed = line.trim_start();
        if trimmed.starts_with("```") {
            code = !code;
        }
        let numbered = trimmed.split_once(". ").is_some_and(|(number, _)| {
            !number.is_empty() && number.chars().all(|c| c.is_ascii_digit())
        });
        let item = trimmed.starts_with("- ") || trimmed.starts_with("* ") || numbered;
        let apart = ["|", "#", "```", "["]
            .iter()
            .any(|s| trimmed.starts_with(s));
        if code || apart || trimmed.is_empty() || (line.starts_with("    ") && !item) {
            // A link may begin a line of prose.
            let prose = !code && trimmed.starts_with('[');
            all.push(if prose {
                trimmed.to_owned()
            } else {
                String::new()
            });
            continue;
        }
        if item {
            let (_, text) = trimmed.split_once(' ').unwrap_or_default();
            all.push(text.to_owned());
        } else if let Some(last) = all.last_mut() {
            *last += " ";
            *last += trimmed;
        }
    }
    all.retain(|paragraph| !paragraph.trim().is_empty());
    all
}

/// The sentences of a page.
fn sentences(page: &str) -> Vec<String> {
    let mut all = Vec::new();
    for paragraph in paragraphs(page) {
        let mut sentence = String::new();
        for word in paragraph.split_whitespace() {
            sentence += word;
            sentence += " ";
            let end = word.trim_end_matches(['"', '”', ')', '*', ']']);
            if end.ends_with(['.', '?', '!']) {
                all.push(std::mem::take(&mut sentence));
            }
        }
        all.push(sentence);
    }
    all.retain(|sentence| length(sentence) > 0);
    all
}

/// Words of a sentence or text: what has a letter or a digit.
fn length(sentence: &str) -> usize {
    let is_word = |word: &&str| word.chars().any(char::is_alphanumeric);
    sentence.split_whitespace().filter(is_word).count()
}

/// What a reader reads: README, CONTRIBUTING, the examples' page and all of docs/.
fn read_pages() -> Vec<(PathBuf, String)> {
    let others = ["README.md", "CONTRIBUTING.md", "examples/README.md"];
    let all = others.into_iter().map(PathBuf::from).chain(pages());
    all.map(|page| {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        (page, text)
    })
    .collect()
}

/// Fails with all of them, so that one run names every place.
fn none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

#[test]
fn the_pages_have_the_words_of_the_field() {
    let mut faults = Vec::new();
    for (page, text) in read_pages() {
        let found = banned(&text);
        faults.extend((found.iter()).map(|fault| format!("{}: {fault}", page.display())));
    }
    none(&faults);
}

#[test]
fn sentences_are_short() {
    let mut faults = Vec::new();
    for (page, text) in read_pages() {
        let sentences = sentences(&text);
        let long = sentences
            .iter()
            .filter(|sentence| length(sentence) > LONGEST);
        faults.extend(long.map(|sentence| format!("{}: {sentence}", page.display())));
        let mut lengths: Vec<usize> = sentences.iter().map(|sentence| length(sentence)).collect();
        lengths.sort_unstable();
        let median = lengths.get(lengths.len() / 2).copied().unwrap_or_default();
        if median > MEDIAN {
            faults.push(format!("{}: {median} words in the middle", page.display()));
        }
    }
    none(&faults);
}

#[test]
fn pages_stay_short() {
    for (page, most) in PAGE_WORDS {
        let text = fs::read_to_string(root().join(page)).unwrap();
        // Every second part lies between two fences.
        let read = text.split("\n```").step_by(2);
        let words: usize = read.map(length).sum();
        assert!(words <= most, "{page}: {words} words, {most} at most");
    }
    let limits = fs::read_to_string(root().join("docs/limits.md")).unwrap();
    let lines = limits.lines().count();
    assert!(lines <= LIMITS_LINES, "docs/limits.md: {lines} lines");
}

#[test]
fn the_book_has_every_page() {
    let summary = fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    for page in pages() {
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        let listed = name == "SUMMARY.md" || summary.contains(&format!("]({name})"));
        assert!(listed, "docs/SUMMARY.md does not list {name}");
    }
}

#[test]
fn the_help_has_the_words_of_the_field() {
    let folder = folder();
    let all = done(folder.path(), &["--help"]);
    let list = all.split("Commands:\n").nth(1).unwrap();
    let list = list.split("\n\n").next().unwrap();
    let names: Vec<&str> = (list.lines())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 20, "{names:?}");
    let mut faults = banned(&all);
    for name in names {
        let help = done(folder.path(), &[name, "--help"]);
        faults.extend((banned(&help).iter()).map(|fault| format!("{name} --help: {fault}")));
        let about = help.split("\nUsage:").next().unwrap_or_default();
        let long = (sentences(about).into_iter()).filter(|sentence| length(sentence) > LONGEST);
        faults.extend(long.map(|sentence| format!("{name} --help: {sentence}")));
    }
    none(&faults);
}

#[test]
fn what_the_program_prints_has_the_words_of_the_field() {
    let mut faults = Vec::new();
    let mut texts = 0;
    for file in files("rs") {
        let printed = ["host-tools/src", "core/src", "simulator/src", "proprio/src"];
        let name = file.to_string_lossy().into_owned();
        if !printed.iter().any(|start| name.starts_with(start)) || name.contains("tests") {
            continue;
        }
        let source = fs::read_to_string(root().join(&file)).unwrap();
        let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap();
        for literal in literals(source) {
            texts += 1;
            faults.extend((banned(&literal).iter()).map(|fault| format!("{name}: {fault}")));
        }
    }
    // The lexer found the texts at all.
    assert!(texts > 5000, "{texts}");
    none(&faults);
}

/// The string literals of a source, lines joined where it joins them.
fn literals(source: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut rest = source;
    while let Some(at) = rest.find(['"', '/', '\'']) {
        let (before, found) = rest.split_at(at);
        rest = &found[1..];
        if found.starts_with("//") {
            rest = found.find('\n').map_or("", |end| &found[end..]);
        } else if found.starts_with('\'') {
            // A quote as a character, or a lifetime.
            let quoted = ["'\"'", "'\\\"'"]
                .into_iter()
                .find(|c| found.starts_with(c));
            rest = &found[quoted.map_or(1, str::len)..];
        } else if let Some(text) = found.strip_prefix('"') {
            let hashes = before.len() - before.trim_end_matches('#').len();
            let raw = before.trim_end_matches('#').ends_with('r');
            let end = match raw {
                true => text.find(&format!("\"{}", "#".repeat(hashes))),
                false => closing(text),
            };
            let Some(end) = end else { break };
            all.push(joined(&text[..end]));
            rest = &text[end + 1..];
        }
    }
    all
}

/// Where the string that `text` begins with ends.
fn closing(text: &str) -> Option<usize> {
    let mut escaped = false;
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return Some(at),
            _ => {}
        }
    }
    None
}

/// A literal without its line ends: a backslash at a line's end joins it to the next.
fn joined(literal: &str) -> String {
    let mut parts = literal.split("\\\n");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.trim_start())
}

#[test]
fn literals_are_found() {
    let source = "// \"no\"\nlet a = \"one \\\n    two\"; let b = '\"'; let c: &'a str = r#\"th\"ree\"#; f(\"fo\\\"ur\")";
    assert_eq!(literals(source), ["one two", "th\"ree", "fo\\\"ur"]);
    let phrases = banned("It IS\ntold. Mending a playful endearment.");
    assert_eq!(phrases.len(), 1, "{phrases:?}");
    assert_eq!(
        sentences("# A b\nOne two. Three\nfour?\n\n- Five\n| six |\n").len(),
        3
    );
}

/// Files of the repository with this extension.
fn files(extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = folder.join(&name);
            let skipped = name.starts_with('.') || name == "target" || name == "node_modules";
            match entry.file_type().unwrap() {
                kind if kind.is_dir() && !skipped => folders.push(path),
                kind if kind.is_file() && name.ends_with(&format!(".{extension}")) => {
                    found.push(path);
                }
                _ => {}
            }
        }
    }
    found
}

#[test]
fn references_in_sources_lead_somewhere() {
    let design = fs::read_to_string(root().join("docs/design.md")).unwrap();
    let mut faults = Vec::new();
    let mut count = 0;
    for extension in ["rs", "py", "pyi", "toml", "cpp"] {
        for file in files(extension) {
            let text = fs::read_to_string(root().join(&file)).unwrap();
            for (at, _) in text.match_indices(".md") {
                let Some((page, rest)) = reference(&text, at) else {
                    continue;
                };
                count += 1;
                let section = rest.trim_start_matches('`').strip_prefix(" §");
                let section = section.and_then(|rest| rest.chars().next());
                let known = section.is_none_or(|n| design.contains(&format!("\n## {n}. ")));
                let heading = quoted(rest).is_none_or(|heading| is_heading(&page, heading));
                if !exists(&file, &page) || !known || !heading {
                    faults.push(format!("{}: {page}{:.40}", file.display(), rest));
                }
            }
        }
    }
    assert!(count > 30, "{count}");
    none(&faults);
}

/// The page that a comment, or a text with its folder, names at the `.md` at `at`, and what follows it.
fn reference(text: &str, at: usize) -> Option<(String, &str)> {
    let is_path = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    let stem = text[..at].rsplit(|c| !is_path(c)).next()?;
    let before = &text[..at - stem.len()];
    let line = before.rsplit('\n').next()?;
    let comment = ["//", "#", "\"\"\""].iter().any(|mark| line.contains(mark));
    let with_folder = stem.starts_with("docs/") || stem.starts_with("studies/");
    let rest = &text[at + ".md".len()..];
    let goes_on = rest.starts_with(|c: char| c.is_ascii_alphanumeric());
    let named = !stem.is_empty() && !goes_on && (comment || with_folder);
    named.then(|| (format!("{stem}.md"), rest))
}

/// The heading that is quoted after a page: `docs/diagnose.md, "Only a part of a log"`.
fn quoted(rest: &str) -> Option<&str> {
    let rest = rest.strip_prefix(", ")?;
    let rest = rest.strip_prefix('\\').unwrap_or(rest).strip_prefix('"')?;
    rest.split(['"', '\\']).next()
}

/// Whether the page that is named has the heading that is quoted.
fn is_heading(page: &str, heading: &str) -> bool {
    let text = fs::read_to_string(root().join(page));
    text.is_ok_and(|text| has_heading(&text, &slug(heading)))
}

/// Whether a page that `file` names exists: from the root, in docs/ or studies/, or beside the file or above it.
fn exists(file: &Path, page: &str) -> bool {
    let places = [Path::new(""), Path::new("docs"), Path::new("studies")];
    let above = file.ancestors().skip(1);
    let all = places.into_iter().chain(above);
    let page = page
        .strip_prefix("/..")
        .unwrap_or(page)
        .trim_start_matches('/');
    all.map(|folder| root().join(folder).join(page))
        .any(|path| path.is_file())
}

/// A file or folder of the repository that a page names in backquotes exists.
#[test]
fn files_that_pages_name_exist() {
    let mut faults = Vec::new();
    let mut count = 0;
    for (page, text) in read_pages() {
        for named in text.split('`').skip(1).step_by(2) {
            let (folder, path) = named.split_once('/').unwrap_or_default();
            let is_path = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
            // NAME and TARGET stand for names that a reader chooses.
            let chosen =
                |part: &str| part.len() > 1 && part.chars().all(|c| c.is_ascii_uppercase());
            let whole = path.chars().all(is_path) && !path.split(['/', '.']).any(chosen);
            if whole && !folder.is_empty() && root().join(folder).is_dir() {
                count += 1;
                if !root().join(named).exists() {
                    faults.push(format!("{}: {named}", page.display()));
                }
            }
        }
    }
    assert!(count > 50, "{count}");
    none(&faults);
}

/// Each key that docs/json.md names as a main one is in the command's schema.
#[test]
fn the_json_pages_keys_are_the_schemas() {
    let page = fs::read_to_string(root().join("docs/json.md")).unwrap();
    let table = page.split("## Main keys").nth(1).unwrap();
    let rows: Vec<&str> = table.lines().filter(|row| row.starts_with("| `")).collect();
    assert!(rows.len() > 10, "{rows:?}");
    for row in rows {
        let cells: Vec<&str> = row.split('|').collect();
        let command = cells[1].trim().trim_matches('`');
        let schema = fs::read_to_string(root().join(format!("docs/schema/{command}.json")));
        let schema = json(&schema.unwrap());
        for key in cells[2].split('`').skip(1).step_by(2) {
            let known = &schema["$defs"]["result"]["properties"][key];
            assert!(known.is_object(), "proprio {command} --json has no {key}");
        }
    }
}

/// docs/catalogue.md is what `proprio effects` lists.
#[test]
fn the_catalogues_page_is_the_catalogue() {
    let path = root().join("docs/catalogue.md");
    let committed = fs::read_to_string(&path).unwrap();
    let folder = folder();
    let list = json(&done(folder.path(), &["effects", "--json"]));
    let cell = |value: &serde_json::Value| value.as_str().unwrap_or("–").replace('|', "\\|");
    let (mut what, mut like) = (String::new(), String::new());
    for effect in list["effects"].as_array().unwrap() {
        let parameters = effect["parameters"].as_array().unwrap().iter();
        let parameters = parameters.map(|p| match p["unit"].as_str() {
            Some("1") => cell(&p["symbol"]),
            unit => format!("{} ({})", cell(&p["symbol"]), unit.unwrap_or_default()),
        });
        let parameters: Vec<String> = parameters.collect();
        let looks_like: Vec<String> = (effect["looks_like"].as_array().unwrap().iter())
            .map(cell)
            .collect();
        let [name, words, torque, motion, urdf, mjcf] =
            ["name", "words", "torque", "told_apart_by", "urdf", "mjcf"]
                .map(|key| cell(&effect[key]));
        what += &format!(
            "| `{name}` | {words} | {torque} | {} |\n",
            parameters.join(", ")
        );
        let looks_like = looks_like.join(", ");
        like += &format!("| `{name}` | {looks_like} | {motion} | {urdf} | {mjcf} |\n");
    }
    // The words around the tables are the page's own.
    let mut written = String::new();
    for (n, part) in committed.split("\n|---").enumerate() {
        let body = match n {
            0 => part.to_owned(),
            _ => {
                let (rule, rest) = part.split_once('\n').unwrap();
                let after = rest.split_once("\n\n").map_or("", |(_, after)| after);
                let table = if n == 1 { &what } else { &like };
                let after = match after {
                    "" => String::new(),
                    _ => format!("\n{after}"),
                };
                format!("\n|---{rule}\n{table}{after}")
            }
        };
        written += &body;
    }
    if std::env::var_os("PROPRIO_ACCEPT").is_some() {
        fs::write(&path, &written).unwrap();
        return;
    }
    let mut lines = committed.lines().zip(written.lines());
    let other = lines.find(|(committed, written)| committed != written);
    assert!(
        committed == written,
        "PROPRIO_ACCEPT=1 writes docs/catalogue.md: {other:#?}"
    );
}
