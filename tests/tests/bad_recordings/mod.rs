//! Every way in which a recording can be bad, whatever its format: the message says what the file is or what is wrong with it,
//! and the way in; the status is 1, and no file is written.

mod archives;
mod bags;
mod databases;
mod kinds;
mod texts;

use std::fs;
use std::path::Path;

use proprio_tests::command::refusal;

/// The type of a Go2's state in a bag.
const GO: &str = "unitree_go/msg/LowState";

/// Imports `contents` under `name` and returns the message after all that must hold of any bad log.
fn refused(name: &str, contents: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), contents).unwrap();
    refused_in(folder.path(), name)
}

fn refused_in(folder: &Path, name: &str) -> String {
    let before = fs::read_dir(folder).unwrap().count();
    let message = refusal(folder, &["identify", name, "--json", "-o", "out.json"]);
    assert_eq!(
        fs::read_dir(folder).unwrap().count(),
        before,
        "a file was left behind"
    );
    assert!(message.starts_with("error: "), "{message}");
    assert!(message.contains(name), "{message}");
    assert!(message.contains("\nhint: "), "{message}");
    message
}

/// Messages of all cases, one below the other.
#[derive(Default)]
struct Messages {
    text: String,
    count: usize,
}

impl Messages {
    fn add(&mut self, what: &str, name: &str, contents: &[u8], expected: &str) {
        let message = refused(name, contents);
        assert!(
            message.contains(expected),
            "{what}: `{expected}` is not in {message}"
        );
        self.text += &format!("# {what}\n{message}\n");
        self.count += 1;
    }
}
