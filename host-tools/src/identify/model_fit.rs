//! A model's effects and bodies, fitted to a recording.

mod result;
mod summary;
mod text;

use proprio_core::effect::{Form, Moved, Prior};
use proprio_core::inertia::UNITS;

use crate::detect::twist::told_by_encoders;
use crate::detect::{bodies, ladder};
use crate::equation::values::{Place, Values, is_shared, places};
use crate::equation::velocity::VelocityGain;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot;
use crate::estimate::stages::{self, Stage, StageParameter};
use crate::estimate::{Constraint, Method, ParameterEstimate, Status};
use crate::log::LEAST_DURATION;
use crate::model::{Model, ModelEffect};
use crate::parallel::side_by_side;
use crate::recording::{Recording, RecordingError};
pub use result::{Fitted, FittedJoint, FittedParameter, Where};

/// Residuals of a file whose numbers have twelve digits differ by less, as a share of the torque.
const ROUNDING: f64 = 1e-9;

/// How a model is fitted.
#[derive(Debug, Clone, Copy, Default)]
pub struct FitOptions {
    /// Whether values may be unphysical.
    pub constraint: Constraint,
    /// By which equation.
    pub method: Method,
    /// Friction first, then inertia: see [`Stage`].
    pub stages: bool,
    /// Whether samples are rounded to what the motor bus carries, as a device receives them.
    pub bus: bool,
}

impl FitOptions {
    /// A fit whose values a model file may have: physical ones.
    pub const PHYSICAL: Self = Self {
        constraint: Constraint::Physical,
        method: Method::Momentum,
        stages: false,
        bus: false,
    };
}

/// Fits `model`, whose values are not looked at but whose priors are, to a recording; of two effects that are one torque, one.
///
/// # Errors
/// [`RecordingError::TooShort`] if no limb has enough samples, [`RecordingError::AtRest`] if no joint moves.
pub fn fit_model(
    recording: &Recording,
    model: &Model,
    options: FitOptions,
) -> Result<Fitted, RecordingError> {
    let given = model;
    let mut once = given.clone();
    let repeated = once.take_out_repeated();
    let model = &once;
    let data = robot::data(recording, model);
    if data.is_empty() {
        return Err(RecordingError::too_short(recording, LEAST_DURATION));
    }
    if data
        .iter()
        .all(|limb| limb.windows().iter().all(|n| *n == 0.0))
    {
        return Err(RecordingError::at_rest(recording));
    }
    let how = How {
        constraint: options.constraint,
        method: options.method,
        ..How::default()
    };
    let places: Vec<Vec<Place>> = data.iter().map(places_of).collect();
    let (mut fits, shared) = bodies::fit(&data, &places, &how);
    if fits.is_empty() {
        return Err(RecordingError::too_short(recording, LEAST_DURATION));
    }
    let stages = if options.stages {
        go_through_stages(&mut fits)
    } else {
        Vec::new()
    };
    let parameters = fits.iter().flat_map(parameters).collect();
    // Of the file as it is given, a torque that it has twice too.
    let ladder = match options.method {
        Method::Momentum => side_by_side(&fits, |fit| ladder::of(fit.data, given)).concat(),
        _ => Vec::new(),
    };
    let of = (recording, model);
    let mut fitted = Fitted::new(of, &fits, parameters, &shared, (&ladder, stages));
    fitted.warnings.extend(repeated);
    Ok(fitted)
}

/// A model file that predicts otherwise than the fit that it was written from.
#[derive(Debug, thiserror::Error)]
#[error(
    "the model as written leaves {written:.6} N m on these logs where the fit left {fitted:.6}: a fault of proprio"
)]
pub struct NotReproduced {
    written: f64,
    fitted: f64,
}

/// Whether a model file, read back, leaves of a recording what the fit has left.
///
/// # Errors
/// [`NotReproduced`] if the root mean squares of their residuals differ by more than what rounding in the file makes of them.
pub fn check_reproduced(
    recording: &Recording,
    written: &Model,
    fitted: &Fitted,
) -> Result<(), NotReproduced> {
    let data = robot::data(recording, written);
    let (mut sum, mut windows) = (0.0, 0.0);
    for limb in &data {
        let given = Values::given(written, limb.limb);
        sum += limb.squares(&limb.predicted(&given, &|_| true)).total();
        windows += limb.windows().iter().sum::<f64>();
    }
    let rms = (sum / f64::max(windows, 1.0)).sqrt();
    let rounding = ROUNDING * (1.0 + fitted.yardsticks.cad_rms);
    match (rms - fitted.rms).abs() <= rounding {
        true => Ok(()),
        false => Err(NotReproduced {
            written: rms,
            fitted: fitted.rms,
        }),
    }
}

