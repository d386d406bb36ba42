//! What a user types, from logs to a page: five simulated robots, one of them with a spring, and uploads that are faulty.

use std::fs;
use std::path::Path;
use std::process::Command;

use proprio_host::command::run_words;
use proprio_host::fleet::{Block, read, write};
use serde_json::Value;

// Public where it is at home.
#[allow(unreachable_pub)]
#[path = "../../tests/src/schema.rs"]
mod schema;

/// Runs `proprio` in this process.
fn proprio(words: &[&str]) {
    let words = std::iter::once("proprio").chain(words.iter().copied());
    assert_eq!(run_words(words.map(Into::into)), 0);
}

/// Standard output of `proprio-fleet`, which must succeed.
fn fleet(folder: &Path, words: &[&str]) -> String {
    let program = env!("CARGO_BIN_EXE_proprio-fleet");
    let output = Command::new(program)
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{words:?}: {told}");
    String::from_utf8(output.stdout).unwrap()
}

/// What --json has printed, held to its schema.
fn object(text: &str) -> Value {
    let value = serde_json::from_str(text).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/schema/fleet.json");
    let faults = schema::Schema::read(&path).faults(&value);
    assert!(faults.is_empty(), "{faults:#?}");
    value
}

/// A table of another log, whose first row is changed before it is sealed.
fn altered(from: &Path, to: &Path, change: impl Fn(&mut Block)) {
    let mut blocks = read(from).blocks;
    blocks
        .iter_mut()
        .for_each(|b| b.log = to.display().to_string());
    change(&mut blocks[0]);
    let sealed: Vec<Block> = blocks.into_iter().take(1).map(Block::sealed).collect();
    write(to, &sealed).unwrap();
}

fn with_columns(block: &mut Block, change: impl Fn(&mut proprio_host::fleet::BlockColumns)) {
    let mut columns = (*block.columns).clone();
    change(&mut columns);
    block.hash = columns.hash().into();
    block.columns = columns.into();
}

#[test]
fn from_uploads_to_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let at = |name: String| folder.join(name).display().to_string();
    fs::create_dir(folder.join("uploads")).unwrap();
    for robot in 0..5 {
        for log in 0..3 {
            let (csv, table) = (
                at(format!("{robot}-{log}.csv")),
                at(format!("uploads/{robot}-{log}.parquet")),
            );
            let seed = (10 * robot + log + 1).to_string();
            let mut words = vec![
                "simulate",
                "--legs",
                "FR",
                "--typical",
                "--duration",
                "24",
                "--seed",
                &seed,
                "-o",
                &csv,
            ];
            if robot == 3 {
                words.extend(["--hide", "spring:FR_thigh=4"]);
            }
            proprio(&words);
            let name = format!("robot-{robot}");
            let begin = (1_790_000_000 + 86_400 * log).to_string();
            proprio(&[
                "factors", &csv, "--robot", &name, "--block", "10", "--begin", &begin, "-o", &table,
            ]);
        }
    }
    let good = object(&fleet(
        folder,
        &["add", "uploads", "--to", "fleet", "--json"],
    ));
    assert_eq!(
        (&good["files"], &good["refused"]),
        (&Value::from(15), &Value::from(0)),
        "{good}"
    );
    let before = fleet(folder, &["report", "fleet", "--json"]);

    // The same again, and faulty ones: nothing changes but the quarantine.
    let bytes = fs::read(folder.join("uploads/0-0.parquet")).unwrap();
    fs::write(
        folder.join("uploads/cut.parquet"),
        &bytes[..bytes.len() / 2],
    )
    .unwrap();
    let mut flipped = bytes.clone();
    flipped[2_000] ^= 4;
    fs::write(folder.join("uploads/flipped.parquet"), flipped).unwrap();
    fs::write(folder.join("uploads/none.parquet"), "t,q\n").unwrap();
    let whole = folder.join("uploads/4-0.parquet");
    let upload = |name: &str| folder.join("uploads").join(name);
    altered(&whole, &upload("nan.parquet"), |b| b.factor[2] = f32::NAN);
    altered(&whole, &upload("shape.parquet"), |b| b.factor.push(0.0));
    altered(&whole, &upload("cad.parquet"), |b| {
        with_columns(b, |c| c.cad = "0".to_owned())
    });
    altered(&whole, &upload("column.parquet"), |b| {
        with_columns(b, |c| c.columns[30].name = "friction:FR_hip".to_owned());
    });
    let other = at("uploads/renamed.parquet".to_owned());
    let begin = 1_790_000_000.to_string();
    proprio(&[
        "factors",
        &at("1-0.csv".to_owned()),
        "--robot",
        "robot-9",
        "--block",
        "10",
        "--begin",
        &begin,
        "-o",
        &other,
    ]);
    let again = object(&fleet(
        folder,
        &["add", "uploads", "--to", "fleet", "--json"],
    ));
    assert_eq!(
        (&again["known"], &again["rows"]),
        (&Value::from(15), &Value::from(0)),
        "{again}"
    );
    for kind in [
        "damaged",
        "not_finite",
        "shape",
        "other_columns",
        "unknown_column",
        "other_robot",
    ] {
        assert!(again["kinds"][kind].as_u64().unwrap() >= 1, "{again}");
    }
    assert_eq!(
        fleet(
            folder,
            &["report", "fleet", "--json", "--html", "fleet.html"]
        ),
        before
    );
    let idle = object(&fleet(
        folder,
        &["add", "uploads", "--to", "fleet", "--json"],
    ));
    assert_eq!(
        (&idle["known"], &idle["refused"]),
        (&Value::from(23), &Value::from(0)),
        "{idle}"
    );

    let status = object(&fleet(folder, &["status", "fleet", "--json"]));
    assert_eq!(
        (&status["robots"], &status["rows"]),
        (&Value::from(5), &good["rows"]),
        "{status}"
    );
    let answers = object(&before);
    let odd = &answers["outliers"][0];
    assert_eq!(
        (&odd["robot"], &odd["name"]),
        (&Value::from("robot-3"), &Value::from("spring:FR_thigh")),
        "{}",
        answers["outliers"]
    );
    let page = fs::read_to_string(folder.join("fleet.html")).unwrap();
    assert!(page.contains("robot-3 differs: spring:FR_thigh") && page.contains("cut or damaged"));

    fleet(folder, &["models", "fleet", "--to", "models"]);
    fleet(folder, &["prior", "fleet", "-o", "prior.toml"]);
    let [log, model, prior] =
        ["4-2.csv", "models/robot-4.toml", "prior.toml"].map(|name| at(name.to_owned()));
    proprio(&["compare", &log, "-m", &model]);
    proprio(&["identify", &log, "-m", &prior]);
}
