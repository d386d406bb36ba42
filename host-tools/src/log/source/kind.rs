//! What a file is, told by its first bytes.

use std::path::Path;

use crate::capture::TITLE;

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Nothing.
    Empty,
    /// Columns of text.
    Text,
    /// The same, compressed.
    Gzip,
    /// A rosbag2 or another recording in MCAP.
    Mcap,
    /// A rosbag2's database.
    Sqlite,
    /// A NumPy archive.
    Npz,
    /// A Parquet table, as of a LeRobot data set.
    Parquet,
    /// A capture of a motor bus.
    Capture,
    /// Something else.
    Other {
        /// What it is.
        what: &'static str,
        /// How its data come in all the same.
        way: &'static str,
    },
}

/// Beginnings of files that are no log, what they are, and the way in.
const OTHERS: [(&[u8], &str, &str); 21] = [
    (
        b"#ROSBAG V",
        "a ROS 1 bag",
        "convert it: `pip install rosbags; rosbags-convert --src FILE --dst bag.mcap`",
    ),
    (
        b"\x89HDF\r\n\x1a\n",
        "an HDF5 file (or a MATLAB 7.3 one)",
        "write its arrays with numpy.savez: t, q, dq, tau (a row per sample) and joint_names",
    ),
    (
        b"MATLAB 5.0 MAT-file",
        "a MATLAB file",
        "writetable(table, 'log.csv') with columns t, q/JOINT, dq/JOINT, tau/JOINT; or scipy.io.loadmat and numpy.savez",
    ),
    (
        b"\x93NUMPY",
        "one NumPy array, without names",
        "save t, q, dq, tau and joint_names together: numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=[...])",
    ),
    (
        b"\x28\xb5\x2f\xfd",
        "compressed by zstd",
        "decompress it first: `unzstd FILE`",
    ),
    (
        b"\xfd7zXZ\0",
        "compressed by xz",
        "decompress it first: `unxz FILE`",
    ),
    (
        b"BZh",
        "compressed by bzip2",
        "decompress it first: `bunzip2 FILE`",
    ),
    (
        b"\x04\x22\x4d\x18",
        "compressed by lz4",
        "decompress it first: `unlz4 FILE`",
    ),
    (
        b"7z\xbc\xaf\x27\x1c",
        "a 7z archive",
        "unpack it first: `7z x FILE`",
    ),
    (b"Rar!", "a RAR archive", "unpack it first"),
    (
        b"ARROW1\0\0",
        "an Arrow (Feather) table",
        "pandas.read_feather(FILE).to_csv('log.csv', index=False)",
    ),
    (
        b"ULog\x01\x12\x35",
        "a PX4 log",
        "`pip install pyulog; ulog2csv FILE`, then name the columns t, q/JOINT, dq/JOINT, tau/JOINT",
    ),
    (
        b"RRF2",
        "a Rerun recording",
        "export it as MCAP or as a table, columns t, q/JOINT, dq/JOINT, tau/JOINT",
    ),
    (
        b"WPILOG",
        "a WPILib log",
        "export it as CSV, columns t, q/JOINT, dq/JOINT, tau/JOINT",
    ),
    (
        b"\xed\xa1\xda\x01",
        "an LCM log",
        "write its messages as CSV, columns t, q/JOINT, dq/JOINT, tau/JOINT",
    ),
    (
        b"\xd4\xc3\xb2\xa1",
        "a capture of network packets",
        "record the topic instead: `ros2 bag record /lowstate`",
    ),
    (
        b"\x0a\x0d\x0d\x0a",
        "a capture of network packets",
        "record the topic instead: `ros2 bag record /lowstate`",
    ),
    (b"\x7fELF", "a program", "name a recording"),
    (b"%PDF", "a PDF", "name a recording"),
    (b"\x89PNG", "a picture", "name a recording"),
    (b"\xff\xd8\xff", "a picture", "name a recording"),
];

