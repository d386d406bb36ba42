//! A report as its reader meets it: in a real browser, without a network.
//!
//! The page and pictures of it are left in `target/report/` for a look.

use std::path::PathBuf;
use std::sync::OnceLock;

use proprio::report::{
    Header, LogFile, Page, candidates, correlation, parameters, torque, waterfall,
};
use proprio_tests::browser::Browser;
use proprio_tests::report_example;

/// `target/report`.
fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../target/report");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The example, written once.
fn example() -> PathBuf {
    static PAGE: OnceLock<PathBuf> = OnceLock::new();
    let write = || {
        let page = folder().join("example.html");
        report_example::write(&page);
        page
    };
    PAGE.get_or_init(write).clone()
}

#[test]
fn it_opens_offline_and_every_plot_has_marks() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    browser.resize(1400, 1000, false);
    browser.open(&example());
    let marks = browser.eval(
        "[...document.querySelectorAll('.plot')].map((plot) => plot.querySelectorAll(\
         '.scatterlayer .js-line, .scatterlayer .point, .barlayer .point').length)",
    );
    let marks: Vec<u64> = serde_json::from_value(marks).unwrap();
    // Path, gains, and for each joint a torque, two residuals, two correlations.
    assert_eq!(marks.len(), 2 + 12 * 5);
    assert!(marks.iter().all(|&marks| marks > 0), "{marks:?}");
    assert_eq!(browser.complaints, [""; 0]);
    assert_eq!(browser.requests, [""; 0]);
    let loaded =
        browser.eval("performance.getEntriesByType('resource').map((entry) => entry.name)");
    assert_eq!(loaded, serde_json::json!([]));
    for id in [
        "waterfall",
        "candidates",
        "torque",
        "residual",
        "correlation",
        "parameters",
    ] {
        browser.screenshot(&format!("#{id}"), &folder().join(format!("light-{id}.png")));
    }
    browser.screenshot("header", &folder().join("light-header.png"));
}
