//! Every way in which a recording can be bad, whatever its format: the message says what the file is or what is wrong with it,
//! and the way in; the status is 1, and no file is written.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;

use flate2::{Compression, write::GzEncoder};
use proprio_tests::command::{proprio, stderr, stdout};
use zip::write::SimpleFileOptions;

/// Imports `contents` under `name` and returns the message after all that must hold of any bad log.
fn refused(name: &str, contents: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), contents).unwrap();
    refused_in(folder.path(), name)
}

fn refused_in(folder: &Path, name: &str) -> String {
    let before = fs::read_dir(folder).unwrap().count();
    let output = proprio(folder, &["identify", name, "--json", "-o", "out.json"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(stdout(&output), "", "{message}");
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

/// A recording in MCAP: topics with their types, and messages by the number of their topic.
fn mcap(topics: &[(&str, &str)], messages: &[(usize, u64, Vec<u8>)]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    let mut channels = Vec::new();
    for (topic, kind) in topics {
        let schema = writer.add_schema(kind, "ros2msg", b"").unwrap();
        channels.push(
            writer
                .add_channel(schema, topic, "cdr", &BTreeMap::new())
                .unwrap(),
        );
    }
    for (n, (topic, time, data)) in messages.iter().enumerate() {
        let header = mcap::records::MessageHeader {
            channel_id: channels[*topic],
            sequence: n as u32,
            log_time: *time,
            publish_time: *time,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

/// A `unitree_go/LowState` of zeros, at a tick.
fn low_state(tick: u32) -> Vec<u8> {
    let mut data = vec![0; 1180];
    data[1] = 1;
    data[1100..1104].copy_from_slice(&tick.to_le_bytes());
    data
}

/// A `JointState` of so many joints called by number, with so many of each quantity.
fn joint_state(k: u64, names: &[&str], counts: [usize; 3]) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    let align = |data: &mut Vec<u8>, width: usize| {
        while !(data.len() - 4).is_multiple_of(width) {
            data.push(0);
        }
    };
    data.extend((k as u32 / 500).to_le_bytes());
    data.extend((k as u32 % 500 * 2_000_000).to_le_bytes());
    data.extend(1u32.to_le_bytes());
    data.push(0);
    align(&mut data, 4);
    data.extend((names.len() as u32).to_le_bytes());
    for name in names {
        align(&mut data, 4);
        data.extend((name.len() as u32 + 1).to_le_bytes());
        data.extend(name.bytes().chain([0]));
    }
    for count in counts {
        align(&mut data, 4);
        data.extend((count as u32).to_le_bytes());
        if count > 0 {
            align(&mut data, 8);
        }
        (0..count).for_each(|n| data.extend((0.1 * n as f64 + 1e-3 * k as f64).to_le_bytes()));
    }
    data
}

const GO: &str = "unitree_go/msg/LowState";
const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
const LEG: [&str; 3] = ["FR_hip_joint", "FR_thigh_joint", "FR_calf_joint"];

#[test]
fn each_bad_bag_is_refused_with_its_place_and_the_fix() {
    let mut messages = Messages::default();
    let states = |make: &dyn Fn(u64) -> Vec<u8>| -> Vec<(usize, u64, Vec<u8>)> {
        (0..300).map(|k| (0, 2_000_000 * k, make(k))).collect()
    };
    let of_joints = |names: &'static [&'static str], counts| {
        mcap(
            &[("/joint_states", JOINT_STATE)],
            &states(&|k| joint_state(k, names, counts)),
        )
    };
    let good = of_joints(&LEG, [3; 3]);
    let mut corrupt = good.clone();
    let middle = corrupt.len() / 2;
    corrupt[middle..middle + 40].fill(0xa5);
    let spoilt = |at: usize, spoil: &dyn Fn(&mut Vec<u8>)| {
        mcap(
            &[("/lowstate", GO)],
            &states(&|k| {
                let mut data = low_state(2 * k as u32);
                if k as usize == at {
                    spoil(&mut data);
                }
                data
            }),
        )
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("magic alone", b"\x89MCAP0\r\n".to_vec(), "no topic"),
        (
            "rubbish after the magic",
            [&b"\x89MCAP0\r\n"[..], &[0x55; 300]].concat(),
            "damaged",
        ),
        ("no topics", mcap(&[], &[]), "none at all"),
        (
            "other topics",
            mcap(
                &[
                    ("/tf", "tf2_msgs/msg/TFMessage"),
                    ("/image", "sensor_msgs/msg/Image"),
                ],
                &[],
            ),
            "/image",
        ),
        (
            "many other topics",
            mcap(
                &[
                    ("/a", "x/A"),
                    ("/b", "x/B"),
                    ("/c", "x/C"),
                    ("/d", "x/D"),
                    ("/e", "x/E"),
                    ("/f", "x/F"),
                    ("/g", "x/G"),
                ],
                &[],
            ),
            "and 1 more",
        ),
        (
            "no messages",
            mcap(&[("/lowstate", GO)], &[]),
            "topic /lowstate has no message",
        ),
        (
            "one message",
            mcap(&[("/lowstate", GO)], &[(0, 0, low_state(0))]),
            "1 sample",
        ),
        (
            "empty message",
            spoilt(3, &|data| data.clear()),
            "message 4",
        ),
        (
            "short message",
            spoilt(3, &|data| data.truncate(1000)),
            "message 4: the message has 1000 bytes",
        ),
        (
            "another version's message",
            spoilt(0, &|data| data.extend([0; 8])),
            "message 1: the message has 1188 bytes",
        ),
        (
            "late short message",
            spoilt(250, &|data| data.truncate(7)),
            "message 251",
        ),
        ("big-endian", spoilt(0, &|data| data[1] = 0), "big-endian"),
        ("no CDR", spoilt(5, &|data| data[0] = 9), "message 6"),
        (
            "compressed one by one",
            spoilt(0, &|data| data[..4].copy_from_slice(b"\x28\xb5\x2f\xfd")),
            "one by one",
        ),
        (
            "infinite",
            spoilt(200, &|data| {
                data[84..88].copy_from_slice(&f32::INFINITY.to_le_bytes())
            }),
            "message 201",
        ),
        ("corrupted chunk", corrupt, "damaged"),
        (
            "no effort",
            of_joints(&LEG, [3, 3, 0]),
            "without its torque",
        ),
        (
            "no velocity",
            of_joints(&LEG, [3, 0, 3]),
            "without its velocity",
        ),
        ("only names", of_joints(&LEG, [0, 0, 0]), "log.mcap"),
        (
            "fewer positions than names",
            of_joints(&LEG, [2, 3, 3]),
            "FR_calf",
        ),
        (
            "another robot's joints",
            of_joints(&["shoulder", "elbow"], [2; 3]),
            "no joint of the robot",
        ),
        ("half a leg", of_joints(&LEG, [2; 3]), "limb FR"),
        ("no joints", of_joints(&[], [0; 3]), "no joint is recorded"),
        (
            "a joint state cut short",
            mcap(
                &[("/joint_states", JOINT_STATE)],
                &states(&|k| joint_state(k, &LEG, [3; 3])[..60].to_vec()),
            ),
            "ends early",
        ),
        (
            "an absurd count",
            mcap(
                &[("/joint_states", JOINT_STATE)],
                &states(&|_| [&[0, 1, 0, 0][..], &[0; 8], &[0xff; 4], &[0; 20]].concat()),
            ),
            "ends early",
        ),
        (
            "beyond the joint's limits",
            of_joints(&LEG, [3; 3]),
            "outside its limits",
        ),
        (
            "10 Hz",
            mcap(
                &[("/lowstate", GO)],
                &(0..300)
                    .map(|k| (0, 100_000_000 * k, low_state(100 * k as u32)))
                    .collect::<Vec<_>>(),
            ),
            "10 Hz",
        ),
        (
            "a clock that was set",
            spoilt(220, &|data| {
                data[1100..1104].copy_from_slice(&7u32.to_le_bytes())
            }),
            "time runs backwards",
        ),
    ];
    for (what, contents, expected) in cases {
        messages.add(what, "log.mcap", &contents, expected);
    }
    assert!(messages.count >= 25, "{}", messages.count);
    insta::assert_snapshot!(messages.text);
}

/// A database made by these statements.
fn database(statements: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bag.db3");
    let database = rusqlite::Connection::open(&file).unwrap();
    database.execute_batch(statements).unwrap();
    database.close().unwrap();
    fs::read(file).unwrap()
}

#[test]
fn each_bad_database_is_refused_with_the_fix() {
    let mut messages = Messages::default();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT \
                  NOT NULL, offered_qos_profiles TEXT NOT NULL); CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER \
                  NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);";
    let with = |more: &str| database(&format!("{tables} {more}"));
    let topic = |kind: &str, format: &str| {
        format!("INSERT INTO topics VALUES(1, '/lowstate', '{kind}', '{format}', '');")
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("magic alone", b"SQLite format 3\0".to_vec(), "log.db3"),
        (
            "rubbish after the magic",
            [&b"SQLite format 3\0"[..], &[0x55; 4096]].concat(),
            "log.db3",
        ),
        (
            "another database",
            database("CREATE TABLE people(name TEXT);"),
            "no rosbag2",
        ),
        ("no topics", with(""), "none at all"),
        (
            "other topics",
            with(&topic("std_msgs/msg/String", "cdr")),
            "std_msgs/msg/String",
        ),
        (
            "another encoding",
            with(&topic(GO, "flexbuffers")),
            "flexbuffers",
        ),
        ("no messages", with(&topic(GO, "cdr")), "no message"),
        (
            "messages of nothing",
            with(&(topic(GO, "cdr") + "INSERT INTO messages VALUES(1, 1, 0, x'00010000');")),
            "message 1: the message has 4 bytes",
        ),
        (
            "messages of text",
            with(&(topic(GO, "cdr") + "INSERT INTO messages VALUES(1, 1, 0, 'hello');")),
            "log.db3",
        ),
        (
            "no table of messages",
            database(
                "CREATE TABLE topics(id, name, type, serialization_format); INSERT INTO topics VALUES(1, '/lowstate', 'unitree_go/msg/LowState', 'cdr');",
            ),
            "log.db3",
        ),
    ];
    for (what, contents, expected) in cases {
        messages.add(what, "log.db3", &contents, expected);
    }
    insta::assert_snapshot!(messages.text);
}

/// An array as NumPy writes it, of any kind and shape.
fn array(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut text = b"\x93NUMPY\x01\x00".to_vec();
    text.extend((header.len() as u16).to_le_bytes());
    [&text, header.as_bytes(), data].concat()
}

fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, contents) in arrays {
        archive
            .start_file(*name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(contents).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn each_bad_archive_is_refused_with_the_fix() {
    let mut messages = Messages::default();
    let numbers = |count: usize, f: &dyn Fn(usize) -> f64| -> Vec<u8> {
        (0..count).flat_map(|n| f(n).to_le_bytes()).collect()
    };
    let t = array("<f8", "50,", &numbers(50, &|n| 0.002 * n as f64));
    let table = |columns: usize| {
        array(
            "<f8",
            &format!("50, {columns}"),
            &numbers(50 * columns, &|n| 0.01 * n as f64),
        )
    };
    let names = |names: &str, width: usize| {
        let count = names.split(' ').count();
        let text: Vec<u8> = names
            .split(' ')
            .flat_map(|name| {
                let mut bytes = name.as_bytes().to_vec();
                bytes.resize(width, 0);
                bytes
            })
            .collect();
        array(&format!("|S{width}"), &format!("{count},"), &text)
    };
    let leg = || names("FR_hip FR_thigh FR_calf", 8);
    let whole = |t: Vec<u8>, q: Vec<u8>, dq: Vec<u8>, tau: Vec<u8>, joints: Vec<u8>| {
        npz(&[
            ("t.npy", t),
            ("q.npy", q),
            ("dq.npy", dq),
            ("tau.npy", tau),
            ("joint_names.npy", joints),
        ])
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "no arrays",
            npz(&[("notes.txt", b"hello".to_vec())]),
            "without NumPy arrays",
        ),
        (
            "no array inside",
            npz(&[("q.npy", b"hello, world".to_vec())]),
            "array `q`",
        ),
        (
            "no header",
            npz(&[("q.npy", b"\x93NUMPY\x01\x00\xff\xff".to_vec())]),
            "array `q`",
        ),
        (
            "a header of rubbish",
            npz(&[("q.npy", b"\x93NUMPY\x01\x00\x03\x00abc".to_vec())]),
            "makes no sense",
        ),
        (
            "an absurd size",
            npz(&[("q.npy", array("<f8", "99999999, 99999999999", b""))]),
            "too large",
        ),
        (
            "an endless size",
            npz(&[("q.npy", array("<f8", "18446744073709551615, 3", b""))]),
            "too large",
        ),
        (
            "cut short",
            npz(&[("t.npy", array("<f8", "50,", &[0; 80]))]),
            "cut short",
        ),
        (
            "objects only",
            npz(&[("q.npy", array("|O", "50,", b""))]),
            "log.npz",
        ),
        (
            "no names",
            npz(&[
                ("t.npy", t.clone()),
                ("q.npy", table(3)),
                ("dq.npy", table(3)),
                ("tau.npy", table(3)),
            ]),
            "nothing names them",
        ),
        (
            "too few names",
            whole(
                t.clone(),
                table(3),
                table(3),
                table(3),
                names("FR_hip FR_thigh", 8),
            ),
            "a list of 2 joints",
        ),
        (
            "no time",
            npz(&[
                ("q.npy", table(3)),
                ("dq.npy", table(3)),
                ("tau.npy", table(3)),
                ("joint_names.npy", leg()),
            ]),
            "no column `t`",
        ),
        (
            "no torque",
            npz(&[
                ("t.npy", t.clone()),
                ("q.npy", table(3)),
                ("dq.npy", table(3)),
                ("joint_names.npy", leg()),
            ]),
            "without its torque",
        ),
        (
            "another length",
            whole(
                array("<f8", "49,", &numbers(49, &|n| n as f64)),
                table(3),
                table(3),
                table(3),
                leg(),
            ),
            "has 50 rows",
        ),
        (
            "another robot",
            whole(t.clone(), table(3), table(3), table(3), names("a b c", 1)),
            "no joint of the robot",
        ),
        (
            "the same name twice",
            whole(
                t.clone(),
                table(3),
                table(3),
                table(3),
                names("FR_hip FR_hip FR_calf", 8),
            ),
            "twice",
        ),
        (
            "not a number",
            whole(
                t.clone(),
                array(
                    "<f8",
                    "50, 3",
                    &numbers(150, &|n| if n == 60 { f64::NAN } else { 0.1 }),
                ),
                table(3),
                table(3),
                leg(),
            ),
            "row 21",
        ),
        (
            "no rows",
            whole(
                array("<f8", "0,", b""),
                array("<f8", "0, 3", b""),
                array("<f8", "0, 3", b""),
                array("<f8", "0, 3", b""),
                leg(),
            ),
            "0 samples",
        ),
    ];
    for (what, contents, expected) in cases {
        messages.add(what, "log.npz", &contents, expected);
    }
    insta::assert_snapshot!(messages.text);
}

#[test]
fn each_bad_text_is_refused_with_its_place_and_the_fix() {
    let mut messages = Messages::default();
    let header = "t,q/FR_hip,q/FR_thigh,q/FR_calf,dq/FR_hip,dq/FR_thigh,dq/FR_calf,tau/FR_hip,tau/FR_thigh,tau/FR_calf";
    let row = |k: usize| format!("{},0.1,0.8,-1.5,0.1,0.2,0.3,1,2,{k}", 0.002 * k as f64);
    let rows = |header: &str, change: &dyn Fn(usize, String) -> String| {
        let body: Vec<String> = (0..400).map(|k| change(k, row(k))).collect();
        format!("{header}\n{}\n", body.join("\n"))
    };
    let as_is = |_: usize, row: String| row;
    let motors = |n: usize| {
        let of = |signal: &str| {
            (0..n)
                .map(|m| format!(",/lowstate/motor_state[{m}]/{signal}"))
                .collect::<String>()
        };
        format!("__time{}{}{}", of("q"), of("dq"), of("tau_est"))
    };
    let cases: Vec<(&str, String, &str)> = vec![
        (
            "decimal commas between commas",
            rows(header, &|k, r| {
                if k == 3 { r.replace("0.8", "0,8") } else { r }
            }),
            "line 5",
        ),
        (
            "a semicolon among commas",
            rows(header, &|k, r| {
                if k == 3 { r.replace(",0.8", ";0.8") } else { r }
            }),
            "line 5",
        ),
        (
            "hexadecimal",
            rows(header, &|k, r| {
                if k == 9 { r.replace("0.8", "0x1f") } else { r }
            }),
            "line 11, column 3",
        ),
        (
            "a quoted word",
            rows(header, &|k, r| {
                if k == 9 {
                    r.replace("0.8", "\"fast\"")
                } else {
                    r
                }
            }),
            "line 11, column 3",
        ),
        (
            "a quote that never ends",
            rows(header, &|k, r| {
                if k == 9 { r.replace("0.8", "\"0.8") } else { r }
            }),
            "line 11",
        ),
        (
            "overflow",
            rows(header, &|k, r| {
                if k == 9 { r.replace("0.8", "1e999") } else { r }
            }),
            "line 11, column 3",
        ),
        (
            "thousands",
            rows(header, &|k, r| {
                if k == 9 { r.replace("0.8", "1'000") } else { r }
            }),
            "line 11, column 3",
        ),
        (
            "bytes that are no text",
            String::from_utf8_lossy(&[0xfe; 50]).into_owned(),
            "log.csv",
        ),
        (
            "a motor of no joint",
            rows(&motors(2).replace("state[0]", "state[15]"), &|k, r| {
                let _ = k;
                r.split(',').take(7).collect::<Vec<_>>().join(",")
            }),
            "log.csv",
        ),
        (
            "half a leg by number",
            rows(&motors(2), &|_, r| {
                r.split(',').take(7).collect::<Vec<_>>().join(",")
            }),
            "limb FR has FR_hip but not FR_calf",
        ),
        (
            "a motor twice",
            rows(&motors(3).replace("state[1]/dq", "state[0]/dq"), &as_is),
            "twice",
        ),
        (
            "no time beside motors",
            rows(&motors(3).replace("__time", "stamp"), &as_is),
            "no column `t`",
        ),
        (
            "no torque beside motors",
            rows(&motors(3).replace("tau_est", "tau_raw"), &as_is),
            "without its torque",
        ),
        (
            "a word in a motor's cell",
            rows(&motors(3), &|k, r| {
                if k == 7 { r.replace("0.8", "x") } else { r }
            }),
            "line 9, column 3",
        ),
        (
            "joint states of another robot",
            rows(
                "__time,/joint_states/elbow/position,a,b,c,d,e,f,g,h",
                &as_is,
            ),
            "`elbow` is no joint",
        ),
        (
            "a motor before an unknown gear",
            rows(&header.replace("q/FR_hip", "q_motor/FR_hop"), &as_is),
            "did you mean `q_motor/FR_hip`?",
        ),
        (
            "a joint and its motor",
            rows(&header.replace("q/FR_thigh", "q_motor/FR_hip"), &as_is),
            "twice",
        ),
        (
            "a second encoder of no joint",
            rows(&header.replace("tau/FR_calf", "q_link/FR_knee"), &as_is),
            "q_link/FR_knee",
        ),
        (
            "rows of other topics only",
            rows(&motors(3), &|k, _| {
                format!("{}{}", 0.002 * k as f64, ",".repeat(9))
            }),
            "0 samples",
        ),
    ];
    for (what, text, expected) in cases {
        messages.add(what, "log.csv", text.as_bytes(), expected);
    }
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(b"not a log at all").unwrap();
    messages.add(
        "prose, compressed",
        "log.csv.gz",
        &gzip.finish().unwrap(),
        "separated by ` `",
    );
    messages.add(
        "gzip's magic alone",
        "log.csv.gz",
        b"\x1f\x8b\x08\0",
        "cannot read on",
    );
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
