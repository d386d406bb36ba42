//! What a report is given: hostile names, broken numbers, long logs.

use proprio_host::report::candidates::Candidate;
use proprio_host::report::correlation::Correlation;
use proprio_host::report::parameters::ParameterRow;
use proprio_host::report::residual::ResidualSeries;
use proprio_host::report::torque::TorqueSeries;
use proprio_host::report::waterfall::Step;
use proprio_host::report::{Finding, Header, LogFile, Moment, Page};
use proprio_host::report::{candidates, correlation, parameters, residual, torque, waterfall};
use proprio_tests::browser::Browser;
use serde_json::from_value;

use super::{MARKS, folder};

/// Names and numbers that a careless page would stumble over.
#[test]
fn hostile_names_and_broken_numbers_are_only_shown() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let evil = "</script><script>window.broken=1</script><img src=x onerror=window.broken=1>\" '<!-- &amp; %{x} @model-1";
    let name = || evil.to_owned();
    let broken = vec![1.0, f64::NAN, f64::INFINITY, -2.0, f64::NEG_INFINITY, 3.0];
    // Long enough to open on its worst stretch, and to name the model there.
    let time: Vec<f64> = (0..6).map(|k| 2.0 * f64::from(k)).collect();
    let page = Page {
        header: Header {
            title: name(),
            findings: vec![Finding {
                text: name(),
                moment: Some(Moment {
                    joint: name(),
                    time: 4.0,
                }),
            }],
            command: name(),
            logs: vec![LogFile {
                path: name(),
                sha256: name(),
            }],
            headline: name(),
            next: vec![name()],
            ..Header::default()
        },
        sections: vec![
            waterfall::section(
                &[
                    Step {
                        label: name(),
                        joints: vec![name()],
                        rms: 1.0,
                    },
                    Step {
                        label: name(),
                        joints: vec![name()],
                        rms: f64::NAN,
                    },
                ],
                Some(f64::NAN),
            ),
            candidates::section(&[Candidate {
                name: name(),
                joints: vec![name()],
                gain: 0.5,
                gain_std: f64::INFINITY,
                look_alikes: vec![name()],
            }]),
            torque::section(&[TorqueSeries {
                joint: name(),
                t: time.clone(),
                measured: broken.clone(),
                predicted: vec![(name(), time.clone())],
            }]),
            residual::section(
                &[ResidualSeries {
                    joint: name(),
                    q: broken.clone(),
                    dq: time.clone(),
                    residual: broken.clone(),
                }],
                &name(),
            ),
            correlation::section(
                &[Correlation {
                    joint: name(),
                    input: Some(name()),
                    lag: time,
                    value: broken,
                    band: f64::NAN,
                }],
                &name(),
            ),
            parameters::section(&[ParameterRow {
                name: name(),
                unit: name(),
                value: f64::NAN,
                std: f64::NAN,
                prior: 0.0,
                prior_std: f64::INFINITY,
                status: name(),
            }]),
        ],
    };
    let path = folder().join("hostile.html");
    page.write(&path).unwrap();
    browser.open(&path);
    assert_eq!(browser.eval("window.broken ?? 0"), 0);
    assert_eq!(browser.eval("document.images.length"), 0);
    assert_eq!(
        browser.eval("document.querySelector('h1').textContent"),
        evil
    );
    assert_eq!(
        browser.eval("document.querySelector('#torque figcaption').textContent"),
        evil
    );
    assert_eq!(
        browser.eval("document.querySelector('#parameters td').textContent"),
        evil
    );
    let how = browser.eval("document.querySelector('#torque .how').textContent");
    assert!(how.as_str().unwrap().contains(evil), "{how}");
    let label = browser.eval("document.querySelector('#waterfall .ytick text').textContent");
    let letters = |text: &str| text.replace([' ', '\u{a0}'], "");
    assert_eq!(letters(label.as_str().unwrap()), letters(evil));
    assert_eq!(browser.complaints, [""; 0]);
    assert_eq!(browser.requests, [""; 0]);
    let marks: Vec<u64> = from_value(browser.eval(MARKS)).unwrap();
    assert_eq!(marks.len(), 6);
    assert!(marks.iter().all(|&marks| marks > 0), "{marks:?}");
}

/// Twelve joints at 500 Hz with two models: every sample differs.
#[test]
fn a_long_log_makes_a_page_for_an_email() {
    let series = |seconds: usize| {
        let t: Vec<f64> = (0..500 * seconds).map(|k| k as f64 * 0.002).collect();
        let wave = |rate: f64| {
            t.iter()
                .map(|t| (rate * t).sin() * (rate * 77.7 * t).cos())
                .collect()
        };
        let joint = |n: usize| TorqueSeries {
            joint: format!("joint {n}"),
            t: t.clone(),
            measured: wave(1.0 + n as f64),
            predicted: vec![("a".to_owned(), wave(2.1)), ("b".to_owned(), wave(3.3))],
        };
        (0..12).map(joint).collect::<Vec<_>>()
    };
    let path = folder().join("long.html");
    let size = |seconds| {
        let sections = vec![torque::section(&series(seconds))];
        Page {
            header: Header::default(),
            sections,
        }
        .write(&path)
        .unwrap();
        std::fs::metadata(&path).unwrap().len()
    };
    let (short, long) = (size(20), size(600));
    println!("20 s: {short} bytes; 600 s: {long} bytes");
    assert!(short < 8_000_000 && long < 8_000_000, "{short}, {long}");
    let Some(mut browser) = Browser::start() else {
        return;
    };
    browser.resize(1400, 1000, false);
    browser.open(&path);
    println!(
        "600 s: drawn after {} ms",
        browser.eval("Math.round(performance.now())")
    );
    assert_eq!(browser.complaints, [""; 0]);
}
