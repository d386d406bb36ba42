//! Counts of judgements against their targets: `battery/mujoco_table.md`.

use std::collections::BTreeMap;
use std::fmt::Write;

use proprio_tests::battery::logged::judgement::{DETECTABLE, Judgement};

/// A count and what it should be.
#[derive(Debug, Clone)]
pub struct Figure {
    /// What is counted.
    pub what: String,
    hits: usize,
    of: usize,
    /// Least or most, %.
    target: Option<Target>,
}

/// What a share should be, %.
#[derive(Debug, Clone, Copy)]
enum Target {
    AtLeast(f64),
    AtMost(f64),
}

impl Figure {
    fn new<'a>(
        what: impl Into<String>,
        target: Option<Target>,
        judgements: impl IntoIterator<Item = &'a Judgement>,
        hit: impl Fn(&Judgement) -> bool,
    ) -> Self {
        let (mut hits, mut of) = (0, 0);
        for judgement in judgements {
            of += 1;
            hits += usize::from(hit(judgement));
        }
        Self {
            what: what.into(),
            hits,
            of,
            target,
        }
    }

    fn percent(&self) -> f64 {
        100.0 * self.hits as f64 / self.of.max(1) as f64
    }

    /// Whether the share is as it should be; of nothing it is.
    pub fn is_met(&self) -> bool {
        match self.target {
            _ if self.of == 0 => true,
            None => true,
            Some(Target::AtLeast(least)) => self.percent() >= least,
            Some(Target::AtMost(most)) => self.percent() <= most,
        }
    }

    fn share(&self) -> String {
        format!("{} of {}", self.hits, self.of)
    }

    fn row(&self) -> String {
        let target = match self.target {
            None => String::new(),
            Some(Target::AtLeast(least)) => format!("≥ {least} %"),
            Some(Target::AtMost(most)) => format!("≤ {most} %"),
        };
        let met = match (self.target, self.is_met()) {
            (None, _) => "",
            (_, true) => "met",
            (_, false) => "missed",
        };
        let Self { what, .. } = self;
        let (share, percent) = (self.share(), self.percent());
        format!("| {what} | {share} | {percent:.1} % | {target} | {met} |\n")
    }
}

/// How loud a case's torque is: `0.2 N m white`.
fn level(judgement: &Judgement) -> (u64, &'static str) {
    let truth = &judgement.case.truth;
    let colour = match truth.torque_memory {
        _ if truth.torque_noise == 0.0 => "",
        0.0 => "white",
        _ => "coloured",
    };
    ((truth.torque_noise * 1e3).round() as u64, colour)
}

/// Judgements by a key.
fn by<K: Ord>(
    judgements: &[Judgement],
    key: impl Fn(&Judgement) -> K,
) -> BTreeMap<K, Vec<&Judgement>> {
    let mut groups: BTreeMap<K, Vec<&Judgement>> = BTreeMap::new();
    for judgement in judgements {
        groups.entry(key(judgement)).or_default().push(judgement);
    }
    groups
}

/// All figures that have a target: of all cases, and of each level of noise.
pub fn figures(judgements: &[Judgement]) -> Vec<Figure> {
    use Target::{AtLeast, AtMost};
    let told = |j: &&Judgement| !j.is_complete() && j.is_detectable();
    let detectable = || judgements.iter().filter(told);
    let known = || detectable().filter(|j| j.is_covered().is_some());
    let all = judgements;
    let mut figures = vec![
        Figure::new("no verdict", Some(AtMost(0.0)), all, |j| {
            j.failure.is_some()
        }),
        Figure::new(
            "detectable: named first",
            Some(AtLeast(95.0)),
            detectable(),
            Judgement::is_top,
        ),
        Figure::new(
            "detectable: in the set",
            Some(AtLeast(99.0)),
            detectable(),
            Judgement::is_in_set,
        ),
        Figure::new(
            "detectable: in the path",
            Some(AtLeast(95.0)),
            detectable(),
            Judgement::is_found,
        ),
        Figure::new(
            "detectable: end error within 5 % of the true model's",
            Some(AtLeast(95.0)),
            detectable(),
            Judgement::is_at_floor,
        ),
        Figure::new(
            "an effect in the path that is not there",
            Some(AtMost(1.0)),
            all,
            |j| !j.extra().is_empty(),
        ),
        Figure::new(
            "\"also outside the catalogue\", and it is not",
            Some(AtMost(1.0)),
            all,
            |j| j.outside,
        ),
        Figure::new(
            "detectable: value within 2 std",
            Some(AtLeast(95.0)),
            known(),
            |j| j.is_covered() == Some(true),
        ),
    ];
    for ((noise, colour), of) in by(judgements, level) {
        let name = format!("{} N m {colour}", noise as f64 * 1e-3);
        let complete = of.iter().copied().filter(|j| j.is_complete());
        let known = of
            .iter()
            .copied()
            .filter(|j| told(j) && j.is_covered().is_some());
        figures.push(Figure::new(
            format!("complete, {name}: an effect is named"),
            Some(AtMost(1.0)),
            complete,
            |j| !j.named.is_empty() || !j.path.is_empty(),
        ));
        figures.push(Figure::new(
            format!("detectable, {name}: value within 2 std"),
            Some(AtLeast(95.0)),
            known,
            |j| j.is_covered() == Some(true),
        ));
    }
    figures
}

