//! The figures of all cases: `battery/table.md`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::PathBuf;

use proprio_simulator::HiddenKind;

use proprio_tests::battery::case::{self, Group};
use proprio_tests::battery::outcome::Outcome;

/// Where the table is.
pub fn path() -> PathBuf {
    super::folder().join("table.md")
}

/// A figure: what was counted, of how many, and the least or most of it in per cent.
struct Figure {
    what: &'static str,
    hits: usize,
    of: usize,
    target: f64,
    at_most: bool,
}

impl Figure {
    fn new<'a>(
        what: &'static str,
        target: f64,
        outcomes: impl Iterator<Item = &'a Outcome>,
        hit: impl Fn(&Outcome) -> bool,
    ) -> Self {
        let (mut hits, mut of) = (0, 0);
        for outcome in outcomes {
            of += 1;
            hits += usize::from(hit(outcome));
        }
        Self {
            what,
            hits,
            of,
            target,
            at_most: false,
        }
    }

    fn row(&self) -> String {
        let percent = 100.0 * self.hits as f64 / self.of.max(1) as f64;
        let (sign, met) = if self.at_most {
            ("≤", percent <= self.target)
        } else {
            ("≥", percent >= self.target)
        };
        format!(
            "| {} | {} of {} | {percent:.1} % | {sign} {} % | {} |\n",
            self.what,
            self.hits,
            self.of,
            self.target,
            if met { "met" } else { "missed" }
        )
    }
}

/// The table of outcomes; those of MuJoCo's logs apart.
pub fn text(outcomes: &[Outcome], mujoco: &[Outcome]) -> String {
    let mut text = String::from(
        "# Labelled battery\n\n\
         `cargo run --release -p proprio-studies --bin battery` makes this; `-- --accept` writes it (`--quick`: every eleventh case). Rows of the cases: `tests/battery/cases.csv`.\n\
         Detectable: at least 3 Cramér-Rao standard deviations (`tests/src/battery/bound.rs`).\n\n\
         | figure | count | share | target | |\n|---|---|---|---|---|\n",
    );
    for figure in figures(outcomes) {
        text += &figure.row();
    }
    let all = case::all().len();
    let _ = writeln!(text, "| cases run | {} of {all} | | | |", outcomes.len());
    let right = mujoco.iter().filter(|o| o.is_right()).count();
    let _ = writeln!(
        text,
        "| MuJoCo's logs right | {right} of {} | | all | |",
        mujoco.len()
    );
    text += &effects(outcomes);
    text += &confusion(outcomes);
    text += &misses(outcomes, mujoco);
    text
}

fn figures(outcomes: &[Outcome]) -> Vec<Figure> {
    let of = |group: Group| outcomes.iter().filter(move |o| o.group == group);
    let told = |group: Group| of(group).filter(|o| o.is_detectable());
    let floor = || {
        let known = outcomes.iter().filter(|o| o.floor.is_some());
        known.filter(|o| o.is_detectable())
    };
    let named = |o: &Outcome| o.named.is_some();
    vec![
        Figure::new(
            "detectable: effect and joint right",
            95.0,
            told(Group::One),
            Outcome::is_top,
        ),
        Figure::new(
            "detectable: truth in the set",
            99.0,
            told(Group::One),
            Outcome::is_in_set,
        ),
        Figure {
            at_most: true,
            ..Figure::new(
                "complete: an effect is called missing",
                1.0,
                of(Group::Complete),
                named,
            )
        },
        Figure {
            at_most: true,
            ..Figure::new(
                "complete: something outside the catalogue is reported",
                1.0,
                of(Group::Complete),
                |o| o.outside,
            )
        },
        Figure::new(
            "held-out error within 5 % of the floor",
            95.0,
            floor(),
            |o| o.is_at_floor() == Some(true),
        ),
        Figure::new(
            "two effects: both found",
            85.0,
            told(Group::Two),
            Outcome::has_all,
        ),
        Figure::new(
            "outside the catalogue: reported as such",
            90.0,
            told(Group::Outside),
            |o| o.outside,
        ),
        Figure {
            at_most: true,
            ..Figure::new(
                "outside the catalogue: only a wrong name",
                10.0,
                told(Group::Outside),
                |o| named(o) && !o.outside,
            )
        },
    ]
}

fn kind(place: &str) -> &str {
    place.split(':').next().unwrap_or(place)
}

/// Each effect: how often it is found, and from which size on.
fn effects(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "\n## Effects\n\nThe limits are the rms torque at which half and 95 % of the cases are named right, N m, all joints together,\n\
         interpolated between the three sizes; `<` or `>` the smallest or largest size tried. For effects outside the catalogue:\n\
         reported as such.\n\n\
         | effect | cases | detectable | top-1 | in set | at floor | half, N m | 95 %, N m |\n|---|---|---|---|---|---|---|---|\n",
    );
    for kind_ in HiddenKind::ALL {
        let single = |o: &&Outcome| {
            matches!(o.group, Group::One | Group::Outside) && kind(&o.hidden[0]) == kind_.name()
        };
        let all: Vec<&Outcome> = outcomes.iter().filter(single).collect();
        if all.is_empty() {
            continue;
        }
        let told: Vec<&&Outcome> = all.iter().filter(|o| o.is_detectable()).collect();
        let count = |hit: &dyn Fn(&Outcome) -> bool| told.iter().filter(|o| hit(o)).count();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            kind_.name(),
            all.len(),
            told.len(),
            count(&Outcome::is_right),
            count(&Outcome::is_in_set),
            count(&|o| o.is_at_floor() == Some(true)),
            limit(&all, 0.5),
            limit(&all, 0.95),
        );
    }
    text
}

