//! A report with every kind of section, made from a simulated log and its identification.
//!
//! The joints move for 20 s with typical friction; the page compares the URDF's rigid body and what was identified.
//! The gains and the path switch the identified effects on and off on the same windows.

use std::path::Path;

use proprio_core::effect::EffectKind;
use proprio_core::estimator::{EFFECTS, LEG_INERTIAL, LEG_PARAMETERS, LegWindow, plausible};
use proprio_core::go2::{self, JOINTS_PER_LEG, JointId, Leg};
use proprio_core::spatial::Transform;
use proprio_core::window::{Push, Sample, Settings};
use proprio_host::identify::{FitOptions, Fitted, identify};
use proprio_host::log::LogWriter;
use proprio_host::parameter;
use proprio_host::report::candidates::Candidate;
use proprio_host::report::correlation::Correlation;
use proprio_host::report::parameters::ParameterRow;
use proprio_host::report::residual::ResidualSeries;
use proprio_host::report::torque::TorqueSeries;
use proprio_host::report::waterfall::Step;
use proprio_host::report::{Header, LogFile, Page};
use proprio_host::report::{candidates, correlation, parameters, residual, torque, waterfall};
use proprio_simulator::hidden::typical;
use proprio_simulator::{SimulatedSample, Simulation};

const SETTINGS: Settings = Settings::DEFAULT;

/// A joint's windows: what was measured and each parameter's share of the prediction.
struct Windows {
    joint: JointId,
    /// Middle of the window, s.
    t: Vec<f64>,
    q: Vec<f64>,
    dq: Vec<f64>,
    measured: Vec<f64>,
    /// One row per window: the columns of the leg's parameters, zero for other joints' effects.
    columns: Vec<[f64; LEG_PARAMETERS]>,
    /// The URDF's parameters and no effect.
    urdf: Vec<f64>,
    /// What was identified.
    identified: Vec<f64>,
    /// What was simulated.
    truth: Vec<f64>,
}

impl Windows {
    fn predicted(&self, theta: &[f64]) -> Vec<f64> {
        let product = |row: &[f64; LEG_PARAMETERS]| row.iter().zip(theta).map(|(w, x)| w * x).sum();
        self.columns.iter().map(product).collect()
    }

    fn residual(&self, theta: &[f64]) -> Vec<f64> {
        let predicted = self.predicted(theta);
        self.measured
            .iter()
            .zip(predicted)
            .map(|(m, p)| m - p)
            .collect()
    }

    /// The identified parameters, but of this joint's effects only those in `effects`.
    fn with_effects(&self, effects: &[EffectKind]) -> Vec<f64> {
        let mut theta = self.identified.clone();
        for (n, value) in theta[LEG_INERTIAL..].iter_mut().enumerate() {
            if !effects.contains(&EFFECTS[n % EFFECTS.len()]) {
                *value = 0.0;
            }
        }
        theta
    }
}

/// Simulates a log of `legs`, identifies it and writes the report to `page`.
///
/// # Panics
/// If any of it fails.
pub fn write(page: &Path, legs: &[Leg]) {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("<b>walk & \"trot\".csv");
    let simulation = Simulation {
        effects: typical(legs),
        ..Simulation::new(legs)
    };
    let samples = record(&simulation, &log);
    let logs = std::slice::from_ref(&log);
    let identified = identify(logs, None, (FitOptions::default(), &[]), |_, _| ()).unwrap();
    let result = identified.fitted;
    let windows: Vec<Windows> = legs
        .iter()
        .enumerate()
        .flat_map(|(n, &leg)| windows_of(leg, JOINTS_PER_LEG * n, &samples, &result))
        .collect();
    let sha256 = proprio_host::model::Provenance::of(&[&log]).unwrap().logs[0]
        .sha256
        .clone();
    let gains = gains(&windows);
    let header = Header {
        title: "What a simulated Go2 lacks in its URDF".to_owned(),
        findings: vec![
            format!(
                "With the URDF alone the torque error is {:.2} N m rms; with what was identified it is {:.3} N m.",
                result.yardsticks.cad_rms, result.rms
            )
            .into(),
            format!("The most useful single effect is {}.", gains[0].name).into(),
        ],
        command: format!("proprio demo --html report.html '{}'", log.display()),
        logs: vec![LogFile {
            path: log.display().to_string(),
            sha256,
        }],
        ..Header::default()
    };
    let (steps, floor) = path(&windows);
    let sections = vec![
        waterfall::section(&steps, Some(floor)),
        candidates::section(&gains),
        torque::section(&windows.iter().map(torques).collect::<Vec<_>>()),
        residual::section(&windows.iter().map(residuals).collect::<Vec<_>>(), "URDF"),
        correlation::section(
            &windows.iter().flat_map(correlations).collect::<Vec<_>>(),
            "identified",
        ),
        parameters::section(&rows(&result)),
    ];
    Page { header, sections }.write(page).unwrap();
}

