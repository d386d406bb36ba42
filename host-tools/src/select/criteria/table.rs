//! The rules at both sides of each threshold: `table.txt` says of synthetic screens and errors which step must follow, and in which words.

use std::fmt::Display;

use proprio_core::effect::EffectKind;

use super::choice::{Look, are_one_column, handicap, may_be_transmission};
use super::feasible::{NEAR, REACH, is_feasible};
use super::presence::{is_change, is_structure, is_there, is_worth_trying, moves};
use super::statistics::{Squared, least_z, noise_lags};
use super::step::{self, HeldOut};
use crate::model::BASE;
use crate::select::candidate::{Candidate, Finding, Member, Trial};
use crate::select::restart::one_joint;

const LEGS: [&str; 4] = ["FR", "FL", "RR", "RL"];
const JOINTS: [&str; 3] = ["hip", "thigh", "calf"];
/// Folds of a screen.
const FOLDS: usize = 4;

#[test]
fn each_rule_holds_at_both_sides_of_its_threshold() {
    let mut wrong = Vec::new();
    let mut rows = 0;
    for (n, line) in include_str!("table.txt").lines().enumerate() {
        let row = line.split('#').next().unwrap_or_default().trim();
        if row.is_empty() {
            continue;
        }
        let (question, rest) = row.split_once(':').expect(row);
        let (asked, expected) = rest.split_once('→').expect(row);
        let (said, expected) = (answer(question, asked.trim()), expected.trim());
        if said != expected {
            wrong.push(format!("line {}: {row}\n    the rules say: {said}", n + 1));
        }
        rows += 1;
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(rows > 150, "{rows} rows");
}

fn answer(question: &str, asked: &str) -> String {
    let numbers = || numbers(asked);
    let yes = |yes: bool| if yes { "yes" } else { "no" }.to_owned();
    match question {
        "next" => Synthetic::of(asked).next(),
        "alike" => Synthetic::of(asked).alike(),
        "there" => yes(is_there(&Synthetic::of(asked).all[0])),
        "feasible" => yes(is_feasible(&Synthetic::of(asked).all[0])),
        "outside" => yes(is_structure(&Synthetic::of(asked).all[0])),
        "scan" => {
            let keeps = !asked.ends_with("not kept");
            let screen = asked.trim_end_matches("not kept");
            yes(may_be_transmission(&Synthetic::of(screen).all[0], keeps))
        }
        "handicap" => {
            let all = Synthetic::of(asked).all;
            format!("{:.3}", handicap(&all[1], &all[0]))
        }
        "step" => yes(step::is_worth_a_step(&errors(asked)[1], &errors(asked)[0])),
        "better" => yes(step::is_better(&errors(asked)[1], &errors(asked)[0])),
        "without nothing" => yes(step::does_without(
            &errors(asked)[1],
            &errors(asked)[0],
            step::Leaves::Nothing,
        )),
        "without superseded" => yes(step::does_without(
            &errors(asked)[1],
            &errors(asked)[0],
            step::Leaves::Resembles,
        )),
        "without infeasible" => yes(step::does_without(
            &errors(asked)[1],
            &errors(asked)[0],
            step::Leaves::Infeasible,
        )),
        "stand-in" => {
            let joints: Vec<_> = numbers().chunks(3).map(|n| (n[0], n[1], n[2])).collect();
            yes(step::is_stand_in(&joints))
        }
        "most folds" => {
            let folds: Vec<_> = numbers().chunks(2).map(|n| (n[0], n[1])).collect();
            yes(step::is_of_most_folds(&folds))
        }
        "noise" => yes(step::is_by_noise(numbers()[0], numbers()[1])),
        "one column" => {
            let all = Synthetic::of(asked).all;
            yes(are_one_column(&all[0], &all[1]))
        }
        "drive" => yes(step::bears_a_drive(&errors(asked)[1], &errors(asked)[0])),
        "one cause" => yes(step::does_as_well(numbers()[1], numbers()[0])),
        "frame" => yes(step::is_frame(
            numbers()[0],
            numbers()[1],
            numbers()[2] as usize,
        )),
        "begin" => yes(step::begins_below(numbers()[0], numbers()[1], numbers()[2])),
        "held" => yes(step::is_held(numbers()[0])),
        "most" => yes(step::are_most(numbers()[0] as usize, numbers()[1] as usize)),
        "try" => yes(step::may_take_away(
            numbers()[0],
            numbers()[1],
            numbers()[2],
        )),
        "again" => yes(!step::promises_no_more(numbers()[0], numbers()[1])),
        "worth trying" => {
            // What is left of a joint and its torque, N m; what is promised and all joints' error.
            let n = numbers();
            let promise = n.get(2).copied();
            let now = n.get(3).copied().unwrap_or_default();
            yes(is_worth_trying(n[0].powi(2), n[1].powi(2), promise, now))
        }
        "sampling" => yes(!step::is_structure(numbers()[0], numbers()[1])),
        "go on" => yes(step::goes_on(numbers()[0] as usize, numbers()[1] as usize)),
        "drift" => yes(is_change(numbers()[0], numbers()[1], numbers()[2])),
        "moves" => {
            // A share of the time, %, at one speed, else at rest; the limit of the speed.
            let speed = |n: usize| {
                if (n as f64) < numbers()[0] {
                    numbers()[1]
                } else {
                    0.0
                }
            };
            yes(moves((0..100).map(speed), numbers()[2]))
        }
        "least z" => format!("{:.2}", least_z(numbers()[0] as usize)),
        "memory" => noise_lags(numbers()[0]).to_string(),
        "one joint" => {
            let (added, first) = asked.split_once('|').expect(asked);
            let added: Vec<Candidate> = added.split(';').map(|one| candidate(one.trim())).collect();
            let added: Vec<_> = added.iter().map(|c| (c.effect, &c.members[..])).collect();
            let first = Synthetic::of(first).all;
            let found = one_joint(&added, first.iter());
            found.map_or("nothing".to_owned(), |member| name(member.1.0, &[member]))
        }
        "place" => {
            let (near, reach) = (numbers()[0] > NEAR, numbers()[0] <= REACH);
            format!("{} {}", yes(near), yes(reach))
        }
        other => panic!("no question: {other}"),
    }
}

fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| c.is_whitespace() || c == ',');
    words.filter_map(|word| word.parse().ok()).collect()
}

