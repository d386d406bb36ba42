//! What `proprio identify --free-base` does: a walking robot's parameters, for machines and for humans; its first screen is in `summary`.

mod summary;

use std::fmt;
use std::path::PathBuf;

use nalgebra::{DMatrix, DVector, Matrix4};
use proprio_core::inertia::INERTIAL;
use serde::Serialize;

use super::NotAModel;
use super::bodies::{OtherBody, other_bodies};
use super::to_model::set_joint;
use crate::catalogue;
use crate::detect::ladder::Yardsticks;
use crate::estimate::{self, Constraint, LEGEND, ParameterEstimate, Status, find};
use crate::free_base::columns::EffectSite;
use crate::free_base::data::Data;
use crate::free_base::doubtful;
use crate::free_base::fit::{Deviations, Fit, rms};
use crate::free_base::legged::Legged;
use crate::free_base::rungs::rungs;
use crate::free_base::sensors::NAMES;
use crate::free_base::shapes;
use crate::free_base::structure::ModelStructure;
use crate::free_base::{FreeBaseError, StanceShares, UnseenFoot, Walks, Windows};
use crate::log::Samples;
use crate::model::{BASE, Impossible, Model, Provenance};
use crate::parameter::{self, INERTIAL_NAMES};
use crate::summary::ErrorRange;
use crate::table::{Table, with_std};

/// Identifies a robot from logs of it walking, taken together: the effects that its model names, or all four of a plain drive at every joint if it names
/// none. The model's priors count, its values do not. `progress` hears of logs read, and of how many in all.
///
/// # Errors
/// [`FreeBaseError`]; the first bad log stops the work.
pub fn identify_free_base(
    logs: &[PathBuf],
    model: &Model,
    constraint: Constraint,
    progress: impl FnMut(u64, u64),
) -> Result<FreeBaseIdentification, FreeBaseError> {
    let structure = ModelStructure::whole(model, constraint)?;
    let walks = Walks::read(logs, (model, &structure.robot), progress)?;
    let (data, structure) = Data::believed(&walks, structure, &[])?;
    let (data, structure) = shapes::settled((&walks, model), data, structure)?;
    FreeBaseIdentification::of(logs, (walks, model), &data, &structure)
        .ok_or(FreeBaseError::Unsolvable)
}

/// What follows from several parameters.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Quantity {
    /// `total_mass`, `trunk_mass`, `trunk_com_x`, …: of the trunk about the base's origin; `robot_com_x`, …: of the whole robot about it, a
    /// Go2 standing with its hips at 0, thighs at 0.8 and calves at −1.6 rad, another robot with its joints at zero or the stop nearest to it.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// By the CAD.
    pub prior: f64,
}

/// A whole robot's parameters from logs in which it moves freely.
#[derive(Debug, Clone, Serialize)]
pub struct FreeBaseIdentification {
    /// Masses and the trunk's centre of mass.
    pub quantities: Vec<Quantity>,
    /// Every parameter: the trunk's and the legs' bodies, effects, what sensors get wrong.
    pub parameters: Vec<ParameterEstimate>,
    /// Root mean square of the fit's residuals over the equations that contact forces leave: mean torque over a window, N m;
    /// equations of the base are scaled to the same noise.
    pub rms: f64,
    /// The same on stretches of time that the fit has not seen; none for short logs.
    pub held_out_rms: Option<f64>,
    /// What an error is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
    /// What became of the windows.
    pub windows: Windows,
    /// Why feet were projected out, log by log.
    pub stance: Vec<StanceShares>,
    /// Feet that carry a force in windows in which they are taken to be in the air.
    pub unseen_feet: Vec<UnseenFoot>,
    /// What became of the samples; one sample is all of the robot's.
    pub samples: Samples,
    /// Blocks of time that the errors come from.
    pub blocks: usize,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// The feet, in the order of what is said of them.
    #[serde(skip)]
    feet: Vec<String>,
    /// The joints.
    #[serde(skip)]
    joints: Vec<String>,
    /// The model's effects.
    #[serde(skip)]
    effects: Vec<EffectSite>,
}

