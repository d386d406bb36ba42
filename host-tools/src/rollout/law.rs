//! The torque that a limb's drives give by what they were asked to do, closed over the simulated motion as a policy feels it:
//!
//! ```text
//! τ = gain · (tau_des + kp (q_des − q) + kd (dq_des − dq)),   within ± what the drive can give
//! ```
//!
//! q and dq are what the joint's encoder would report of the simulated motion. A command holds until the next sample's. Drives are immediate: delay,
//! lag and dead band of the model are of the reported torque, which this law does not know ([`is_included`](super::is_included)).

use crate::equation::contribution::Contribution;
use crate::equation::encoder::Encoder;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::log::Channel;

use super::plant::{Given, State};

/// Gains of drives where no log states them, N m/rad and N m s/rad: of all joints, or of one, by its number in the model. The last that fits counts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gains {
    /// kp.
    pub position: Vec<(Option<usize>, f64)>,
    /// kd.
    pub velocity: Vec<(Option<usize>, f64)>,
}

/// What of a command is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Missing {
    /// A column of a joint, by its number in the limb.
    Column(Channel, usize),
    /// The gains of such a joint's drive.
    Gains(usize),
}

/// What the drives of a limb were asked to do, by [`Channel::COMMAND`], of each sample and joint; each is a number.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Commands(Vec<[f64; 5]>);

/// A channel's place in a command.
const fn place(channel: Channel) -> usize {
    match channel {
        Channel::QDes => 0,
        Channel::DqDes => 1,
        Channel::TauDes => 2,
        Channel::Kp => 3,
        _ => 4,
    }
}

impl Gains {
    /// kp and kd of a joint, by its number in the model, where they are stated here.
    fn of(&self, joint: usize) -> [Option<f64>; 2] {
        [&self.position, &self.velocity].map(|all| {
            let own = all.iter().rfind(|(of, _)| *of == Some(joint));
            let own = own.or_else(|| all.iter().rfind(|(of, _)| of.is_none()));
            own.map(|(_, gain)| *gain)
        })
    }
}

impl Commands {
    /// Of a limb whose recording has commands. Gains that are stated come before those of the log. Without any the commanded torque is all that
    /// the drive follows.
    pub(crate) fn of(data: &LimbData, gains: &Gains) -> Result<Self, Missing> {
        let n = data.joints();
        let mut all = data.recording.command.clone();
        all.resize(n * data.recording.len(), [f64::NAN; 5]);
        for (j, body) in data.limb.bodies.clone().enumerate() {
            let own = || all.iter().skip(j).step_by(n);
            let has = |channel| own().any(|command| command[place(channel)].is_finite());
            let stated = gains.of(body);
            let known =
                [Channel::Kp, Channel::Kd].map(|of| stated[place(of) - 3].is_some() || has(of));
            let mut absent = [0.0; 5];
            match known {
                [true, true] => {
                    let logged = || own().any(|command| command[3] > 0.0);
                    let stiff = stated[0].map_or_else(logged, |kp| kp != 0.0);
                    if stiff && !has(Channel::QDes) {
                        return Err(Missing::Column(Channel::QDes, j));
                    }
                }
                [false, false] if has(Channel::TauDes) => {}
                [false, false] if !has(Channel::QDes) => {
                    return Err(Missing::Column(Channel::QDes, j));
                }
                _ => return Err(Missing::Gains(j)),
            }
            for channel in Channel::COMMAND {
                let mut all = own().map(|command| command[place(channel)]);
                let first = all.find(|x| x.is_finite());
                absent[place(channel)] = first.unwrap_or(0.0);
            }
            // Before its first value a channel has that, and in a row without one the row's before.
            let mut last = absent;
            for command in all.iter_mut().skip(j).step_by(n) {
                for (c, value) in command.iter_mut().enumerate() {
                    let stated = c.checked_sub(3).and_then(|gain| stated[gain]);
                    *value = stated.unwrap_or(if value.is_finite() { *value } else { last[c] });
                }
                last = *command;
            }
        }
        Ok(Self(all))
    }
}

/// Drives that follow commands.
pub(super) struct Law<'a> {
    commands: &'a Commands,
    drives: Vec<Drive>,
}

/// A joint's drive.
struct Drive {
    encoder: Encoder,
    /// Reported over true velocity.
    velocity_gain: f64,
    /// True over commanded torque.
    gain: f64,
    /// The most that it gives, N m.
    limit: f64,
}

impl<'a> Law<'a> {
    pub(super) fn of(
        data: &LimbData,
        values: &Values,
        effects: &[Vec<Contribution>],
        commands: &'a Commands,
    ) -> Self {
        let bodies = &data.model.robot().bodies()[data.limb.bodies.clone()];
        let drive = |(j, effects): (usize, &Vec<Contribution>)| {
            let limits = (effects.iter()).filter(|own| own.effect.description().is_limit());
            let effort = Some(bodies[j].effort).filter(|effort| *effort > 0.0);
            Drive {
                encoder: values.encoder(j),
                velocity_gain: data.velocity_gain[j],
                gain: values.torque_gain(j),
                limit: limits.fold(effort.unwrap_or(f64::INFINITY), |least, own| {
                    least.min(own.shapes[0])
                }),
            }
        };
        Self {
            commands,
            drives: effects.iter().enumerate().map(drive).collect(),
        }
    }

    /// The torques in a state by the commands of a sample.
    pub(super) fn torque(&self, sample: usize, state: &State) -> Given {
        let n = self.drives.len();
        let commands = &self.commands.0[sample * n..(sample + 1) * n];
        let joint = |(j, drive): (usize, &Drive)| {
            let [q_des, dq_des, tau_des, kp, kd] = commands[j];
            let motion = drive.encoder.reported([state.q[j], state.dq[j]]);
            let [q, dq] = [motion[0], drive.velocity_gain * motion[1]];
            let asked = drive.gain * (tau_des + kp * (q_des - q) + kd * (dq_des - dq));
            let given = asked.clamp(-drive.limit, drive.limit);
            // At its limit a drive damps nothing.
            let damping = if given == asked {
                drive.gain * kd * drive.velocity_gain
            } else {
                0.0
            };
            (given, damping)
        };
        let (torque, damping) = self.drives.iter().enumerate().map(joint).unzip();
        Given { torque, damping }
    }
}
