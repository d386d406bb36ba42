//! A report as its reader meets it: in a real browser, without a network.
//!
//! The page and pictures of it are left in `target/report/` for a look. Without Chromium these tests fail, unless
//! `PROPRIO_SKIP_BROWSER` is set; then they say that they were skipped.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use proprio::report::candidates::Candidate;
use proprio::report::correlation::Correlation;
use proprio::report::parameters::ParameterRow;
use proprio::report::residual::ResidualSeries;
use proprio::report::torque::TorqueSeries;
use proprio::report::waterfall::Step;
use proprio::report::{Header, LogFile, Page};
use proprio::report::{candidates, correlation, parameters, residual, torque, waterfall};
use proprio_core::go2::Leg;
use proprio_tests::browser::Browser;
use proprio_tests::report_example;
use serde_json::{Value, from_value, json};

const SECTIONS: [&str; 6] = [
    "waterfall",
    "candidates",
    "torque",
    "residual",
    "correlation",
    "parameters",
];

/// Marks in each plot: lines, points, bars.
const MARKS: &str = "[...document.querySelectorAll('.plot')].map((plot) => plot.querySelectorAll(\
                     '.scatterlayer .js-line, .scatterlayer .point, .barlayer .point').length)";

/// `target/report`.
fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../target/report");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The example of one leg, written once.
fn example() -> PathBuf {
    static PAGE: OnceLock<PathBuf> = OnceLock::new();
    let write = || {
        let page = folder().join("one_leg.html");
        report_example::write(&page, &[Leg::FR]);
        page
    };
    PAGE.get_or_init(write).clone()
}

/// A browser on a desk, in light, with the page open.
fn open(page: &Path) -> Option<Browser> {
    let mut browser = Browser::start()?;
    browser.resize(1400, 1000, false);
    browser.prefer("light");
    browser.open(page);
    Some(browser)
}

fn pictures(browser: &mut Browser, prefix: &str) {
    for id in SECTIONS {
        browser.screenshot(
            &format!("#{id}"),
            &folder().join(format!("{prefix}-{id}.png")),
        );
    }
    browser.screenshot("header", &folder().join(format!("{prefix}-header.png")));
}

#[test]
fn it_opens_offline_and_every_plot_has_marks() {
    let page = folder().join("example.html");
    report_example::write(&page, &Leg::ALL);
    let Some(mut browser) = open(&page) else {
        return;
    };
    let marks: Vec<u64> = from_value(browser.eval(MARKS)).unwrap();
    // Path, gains, and for each joint a torque, two residuals, two correlations.
    assert_eq!(marks.len(), 2 + 12 * 5);
    assert!(marks.iter().all(|&marks| marks > 0), "{marks:?}");
    assert_eq!(browser.complaints, [""; 0]);
    assert_eq!(browser.requests, [""; 0]);
    let loaded = browser.eval("performance.getEntriesByType('resource').map((e) => e.name)");
    assert_eq!(loaded, json!([]));
    pictures(&mut browser, "light");
}

/// The proof that the test above would notice: a page that does ask is caught, by its policy and by the browser.
#[test]
fn a_request_and_an_error_are_noticed() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    browser.eval("fetch('https://example.org/a').catch(() => 0)");
    assert!(
        browser
            .complaints
            .iter()
            .any(|c| c.contains("Content Security Policy"))
    );
    assert_eq!(browser.requests, [""; 0]);
    let page = folder().join("careless.html");
    let text = "<!DOCTYPE html><html data-ready=yes><script>throw 1</script><img src=https://example.org/b>";
    std::fs::write(&page, text).unwrap();
    browser.complaints.clear();
    browser.open(&page);
    browser.eval("new Promise((done) => setTimeout(done, 200))");
    std::fs::remove_file(&page).unwrap();
    assert_eq!(browser.requests, ["https://example.org/b"]);
    assert!(browser.complaints.iter().any(|c| c.contains("Uncaught")));
}

/// The x range that each torque plot shows.
fn ranges(browser: &mut Browser) -> Vec<[f64; 2]> {
    let ranges =
        "[...document.querySelectorAll('#torque .plot')].map((p) => p._fullLayout.xaxis.range)";
    from_value(browser.eval(ranges)).unwrap()
}