impl FreeBaseIdentification {
    fn of(
        logs: &[PathBuf],
        (walks, model): (Walks, &Model),
        data: &Data,
        structure: &ModelStructure,
    ) -> Option<Self> {
        let fit = data.fit(structure)?;
        let rungs = rungs(data, model).ok()?;
        let deviations = data.deviations(&fit);
        let parameters = walk_parameters(data, &fit, &deviations);
        let other = walk_bodies(&walks, structure, &parameters, model);
        Some(Self {
            quantities: quantities(&fit, &deviations, &structure.robot),
            parameters,
            rms: data.rms(fit.theta()),
            held_out_rms: data.held_out(structure).map(|parts| rms(&parts)),
            yardsticks: Yardsticks::of_walk(rungs.each_ref().map(|theta| data.rms(theta))),
            windows: data.windows.clone(),
            stance: walks.stance(),
            unseen_feet: data.unseen.clone(),
            samples: walks.samples(),
            blocks: data.block_count(),
            logs: logs.to_vec(),
            warnings: [
                walks.warnings,
                data.warnings(),
                doubtful::sensors(data.columns(), fit.theta()),
                doubtful::robot(structure, fit.theta()),
                other.iter().map(ToString::to_string).collect(),
            ]
            .concat(),
            feet: structure
                .robot
                .feet
                .iter()
                .map(|foot| foot.name.clone())
                .collect(),
            joints: structure.robot.names.clone(),
            effects: structure.effects.clone(),
        })
    }

    /// The error of the file as given, and that of the fit on time it has not seen.
    pub fn error(&self) -> ErrorRange {
        self.yardsticks.error(self.held_out_rms)
    }

    /// The estimate of the parameter of that name, such as `m:base` or `coulomb:FR_hip`.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        find(&self.parameters, name)
    }

    /// The robot's `model` with the bodies and effects identified, its trunk too, their standard deviations, and `provenance`.
    ///
    /// # Errors
    /// [`NotAModel`] if a value is unphysical, as those of a fit without constraints may be.
    pub fn to_model(&self, model: &Model, provenance: Provenance) -> Result<Model, NotAModel> {
        let mut model = model.clone();
        let total = total_std(&self.quantities);
        set_walk((&self.parameters, total), &self.effects, &mut model)?;
        model.set_provenance(provenance);
        Ok(model)
    }

    /// The quantity of that name, such as `total_mass`.
    pub fn quantity(&self, name: &str) -> Option<&Quantity> {
        self.quantities
            .iter()
            .find(|quantity| quantity.name == name)
    }
}

/// Of the whole robot's centre of mass.
const ROBOT_COM: [&str; 3] = ["robot_com_x", "robot_com_y", "robot_com_z"];

/// Standard deviations of the whole robot's mass and centre of mass, as a model file keeps them.
pub(crate) fn total_std(quantities: &[Quantity]) -> Option<[f64; 4]> {
    let std = |name| Some(quantities.iter().find(|q| q.name == name)?.std);
    let [x, y, z] = ROBOT_COM.map(std);
    Some([std("total_mass")?, x?, y?, z?])
}

/// What follows from several parameters of a fit.
pub(crate) fn quantities(fit: &Fit, deviations: &Deviations, robot: &Legged) -> Vec<Quantity> {
    let theta = fit.theta();
    // Of bodies alone, which come first.
    let prior = fit.problem.start().resize_vertically(theta.len(), 0.0);
    let at = |entries: &[(usize, f64)]| {
        let mut combination = DVector::zeros(theta.len());
        entries.iter().for_each(|(k, x)| combination[*k] = *x);
        combination
    };
    let shares = robot.shares_of_total();
    let total = |row: usize| {
        let own = |(b, share): (usize, &Matrix4<f64>)| {
            let share = *share;
            (0..4).map(move |k| (INERTIAL * b + k, share[(row, k)]))
        };
        shares.iter().enumerate().flat_map(own).collect::<Vec<_>>()
    };
    let masses = total(0);
    let linear = |name, entries: &[(usize, f64)]| {
        let combination = at(entries);
        Quantity {
            name,
            unit: "kg",
            value: combination.dot(theta),
            std: deviations.of_combination(&combination),
            prior: combination.dot(&prior),
        }
    };
    let mut all = vec![
        linear("total_mass", &masses),
        linear("trunk_mass", &[(0, 1.0)]),
    ];
    let mut place = |name, mass: &DVector<f64>, moment: &DVector<f64>| {
        let com = |theta: &DVector<f64>| moment.dot(theta) / mass.dot(theta);
        // c = h/m: ∂c = (∂h − c ∂m)/m.
        let value = com(theta);
        let change = (moment - mass * value) / mass.dot(theta);
        all.push(Quantity {
            name,
            unit: "m",
            value,
            std: deviations.of_combination(&change),
            prior: com(&prior),
        });
    };
    for (axis, name) in ["trunk_com_x", "trunk_com_y", "trunk_com_z"]
        .into_iter()
        .enumerate()
    {
        place(name, &at(&[(0, 1.0)]), &at(&[(1 + axis, 1.0)]));
    }
    for (axis, name) in ROBOT_COM.into_iter().enumerate() {
        place(name, &at(&masses), &at(&total(1 + axis)));
    }
    all
}

/// Whether a parameter is of what sensors get wrong.
fn is_sensors(parameter: &ParameterEstimate) -> bool {
    NAMES.iter().any(|(name, _)| *name == parameter.name)
}