/// Beginnings of texts that are no table.
const TEXTS: [(&str, &str, &str); 9] = [
    (
        "rosbag2_bagfile_information",
        "a bag's metadata",
        "name the bag's folder, or the .mcap or .db3 file in it",
    ),
    (
        "<",
        "XML",
        "a robot's description goes to `--urdf FILE`; the log is another file",
    ),
    (
        "{",
        "JSON",
        "write it as CSV: a column each for t, q/JOINT, dq/JOINT, tau/JOINT",
    ),
    (
        "[",
        "JSON or TOML",
        "a model file goes to `-m FILE`; a log is CSV, a bag, .npz or Parquet",
    ),
    (
        "header:",
        "what `ros2 topic echo` prints",
        "record the topic instead: `ros2 bag record -s mcap TOPIC`",
    ),
    (
        "---",
        "YAML",
        "record the topic instead: `ros2 bag record -s mcap TOPIC`",
    ),
    ("format = ", "a model file", "it goes to `-m FILE`"),
    (
        "version https://git-lfs",
        "a pointer to a file in Git LFS",
        "fetch the file itself: `git lfs pull`",
    ),
    (
        "# A robot as proprio knows it",
        "a model file",
        "it goes to `-m FILE`",
    ),
];

/// What begins with `start` and is called `path`.
pub(super) fn of(start: &[u8], path: &Path) -> Kind {
    if start.is_empty() {
        return Kind::Empty;
    }
    let magics: [(&[u8], Kind); 6] = [
        (TITLE.as_bytes(), Kind::Capture),
        (b"\x1f\x8b", Kind::Gzip),
        (b"\x89MCAP", Kind::Mcap),
        (b"SQLite format 3\0", Kind::Sqlite),
        (b"PK\x03\x04", zip(path)),
        (b"PAR1", Kind::Parquet),
    ];
    if let Some((_, kind)) = magics.iter().find(|(magic, _)| start.starts_with(magic)) {
        return *kind;
    }
    if let Some((_, what, way)) = OTHERS.iter().find(|(magic, ..)| start.starts_with(magic)) {
        return Kind::Other { what, way };
    }
    if start.get(257..262) == Some(b"ustar") {
        return Kind::Other {
            what: "a tar archive",
            way: "unpack it first: `tar xf FILE`",
        };
    }
    if matches!(start, [0x80, 2..=5, ..]) {
        return Kind::Other {
            what: "a Python pickle",
            way: "load it in Python and write numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=[...])",
        };
    }
    if matches!(start, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
        return Kind::Other {
            what: "text in UTF-16",
            way: "save it as UTF-8: `iconv -f UTF-16 -t UTF-8 FILE > log.csv`",
        };
    }
    if start.contains(&0) {
        return Kind::Other {
            what: "binary data that proprio does not know",
            way: "logs are CSV (plain or .gz), rosbag2 (.mcap, .db3), .npz, Parquet or bus captures (.cap)",
        };
    }
    text(start)
}

/// An archive of arrays, or of something else.
fn zip(path: &Path) -> Kind {
    let extension = path.extension().and_then(|e| e.to_str());
    match extension {
        Some("xlsx" | "ods") => Kind::Other {
            what: "a spreadsheet",
            way: "save it as CSV, columns t, q/JOINT, dq/JOINT, tau/JOINT",
        },
        _ => Kind::Npz,
    }
}

fn text(start: &[u8]) -> Kind {
    let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    let text = text.trim_ascii_start();
    let found = TEXTS
        .iter()
        .find(|(words, ..)| text.starts_with(words.as_bytes()));
    match found {
        Some((_, what, way)) => Kind::Other { what, way },
        None => Kind::Text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_what_it_begins_with() {
        let of = |start: &[u8]| of(start, Path::new("log"));
        assert_eq!(of(b"t,q/FR_hip\n"), Kind::Text);
        assert_eq!(of(b""), Kind::Empty);
        assert_eq!(of(b"proprio capture 1 baud=4000000\n\0"), Kind::Capture);
        assert_eq!(of(b"\x89MCAP0\r\n"), Kind::Mcap);
        assert_eq!(of(b"PK\x03\x04.."), Kind::Npz);
        for (magic, what, _) in OTHERS {
            assert!(matches!(of(magic), Kind::Other { what: found, .. } if found == what));
        }
    }
}
