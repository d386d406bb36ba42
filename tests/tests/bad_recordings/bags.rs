//! Bags of ROS 2 in MCAP.

use std::collections::BTreeMap;
use std::io::Cursor;

use super::{GO, Messages};

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
            mcap(
                &[("/lowstate", GO)],
                &states(&|k| {
                    let since = u32::try_from(k).unwrap();
                    low_state(if since < 220 {
                        2 * since
                    } else {
                        2 * since - 433
                    })
                }),
            ),
            "time runs backwards",
        ),
    ];
    for (what, contents, expected) in cases {
        messages.add(what, "log.mcap", &contents, expected);
    }
    assert!(messages.count >= 25, "{}", messages.count);
    insta::assert_snapshot!(messages.text);
}