/// The steps of all limbs, parameter by parameter.
fn go_through_stages(fits: &mut [LimbFit]) -> Vec<Stage> {
    let mut parameters: [Vec<StageParameter>; 3] = Default::default();
    let mut sums = [[0.0; 2]; 3];
    for fit in fits {
        let Some(stages) = fit.go_through_stages() else {
            continue;
        };
        for (n, solution) in stages.iter().enumerate() {
            let squares = fit.group_squares(&solution.theta, |_| true);
            sums[n][0] += squares.iter().sum::<f64>();
            sums[n][1] += fit.all.iter().map(|rows| rows.count()).sum::<f64>();
            for (k, entry) in fit.columns.entries.iter().enumerate() {
                if entry.effect.is_some() == (n == 0) {
                    parameters[n].push(StageParameter {
                        name: fit.data.name(entry),
                        value: fit
                            .data
                            .value(&fit.at, &fit.columns, k, solution.theta.as_slice()),
                    });
                }
            }
        }
    }
    let all = stages::NAMES.into_iter().zip(parameters).zip(sums);
    all.map(|((name, parameters), [square, rows])| Stage {
        name,
        rms: (square / f64::max(rows, 1.0)).sqrt(),
        parameters,
    })
    .collect()
}

/// The effects that a model has at a limb and that a fit gives values to.
pub(crate) fn places_of(data: &LimbData) -> Vec<Place> {
    let all = places(data.model, data.limb).map(|(place, _)| place);
    all.filter(|place| data.can_tell(*place) || data.is_given(*place))
        .collect()
}

/// All parameters of a limb: its bodies', its effects' by column, then what is known without a column.
pub(crate) fn parameters(fit: &LimbFit) -> Vec<FittedParameter> {
    let deviations = fit.deviations();
    // What was stated, of a body that was released too.
    let mut stated = fit.problem.without_data();
    stated.bodies = fit.data.bodies_stated();
    let prior = stated.solve();
    let prior_std = prior.as_ref().map(crate::estimate::bounded::Solution::std);
    let there = fit.problem.prior_root(&fit.solution.theta);
    let entries = fit.columns.entries.iter().enumerate();
    let mut all: Vec<FittedParameter> = entries
        .filter(|(_, entry)| !is_shared(entry.joint))
        .map(|(k, entry)| {
            let [independent, _] = deviations.of_parameter(k);
            let prior_std = prior_std.as_ref().map_or(f64::INFINITY, |std| std[k]);
            let (std, std_between) = (fit.std(k), fit.spread().of_parameter(k));
            let body = fit.data.body_of(entry.joint);
            let estimate = ParameterEstimate {
                name: fit.data.name(entry),
                unit: entry.effect.map_or(UNITS[entry.parameter], |effect| {
                    fit.data.model.unit(effect, body, entry.parameter)
                }),
                value: fit.value(k),
                std,
                prior: fit.prior_mean(k),
                prior_std,
                status: Status::there(std, prior_std, independent, there.row(k).norm()),
                at_bound: fit.solution.held[k] && !fit.is_found_by_trying(k),
            };
            FittedParameter {
                estimate: match entry.effect {
                    Some(effect) => estimate.unless_absent(effect, entry.parameter),
                    None => estimate.unless_at_bound(),
                },
                std_independent: independent,
                std_between,
                place: entry
                    .effect
                    .map_or(Where::Body(body, entry.parameter), |effect| {
                        Where::Effect(effect, body, entry.parameter)
                    }),
            }
        })
        .collect();
    all.extend(shapes(fit));
    all.extend(told_by_positions(fit));
    all
}

/// The shapes that were scanned.
fn shapes(fit: &LimbFit) -> Vec<FittedParameter> {
    let shaped = fit.values.places().filter(|place| !is_shared(place.1));
    let numbers = |place: Place| place.0.description().shapes().map(move |n| (place, n));
    let of = |(place, n): (Place, usize)| {
        let (mean, prior) = fit.data.prior(place, n);
        let body = fit.data.body_of(place.1);
        let std = fit.known_shape(place, n);
        let mut shape = FittedParameter::of_effect(
            fit.data.model,
            (place.0, body, n),
            (fit.values.get(place, n), std),
            Prior { mean, std: prior },
        );
        shape.place = Where::Shape(place.0, body, n);
        shape
    };
    shaped.flat_map(numbers).map(of).collect()
}

/// What positions tell and no column: velocity gains, and gears with an encoder on either side.
fn told_by_positions(fit: &LimbFit) -> Vec<FittedParameter> {
    let data = fit.data;
    let of = |(place, effect): (Place, &ModelEffect)| -> Vec<FittedParameter> {
        let body = data.body_of(place.1);
        let measured: Option<Vec<[f64; 2]>> = match place.0.description().form {
            Form::Motion(_) if data.can_tell(place) => return Vec::new(),
            Form::Motion(Moved::Velocity) => {
                VelocityGain::of(data.recording, place.1, &data.blocks)
                    .map(|gain| vec![[gain.value, gain.std]])
            }
            Form::Motion(Moved::Link(_)) => told_by_encoders(data, &fit.values, place),
            _ => return Vec::new(),
        };
        let parameters = place.0.description().parameters.iter().enumerate();
        let told = parameters.map(|(n, _)| {
            let (mean, std) = data.prior(place, n);
            let given = effect.estimates[n].filter(|_| data.is_given(place));
            let given = given.map(|e| [e.value, e.std.unwrap_or(std)]);
            let [value, deviation] = measured
                .as_ref()
                .map(|values| values[n])
                .or(given)
                .unwrap_or([mean, std]);
            let prior = Prior { mean, std };
            FittedParameter::of_effect(data.model, (place.0, body, n), (value, deviation), prior)
        });
        told.collect()
    };
    places(data.model, data.limb).flat_map(of).collect()
}