fn record(simulation: &Simulation, path: &Path) -> Vec<SimulatedSample> {
    let mut log = LogWriter::new(Vec::new(), &simulation.legs).unwrap();
    let samples: Vec<_> = simulation.samples().collect::<Result<_, _>>().unwrap();
    for sample in &samples {
        log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
            .unwrap();
    }
    std::fs::write(path, log.finish().unwrap()).unwrap();
    samples
}

/// `first` is the leg's first joint in the samples.
fn windows_of(
    leg: Leg,
    first: usize,
    samples: &[SimulatedSample],
    result: &Fitted,
) -> [Windows; 3] {
    let names = parameter::names_of_leg(leg);
    let estimates = names
        .iter()
        .map(|(name, _)| result.parameter(name).unwrap());
    let identified: Vec<f64> = estimates.clone().map(|e| e.value).collect();
    let effect = |n: usize| n >= LEG_INERTIAL;
    let urdf: Vec<f64> = estimates
        .enumerate()
        .map(|(n, e)| if effect(n) { 0.0 } else { e.prior })
        .collect();
    let simulated = Simulation {
        effects: typical(&[leg]),
        ..Simulation::new(&[leg])
    }
    .truth();
    let truth_of =
        |(name, _): &(String, _)| simulated.iter().find(|p| p.name == *name).unwrap().value;
    let truth: Vec<f64> = names.iter().map(truth_of).collect();
    let mut joints = JointId::of(leg).map(|joint| Windows {
        joint,
        t: Vec::new(),
        q: Vec::new(),
        dq: Vec::new(),
        measured: Vec::new(),
        columns: Vec::new(),
        urdf: urdf.clone(),
        identified: identified.clone(),
        truth: truth.clone(),
    });
    let base = Transform::identity();
    let mut window: LegWindow<f64> =
        LegWindow::new(go2::leg(leg), base, EFFECTS, plausible(leg), SETTINGS);
    for sample in samples {
        let of_leg = |all: &[f64]| std::array::from_fn(|j| all[first + j]);
        let (q, dq): ([f64; 3], [f64; 3]) = (of_leg(&sample.q), of_leg(&sample.dq));
        let heard = Sample {
            time_us: (sample.t * 1e6).round() as u64,
            q,
            dq,
            tau: of_leg(&sample.tau),
        };
        if window.push(&heard) != Push::Closed {
            continue;
        }
        let rows = window.rows();
        for (j, joint) in joints.iter_mut().enumerate() {
            let mut columns = [0.0; LEG_PARAMETERS];
            for (n, column) in columns[..LEG_INERTIAL].iter_mut().enumerate() {
                *column = rows.inertial[LEG_INERTIAL * j + n];
            }
            let own = LEG_INERTIAL + EFFECTS.len() * j;
            columns[own..own + EFFECTS.len()].copy_from_slice(&rows.effects[j]);
            joint.columns.push(columns);
            joint
                .t
                .push((rows.span_us[0] + rows.span_us[1]) as f64 * 0.5e-6);
            joint.measured.push(rows.torque[j]);
            joint.q.push(q[j]);
            joint.dq.push(dq[j]);
        }
    }
    joints
}

fn torques(windows: &Windows) -> TorqueSeries {
    TorqueSeries {
        joint: windows.joint.name().to_owned(),
        t: windows.t.clone(),
        measured: windows.measured.clone(),
        predicted: vec![
            ("URDF".to_owned(), windows.predicted(&windows.urdf)),
            (
                "identified".to_owned(),
                windows.predicted(&windows.identified),
            ),
        ],
    }
}

