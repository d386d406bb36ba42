//! What is known of a device from what it has said.

use std::collections::VecDeque;

use proprio_core::bus::Reply;
use proprio_core::go2::{JOINTS_PER_LEG, JointId, LEGS, Leg};
use proprio_core::wire::{
    Action, Answer, BodyPrior, Clock, Counters, DeviceMessage, Diagnosis, EffectAt, Estimate,
    Hello, Kept, LegCounters, Outcome, Positions, Reset, SetZero, Setup, Solution, Walk, Wiring,
    Zero,
};

use super::residual::Residual;
use crate::device::names::{
    parameters_of, place, words_of, words_of_lacking, words_of_setup, words_of_top_temperature,
    words_of_walk, words_of_wiring, words_of_zero,
};
use crate::estimate::ParameterEstimate;
use crate::parameter;

/// Events that are kept.
const EVENTS: usize = 200;
/// A candidate is called missing if its gain is so many of its own errors, which two folds tell badly, and this share of the
/// squared error at least.
///
/// Less than that dry friction itself feigns. While a joint turns round it sticks for some milliseconds, and its friction is
/// then whatever balances the other torques; the device's column of Coulomb friction is a function of the velocity, which noise
/// hides there ([`JointState::sign`](proprio_core::effect::JointState::sign)). What is left falls as the torque does, as the column of
/// `delay` does: at the calves of a simulated Go2 that hides no delay it finds −0.2 to −0.45 ms and 1 to 5 %. Stamps and
/// integration have no part in it: without Coulomb friction it finds 0.004 ms and nothing
/// (`tests/tests/device_delay.rs`), with it the same without sensor noise and at four times the rate.
const SURE: f32 = 3.0;
const LEAST_GAIN: f32 = 0.1;

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Device time of the last counters before it, µs.
    pub time_us: u64,
    /// In words.
    pub text: String,
}

/// What is known of a leg.
#[derive(Debug, Clone, Default)]
pub struct LegView {
    /// θ by name, empty before the first estimate.
    pub parameters: Vec<ParameterEstimate>,
    /// Windows of data in it.
    pub windows: u32,
    /// Least squares alone had a body that cannot exist or an effect beyond its bounds: this is the likeliest that can be.
    pub consistent: bool,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    pub noise: [f64; JOINTS_PER_LEG],
    /// The same of the newest windows.
    pub residuals: [Residual; JOINTS_PER_LEG],
    /// Samples a second.
    pub rate: f64,
    above: [bool; JOINTS_PER_LEG],
    was_consistent: bool,
    lost: u32,
}

/// An effect at a joint, as the device judges it.
#[derive(Debug, Clone, Copy)]
pub struct Ranked {
    /// Where the device keeps it.
    pub at: EffectAt,
    /// At which joint.
    pub joint: JointId,
    /// Which effect.
    pub effect: &'static str,
    /// Unit of its value.
    pub unit: &'static str,
    /// The model has it; else it is a candidate.
    pub active: bool,
    /// 1 − squared error with / without the effect, on held-out data.
    pub gain: f32,
    /// The gain's standard error.
    pub gain_error: f32,
    /// Its value in the model that has it.
    pub value: f32,
    /// That value's standard deviation.
    pub std: f32,
}

impl Ranked {
    /// A candidate whose gain is beyond its error.
    pub fn is_missing(&self) -> bool {
        !self.active && self.gain > LEAST_GAIN && self.gain > SURE * self.gain_error
    }
}

/// All that is known.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// Who the device is.
    pub hello: Option<Hello>,
    /// Its legs.
    pub legs: [LegView; LEGS],
    /// The last counters.
    pub counters: Option<Counters>,
    /// The last estimate of a robot that walks.
    pub walk: Option<Walk>,
    /// What happened, the newest last.
    pub events: VecDeque<Event>,
    /// Messages heard.
    pub messages: u64,
    /// Frames from the device that were damaged, and that never came.
    pub losses: (u32, u32),
    diagnoses: Vec<Diagnosis>,
    asked: Vec<(u32, Action)>,
    happened: u64,
}

