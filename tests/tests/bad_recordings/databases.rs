//! Bags of ROS 2 in SQLite.

use std::fs;

use super::{GO, Messages};

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
