//! Recordings of others, written by independent implementations (`tests/oracle/recordings.py`): every number arrives to the
//! last bit, in every command, through files, folders and standard input.

mod bags;
mod damaged;
mod names;
mod transmission;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use flate2::read::GzDecoder;
use proprio_tests::command::{binary, done, folder};

fn recordings() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/recordings")
}

/// Columns by name, their numbers as bits.
type Table = BTreeMap<String, Vec<u64>>;

fn table(text: &str) -> Table {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut table: Table = names
        .iter()
        .map(|name| ((*name).to_owned(), Vec::new()))
        .collect();
    for line in lines {
        for (name, cell) in names.iter().zip(line.split(',')) {
            let bits = cell.parse::<f64>().unwrap().to_bits();
            table.get_mut(*name).unwrap().push(bits);
        }
    }
    table
}

/// The text of a gzip-compressed file.
fn unpacked(path: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(File::open(path).unwrap())
        .read_to_string(&mut text)
        .unwrap();
    text
}

/// What `proprio import` makes of a recording.
fn imported(recording: &Path, more: &[&str]) -> Table {
    let folder = folder();
    let recording = recording.to_str().unwrap();
    done(
        folder.path(),
        &[&["import", recording, "-o", "log.csv"], more].concat(),
    );
    table(&fs::read_to_string(folder.path().join("log.csv")).unwrap())
}

/// Every channel of `expected`, and no other.
fn assert_same(found: &Table, expected: &Table, what: &str) {
    let names = |table: &Table| table.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected), "{what}");
    for (name, numbers) in expected {
        assert_eq!(found[name].len(), numbers.len(), "{what}: {name}");
        let differs = numbers.iter().zip(&found[name]).position(|(a, b)| a != b);
        if let Some(row) = differs {
            let of = |table: &Table| f64::from_bits(table[name][row]);
            panic!(
                "{what}: {name}, row {row}: {} instead of {}",
                of(found),
                of(expected)
            );
        }
    }
}

const OF_A_GO2: [(&str, &str); 13] = [
    ("go_mcap/go_mcap.mcap", "low_state"),
    ("go_mcap", "low_state"),
    ("go_mcap_zstd/go_mcap_zstd.mcap", "low_state"),
    ("go_lz4.mcap", "low_state"),
    ("go_db3/go_db3.db3", "low_state"),
    ("commanded_db3", "commanded"),
    ("joint_mcap", "joint_state"),
    ("joint_db3", "joint_state"),
    ("log.npz", "joint_state"),
    ("log_compressed.npz", "joint_state"),
    ("columns.npz", "joint_state"),
    ("log.parquet", "joint_state"),
    ("lerobot", "lerobot"),
];

#[test]
fn every_recording_arrives_to_the_last_bit() {
    for (recording, expected) in OF_A_GO2 {
        let expected = table(&unpacked(&recordings().join(format!("{expected}.csv.gz"))));
        let found = imported(&recordings().join(recording), &[]);
        assert_same(&found, &expected, recording);
    }
}

/// `proprio identify - < recording`, and `import … -o - | identify -`, as the file itself.
#[test]
fn standard_input_is_a_log_too() {
    let through = |recording: &str, arguments: &[&str]| {
        let child = Command::new(binary())
            .args(arguments)
            .stdin(Stdio::from(
                File::open(recordings().join(recording)).unwrap(),
            ))
            .stdout(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(child.status.code(), Some(0), "{recording}");
        String::from_utf8(child.stdout).unwrap()
    };
    for (recording, expected) in [
        ("go_lz4.mcap", "low_state"),
        ("go_db3/go_db3.db3", "low_state"),
        ("log.npz", "joint_state"),
        ("log.parquet", "joint_state"),
        ("low_state.csv.gz", "low_state"),
    ] {
        let found = table(&through(recording, &["import", "-", "-o", "-"]));
        let expected = table(&unpacked(&recordings().join(format!("{expected}.csv.gz"))));
        assert_same(&found, &expected, recording);
    }
}