/// Errors before and after: `100 | 98`; of whole logs that are held out, `60 40 | 61 37`.
fn errors(text: &str) -> Vec<HeldOut> {
    let of = |text: &str| {
        let by_log = numbers(text);
        HeldOut {
            weighted: by_log.iter().sum(),
            is_by_log: by_log.len() > 1,
            by_log,
        }
    };
    text.split('|').map(of).collect()
}

/// A screen that nobody measured.
struct Synthetic {
    all: Vec<Candidate>,
    /// What a candidate adds beside another.
    beside: Vec<(Candidate, Candidate)>,
}

impl Synthetic {
    fn of(text: &str) -> Self {
        let (mut all, mut beside) = (Vec::new(), Vec::new());
        for own in text.split(';').map(str::trim) {
            match own.split_once(" beside ") {
                None => all.push(candidate(own)),
                Some((one, rest)) => {
                    let (other, words) = rest.split_once(' ').unwrap_or((rest, ""));
                    beside.push((candidate(&format!("{one} {words}")), candidate(other)));
                }
            }
        }
        Self { all, beside }
    }

    fn look<T>(&self, rule: impl FnOnce(&Look) -> T) -> T {
        let known = |candidate: &Candidate, other: &Candidate| {
            let mut beside = self.beside.iter();
            let found = beside.find(|(one, with)| one.is_same(candidate) && with.is_same(other));
            // Unless a row says else, each explains its own.
            Some(found.map_or_else(|| candidate.clone(), |(one, _)| one.clone()))
        };
        rule(&Look {
            all: &self.all,
            windows: 1000.0,
            beside: &known,
        })
    }

    fn next(&self) -> String {
        let open: Vec<&Candidate> = self.all.iter().collect();
        let best = self.look(|look| look.best(&open));
        best.map_or("nothing".to_owned(), |c| name(c.effect, &c.members))
    }

    fn alike(&self) -> String {
        let found = self.look(|look| look.alternatives(&self.all[0]));
        let names = found.iter().map(|(effect, members)| name(*effect, members));
        let names: Vec<String> = names.collect();
        if names.is_empty() {
            return "nothing".to_owned();
        }
        names.join(", ")
    }
}

