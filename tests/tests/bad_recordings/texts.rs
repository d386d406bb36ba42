//! Tables of text.

use std::io::Write;

use flate2::{Compression, write::GzEncoder};

use super::Messages;

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
            "holds no number in any of 400 rows",
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