impl View {
    /// Takes in a message.
    pub fn hear(&mut self, message: &DeviceMessage) {
        self.messages += 1;
        match message {
            DeviceMessage::Hello(hello) => self.hello(hello),
            DeviceMessage::Estimate(estimate) => self.estimate(estimate),
            DeviceMessage::Counters(counters) => self.counters(counters),
            DeviceMessage::Diagnosis(diagnosis) => self.diagnosis(diagnosis),
            DeviceMessage::Answer(answer) => self.answer(answer),
            DeviceMessage::Change(change) => {
                words_of(change)
                    .into_iter()
                    .for_each(|words| self.happened(words));
            }
            DeviceMessage::Walk(walk) => {
                self.walk = Some(*walk);
                self.happened(words_of_walk(walk));
            }
            DeviceMessage::FactorPart(_) | DeviceMessage::Advanced(_) => {}
        }
    }

    /// Takes note of what the device was asked.
    pub fn ask(&mut self, id: u32, action: Action) {
        self.asked.push((id, action));
    }

    /// Takes note of what the link lost.
    pub fn lose(&mut self, bad: u32, missed: u32) {
        if missed > self.losses.1 {
            let lost = missed - self.losses.1;
            self.happened(format!("{lost} messages of the device were lost"));
        }
        self.losses = (bad, missed);
    }

    /// Adds an event.
    pub fn happened(&mut self, text: String) {
        let time_us = self.counters.map_or(0, |counters| counters.time_us);
        self.happened += 1;
        self.events.push_back(Event { time_us, text });
        if self.events.len() > EVENTS {
            self.events.pop_front();
        }
    }

    /// How many events there were, those included that are no longer kept.
    pub fn happened_so_far(&self) -> u64 {
        self.happened
    }

    fn hello(&mut self, hello: &Hello) {
        match &self.hello {
            None => {
                let (board, firmware, git) = (&hello.board, &hello.firmware, &hello.git);
                self.happened(match git.is_empty() {
                    true => format!("{board} says hello, firmware {firmware}"),
                    false => format!("{board} says hello, firmware {firmware} ({git})"),
                });
                self.start_of(hello);
            }
            Some(before) if !is_same(before, hello) => self.happened("another device".to_owned()),
            Some(before) if before.reset != hello.reset || before.crash != hello.crash => {
                self.start_of(hello);
            }
            Some(before) if before.listens_to != hello.listens_to => {
                self.happened(format!("listens to {}", legs_of(hello.listens_to)));
            }
            Some(_) => {}
        }
        let before = self.hello.as_ref().map(|before| before.setup);
        self.setup(before, hello);
        let before = self.hello.as_ref().is_some_and(|before| before.carried);
        self.feet(before, hello.carried);
        let before = self.hello.as_ref().map(|before| before.zeros);
        self.zeros(before, &hello.zeros);
        let before = self.hello.as_ref().map(|before| before.wiring);
        self.wiring(before.unwrap_or_default(), &hello.wiring);
        self.hello = Some(hello.clone());
    }

    /// Says what the board is set up for if its flash has kept another since the hello before, or that waits for its next start.
    fn setup(&mut self, before: Option<Setup>, hello: &Hello) {
        // A device that says nothing of it has a bus of no bits per second.
        if hello.setup_in_use || hello.setup.bus_baud == 0 || before == Some(hello.setup) {
            return;
        }
        let words = words_of_setup(&hello.setup);
        self.happened(format!("kept for its next start: {words}; reset the board"));
    }

    /// What a device tells of its start that its user should know.
    fn start_of(&mut self, hello: &Hello) {
        if let Some(words) = words_of_lacking(hello) {
            self.happened(words);
        }
        if !hello.crash.is_empty() {
            self.happened(format!("the run before ended: {}", hello.crash));
        }
        match (hello.reset, hello.brown_out_level) {
            (Reset::Watchdog, _) => self.happened("its watchdog has reset it".to_owned()),
            (Reset::BrownOut, Some(level)) => self.happened(format!(
                "its supply fell below brown-out level {level} and has reset it"
            )),
            (Reset::BrownOut, None) => self.happened("a brown-out has reset it".to_owned()),
            _ => {}
        }
        if hello.clock == Clock::Internal {
            self.happened(
                "its crystal's clock does not come: its times are some per cent off, and velocities with them".to_owned(),
            );
        }
        match hello.kept {
            Kept::NoStorage | Kept::Nothing => {}
            Kept::Restored => self.happened("goes on from its snapshot".to_owned()),
            Kept::OfAnother => self.happened(
                "its snapshot is of another firmware, robot or model: begins anew".to_owned(),
            ),
        }
    }