#[test]
fn zooming_one_joint_zooms_all() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    let opening = ranges(&mut browser);
    assert!(
        opening.iter().all(|range| *range == opening[0]),
        "{opening:?}"
    );
    let area: [f64; 4] = from_value(browser.eval(
        "(() => { const drag = document.querySelector('#torque .nsewdrag'); drag.scrollIntoView({block: 'center'}); \
         const r = drag.getBoundingClientRect(); return [r.x, r.y, r.width, r.height]; })()",
    ))
    .unwrap();
    let [x, y, width, height] = area;
    // A drag across the middle third, level: it zooms in time alone.
    let mouse = |browser: &mut Browser, kind: &str, share: f64| {
        browser.call(
            "Input.dispatchMouseEvent",
            json!({"type": kind, "x": x + share * width, "y": y + 0.5 * height, "button": "left",
                   "buttons": 1, "clickCount": 1}),
        );
    };
    mouse(&mut browser, "mousePressed", 1.0 / 3.0);
    mouse(&mut browser, "mouseMoved", 0.5);
    mouse(&mut browser, "mouseMoved", 2.0 / 3.0);
    mouse(&mut browser, "mouseReleased", 2.0 / 3.0);
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    let zoomed = ranges(&mut browser);
    let [start, end] = opening[0];
    let third = (end - start) / 3.0;
    for [from, to] in &zoomed {
        assert!((from - (start + third)).abs() < 0.1 * third, "{zoomed:?}");
        assert!((to - (end - third)).abs() < 0.1 * third, "{zoomed:?}");
    }
    // The stretch stays when the theme changes, until all is asked for.
    browser.eval("document.getElementById('theme').click()");
    assert_eq!(ranges(&mut browser), zoomed);
    browser.screenshot("#torque", &folder().join("zoomed-torque.png"));
    browser.eval("document.querySelector('#torque .whole').click()");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    for [from, to] in ranges(&mut browser) {
        assert!(from < 0.5 && to > 19.5, "{from} to {to}");
    }
    assert_eq!(browser.complaints, [""; 0]);
}

/// Colours of the ground, of a measured line, and of a number at an axis.
const COLOURS: &str = "[getComputedStyle(document.body).backgroundColor, \
                       getComputedStyle(document.querySelector('#torque .js-line')).stroke, \
                       getComputedStyle(document.querySelector('#torque .xtick text')).fill]";

/// Least contrast (WCAG 2, section 1.4.3) of each colour of the style sheet with any of the grounds.
const CONTRASTS: &str = "((names, grounds) => { const probe = document.body.appendChild(document.createElement('i')); \
    const light = (name) => { probe.style.color = `var(--${name})`; \
      const rgb = getComputedStyle(probe).color.match(/[0-9.]+/g).slice(0, 3).map((v) => v / 255) \
        .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); \
      return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }; \
    const ratio = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05); \
    const found = names.map((n) => Math.min(...grounds.map((g) => ratio(light(n), light(g))))); \
    probe.remove(); return found; })";

/// Text stands out by 4.5, what is drawn by 3, from all it is drawn on.
fn assert_readable(browser: &mut Browser) {
    let lines = [
        "measured", "model-1", "model-2", "model-3", "model-4", "bar", "point",
    ];
    for (names, grounds, least) in [
        (
            json!(["text", "quiet", "link"]),
            json!(["ground", "raised"]),
            4.5,
        ),
        (json!(lines), json!(["ground"]), 3.0),
        (json!(["model-1"]), json!(["band"]), 3.0),
        (json!(["limit"]), json!(["ground", "bar", "removed"]), 3.0),
    ] {
        let asked = format!("{CONTRASTS}({names}, {grounds})");
        let ratios: Vec<f64> = from_value(browser.eval(&asked)).unwrap();
        assert!(
            ratios.iter().all(|&ratio| ratio >= least),
            "{names}: {ratios:?}"
        );
    }
}

