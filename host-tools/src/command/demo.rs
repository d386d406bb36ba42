//! `proprio demo`: the tour. A simulated leg hides an effect; compare, diagnose, add, compare.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::catalogue;
use crate::compare::ValuesFrom;
use crate::compare::{Comparison, compare};
use crate::diagnose::Verdict;
use crate::diagnose::diagnose;
use crate::model::Model;
use crate::output::{self, WriteError};
use crate::recording::Recording;
use crate::report::pages;
use crate::summary::{ErrorRange, Summary, torque};
use crate::table::{Table, with_std};
use clap::Args;
use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use proprio_simulator::hidden::typical;
use proprio_simulator::{HiddenEffect, Hide, Simulation, TrueValue};
use serde::Serialize;

use super::result::judged;
use super::simulate::record_with_truth;
use super::{Error, unreadable};

/// Find a hidden effect in a simulated log: the tour
///
/// Simulates a leg whose bodies are off the CAD and which hides an effect from its model. Compares model and log, diagnoses what
/// is missing, adds it, compares again, and prints each command on the way. Log, model, and a report with plots stay in a
/// directory to go on with. Takes seconds.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio demo
  proprio demo --seed 7 -o /tmp/tour
  proprio demo --json")]
pub(crate) struct Demo {
    /// Where log, model and report go
    #[arg(short, long, value_name = "DIR", default_value = "proprio-demo")]
    output: PathBuf,
    /// Where the report goes [default: report.html in DIR]
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Seed of the motion, of the bodies and of the noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What is hidden: a cable that pulls the thigh back, N m/rad.
const HIDDEN: (EffectKind, &str, f64) = (EffectKind::Spring, "FR_thigh", 4.0);

/// How far the bodies are off the CAD.
const INERTIA_ERROR: f64 = 0.06;

/// An error this close to the noise floor is down to it.
const DOWN_TO_NOISE: f64 = 1.1;

/// First line of the file that says that a directory is a demo's.
const TOUR: &str = "# Made by `proprio demo`, which may overwrite the files named here.\n";

/// The files of a demo.
#[derive(Debug, Clone, Serialize)]
struct Files {
    log: PathBuf,
    truth: PathBuf,
    model: PathBuf,
    report: PathBuf,
    tour: PathBuf,
}

impl Files {
    /// In `folder`, which is made; what is there already stays unless a demo made it.
    fn prepare(folder: &Path) -> Result<Self, Error> {
        let inside = |name: &str| folder.join(name);
        let files = Self {
            log: inside("log.csv"),
            truth: inside("log.truth.json"),
            model: inside("model.toml"),
            report: inside("report.html"),
            tour: inside("tour.txt"),
        };
        let unwritable = |source| WriteError {
            path: folder.to_owned(),
            source,
        };
        std::fs::create_dir_all(folder).map_err(unwritable)?;
        let empty = folder.read_dir().map_err(unwritable)?.next().is_none();
        let ours = std::fs::read_to_string(&files.tour).is_ok_and(|text| text.starts_with(TOUR));
        if empty || ours {
            Ok(files)
        } else {
            Err(Error::NotADemo(folder.to_owned()))
        }
    }
}

/// What the demo found.
#[derive(Debug, Serialize)]
struct Report {
    /// The hidden effect and its true value.
    hidden: TrueValue,
    /// What the diagnosis names first, `spring:FR_thigh`; none if it finds nothing.
    found: Option<String>,
    value: Option<f64>,
    std: Option<f64>,
    #[serde(skip)]
    before_rms: f64,
    #[serde(skip)]
    after_rms: f64,
    #[serde(skip)]
    noise_floor_rms: Option<f64>,
    /// Whether what is found is what was hidden, and the error is down to the noise.
    passed: bool,
    files: Files,
    #[serde(skip)]
    tour: Tour,
}

impl Report {
    fn error(&self) -> ErrorRange {
        ErrorRange::torque(self.before_rms, self.after_rms, self.noise_floor_rms)
    }
}

/// What there is to tell.
#[derive(Debug)]
struct Tour {
    seed: u64,
    before: Comparison,
    summary: Summary,
    after: Comparison,
}

impl Demo {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut files = Files::prepare(&self.output)?;
        if let Some(path) = self.html {
            files.report = path;
        }
        // First, so that what an interrupted demo leaves is known to be a demo's.
        output::write(&files.tour, TOUR)?;
        let report = tour(files, self.seed)?;
        output::write(&report.files.tour, &format!("{TOUR}\n{report}"))?;
        Ok(match self.json {
            true => judged("demo", report.error(), &report),
            false => report.screen(),
        })
    }
}

