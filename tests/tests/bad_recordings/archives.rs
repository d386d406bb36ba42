//! NumPy's archives.

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;

use super::Messages;

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
