//! Files of another kind, and folders that hold no recording.

use std::fs;
use std::path::Path;

use super::{Messages, refused_in};

#[test]
fn a_file_of_another_kind_is_named_for_what_it_is() {
    let mut messages = Messages::default();
    let padded = |start: &[u8]| [start, &[0; 600]].concat();
    let cases: [(&str, &[u8], &str); 27] = [
        ("ROS 1 bag", b"#ROSBAG V2.0\n", "a ROS 1 bag"),
        ("HDF5", b"\x89HDF\r\n\x1a\n", "HDF5"),
        (
            "MATLAB 5",
            b"MATLAB 5.0 MAT-file, Platform",
            "a MATLAB file",
        ),
        ("one array", b"\x93NUMPY\x01\x00", "one NumPy array"),
        ("zstd", b"\x28\xb5\x2f\xfd", "unzstd"),
        ("xz", b"\xfd7zXZ\0", "unxz"),
        ("bzip2", b"BZh91AY&SY", "bunzip2"),
        ("lz4", b"\x04\x22\x4d\x18", "unlz4"),
        ("7z", b"7z\xbc\xaf\x27\x1c", "7z x"),
        ("RAR", b"Rar!\x1a\x07\x01\0", "RAR"),
        ("Arrow", b"ARROW1\0\0", "read_feather"),
        ("ULog", b"ULog\x01\x12\x35\x01", "PX4"),
        ("Rerun", b"RRF2", "Rerun"),
        ("WPILib", b"WPILOG\0\x01", "WPILib"),
        ("LCM", b"\xed\xa1\xda\x01", "LCM"),
        ("pcap", b"\xd4\xc3\xb2\xa1", "network"),
        ("pcapng", b"\x0a\x0d\x0d\x0a", "network"),
        ("program", b"\x7fELF\x02", "a program"),
        ("PDF", b"%PDF-1.7", "a PDF"),
        ("PNG", b"\x89PNG\r\n", "a picture"),
        ("JPEG", b"\xff\xd8\xff\xe0", "a picture"),
        ("pickle", b"\x80\x04\x95", "pickle"),
        ("UTF-16", b"\xff\xfet\0,\0q\0", "UTF-16"),
        ("unknown", b"\x01\x02\x03\x04", "does not know"),
        ("zeros", b"\0\0\0\0", "does not know"),
        ("zip of something", b"PK\x03\x04", "damaged"),
        ("Parquet's magic alone", b"PAR1", "damaged"),
    ];
    for (what, start, expected) in cases {
        messages.add(what, "log.dat", &padded(start), expected);
    }
    let mut tar = vec![0; 1024];
    tar[257..262].copy_from_slice(b"ustar");
    messages.add("tar", "log.tar", &tar, "tar xf");
    messages.add(
        "spreadsheet",
        "log.xlsx",
        &padded(b"PK\x03\x04"),
        "a spreadsheet",
    );
    for (what, text, expected) in [
        (
            "bag metadata",
            "rosbag2_bagfile_information:\n  version: 5\n",
            "folder",
        ),
        (
            "URDF",
            "<?xml version=\"1.0\"?>\n<robot name=\"go2\"/>\n",
            "--urdf",
        ),
        ("JSON", "{\"t\": [0, 1]}\n", "JSON"),
        ("JSON list", "[{\"t\": 0}]\n", "JSON"),
        (
            "model file",
            "format = 1\n[robot]\nbuiltin = \"go2\"\n",
            "-m FILE",
        ),
        (
            "proprio's model file",
            "# A robot as proprio knows it: SI units\nformat = 1\n",
            "-m FILE",
        ),
        (
            "ros2 topic echo",
            "header:\n  stamp:\n    sec: 1\n",
            "ros2 bag record",
        ),
        ("YAML", "---\nname: [a]\n", "ros2 bag record"),
        (
            "LFS pointer",
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\n",
            "git lfs pull",
        ),
        (
            "prose",
            "Dear all,\nthe log is attached.\n",
            "no column `t`",
        ),
        ("one word", "hello\n", "no column `t`"),
        ("bars", "t | q/FR_hip\n0 | 1\n", "separated by ` `"),
    ] {
        messages.add(what, "log.txt", text.as_bytes(), expected);
    }
    assert!(messages.count >= 40, "{}", messages.count);
    insta::assert_snapshot!(messages.text);
}

/// Folders, and what is not there.
#[test]
fn a_folder_that_is_no_recording_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let mut texts = String::new();
    fs::create_dir(&bag).unwrap();
    texts += &refused_in(folder.path(), "bag");
    fs::write(bag.join("metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    texts += &refused_in(folder.path(), "bag");
    fs::write(bag.join("bag_0.mcap"), b"").unwrap();
    texts += &refused_in(folder.path(), "bag");
    let oracle = Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/recordings");
    fs::copy(oracle.join("go_lz4.mcap"), bag.join("bag_0.mcap")).unwrap();
    fs::copy(
        oracle.join("joint_mcap/joint_mcap.mcap"),
        bag.join("bag_1.mcap"),
    )
    .unwrap();
    texts += &refused_in(folder.path(), "bag");
    fs::create_dir_all(folder.path().join("set/data/chunk-000")).unwrap();
    texts += &refused_in(folder.path(), "set");
    insta::assert_snapshot!(texts);
}