    /// Legs of which a joint's zero is unknown: nothing is identified of them.
    pub fn unplaced(&self) -> Vec<Leg> {
        let Some(hello) = &self.hello else {
            return Vec::new();
        };
        let legs = Leg::ALL.into_iter().zip(&hello.zeros);
        let unplaced = legs.filter(|(_, zeros)| !zeros.iter().all(|zero| zero.is_known()));
        unplaced.map(|(leg, _)| leg).collect()
    }

    /// Says which zeros are void that were not, and which are known that were not.
    fn zeros(&mut self, before: Option<Zeros>, now: &Zeros) {
        const ALL: [Zero; 7] = [
            Zero::Unknown,
            Zero::Restarted,
            Zero::Silent,
            Zero::Jumped,
            Zero::Exchanged,
            Zero::Set,
            Zero::Absolute,
        ];
        for kind in ALL {
            let joints: Vec<JointId> = JointId::all()
                .filter(|joint| {
                    let of = |zeros: &Zeros| zeros[joint.leg().index()][joint.place()];
                    of(now) == kind && before.as_ref().map(of) != Some(kind)
                })
                .collect();
            // A device that says of itself for the first time that all is well says nothing new.
            if joints.is_empty() || (before.is_none() && kind.is_known()) {
                continue;
            }
            let names = names_of(&joints);
            self.happened(match kind {
                Zero::Set => format!("zero of {names} known"),
                Zero::Absolute => format!("positions of {names} are angles"),
                void => format!("zero of {names} {}", words_of_zero(void)),
            });
        }
    }

    /// Legs whose zeros are known and of which nothing is identified, and why in words.
    pub fn withheld(&self) -> Vec<(Leg, Wiring)> {
        let Some(hello) = &self.hello else {
            return Vec::new();
        };
        let legs = Leg::ALL.into_iter().zip(hello.wiring);
        let withheld =
            legs.filter(|(_, wiring)| !matches!(wiring, Wiring::Untested | Wiring::Right));
        withheld.collect()
    }

    /// Says what a device has found of its legs' wiring.
    fn wiring(&mut self, before: [Wiring; LEGS], now: &[Wiring; LEGS]) {
        for ((leg, before), now) in Leg::ALL.into_iter().zip(before).zip(*now) {
            if before != now && now != Wiring::Untested {
                self.happened(format!("{}: {}", leg.name(), words_of_wiring(leg, now)));
            }
        }
    }

    /// Says when the robot is put on its feet, and when it hangs again.
    fn feet(&mut self, before: bool, now: bool) {
        match (before, now) {
            (false, true) => self.happened(
                "the robot's feet carry it: its windows are excluded until it is suspended; a robot that walks: --free-base (its board: proprio flash --walking)"
                    .to_owned(),
            ),
            (true, false) => self.happened("the robot is suspended".to_owned()),
            _ => {}
        }
    }

    fn estimate(&mut self, estimate: &Estimate) {
        let n = usize::from(estimate.leg);
        let (Some(hello), Some(leg)) = (&self.hello, Leg::ALL.get(n)) else {
            return;
        };
        let Ok(parameters) = parameters_of(estimate, hello) else {
            return;
        };
        let view = &mut self.legs[n];
        let first = view.windows == 0 && estimate.windows > 0;
        view.parameters = parameters;
        view.windows = estimate.windows;
        view.consistent = estimate.solution == Solution::Consistent;
        let first_consistent = view.consistent && !view.was_consistent;
        view.was_consistent |= view.consistent;
        view.noise = estimate.noise.map(f64::from);
        let mut above = Vec::new();
        for (j, joint) in JointId::of(*leg).into_iter().enumerate() {
            let residual = &mut view.residuals[j];
            residual.hear(f64::from(estimate.windows), view.noise[j]);
            let is_above = residual.is_above();
            if is_above && !view.above[j] {
                above.push(joint);
            }
            view.above[j] = is_above;
        }
        if first {
            self.happened(format!("first data of {}", leg.name()));
        }
        if first_consistent {
            self.happened(format!(
                "{}: least squares gives an unphysical body or negative friction; the physical solution is shown",
                leg.name()
            ));
        }
        for joint in above {
            self.happened(format!("{}: residual above its band", joint.name()));
        }
    }

