//! The tables of cost in `docs/board.md` and `studies/board.md` say what `budgets.toml` accepted; `PROPRIO_ACCEPT=1` writes them.

use std::fs;
use std::path::Path;

use toml::Table;

/// Rows: what they are called, and the figures in them.
const ROWS: &[(&str, &[&str])] = &[
    ("instructions per tick, mean", &["tick_mean"]),
    ("instructions per tick, worst", &["tick_worst"]),
    (
        "instructions per tick where no leg could be as the data say: mean; worst",
        &["impossible_tick_mean", "impossible_tick_worst"],
    ),
    (
        "instructions per tick while every leg's wiring is on trial: mean; worst",
        &["trial_tick_mean", "trial_tick_worst"],
    ),
    ("a polling cycle's bytes to frames", &["decode_cycle"]),
    (
        "a sample into the window; one that closes it",
        &["push", "push_closing"],
    ),
    ("the rows of a closed window laid by", &["take"]),
    ("six windows folded into a leg's factors", &["fold"]),
    ("the test for changes looks at them", &["look"]),
    (
        "a closed block judged; old blocks weighed down at the begin of one",
        &["judge_block", "forget_block"],
    ),
    (
        "most expensive step of gathering the folds; of the solution",
        &["gather_step", "solver_step"],
    ),
    (
        "physically consistent solution of a leg: one Newton step, all before it included; its most expensive part",
        &["consistent_newton_step", "consistent_part"],
    ),
    ("flash, bytes", &["flash_bytes"]),
    ("static RAM, bytes", &["static_ram_bytes"]),
    ("stack, high-water, bytes", &["stack_bytes"]),
    ("walking: instructions per tick, mean", &["walk_tick_mean"]),
    (
        "walking: instructions per tick, worst",
        &["walk_tick_worst"],
    ),
    (
        "walking: a sample; one that closes a window; one after which a foot has changed",
        &["walk_push", "walk_push_closing", "walk_push_cutting"],
    ),
    (
        "walking: most expensive part of folding; of a solution of 179 parts",
        &["walk_fold_part", "walk_solve_part"],
    ),
    ("walking: flash, bytes", &["walk_flash_bytes"]),
    ("walking: static RAM, bytes", &["walk_static_ram_bytes"]),
    ("walking: stack, high-water, bytes", &["walk_stack_bytes"]),
];

#[test]
fn the_documents_say_what_the_budgets_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let budgets: Table = fs::read_to_string(root.join("budgets.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let figure = |table: &str, key: &str| {
        budgets[table]
            .get(key)
            .map(|x| thousands(x.as_integer().unwrap()))
    };
    let row = |(name, keys): &(&str, &[&str])| {
        let of = |table| {
            let all: Vec<String> = keys.iter().filter_map(|key| figure(table, key)).collect();
            all.join("; ")
        };
        let line = format!(
            "| {name} | {} | {} | {} |",
            of("f64"),
            of("f32"),
            of("target")
        );
        line.replace("|  |", "| |")
    };
    let pages = ["docs/board.md", "studies/board.md"].map(|page| root.join(page));
    let committed = pages
        .each_ref()
        .map(|page| fs::read_to_string(page).unwrap());
    let mut written = committed.clone();
    for own in ROWS {
        let begin = format!("| {} |", own.0);
        let mut found = false;
        for (text, written) in committed.iter().zip(&mut written) {
            for line in text.lines().filter(|line| line.starts_with(&begin)) {
                found = true;
                *written = written.replace(line, &row(own));
            }
        }
        assert!(found, "neither page has a row `{begin}`");
    }
    if std::env::var_os("PROPRIO_ACCEPT").is_some() {
        for (page, text) in pages.iter().zip(&written) {
            fs::write(page, text).unwrap();
        }
        return;
    }
    assert_eq!(
        committed, written,
        "PROPRIO_ACCEPT=1 writes docs/board.md and studies/board.md"
    );
}

/// 12 345.
fn thousands(number: i64) -> String {
    match number {
        ..1000 => number.to_string(),
        _ => format!("{} {:03}", thousands(number / 1000), number % 1000),
    }
}
