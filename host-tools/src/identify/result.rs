//! What an identification says, for machines and for humans.

use std::fmt;
use std::path::PathBuf;

use proprio_core::effect::EffectKind;
use proprio_core::go2::{JOINTS_PER_LEG, JointId};
use serde::Serialize;

use super::leg::{LegFit, Misfit};
use crate::estimate::{self, LEGEND, ParameterEstimate, Status};
use crate::log::Samples;
use crate::parameter;

/// The robot's parameters with what is known of their errors.
#[derive(Debug, Clone, Serialize)]
pub struct Identification {
    /// Every parameter of every leg in the logs.
    pub parameters: Vec<ParameterEstimate>,
    /// How well each joint's torque is explained.
    pub joints: Vec<JointFit>,
    /// Root mean square of the fit's residuals over all joints: mean torque over a window, N m.
    pub rms: f64,
    /// The same under the URDF's rigid body without any effect, N m.
    pub urdf_rms: f64,
    /// The same on blocks of time that the fit has not seen, N m; none for logs shorter than two blocks.
    pub held_out_rms: Option<f64>,
    /// Windows used, each of all joints of a leg.
    pub windows: u64,
    /// What became of the samples; one sample is one leg's.
    pub samples: Samples,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
}

/// How well a joint's torque is explained; N m, mean torque over a window.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct JointFit {
    /// Which joint.
    #[serde(serialize_with = "serialize_name")]
    pub joint: JointId,
    /// Root mean square of the fit's residuals.
    pub rms: f64,
    /// The same under the URDF's rigid body without any effect.
    pub urdf_rms: f64,
    /// The same on blocks of time that the fit has not seen.
    pub held_out_rms: Option<f64>,
}

fn serialize_name<S: serde::Serializer>(joint: &JointId, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(joint.name())
}

impl Identification {
    pub(super) fn new(logs: &[PathBuf], fits: &[LegFit], warnings: Vec<String>) -> Self {
        let total =
            fits.iter()
                .flat_map(|fit| &fit.joints)
                .fold(Misfit::default(), |sum, joint| Misfit {
                    fit: sum.fit + joint.fit,
                    urdf: sum.urdf + joint.urdf,
                    held_out: sum.held_out + joint.held_out,
                    held_out_windows: sum.held_out_windows + joint.held_out_windows,
                });
        let windows = fits.iter().map(|fit| fit.windows).sum();
        let rows = (JOINTS_PER_LEG as u64 * windows) as f64;
        Self {
            parameters: fits.iter().flat_map(|fit| fit.parameters.clone()).collect(),
            joints: fits.iter().flat_map(joints).collect(),
            rms: (total.fit / rows).sqrt(),
            urdf_rms: (total.urdf / rows).sqrt(),
            held_out_rms: total.held_out_rms(),
            windows,
            samples: fits
                .iter()
                .fold(Samples::default(), |sum, fit| sum.plus(&fit.samples)),
            logs: logs.to_vec(),
            warnings,
        }
    }

    /// The estimate of the parameter of that name, such as `coulomb:FR_hip`.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        estimate::find(&self.parameters, name)
    }
}

impl Misfit {
    fn held_out_rms(&self) -> Option<f64> {
        (self.held_out_windows > 0.0).then(|| (self.held_out / self.held_out_windows).sqrt())
    }
}

fn joints(fit: &LegFit) -> impl Iterator<Item = JointFit> {
    let windows = fit.windows as f64;
    JointId::of(fit.leg)
        .into_iter()
        .zip(&fit.joints)
        .map(move |(joint, misfit)| JointFit {
            joint,
            rms: (misfit.fit / windows).sqrt(),
            urdf_rms: (misfit.urdf / windows).sqrt(),
            held_out_rms: misfit.held_out_rms(),
        })
}

/// The effects of every joint with their errors, and how much of the torque they explain.
impl fmt::Display for Identification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rms =
            |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
        let errors = |joint: &JointFit| {
            let errors = [Some(joint.rms), joint.held_out_rms, Some(joint.urdf_rms)];
            (joint.joint, errors.map(rms))
        };
        let headings = [["rms", "N m"], ["held-out", "N m"], ["URDF's", "N m"]];
        let rows = self.joints.iter().map(errors);
        let mut table = estimate::effect_table(&self.parameters, headings, rows);
        let errors = [Some(self.rms), self.held_out_rms, Some(self.urdf_rms)].map(rms);
        let blank = [const { String::new() }; 4];
        table.row(["all".to_owned()].into_iter().chain(blank).chain(errors));
        write!(f, "{table}")?;
        self.legend(f)
    }
}

impl Identification {
    fn legend(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let inertial = self
            .parameters
            .iter()
            .filter(|parameter| parameter.is_inertial());
        let (all, identified) = inertial.fold((0, 0), |(all, identified), parameter| {
            (
                all + 1,
                identified + usize::from(parameter.status == Status::Identified),
            )
        });
        let windows = self.windows;
        let Samples {
            total,
            repeated,
            late,
            rejected,
            gaps,
        } = self.samples;
        writeln!(
            f,
            "
{LEGEND}
rms of the mean torque over {windows} windows: of the fit, on blocks it has not seen, and of the URDF's rigid body.
{identified} of {all} inertial parameters are identified beyond the CAD; --json lists them.
Of {total} samples, one per leg and row, {repeated} repeat the one before, {late} are late, {rejected} impossible; \
             {gaps} gaps."
        )?;
        EffectKind::ALL
            .iter()
            .try_for_each(|&effect| self.unphysical(f, effect))
    }

    /// Names the joints where an effect has a value that it cannot have.
    fn unphysical(&self, f: &mut fmt::Formatter<'_>, effect: EffectKind) -> fmt::Result {
        let description = effect.description();
        let (lower, upper) = (
            description.parameters[0].lower,
            description.parameters[0].upper,
        );
        let beyond =
            |e: &ParameterEstimate| e.value + 2.0 * e.std < lower || e.value - 2.0 * e.std > upper;
        let joints = self.joints.iter().map(|fit| fit.joint).filter(|&joint| {
            self.parameter(&parameter::name(effect.name(), joint))
                .is_some_and(beyond)
        });
        let names: Vec<_> = joints.map(JointId::name).collect();
        if names.is_empty() {
            return Ok(());
        }
        let (name, joints) = (effect.name(), names.join(", "));
        let look_alikes = description.look_alikes.join(", ");
        writeln!(
            f,
            "Unphysical {name} of {joints}: the model lacks something that looks like it ({look_alikes})."
        )
    }
}