    /// Says which motors are at the end of their temperature's scale that were not.
    fn temperatures(&mut self, before: Option<&Counters>, now: &Counters) {
        for joint in JointId::all() {
            let is_at_end = |counters: &Counters| {
                let leg = &counters.legs[joint.leg().index()];
                leg.temperatures[joint.place()] == Reply::TOP_TEMPERATURE
            };
            if is_at_end(now) && !before.is_some_and(is_at_end) {
                self.happened(format!("{}: {}", joint.name(), words_of_top_temperature()));
            }
        }
    }

    fn counters(&mut self, counters: &Counters) {
        let before = self.counters.replace(*counters);
        self.temperatures(before.as_ref(), counters);
        let Some(before) = before else { return };
        if counters.time_us < before.time_us {
            self.happened("the device began anew".to_owned());
            self.begin_anew();
            return;
        }
        let seconds = (counters.time_us - before.time_us) as f64 * 1e-6;
        for (n, leg) in Leg::ALL.into_iter().enumerate() {
            let (now, then) = (&counters.legs[n], &before.legs[n]);
            let view = &mut self.legs[n];
            // Fewer than before: the device has forgotten its counts.
            let samples = now.samples.checked_sub(then.samples);
            if let (Some(samples), true) = (samples, seconds > 0.0) {
                let rate = f64::from(samples) / seconds;
                // Counters come ten times a second; their rate is smoothed over about one.
                view.rate += (rate - view.rate) * seconds.min(1.0);
            }
            let lost = faults(now);
            let news = lost.wrapping_sub(view.lost);
            if news > 0 && lost > view.lost {
                let kind = worst(now, then);
                self.legs[n].lost = lost;
                self.happened(format!("{}: {news} {kind}", leg.name()));
            }
        }
        let over = counters.load.over_budget;
        if over > before.load.over_budget {
            let more = over - before.load.over_budget;
            self.happened(format!("{more} steps over budget"));
        }
        if counters.snapshots > before.snapshots {
            self.happened("snapshot written".to_owned());
        }
        if counters.snapshots_failed > before.snapshots_failed {
            self.happened("snapshot given up: the flash refuses it".to_owned());
        }
        let dropped = counters.frames_dropped;
        if dropped > before.frames_dropped {
            let more = dropped - before.frames_dropped;
            self.happened(format!("the link was too slow for {more} messages"));
        }
    }

    /// Forgets what the device has forgotten.
    fn begin_anew(&mut self) {
        self.legs = Default::default();
        self.diagnoses.clear();
    }

    fn diagnosis(&mut self, diagnosis: &Diagnosis) {
        let known = self.diagnoses.iter().position(|d| d.at == diagnosis.at);
        let was = known.is_some_and(|n| {
            self.ranked(&self.diagnoses[n])
                .is_some_and(|r| r.is_missing())
        });
        match known {
            Some(n) => self.diagnoses[n] = *diagnosis,
            None => self.diagnoses.push(*diagnosis),
        }
        let ranked = self.ranked(diagnosis);
        if let Some(ranked) = ranked.filter(|ranked| ranked.is_missing() && !was) {
            let (effect, joint) = (ranked.effect, ranked.joint.name());
            self.happened(format!("{joint} lacks {effect}"));
        }
    }