#[test]
fn dark_and_light_change_every_colour_and_both_are_readable() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    let light: [String; 3] = from_value(browser.eval(COLOURS)).unwrap();
    assert_readable(&mut browser);
    browser.prefer("dark");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    let dark: [String; 3] = from_value(browser.eval(COLOURS)).unwrap();
    for (light, dark) in light.iter().zip(&dark) {
        assert_ne!(light, dark);
    }
    assert_readable(&mut browser);
    pictures(&mut browser, "dark");
    browser.eval("document.getElementById('theme').click()");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    assert_eq!(browser.eval(COLOURS), json!(light));
    assert_eq!(browser.complaints, [""; 0]);
}

#[test]
fn a_phone_shows_it_without_scrolling_sideways() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    browser.resize(390, 844, true);
    browser.prefer("light");
    browser.open(&example());
    let width =
        browser.eval("Math.max(document.documentElement.scrollWidth, document.body.scrollWidth)");
    assert_eq!(width, 390);
    let widest = browser.eval(
        "Math.max(...[...document.querySelectorAll('.plot svg')].map((s) => s.getBoundingClientRect().right))",
    );
    assert!(widest.as_f64().unwrap() <= 390.0, "{widest}");
    pictures(&mut browser, "phone");
    // Turned on its side it draws for the new width.
    browser.resize(844, 390, true);
    browser.eval("new Promise((done) => setTimeout(done, 800))");
    let fits = browser.eval(
        "[...document.querySelectorAll('.plot')].every((p) => p._fullLayout.width === p.clientWidth)",
    );
    assert_eq!(fits, true);
    assert_eq!(browser.complaints, [""; 0]);
}

#[test]
fn it_prints_in_light_and_comes_back() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    let light = browser.eval(COLOURS);
    browser.prefer("dark");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    let dark = browser.eval(COLOURS);
    browser.eval(&format!(
        "addEventListener('beforeprint', () => {{ window.printed = {COLOURS}; \
         window.tooWide = [...document.querySelectorAll('.plot')].filter((p) => p._fullLayout.width !== p.clientWidth).length; }})"
    ));
    let pdf = browser.pdf();
    std::fs::write(folder().join("example.pdf"), &pdf).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    let text = String::from_utf8_lossy(&pdf);
    let pages = text.matches("/Type /Page\n").count();
    assert!((3..30).contains(&pages), "{pages} pages");
    assert_eq!(browser.eval("window.printed"), light);
    assert_eq!(browser.eval("window.tooWide"), 0);
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    assert_eq!(browser.eval(COLOURS), dark);
    assert_eq!(browser.complaints, [""; 0]);
}

#[test]
fn legend_and_tables_do_what_they_offer() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    let lines = "document.querySelectorAll('#torque .js-line').length";
    assert_eq!(browser.eval(lines), 9);
    browser.eval("document.querySelector('#torque [data-trace=\"1\"]').click()");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    assert_eq!(browser.eval(lines), 6);

    let rows: Value = browser.eval(
        "(() => { const box = document.querySelector('#parameters .table'); \
         const input = box.querySelector('input'); input.value = 'coulomb identified'; \
         input.dispatchEvent(new Event('input')); \
         box.querySelectorAll('th button')[1].click(); \
         return [...box.querySelectorAll('tbody tr')].filter((r) => r.offsetParent) \
           .map((r) => [r.cells[0].textContent, Number(r.cells[1].dataset.value)]); })()",
    );
    let rows: Vec<(String, f64)> = from_value(rows).unwrap();
    assert_eq!(rows.len(), 3);
    assert!(
        rows.iter().all(|(name, _)| name.starts_with("coulomb:")),
        "{rows:?}"
    );
    assert!(rows.is_sorted_by(|a, b| a.1 <= b.1), "{rows:?}");
}

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
            findings: vec![name()],
            command: name(),
            logs: vec![LogFile {
                path: name(),
                sha256: name(),
            }],
        },
        sections: vec![
            waterfall::section(
                &[
                    Step {
                        label: name(),
                        rms: 1.0,
                    },
                    Step {
                        label: name(),
                        rms: f64::NAN,
                    },
                ],
                Some(f64::NAN),
            ),
            candidates::section(&[Candidate {
                name: name(),
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
    assert_eq!(label, evil);
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