/// The bodies that `values` put beyond what is known of them, which are of a fit that the CAD's uncertainty alone holds. None where a trunk's motion
/// is unknown: the bodies take what it does to the legs.
pub(crate) fn walk_bodies(
    walks: &Walks,
    structure: &ModelStructure,
    values: &[ParameterEstimate],
    model: &Model,
) -> Vec<OtherBody> {
    if !walks.know_the_trunk() {
        return Vec::new();
    }
    other_bodies(without_loaded(structure, values).iter(), &[], model)
}

/// The values but for those of bodies that carry a load: that is told by itself.
pub(crate) fn without_loaded(
    structure: &ModelStructure,
    values: &[ParameterEstimate],
) -> Vec<ParameterEstimate> {
    let names = structure.robot.names.iter().map(String::as_str);
    let names = std::iter::once("base").chain(names);
    let loaded = names.zip(&structure.bodies).filter(|(_, body)| body.loaded);
    let of_loaded = |of: &str| {
        let names = INERTIAL_NAMES.iter();
        names
            .map(|(what, _)| parameter::name_at(what, of))
            .collect::<Vec<_>>()
    };
    let told: Vec<String> = loaded.flat_map(|(of, _)| of_loaded(of)).collect();
    let others = values.iter().filter(|value| !told.contains(&value.name));
    others.cloned().collect()
}

/// Sets each body and each effect of a `model` to what walks were found to say of them, in the order of bodies, and how well the sum of bodies is known.
pub(crate) fn set_walk(
    (found, total): (&[ParameterEstimate], Option<[f64; 4]>),
    effects: &[EffectSite],
    model: &mut Model,
) -> Result<(), NotAModel> {
    let joints = model.robot().bodies().iter();
    let joints: Vec<String> = joints.map(|body| body.name.clone()).collect();
    let joints = joints.iter().map(String::as_str).enumerate();
    for (body, of) in std::iter::once((BASE, "base")).chain(joints) {
        let named = |fault| NotAModel {
            of: of.to_owned(),
            fault,
        };
        set_joint(found, model, body, of).map_err(named)?;
        for site in effects.iter().filter(|site| site.place.1 == body) {
            set_effect(found, site, model, of).map_err(named)?;
        }
    }
    let whole = |fault| NotAModel {
        of: "the whole robot".to_owned(),
        fault,
    };
    total.map_or(Ok(()), |std| model.set_total_std(std).map_err(whole))
}

/// Sets what [`set_joint`] does not know of an effect: of a formula its first parameter, of all the others.
fn set_effect(
    found: &[ParameterEstimate],
    site: &EffectSite,
    model: &mut Model,
    of: &str,
) -> Result<(), Impossible> {
    let (effect, joint) = site.place;
    let first = usize::from(catalogue::formula_of(effect).is_none());
    for n in first..effect.description().parameters.len() {
        let found = find(found, &parameter::of_effect(effect, n, of));
        let (value, std) = match found {
            Some(own) => (own.value, Some(own.std)),
            None if effect.description().parameters[n].shape => (site.shape(n), None),
            None => continue,
        };
        model.set_parameter(effect, joint, n, value, std)?;
    }
    Ok(())
}

/// What is told of all parameters of a walk's fit: bodies, effects, what sensors get wrong.
pub(crate) fn walk_parameters(
    data: &Data,
    fit: &Fit,
    deviations: &Deviations,
) -> Vec<ParameterEstimate> {
    let norms = |root: DMatrix<f64>| DVector::from_fn(root.nrows(), |k, _| root.row(k).norm());
    let prior = fit.problem.start();
    // The prior as it looks from the CAD, and from the estimate: for what the motion shows.
    let prior_std = norms(fit.problem.prior_root(&prior));
    let prior_there = norms(fit.problem.prior_root(&fit.solution.theta));
    let of = |name: String, unit: &'static str, k: usize, neutral: f64| {
        let at = fit.active.binary_search(&k).ok()?;
        let [independent, blocks] = deviations.of_parameter(k);
        let std = independent.max(blocks);
        Some(ParameterEstimate {
            name,
            unit,
            value: fit.theta()[k] + neutral,
            std,
            prior: prior[at] + neutral,
            prior_std: prior_std[at],
            status: Status::there(std, prior_std[at], independent, prior_there[at]),
            at_bound: fit.is_held(k),
        })
    };
    let robot = &data.columns().robot;
    let (acc, fixed) = (data.columns().acc(), data.columns().fixed());
    let names = robot.names.iter().map(String::as_str);
    let bodies = std::iter::once("base").chain(names);
    let inertial = bodies.flat_map(|body| {
        let name = move |&(what, unit): &(&str, _)| (parameter::name_at(what, body), unit);
        INERTIAL_NAMES.iter().map(name)
    });
    let inertial = (0..acc).zip(inertial);
    let inertial = inertial.filter_map(|(k, (name, unit))| of(name, unit, k, 0.0));
    let inertial = inertial.map(ParameterEstimate::unless_at_bound);
    let columns = data.columns();
    let effects = columns.effects().filter_map(|(k, n, linear)| {
        let (effect, joint) = columns.sites[n].place;
        let name = parameter::of_effect(effect, linear.parameter, robot.names.get(joint)?);
        let unit = effect.description().parameters[linear.parameter].unit;
        let estimate = of(name, unit, k, linear.neutral)?;
        Some(estimate.unless_absent(effect, linear.parameter))
    });
    let sensors = (acc..fixed).zip(NAMES);
    let sensors = sensors.filter_map(|(k, (name, unit))| of(name.to_owned(), unit, k, 0.0));
    let sensors = sensors.map(|estimate| estimate.unless_nothing(0.0));
    inertial.chain(effects).chain(sensors).collect()
}