    fn answer(&mut self, answer: &Answer) {
        let Some(place) = self.asked.iter().position(|(id, _)| *id == answer.id) else {
            return;
        };
        let (_, action) = self.asked.remove(place);
        let done = answer.outcome == Outcome::Accepted;
        let what = match action {
            Action::Reset => "reset".to_owned(),
            Action::AddEffect(at) => self.named("add", &at),
            Action::DropEffect(at) => self.named("drop", &at),
            Action::SetMemory(0) => "forget nothing".to_owned(),
            Action::SetMemory(seconds) => format!("memory of {seconds} s"),
            Action::SetEffectPrior(at, belief) => {
                let (mean, std) = (belief.mean, belief.std);
                format!("{} = {mean} ± {std}", self.named("prior", &at))
            }
            Action::SetBodyPrior(BodyPrior {
                leg,
                body,
                uncertainty,
            }) => {
                let joints = Leg::ALL.get(usize::from(leg)).map(|leg| leg.joint_names());
                let name = joints.and_then(|joints| joints.get(usize::from(body)).copied());
                let percent = 100.0 * uncertainty;
                format!("body {} within {percent} %", name.unwrap_or("?"))
            }
            Action::SetLegs(legs) => format!("listen to {}", legs_of(legs)),
            Action::Keep => "snapshot".to_owned(),
            Action::SetPositions(Positions::Absolute) => "positions are angles".to_owned(),
            Action::SetPositions(Positions::FromPowerUp) => "zeros to be set".to_owned(),
            Action::SetZero(SetZero {
                leg, joint, angle, ..
            }) => {
                let joints = Leg::ALL.get(usize::from(leg)).map(|leg| leg.joint_names());
                let name = joints.and_then(|joints| joints.get(usize::from(joint)).copied());
                format!("{} at {angle} rad", name.unwrap_or("?"))
            }
            Action::TrustZeros => "zeros as kept".to_owned(),
            Action::TrustWiring => "wiring is right".to_owned(),
            Action::SetUp(setup) => format!("set up: {}", words_of_setup(&setup)),
        };
        if done && action == Action::Reset {
            self.begin_anew();
        }
        if let (true, Action::AddEffect(at) | Action::DropEffect(at)) = (done, action) {
            // What was found of the other model says nothing of this one.
            let joint = |d: &Diagnosis| (d.at.leg, d.at.joint) == (at.leg, at.joint);
            self.diagnoses.retain(|d| !joint(d));
        }
        self.happened(match answer.outcome {
            Outcome::Accepted => format!("{what}: done"),
            Outcome::NoSuchLeg => format!("{what}: no such leg"),
            Outcome::NoSuchJoint => format!("{what}: no such joint"),
            Outcome::NoSuchEffect => format!("{what}: the device does not keep it"),
            Outcome::AlreadyActive => format!("{what}: the model has it already"),
            Outcome::NotActive => format!("{what}: the model does not have it"),
            Outcome::OutOfRange => format!("{what}: cannot be"),
            Outcome::NoStorage => format!("{what}: the board has no flash for it"),
            Outcome::NotHeard => format!("{what}: its motor does not answer"),
            Outcome::Moves => format!("{what}: it moves"),
            Outcome::NoZero => format!("{what}: none is kept that has held"),
            Outcome::NoTrial => format!("{what}: no leg is on trial, or it has a fault"),
        });
    }

    fn named(&self, verb: &str, at: &EffectAt) -> String {
        let place = self.hello.as_ref().and_then(|hello| place(at, hello));
        place.map_or_else(
            || verb.to_owned(),
            |(joint, effect)| format!("{verb} {}:{}", effect.name(), joint.name()),
        )
    }

    fn ranked(&self, diagnosis: &Diagnosis) -> Option<Ranked> {
        let (joint, effect) = place(&diagnosis.at, self.hello.as_ref()?)?;
        Some(Ranked {
            at: diagnosis.at,
            joint,
            effect: effect.name(),
            unit: parameter::unit(effect),
            active: diagnosis.active,
            gain: diagnosis.gain,
            gain_error: diagnosis.gain_error,
            value: diagnosis.value,
            std: diagnosis.std,
        })
    }