/// Simulates, compares, diagnoses, adds, compares.
fn tour(files: Files, seed: u64) -> Result<Report, Error> {
    let hidden = hidden();
    let leg = Leg::FR;
    let simulation = Simulation {
        effects: typical(&[leg])
            .into_iter()
            .chain([hidden.clone()])
            .collect(),
        inertia_error: INERTIA_ERROR,
        seed,
        ..Simulation::new(&[leg])
    };
    record_with_truth(&simulation, &files.log, Some(&files.truth))?;

    let mut model = Model::default();
    let joints = 0..model.robot().bodies().len();
    let known: Vec<_> = EffectKind::PLAIN
        .iter()
        .flat_map(|&effect| joints.clone().map(move |joint| (effect, joint)))
        .collect();
    model.add_last(&known);
    let recording = Recording::read(std::slice::from_ref(&files.log), &model, |_, _| ())?;
    let before = compare(&recording, &model, ValuesFrom::Auto)?;
    let mut diagnosis = diagnose(&recording, &model)?;
    let path = files.model.display().to_string();
    diagnosis.next = diagnosis.next.replace("MODEL", &path);

    let mut complete = model.clone();
    diagnosis.apply(&mut complete);
    let page = compare(&recording, &complete, ValuesFrom::Fitted)?;
    let report = pages::DiagnosisPage {
        diagnosis: &diagnosis,
        after: &page,
        recording: &recording,
        given: &model,
        complete: &complete,
        model: Some(&files.model),
        written: false,
    };
    report.page().map_err(unreadable)?.write(&files.report)?;
    let summary = diagnosis.summary(model.robot(), Some(&files.model));

    let best = diagnosis.candidates.first();
    let best = best.filter(|_| diagnosis.verdict == Verdict::Missing);
    for joint in best.into_iter().flat_map(|best| &best.joints) {
        if let Some(effect) = best.and_then(|best| catalogue::effect_named(best.effect)) {
            let places = model.robot().place(effect, Some(joint))?;
            model.add_last(&places.iter().map(|&p| (effect, p)).collect::<Vec<_>>());
        }
    }
    model.save(&files.model)?;
    let after = compare(&recording, &model, ValuesFrom::Auto)?;
    let found = best.map(|best| best.name());
    let down = after
        .yardsticks
        .noise_floor_rms
        .is_some_and(|floor| after.rms <= DOWN_TO_NOISE * floor);
    Ok(Report {
        passed: down && found.as_ref() == Some(&hidden.place()),
        value: best.map(|best| best.value),
        std: best.map(|best| best.std),
        found,
        before_rms: before.rms,
        after_rms: after.rms,
        noise_floor_rms: after.yardsticks.noise_floor_rms,
        hidden: TrueValue {
            name: hidden.place(),
            unit: HIDDEN.0.description().parameters[0].unit,
            value: HIDDEN.2,
        },
        files,
        tour: Tour {
            seed,
            before,
            summary,
            after,
        },
    })
}

/// The hidden effect as the simulator has it.
fn hidden() -> HiddenEffect {
    let (effect, joint, value) = HIDDEN;
    let hide: Hide = format!("{}:{joint}={value}", effect.name())
        .parse()
        .expect("the constant names an effect, a joint and a value");
    let effects = hide.on(&[Leg::FR]).expect("the joint is of this leg");
    effects.into_iter().next().expect("a joint is one place")
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (log, model) = (self.files.log.display(), self.files.model.display());
        let Tour {
            seed,
            before,
            summary,
            after,
        } = &self.tour;
        let hide = format!("{}={}", self.hidden.name, self.hidden.value);
        writeln!(
            f,
            "1. A leg with typical friction moves for 20 s. Its bodies are off the CAD, and it hides an effect.\n\n\
             $ proprio simulate --legs FR --typical --inertia-error {INERTIA_ERROR} --hide {hide} --seed {seed} -o {log}\n"
        )?;
        let known = EffectKind::PLAIN.map(EffectKind::name).join(" ");
        writeln!(
            f,
            "2. The model: the CAD, and what every motor has. How wrong is it, and where?\n\n\
             $ proprio add {known} -m {model}\n$ proprio compare {log} -m {model}\n"
        )?;
        write_comparison(f, before)?;
        writeln!(
            f,
            "\n3. What is missing?\n\n$ proprio diagnose {log} -m {model} --html {}\n\n{summary}",
            self.files.report.display()
        )?;
        let Some(found) = &self.found else {
            return writeln!(f, "\nThe hidden effect, {hide}, was not found.");
        };
        writeln!(
            f,
            "\n4. Add it and look again.\n\n$ proprio add {found} -m {model}\n$ proprio compare {log} -m {model}\n"
        )?;
        write_comparison(f, after)?;
        self.write_end(f)
    }
}