impl fmt::Display for FreeBaseIdentification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        table.row(["", "unit", "found", "CAD"].map(str::to_owned));
        for quantity in &self.quantities {
            let Quantity {
                name,
                unit,
                value,
                std,
                prior,
            } = quantity;
            let cells = [
                (*name).to_owned(),
                (*unit).to_owned(),
                with_std(*value, *std),
                format!("{prior:.4}"),
            ];
            table.row(cells);
        }
        let sensors = self.parameters.iter().filter(|p| is_sensors(p));
        for estimate in sensors {
            let cells = [
                estimate.name.clone(),
                estimate.unit.to_owned(),
                estimate.cell(),
                "0".to_owned(),
            ];
            table.row(cells);
        }
        writeln!(f, "{table}")?;
        let joints = self.joints.iter();
        let joints: Vec<_> = joints.map(|joint| (joint.clone(), [])).collect();
        let find = |name: &str| self.parameter(name);
        write!(f, "{}", estimate::effect_table(find, [], &joints))?;
        self.legend(f)?;
        self.time(f)
    }
}

impl FreeBaseIdentification {
    fn legend(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let inertial = || self.parameters[..INERTIAL * (self.joints.len() + 1)].iter();
        let identified = inertial()
            .filter(|p| p.status == Status::Identified)
            .count();
        let held_out = self
            .held_out_rms
            .map_or("–".to_owned(), |rms| format!("{rms:.4}"));
        writeln!(
            f,
            "\n± one standard deviation, the larger of what independent residuals and the spread over {} blocks of time give;\n{}\n\
             rms {:.4} N m, held-out {held_out}, of the CAD's rigid bodies {:.4}: mean torque over a window, in the equations that contact\n\
             forces leave. {identified} of {} inertial parameters are identified beyond the CAD; --json lists them.",
            self.blocks,
            LEGEND.split_once("; ").map_or(LEGEND, |(_, marks)| marks),
            self.rms,
            self.yardsticks.cad_rms,
            inertial().count(),
        )
    }

    /// Which rows were used and why.
    fn time(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Windows {
            used,
            by_feet,
            equations,
            resting,
            cut,
            impact,
            gap,
            still,
            outside,
            held,
            rejected,
        } = &self.windows;
        let feet: Vec<String> = by_feet
            .iter()
            .enumerate()
            .map(|(feet, windows)| format!("{windows} with {feet}"))
            .collect();
        writeln!(
            f,
            "\n{used} windows with {equations} equations: {} feet whose force is eliminated.\n\
             Excluded from them: {resting} equations of sticking joints.\n\
             Excluded: {cut} at touch-down or lift-off, {impact} at impacts, {gap} at gaps, {still} in which the robot stands still, {outside} \
             that no model explains;\n\
             {held} without the trunk's equations: the robot is supported by something else, or has no IMU.\n\
             Of {} samples {} repeat the one before, {} are late, {} impossible.",
            feet.join(", "),
            self.samples.total,
            self.samples.repeated,
            self.samples.late,
            self.samples.rejected + rejected,
        )?;
        for (log, stance) in self.logs.iter().zip(&self.stance) {
            let mut table = Table::default();
            let head = ["% of the time", "torque", "count", "height", "guard", "air"];
            table.row(head.map(str::to_owned));
            let shares = [
                &stance.torque,
                &stance.count,
                &stance.height,
                &stance.guard,
                &stance.air,
            ];
            for (n, foot) in self.feet.iter().enumerate() {
                let cells = shares.map(|share| format!("{:.0}", 100.0 * share[n]));
                table.row([foot.clone()].into_iter().chain(cells));
            }
            write!(
                f,
                "\n{}: evidence that a foot is in stance\n{table}",
                log.display()
            )?;
        }
        Ok(())
    }
}