/// The torque from which on this share of the cases is right.
fn limit(all: &[&Outcome], share: f64) -> String {
    let sizes: Vec<(f64, f64)> = (0..3)
        .filter_map(|size| {
            let own: Vec<_> = all.iter().filter(|o| o.size == size).collect();
            let n = own.len() as f64;
            let log: f64 = own.iter().map(|o| o.torque.max(1e-6).ln()).sum();
            let right = own.iter().filter(|o| o.is_right()).count();
            (n > 0.0).then(|| ((log / n).exp(), right as f64 / n))
        })
        .collect();
    let mut sizes = sizes;
    sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
    // From the largest size down: the last one at which the share is reached without a gap above it.
    let Some(reached) = sizes.iter().rposition(|s| s.1 < share).map(|n| n + 1) else {
        return sizes
            .first()
            .map_or_else(String::new, |s| format!("< {:.3}", s.0));
    };
    match (sizes.get(reached), sizes.get(reached - 1)) {
        (Some(above), Some(below)) => {
            let t = (share - below.1) / (above.1 - below.1);
            format!(
                "{:.3}",
                (below.0.ln() + t * (above.0.ln() - below.0.ln())).exp()
            )
        }
        _ => sizes
            .last()
            .map_or_else(String::new, |s| format!("> {:.3}", s.0)),
    }
}

/// Hidden × named, where a count is not zero.
fn confusion(outcomes: &[Outcome]) -> String {
    let mut counts: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
    let mut columns: BTreeSet<&str> = BTreeSet::new();
    let single = |o: &&Outcome| o.group != Group::Two && o.is_detectable();
    for outcome in outcomes.iter().filter(single) {
        let hidden = outcome.hidden.first().map_or("nothing", |h| kind(h));
        let named = match &outcome.named {
            None if outcome.outside => "outside",
            None => "nothing",
            Some(named) => kind(named),
        };
        let elsewhere = outcome.named.is_some() && !outcome.is_top() && named == hidden;
        let named = if elsewhere { "wrong joint" } else { named };
        columns.insert(named);
        *counts.entry(hidden).or_default().entry(named).or_default() += 1;
    }
    let columns: Vec<&str> = columns.into_iter().collect();
    let mut text = String::from(
        "\n## Confusion\n\nHidden (rows) and named first (columns), detectable cases.\n\n| |",
    );
    for column in &columns {
        let _ = write!(text, " {column} |");
    }
    text += "\n|---|";
    text += &"---|".repeat(columns.len());
    let rows = HiddenKind::ALL.iter().map(|k| k.name()).chain(["nothing"]);
    for row in rows {
        let Some(own) = counts.get(row) else { continue };
        let _ = write!(text, "\n| {row} |");
        for column in &columns {
            let count = own.get(column).map_or_else(String::new, usize::to_string);
            let _ = write!(text, " {count} |");
        }
    }
    text.push('\n');
    text
}

/// Every case that is not as it should be.
fn misses(outcomes: &[Outcome], mujoco: &[Outcome]) -> String {
    let mut text = String::from(
        "\n## Misses\n\nDetectable cases. *apart*: the hidden effect's size, in Cramér-Rao standard deviations, if the named one is fitted too.\n\n\
         | case | size/std | named | alternatives | outside | apart | after | floor |\n|---|---|---|---|---|---|---|---|\n",
    );
    let number =
        |x: Option<f64>, digits: usize| x.map_or_else(String::new, |x| format!("{x:.digits$}"));
    let row = |o: &Outcome| {
        let named = match o.group {
            Group::Two => o.path.join(" "),
            _ => o.named.clone().unwrap_or_default(),
        };
        format!(
            "| {} | {} | {named} | {} | {} | {} | {:.4} | {} |\n",
            o.case,
            number(o.snr, 1),
            o.alternatives.join(" "),
            if o.outside { "yes" } else { "" },
            number(o.apart, 1),
            o.after,
            number(o.floor, 4),
        )
    };
    let wrong = |o: &&Outcome| o.is_detectable() && !o.is_right();
    outcomes
        .iter()
        .chain(mujoco)
        .filter(wrong)
        .for_each(|o| text += &row(o));
    text += "\nRight, but the error after the path is not at the floor:\n\n| case | named | path | after | floor |\n|---|---|---|---|---|\n";
    let high = |o: &&Outcome| o.is_detectable() && o.is_right() && o.is_at_floor() == Some(false);
    for o in outcomes.iter().chain(mujoco).filter(high) {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.4} | {} |",
            o.case,
            o.named.clone().unwrap_or_default(),
            o.path.join(" "),
            o.after,
            number(o.floor, 4),
        );
    }
    text
}
