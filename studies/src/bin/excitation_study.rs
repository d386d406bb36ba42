//! What designed motions tell: `cargo run --release -p proprio-studies --bin excitation_study [STUDY]… [--write]`.
//!
//! Each study prints its part of `studies/excitation.md`; `--write` replaces it there.

use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use proprio_studies::excitation::{
    Failure, Stopwatch, arms, condition, errors, feedback, separation, table,
};

/// What designed motions tell, measured
#[derive(Debug, Parser)]
struct Arguments {
    /// Which studies [default: all]
    studies: Vec<Study>,
    /// Simulated robots of the error and validation studies
    #[arg(long, default_value_t = 40)]
    robots: usize,
    /// Simulated robots of each set for each truth of the look-alikes
    #[arg(long, default_value_t = 20)]
    each: usize,
    /// Numbers of the first robots of these sets
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 3000])]
    first_robots: Vec<u64>,
    /// Only pairs with this effect
    #[arg(long, value_name = "EFFECT", conflicts_with = "write")]
    pairs_of: Option<String>,
    /// Random motions
    #[arg(long, default_value_t = 10_000)]
    random: usize,
    /// Replace the parts of the committed table
    #[arg(long)]
    write: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Study {
    /// One leg's condition number beside random motions' and recorded chirps', and its curve over time
    Condition,
    /// Four legs at once: time and condition numbers
    Legs,
    /// Errors of the base parameters beside chirps' and random motions'
    Errors,
    /// Look-alikes told apart
    Separation,
    /// Feedback torque on simulated robots
    Feedback,
    /// Feedback torque on recorded chirps
    Chirps,
    /// Arms as others design motions for them
    Arms,
    /// How fast a motion is followed on the simulator
    Speed,
}

impl Study {
    fn heading(self) -> &'static str {
        match self {
            Self::Condition => "One leg",
            Self::Legs => "Four legs",
            Self::Errors => "Errors of the base parameters",
            Self::Separation => "Look-alikes told apart",
            Self::Feedback => "Feedback torque, simulated",
            Self::Chirps => "Feedback torque, recorded",
            Self::Arms => "Arms of seven joints",
            Self::Speed => "A motion followed on the simulator",
        }
    }

    fn run(self, asked: &Arguments) -> Result<String, Failure> {
        match self {
            Self::Condition => condition::one_leg(asked.random),
            Self::Legs => condition::four_legs(),
            Self::Errors => errors::study(asked.robots),
            Self::Separation => separation::study(&separation::Asked {
                robots: asked.each,
                first_robots: asked.first_robots.clone(),
                pairs_of: asked.pairs_of.clone(),
            }),
            Self::Feedback => feedback::simulated(asked.robots),
            Self::Chirps => feedback::chirps(),
            Self::Arms => arms::study(),
            Self::Speed => feedback::speed(),
        }
    }
}

fn main() -> ExitCode {
    let asked = Arguments::parse();
    let studies = match asked.studies.is_empty() {
        true => Study::value_variants(),
        false => &asked.studies[..],
    };
    for study in studies {
        if let Err(error) = one(*study, &asked) {
            eprintln!("excitation_study: {}: {error}", study.heading());
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn one(study: Study, asked: &Arguments) -> Result<(), Failure> {
    let clock = Stopwatch::start();
    let text = study.run(asked)?;
    println!("## {}\n\n{}", study.heading(), text.trim());
    eprintln!(
        "{}: {:.0} s, {:.0} s of processor time",
        study.heading(),
        clock.wall(),
        clock.processor()
    );
    if asked.write {
        table::write(study.heading(), &text)?;
    }
    Ok(())
}