/// The table, with what made it.
pub fn text(title: &str, command: &str, judgements: &[Judgement]) -> String {
    let mut text = format!(
        "# {title}\n\n`{command}` makes this.\n\
         Detectable: at least {DETECTABLE} standard deviations of an efficient estimate (Cramér-Rao).\n\n\
         | figure | count | share | target | |\n|---|---|---|---|---|\n"
    );
    for figure in figures(judgements) {
        text += &figure.row();
    }
    text += &by_effect(judgements);
    text += &by_size(judgements);
    text += &bias(judgements);
    text += &wrong(judgements);
    text
}

fn by_effect(judgements: &[Judgement]) -> String {
    let mut text = String::from(
        "\n## Effects\n\nDetectable cases, or all of a complete model; extra steps and \"outside\" of all.\n\n\
         | effect | cases | detectable | named first | in the set | in the path | at the floor | extra | outside | value within 2 std |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    let effect = |j: &Judgement| {
        j.case
            .truth
            .effect
            .clone()
            .unwrap_or_else(|| "none".to_owned())
    };
    for (name, of) in by(judgements, effect) {
        let told: Vec<&Judgement> = of.iter().copied().filter(|j| j.is_detectable()).collect();
        let count = |of: &[&Judgement], hit: &dyn Fn(&Judgement) -> bool| {
            of.iter().filter(|j| hit(j)).count()
        };
        let covered = count(&told, &|j| j.is_covered() == Some(true));
        let known = count(&told, &|j| j.is_covered().is_some());
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {covered} of {known} |",
            of.len(),
            told.len(),
            count(&told, &Judgement::is_top),
            count(&told, &Judgement::is_in_set),
            count(&told, &Judgement::is_found),
            count(&told, &Judgement::is_at_floor),
            count(&of, &|j| !j.extra().is_empty()),
            count(&of, &|j| j.outside),
        );
    }
    text
}

/// Where half are missed: by what the log can tell.
fn by_size(judgements: &[Judgement]) -> String {
    let mut text = String::from(
        "\n## Sizes\n\nIn standard deviations of an efficient estimate.\n\n| from | to | cases | named first | in the set |\n|---|---|---|---|---|\n",
    );
    let edges = [0.0, 1.0, 3.0, 10.0, 30.0, 100.0, f64::INFINITY];
    for edge in edges.windows(2) {
        let within = |j: &&Judgement| {
            j.case
                .truth
                .snr
                .is_some_and(|snr| (edge[0]..edge[1]).contains(&snr))
        };
        let of: Vec<&Judgement> = judgements
            .iter()
            .filter(|j| !j.is_complete())
            .filter(within)
            .collect();
        let top = of.iter().filter(|j| j.is_top()).count();
        let set = of.iter().filter(|j| j.is_in_set()).count();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {top} | {set} |",
            edge[0],
            edge[1],
            of.len()
        );
    }
    text
}

/// Mean and spread of the values' errors, in their own standard deviations: 0 and 1 if the errors hold.
fn bias(judgements: &[Judgement]) -> String {
    let mut text = String::from(
        "\n## Values\n\nErrors of detectable values in their own standard deviations: by the noise of the torque, and by effect. \
         Unbiased: the median is 0; right: the median of the absolute is 0.67.\n\n\
         | of | values | median | median of the absolute | within 2 |\n|---|---|---|---|---|\n",
    );
    let known = |j: &&Judgement| j.is_detectable() && j.deviation().is_some();
    let mut row = |name: String, of: &[&Judgement]| {
        let mut z: Vec<f64> = of
            .iter()
            .copied()
            .filter(known)
            .filter_map(Judgement::deviation)
            .collect();
        if z.is_empty() {
            return;
        }
        let (middle, within) = (median(&mut z), z.iter().filter(|z| z.abs() <= 2.0).count());
        let mut size: Vec<f64> = z.iter().map(|z| z.abs()).collect();
        let _ = writeln!(
            text,
            "| {name} | {} | {middle:+.2} | {:.2} | {within} |",
            z.len(),
            median(&mut size)
        );
    };
    for ((noise, colour), of) in by(judgements, level) {
        row(format!("{} N m {colour}", noise as f64 * 1e-3), &of);
    }
    for (name, of) in by(judgements, |j| j.case.truth.effect.clone()) {
        row(name.unwrap_or_default(), &of);
    }
    text
}

fn median(x: &mut [f64]) -> f64 {
    x.sort_by(f64::total_cmp);
    let half = x.len() / 2;
    if x.len() % 2 == 1 {
        x[half]
    } else {
        0.5 * (x[half - 1] + x[half])
    }
}

fn wrong(judgements: &[Judgement]) -> String {
    let mut text = String::from(
        "\n## What is wrong\n\n| case | size/std | torque's noise, N m | memory, s | velocity's, rad/s | Hz | repeats | |\n|---|---|---|---|---|---|---|---|\n",
    );
    for judgement in judgements {
        let errors = judgement.errors();
        if errors.is_empty() {
            continue;
        }
        let truth = &judgement.case.truth;
        let snr = truth
            .snr
            .map_or_else(String::new, |snr| format!("{snr:.1}"));
        let _ = writeln!(
            text,
            "| {} | {snr} | {} | {} | {} | {} | {} | {} |",
            truth.name,
            truth.torque_noise,
            truth.torque_memory,
            truth.velocity_noise,
            truth.rate,
            truth.repeats,
            errors.join("; "),
        );
    }
    text
}
