//! A report as its reader meets it: in a real browser, without a network.
//!
//! The page and pictures of it are left in `target/report/` for a look. Without Chromium these tests fail, unless
//! `PROPRIO_SKIP_BROWSER` is set; then they say that they were skipped.
//!
//! `axe-core-4.14.1.min.js.gz` is the accessibility checker of Deque Systems as the npm registry has it, unchanged (Mozilla Public
//! License 2.0; `npm pack axe-core@4.14.1`). It is here because tests must not need a network.

mod choices;
mod data;
mod interaction;
mod look;
mod pages;

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

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

/// What axe-core finds in the page as it is, a line each, and how many of its rules pass.
pub(crate) fn axe(browser: &mut Browser) -> Value {
    let packed = include_bytes!("axe-core-4.14.1.min.js.gz");
    let mut axe = String::new();
    flate2::read::GzDecoder::new(&packed[..])
        .read_to_string(&mut axe)
        .unwrap();
    browser.eval(&format!("{axe}; 1"));
    browser.eval(
        "axe.run().then(({violations, passes}) => ({found: violations.map((v) => \
         `${v.id}: ${v.nodes.slice(0, 3).map((n) => n.html.slice(0, 200)).join(' | ')}`), passes: passes.length}))",
    )
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
