//! A fit of a model for humans.

use std::fmt::{self, Write};

use proprio_core::effect::EffectKind;

use super::result::{Fitted, FittedJoint, FittedParameter, Where};
use crate::catalogue;
use crate::estimate::stages::Stage;
use crate::estimate::{LEGEND, Status, effect_table};
use crate::identifiability::NullDirection;
use crate::identify::runs::{Consistency, Run};
use crate::parameter::told;
use crate::table::{Table, with_std};

/// Most disagreements that are listed.
const MOST_LISTED: usize = 12;

/// The effects of every joint with their errors, and how much of the torque they explain.
impl fmt::Display for Fitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rms =
            |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
        let errors = |joint: &FittedJoint| {
            let known = |rms| (joint.windows > 0).then_some(rms);
            let errors = [
                known(joint.rms),
                joint.held_out_rms,
                known(joint.yardsticks.cad_rms),
            ];
            (joint.joint.clone(), errors.map(rms))
        };
        let all = [
            Some(self.rms),
            self.held_out_rms,
            Some(self.yardsticks.cad_rms),
        ]
        .map(rms);
        let rows = self.joints.iter().map(errors);
        let rows: Vec<_> = rows.chain([("all".to_owned(), all)]).collect();
        let headings = [["rms", "N m"], ["held-out", "N m"], ["CAD's", "N m"]];
        let estimate = |name: &str| self.parameter(name);
        write!(f, "{}", effect_table(estimate, headings, &rows))?;
        others(
            f,
            &self.parameters,
            rows.iter().map(|(joint, _)| joint.as_str()),
        )?;
        let inertial = || self.parameters.iter().filter(|p| p.estimate.is_inertial());
        let identified = inertial()
            .filter(|p| p.estimate.status == Status::Identified)
            .count();
        writeln!(
            f,
            "\n± one standard deviation, the larger of what independent residuals and the spread over blocks of time give, and by how much\n\
             values differ between blocks of time or logs;\n{}\n{}\
             rms of the mean torque over windows, N m: of the fit, held out by blocks of time, and of the CAD's \
             rigid body.\n{identified} of {} inertial parameters are identified beyond the CAD; --json lists them.",
            LEGEND.split_once("; ").map_or(LEGEND, |(_, marks)| marks),
            between(&self.parameters),
            inertial().count(),
        )?;
        unphysical(f, &self.parameters)?;
        stages(f, &self.stages)?;
        runs(f, &self.runs, &self.consistency)
    }
}

/// The effects that are not of every drive at one of these `joints`, with what is known of them before any data.
fn others<'a>(
    f: &mut fmt::Formatter<'_>,
    parameters: &[FittedParameter],
    joints: impl Iterator<Item = &'a str>,
) -> fmt::Result {
    let joints: Vec<&str> = joints.collect();
    let plain = |p: &&FittedParameter| {
        let place = p.estimate.name.split_once(':');
        place.is_some_and(|(what, joint)| {
            let is_plain = EffectKind::PLAIN.iter().any(|effect| effect.name() == what);
            is_plain && joints.contains(&joint)
        })
    };
    let mut others = (parameters.iter())
        .filter(|p| !p.estimate.is_inertial() && !plain(p))
        .peekable();
    if others.peek().is_none() {
        return Ok(());
    }
    let mut table = Table::default();
    table.row(["parameter", "unit", "value", "prior"].map(str::to_owned));
    for FittedParameter { estimate, .. } in others {
        let [_, unit] = estimate.told();
        table.row([
            estimate.name.clone(),
            unit,
            estimate.cell(),
            told(estimate.prior, estimate.prior_std, estimate.unit)[0].clone(),
        ]);
    }
    write!(f, "\n{table}")
}

/// Names the values that cannot be, by two standard deviations: those of a fit without constraints.
pub(super) fn unphysical(f: &mut impl Write, parameters: &[FittedParameter]) -> fmt::Result {
    let mut effects: Vec<EffectKind> = Vec::new();
    for p in parameters {
        if let Where::Effect(effect, ..) = p.place
            && !effects.contains(&effect)
        {
            effects.push(effect);
        }
    }
    effects.sort_by_cached_key(|effect| catalogue::order(*effect));
    for effect in effects {
        let description = effect.description();
        let beyond = |p: &&FittedParameter| match p.place {
            Where::Effect(own, _, n) if own == effect => {
                let (estimate, bound) = (&p.estimate, &description.parameters[n]);
                let [least, most] = [-2.0, 2.0].map(|by| estimate.value + by * estimate.std);
                most < bound.lower || least > bound.upper
            }
            _ => false,
        };
        let names: Vec<&str> = (parameters.iter().filter(beyond))
            .map(|p| p.estimate.name.as_str())
            .collect();
        if !names.is_empty() {
            writeln!(
                f,
                "Unphysical: {}. The model lacks an effect that looks like it ({}).",
                names.join(", "),
                description.look_alikes.join(", ")
            )?;
        }
    }
    Ok(())
}

fn stages(f: &mut fmt::Formatter<'_>, stages: &[Stage]) -> fmt::Result {
    if stages.is_empty() {
        return Ok(());
    }
    let names: Vec<&str> = stages.iter().map(|stage| stage.name).collect();
    let errors: Vec<String> = stages
        .iter()
        .map(|stage| format!("{:.4}", stage.rms))
        .collect();
    writeln!(
        f,
        "By stages ({}): rms {} N m.",
        names.join(", then "),
        errors.join(", ")
    )
}

