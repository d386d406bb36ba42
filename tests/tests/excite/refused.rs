//! Designs that cannot be, and motions that no leg can follow.

use std::fs;
use std::path::Path;

use proprio_tests::command::{folder, proprio, stderr};

#[test]
fn bad_input_is_named_and_leaves_no_file() {
    let folder = folder();
    let here = folder.path();
    fs::write(here.join("short.csv"), "t,q/FR_hip\n0,0\n").unwrap();
    fs::write(
        here.join("wall.toml"),
        "[[plane]]\nname = \"the wall\"\nnormal = [0, 0, 1]\noffset = 0.5\n",
    )
    .unwrap();
    fs::write(here.join("bad.toml"), "[[cylinder]]\n").unwrap();
    bad_motions(here);
    let files = fs::read_dir(here).unwrap().count();
    let cases: [(&[&str], i32, &str); 44] = [
        (
            &["excite", "--pose", "FR_calf=-3"],
            1,
            "position of FR_calf",
        ),
        (&["excite", "--position-margin", "1.5"], 1, "cannot move"),
        (&["excite", "--legs", "FX"], 1, "no leg `FX`"),
        (&["excite", "--pose", "FR_knee=0"], 1, "FR_knee"),
        (&["excite", "--duration", "0"], 2, "must lie between"),
        (
            &["excite", "--acceleration", "nan"],
            1,
            "the greatest acceleration",
        ),
        (
            &["excite", "--separate", "stribeck,stribek:FR_hip"],
            2,
            "did you mean `stribeck`",
        ),
        (
            &["excite", "--separate", "contact,viscous:FR_hip"],
            1,
            "contact",
        ),
        (
            &["simulate", "--follow", "short.csv"],
            1,
            "no column `q/FR_thigh`",
        ),
        (&["validate"], 2, "--motion"),
        (
            &["excite", "--velocity-share", "nan"],
            2,
            "must lie between",
        ),
        (&["excite", "--duration", "inf"], 2, "must lie between"),
        (&["excite", "--duration", "1e9"], 2, "must lie between"),
        (&["excite", "--harmonics", "3000"], 2, "2..=100"),
        (
            &["excite", "--pose", "FR_calf=nan"],
            1,
            "the pose of FR_calf",
        ),
        (&["excite", "--torque-share", "0.01"], 1, "torque of FR_"),
        (&["excite", "--starts", "0"], 2, "1..=100000"),
        (
            &["excite", "--legs", "FR", "--for", "m:FR_foot"],
            1,
            "m:FR_foot",
        ),
        (
            &[
                "excite",
                "--legs",
                "FR",
                "--separate",
                "viscous,coulomb:FR_knee",
            ],
            1,
            "FR_knee",
        ),
        (&["excite", "--shapes", "none.toml"], 1, "none.toml"),
        (&["excite", "--shapes", "bad.toml"], 1, "cylinder"),
        // Where the leg hangs the wall stands already.
        (
            &["excite", "--legs", "FR", "--shapes", "wall.toml"],
            1,
            "to the wall is beyond its limit",
        ),
        (
            &["excite", "--legs", "FR", "--from", "short.csv"],
            1,
            "short.csv",
        ),
        (
            &["excite", "--ground", "nan"],
            1,
            "the height above the ground",
        ),
        (&["excite", "--period", "0"], 2, "must lie between"),
        (
            &["excite", "--uncertainty", "nan"],
            1,
            "the uncertainty of the parameters",
        ),
        (
            &["excite", "--power-share", "nan"],
            1,
            "the share of the power",
        ),
        (&["excite", "--kp", "nan"], 2, "must lie between"),
        (&["excite", "--kd=-1"], 2, "must lie between"),
        // The floor is where the foot is.
        (
            &["excite", "--legs", "FR", "--ground", "0.05"],
            1,
            "foot to the ground is beyond its limit",
        ),
        (&["simulate", "--follow", "none.csv"], 1, "none.csv"),
        (&["simulate", "--follow", "still.csv"], 1, "no motion"),
        (
            &["simulate", "--follow", "instant.csv"],
            1,
            "instant.csv:3: the time",
        ),
        (
            &["simulate", "--follow", "nan.csv"],
            1,
            "nan.csv:3: `nan` in column `q/FR_thigh`",
        ),
        (
            &["simulate", "--follow", "stops.csv"],
            1,
            "stops.csv:3: FR_thigh is asked to be at 9 rad",
        ),
        (
            &["simulate", "--follow", "knee.csv"],
            1,
            "there is no joint `FR_knee`",
        ),
        (
            &["simulate", "--follow", "path.csv", "--duration", "0"],
            2,
            "--duration",
        ),
        (
            &["validate", "--motion", "nan.csv", "--html", "page.html"],
            1,
            "nan.csv:3",
        ),
        (
            &["validate", "--motion", "stops.csv", "--html", "page.html"],
            1,
            "stops.csv:3",
        ),
        (
            &["validate", "none.csv", "--html", "page.html"],
            1,
            "none.csv",
        ),
        (
            &["validate", "--motion", "path.csv", "-m", "none.toml"],
            1,
            "none.toml",
        ),
        (&["advise", "none.csv"], 1, "none.csv"),
        (&["advise", "path.csv", "--legs", "FX"], 1, "no leg `FX`"),
        (&["advise", "short.csv"], 1, "short.csv"),
    ];
    for (arguments, status, words) in cases {
        let output = proprio(here, arguments);
        assert_eq!(
            output.status.code(),
            Some(status),
            "{arguments:?}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(words),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    let left: Vec<_> = fs::read_dir(here)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), files, "{left:?}");
}

/// Motions that no leg can follow, and `path.csv` that one can.
fn bad_motions(folder: &Path) {
    let columns = ["q", "dq", "ddq"].map(|c| format!("{c}/FR_hip,{c}/FR_thigh,{c}/FR_calf"));
    let header = format!("t,{}\n", columns.join(","));
    let row = |t: &str, thigh: &str| format!("{t},0,{thigh},-1.7,0,0,0,0,0,0\n");
    let start = row("0", "0.9");
    let write = |name: &str, text: String| fs::write(folder.join(name), text).unwrap();
    write("path.csv", format!("{header}{start}{}", row("1", "0.9")));
    write("still.csv", format!("{header}{start}"));
    write("instant.csv", format!("{header}{start}{start}"));
    write("nan.csv", format!("{header}{start}{}", row("1", "nan")));
    write("stops.csv", format!("{header}{start}{}", row("1", "9")));
    write(
        "knee.csv",
        format!("{}{start}", header.replace("q/FR_calf", "q/FR_knee")),
    );
}