fn name(effect: EffectKind, members: &[Member]) -> String {
    let joint = |(leg, place): &Member| match place.1 {
        BASE => "all".to_owned(),
        joint => format!("{}_{}", LEGS[*leg], JOINTS[joint]),
    };
    let mut joints: Vec<String> = members.iter().map(joint).collect();
    joints.dedup();
    format!("{}:{}", effect.name(), joints.join("+"))
}

/// `effect:joint+joint word number… word number…`, as the head of the table explains the words.
fn candidate(text: &str) -> Candidate {
    let mut words = text.split_whitespace();
    let site = words.next().expect(text);
    let (effect, joints) = site.split_once(':').expect(site);
    let effect = EffectKind::from_name(effect).expect(effect);
    let mut said: Vec<(&str, Vec<&str>)> = Vec::new();
    for word in words {
        match said.last_mut() {
            Some((_, values)) if !word.starts_with(|c: char| c.is_ascii_lowercase()) => {
                values.push(word);
            }
            _ => said.push((word, Vec::new())),
        }
    }
    let values = |key: &str| said.iter().find(|(word, _)| *word == key).map(|(_, v)| v);
    let number = |key: &str, default: f64| values(key).map_or(default, |values| parsed(values[0]));
    let members: Vec<Member> = match joints {
        "all" => (0..2).map(|leg| (leg, (effect, BASE))).collect(),
        joints => (joints.split('+'))
            .map(|joint| {
                let (leg, joint) = joint.split_once('_').expect(joint);
                let at = |names: &[&str], name: &str| names.iter().position(|n| *n == name);
                let at = at(&LEGS, leg).zip(at(&JOINTS, joint)).expect(text);
                (at.0, (effect, at.1))
            })
            .collect(),
    };
    let said_gains = values("gain").map_or(&[][..], |values| values);
    let gains: Vec<f64> = match said_gains {
        [] => vec![0.0; FOLDS],
        [all] => vec![parsed(all) / FOLDS as f64; FOLDS],
        folds => folds.iter().map(parsed).collect(),
    };
    let pairs = |key: &str| -> Option<Vec<(f64, f64)>> {
        let pair = |text: &&str| {
            let (value, std) = text.split_once('±').expect(text);
            (parsed(value), parsed(std))
        };
        Some(values(key)?.iter().map(pair).collect())
    };
    let described = effect.description();
    let linear: Vec<usize> = described.linear().collect();
    let told = |n: usize| {
        let at = linear.iter().position(|l| *l == n)?;
        let default = match at {
            0 => (described.parameters[n].neutral + 0.3, 0.01),
            _ => (0.0, 0.1),
        };
        Some(pairs("value").map_or(default, |told| told[at]))
    };
    let parameters = 0..described.parameters.len();
    let finding = |member: &Member| Finding {
        place: member.1,
        parameters: parameters.clone().map(told).collect(),
        prior: (described.parameters.iter().enumerate())
            .map(|(n, p)| pairs("prior").map_or((p.neutral, 1.0), |prior| prior[n]))
            .collect(),
        nonlinear: 0.1,
        period: 2e-3,
        beyond_limit: described.is_limit().then(|| number("shown", 0.0)),
    };
    let mut legs: Vec<usize> = members.iter().map(|(leg, _)| *leg).collect();
    legs.dedup();
    let share = 1.0 / legs.len() as f64;
    let own = |sum: f64| share * sum;
    let sum: f64 = gains.iter().sum();
    let size = number("z", 10.0).powi(2);
    let trial = |leg: usize| Trial {
        places: members.iter().filter(|m| m.0 == leg).map(|m| m.1).collect(),
        gains: gains.iter().copied().map(own).collect(),
        falls: gains
            .iter()
            .map(|gain| own(gain * number("worth", 1.0)))
            .collect(),
        felt: own(100.0),
        torque: own(number("torque", 1000.0)),
        fall: own(number("fall", sum)),
        findings: members.iter().filter(|m| m.0 == leg).map(finding).collect(),
        ..Trial::default()
    };
    let trials = legs.iter().map(|&leg| (leg, trial(leg))).collect();
    let mut candidate = Candidate::of(effect, trials, number("tried", 1.0) as usize).expect(text);
    candidate.sure = Squared {
        size,
        freedom: 1.0,
        tried: 1.0,
    };
    candidate
}

fn parsed(text: impl Display) -> f64 {
    let text = text.to_string();
    text.parse().unwrap_or_else(|_| panic!("no number: {text}"))
}