fn residuals(windows: &Windows) -> ResidualSeries {
    ResidualSeries {
        joint: windows.joint.name().to_owned(),
        q: windows.q.clone(),
        dq: windows.dq.clone(),
        residual: windows.residual(&windows.urdf),
    }
}

fn correlations(windows: &Windows) -> [Correlation; 2] {
    let residual = windows.residual(&windows.identified);
    let band = 2.576 / (residual.len() as f64).sqrt();
    let of = |input: Option<&str>, other: &[f64]| {
        let lags = 0..50;
        Correlation {
            joint: windows.joint.name().to_owned(),
            input: input.map(str::to_owned),
            lag: lags.clone().map(|k| k as f64 * 0.02).collect(),
            value: lags.map(|k| correlated(&residual, other, k)).collect(),
            band,
        }
    };
    [of(None, &residual), of(Some("q̇"), &windows.dq)]
}

/// Correlation of `y` with `x`, which comes `lag` earlier.
fn correlated(y: &[f64], x: &[f64], lag: usize) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (my, mx) = (mean(y), mean(x));
    let power = |v: &[f64], m: f64| v.iter().map(|v| (v - m).powi(2)).sum::<f64>();
    let product: f64 = y[lag..]
        .iter()
        .zip(x)
        .map(|(y, x)| (y - my) * (x - mx))
        .sum();
    product / (power(y, my) * power(x, mx)).sqrt()
}

/// The error with more and more of the effects, and the noise floor: the error of the true parameters.
fn path(windows: &[Windows]) -> (Vec<Step>, f64) {
    let order = [
        EffectKind::Coulomb,
        EffectKind::Armature,
        EffectKind::Bias,
        EffectKind::Viscous,
    ];
    let rms = |residual: &dyn Fn(&Windows) -> Vec<f64>| {
        let all: Vec<f64> = windows.iter().flat_map(residual).collect();
        (all.iter().map(|r| r * r).sum::<f64>() / all.len() as f64).sqrt()
    };
    let steps = (0..=order.len()).map(|n| Step {
        label: match n {
            0 => "rigid body alone".to_owned(),
            n => format!("+ {}, all joints", order[n - 1].name()),
        },
        joints: Vec::new(),
        rms: rms(&|w| w.residual(&w.with_effects(&order[..n]))),
    });
    let floor = rms(&|w| w.residual(&w.truth));
    (steps.collect(), floor)
}

/// What each identified effect of each joint takes away, over ten blocks of time.
fn gains(windows: &[Windows]) -> Vec<Candidate> {
    const BLOCKS: usize = 10;
    let mut candidates: Vec<Candidate> = windows
        .iter()
        .flat_map(|w| EFFECTS.map(|effect| (w, effect)))
        .map(|(w, effect)| {
            let others: Vec<_> = EFFECTS.into_iter().filter(|&e| e != effect).collect();
            let with = w.residual(&w.identified);
            let without = w.residual(&w.with_effects(&others));
            let block = with.len() / BLOCKS;
            let squares = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>();
            let gains: Vec<f64> = with
                .chunks_exact(block)
                .zip(without.chunks_exact(block))
                .map(|(with, without)| 1.0 - squares(with) / squares(without))
                .collect();
            let n = gains.len() as f64;
            let gain = gains.iter().sum::<f64>() / n;
            let variance = gains.iter().map(|g| (g - gain).powi(2)).sum::<f64>() / (n - 1.0);
            let alike = effect.description().look_alikes.iter();
            Candidate {
                name: parameter::name(effect.name(), w.joint),
                joints: Vec::new(),
                gain,
                gain_std: (variance / n).sqrt(),
                look_alikes: alike.map(|other| format!("{other}:{}", w.joint)).collect(),
            }
        })
        .collect();
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    candidates
}

fn rows(result: &Fitted) -> Vec<ParameterRow> {
    let row = |p: &proprio_host::estimate::ParameterEstimate| ParameterRow {
        name: p.name.clone(),
        unit: p.unit.to_owned(),
        value: p.value,
        std: p.std,
        prior: p.prior,
        prior_std: p.prior_std,
        status: serde_json::to_value(p.status)
            .unwrap()
            .as_str()
            .unwrap()
            .to_owned(),
    };
    result.parameters.iter().map(|p| row(&p.estimate)).collect()
}