/// Which parameters have other values at another time, beyond chance: a line, or none.
pub(super) fn between(parameters: &[FittedParameter]) -> String {
    let differs = |p: &&FittedParameter| p.std_between > 0.0;
    let mut differing: Vec<&FittedParameter> = parameters.iter().filter(differs).collect();
    // First the one that differs by most of what was not known before: of a value known to a thousandth, another is no more than that. One at its
    // bound says nothing.
    let share = |p: &FittedParameter| p.std_between / p.estimate.prior_std;
    let at_bound = |p: &FittedParameter| p.estimate.at_bound;
    differing.sort_by(|a, b| {
        let by_share = share(b).total_cmp(&share(a));
        at_bound(a).cmp(&at_bound(b)).then(by_share)
    });
    let Some(most) = differing.first() else {
        return String::new();
    };
    format!(
        "{} of {} parameters have other values in other stretches of time than noise explains, {} the most ({}): the model\n\
         lacks something there, and another log may give other values.\n",
        differing.len(),
        parameters.len(),
        most.estimate.name,
        with_std(most.estimate.value, most.std_between),
    )
}

fn runs(f: &mut fmt::Formatter<'_>, runs: &[Run], consistency: &[Consistency]) -> fmt::Result {
    if runs.is_empty() {
        return Ok(());
    }
    let mut table = Table::default();
    table.row(
        [
            "run",
            "rms",
            "held-out",
            "°C",
            "speed",
            "torque",
            "disagrees on",
        ]
        .map(str::to_owned),
    );
    table.row(["", "N m", "N m", "mean", "rad/s", "N m", ""].map(str::to_owned));
    let some =
        |x: Option<f64>, decimals: usize| x.map_or("–".to_owned(), |x| format!("{x:.decimals$}"));
    for run in runs {
        table.row([
            name(run),
            format!("{:.4}", run.rms),
            some(run.held_out_rms, 4),
            some(run.temperature, 0),
            format!("{:.2}", run.speed),
            format!("{:.2}", run.torque),
            run.disagreements.to_string(),
        ]);
    }
    write!(f, "\n{table}")?;
    let beyond: Vec<&Consistency> = consistency.iter().filter(|c| !c.consistent).collect();
    if beyond.is_empty() {
        return writeln!(
            f,
            "The runs agree on all {} parameters that two or more of them identify.",
            consistency.len()
        );
    }
    writeln!(
        f,
        "The runs disagree beyond chance on {} of {} parameters that two or more of them identify; the worst, by standard \
         deviations of the difference:",
        beyond.len(),
        consistency.len(),
    )?;
    let mut table = Table::default();
    for c in beyond.iter().take(MOST_LISTED) {
        let values: Vec<String> = c
            .runs
            .iter()
            .map(|run| with_std(run.value, run.std))
            .collect();
        let differs = runs.get(c.differs).map_or_else(String::new, name);
        table.row([
            c.parameter.clone(),
            format!("{:.1}", c.sigma),
            differs,
            values.join(" | "),
            c.unit.to_owned(),
        ]);
    }
    write!(f, "{table}")
}

fn name(run: &Run) -> String {
    run.log
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

impl Fitted {
    /// How many of the identifiable combinations of parameters these logs identify.
    pub fn base_words(&self) -> String {
        let of = |status| {
            self.base_parameters
                .iter()
                .filter(move |base| base.status == status)
        };
        let [identified, prior, unexcited] =
            [Status::Identified, Status::Prior, Status::Unexcited].map(|status| of(status).count());
        let alone = |d: &&NullDirection| d.structural && d.terms.len() == 1;
        let never = self.null_directions.iter().filter(alone).count();
        format!(
            "Base parameters: {identified} of {} identified, {prior} prior-dominated, {unexcited} unexcited. {never} parameters \
             are never identifiable on this base.",
            self.base_parameters.len()
        )
    }

    /// What motion can tell and what these logs do not, for humans.
    pub fn identifiability(&self) -> String {
        let mut text = String::new();
        let mut table = Table::default();
        table.row(["base parameter", "value", "unit", "status"].map(str::to_owned));
        for base in &self.base_parameters {
            let status = format!("{:?}", base.status).to_lowercase();
            table.row([
                base.expression(),
                with_std(base.value, base.std),
                base.unit.to_owned(),
                status,
            ]);
        }
        // Writing into a String cannot fail.
        let _ = write!(
            text,
            "\nIdentifiable combinations, and what these logs identify of them:\n{table}"
        );
        for (structural, heading) in [
            (true, "Not identifiable on this base:"),
            (false, "Not identified by these logs:"),
        ] {
            let directions = self
                .null_directions
                .iter()
                .filter(|d| d.structural == structural);
            let (alone, together): (Vec<_>, Vec<_>) = directions.partition(|d| d.terms.len() == 1);
            if alone.is_empty() && together.is_empty() {
                continue;
            }
            let _ = writeln!(text, "\n{heading}");
            together
                .iter()
                .for_each(|d| text += &format!("  {}\n", d.words));
            if !alone.is_empty() {
                let names: Vec<&str> = alone
                    .iter()
                    .map(|d| d.terms[0].parameter.as_str())
                    .collect();
                let _ = writeln!(text, "  not at all: {}", names.join(", "));
            }
        }
        text
    }
}