impl Report {
    /// The tour in short: the file that `tour` names has each command and what it printed.
    fn screen(&self) -> String {
        let Tour {
            before, summary, ..
        } = &self.tour;
        let where_ = before.patterns.first().map(|p| p.sentence.clone());
        let mut end = String::new();
        // Writing into a String cannot fail.
        let _ = self.write_end(&mut end);
        let hidden = format!("{} of {}", self.hidden.name, self.hidden.value);
        let points = vec![
            format!(
                "simulate, add, compare: the CAD with friction, rotor and offset leaves {} N m; {}",
                torque(self.before_rms),
                where_.unwrap_or_default()
            ),
            format!("diagnose: {}", summary.headline),
            format!("add, compare: {end}"),
        ];
        let model = crate::summary::word(&self.files.model);
        let tour = self.files.tour.display();
        let screen = Summary {
            headline: format!(
                "A simulated leg hides {hidden} {} from its model.",
                self.hidden.unit
            ),
            points,
            next: vec![format!("proprio show {model}")],
            ..Summary::default()
        };
        screen.screen(&[], &format!("{tour} (each command and what it prints)"))
    }

    /// Whether it is the one, and how near the error came to the noise.
    fn write_end(&self, f: &mut impl fmt::Write) -> fmt::Result {
        let TrueValue { name, unit, value } = &self.hidden;
        let found = self.found.as_deref().unwrap_or("nothing");
        let size = match (self.value, self.std) {
            (Some(value), Some(std)) => format!(" of {} {unit}", with_std(value, std)),
            _ => String::new(),
        };
        if found == name {
            writeln!(
                f,
                "\n✓ Hidden was {name} of {value} {unit}; found was {found}{size}."
            )?;
        } else {
            writeln!(
                f,
                "\n✗ Hidden was {name} of {value} {unit}; found was {found}."
            )?;
        }
        write!(
            f,
            "{} The error fell from {:.4} to {:.4} N m",
            if self.passed { "✓" } else { "✗" },
            self.before_rms,
            self.after_rms
        )?;
        if let Some(floor) = self.noise_floor_rms.map(|floor| floor.min(self.after_rms)) {
            let beyond = 100.0 * (self.after_rms / floor - 1.0);
            write!(f, ", {beyond:.0} % above the noise floor of {floor:.4}")?;
        }
        writeln!(
            f,
            ".\n\nThe plots are in {}; the truth is in {}.",
            self.files.report.display(),
            self.files.truth.display()
        )
    }
}

/// Each joint's error, the headline, and the worst pattern.
fn write_comparison(f: &mut fmt::Formatter<'_>, comparison: &Comparison) -> fmt::Result {
    let mut table = Table::default();
    let heads = ["joint", "rms N m", "fit %", "noise floor N m"];
    table.row(heads.map(str::to_owned));
    for joint in &comparison.joints {
        let number =
            |x: Option<f64>, digits: usize| x.map_or("-".to_owned(), |x| format!("{x:.digits$}"));
        table.row([
            joint.joint.clone(),
            format!("{:.4}", joint.scores.rms),
            number(joint.scores.fit_percent, 1),
            number(joint.yardsticks.floor_beside(joint.scores.rms), 4),
        ]);
    }
    writeln!(f, "{table}\n{}.", comparison.headline())?;
    match comparison.patterns.first() {
        Some(worst) => writeln!(
            f,
            "{:.0} % of the square error: {}.",
            worst.share_percent, worst.sentence
        ),
        None => writeln!(f, "The residual has no structure above the noise."),
    }
}