    /// What the device judged, missing effects first, each kind by its gain; then what the model has.
    pub fn ranking(&self) -> Vec<Ranked> {
        let all = self.diagnoses.iter().filter_map(|d| self.ranked(d));
        let mut ranking: Vec<Ranked> = all.collect();
        let class = |r: &Ranked| (r.active, !r.is_missing());
        ranking.sort_by(|a, b| class(a).cmp(&class(b)).then(b.gain.total_cmp(&a.gain)));
        ranking
    }

    /// What was counted of a leg that never became a sample.
    pub fn lost(&self, leg: usize) -> u32 {
        self.counters
            .map_or(0, |counters| counters.legs.get(leg).map_or(0, faults))
    }
}

/// Whether it is the same device, whatever it was told and has found.
fn is_same(one: &Hello, other: &Hello) -> bool {
    let with = Hello {
        listens_to: other.listens_to,
        carried: other.carried,
        zeros: other.zeros,
        wiring: other.wiring,
        kept: other.kept,
        reset: other.reset,
        clock: other.clock,
        crash: other.crash.clone(),
        setup: other.setup,
        setup_in_use: other.setup_in_use,
        ..one.clone()
    };
    with == *other
}

/// Each joint's zero, by leg.
type Zeros = [[Zero; JOINTS_PER_LEG]; LEGS];

/// The names of joints: of a whole leg, its own.
fn names_of(joints: &[JointId]) -> String {
    let mut names = Vec::new();
    for leg in Leg::ALL {
        let own = joints.iter().filter(|joint| joint.leg() == leg);
        let own: Vec<&str> = own.map(|joint| joint.name()).collect();
        match own.len() {
            JOINTS_PER_LEG => names.push(leg.name()),
            _ => names.extend(own),
        }
    }
    names.join(" ")
}

/// The names of legs, bit n for the n-th.
fn legs_of(mask: u8) -> String {
    let legs = Leg::ALL.iter().filter(|leg| mask >> leg.index() & 1 == 1);
    let names: Vec<&str> = legs.map(|leg| leg.name()).collect();
    match names.is_empty() {
        true => "no leg".to_owned(),
        false => names.join(" "),
    }
}

/// What a count is called, and where it stands.
type Fault = (&'static str, fn(&LegCounters) -> u32);

/// What a leg's counters are called that tell of something wrong.
const FAULTS: [Fault; 10] = [
    ("bytes lost", |c| c.lost_bytes),
    ("bad checksums", |c| c.bad_crc + c.short),
    ("motor faults", |c| c.motor_faults),
    ("overheated replies", |c| c.overheated),
    ("replies of a stuck encoder", |c| c.stuck),
    ("cycles left out", |c| c.surplus),
    ("samples that cannot be true", |c| c.rejected),
    ("gaps", |c| c.gaps),
    ("incomplete cycles", |c| c.incomplete),
    ("failed solutions", |c| c.unsolved + c.unfolded),
];

fn faults(counters: &LegCounters) -> u32 {
    let counts = FAULTS.iter().map(|(_, count)| count(counters));
    counts.fold(0, u32::wrapping_add)
}

/// The name of what grew most.
fn worst(now: &LegCounters, then: &LegCounters) -> &'static str {
    let growth =
        |(_, count): &&(&str, fn(&LegCounters) -> u32)| count(now).wrapping_sub(count(then));
    FAULTS
        .iter()
        .max_by_key(growth)
        .map_or("", |(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_at_the_top_of_its_temperature_scale_is_an_event_once() {
        let (mut view, mut counters) = (View::default(), Counters::default());
        let top = Reply::TOP_TEMPERATURE;
        for (temperature, events) in [(40, 0), (top, 1), (top, 1), (top - 1, 1), (top, 2)] {
            counters.time_us += 100_000;
            counters.legs[3].temperatures[2] = temperature;
            view.hear(&DeviceMessage::Counters(counters));
            assert_eq!(view.events.len(), events, "{:?}", view.events);
        }
        assert!(view.events[0].text.starts_with("RL_calf: reports 127 °C"));
        // It is one from the first on.
        let mut view = View::default();
        view.hear(&DeviceMessage::Counters(counters));
        assert_eq!(view.events.len(), 1);
    }
}
