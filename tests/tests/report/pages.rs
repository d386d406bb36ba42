//! Every page of every command: no wider than the screen, short at first, with a headline, and usable by everyone.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use proprio_tests::browser::Browser;
use proprio_tests::command::done;
use serde_json::{Value, json};

use super::{axe, folder};

/// Window sizes, px: of a phone and of a desk.
const SIZES: [(u32, u32); 2] = [(400, 800), (1400, 900)];
/// Greatest height of a page as it opens on a phone, px: two screens.
const FIRST_VIEW: f64 = 1600.0;

/// A page as it opens, and with all of it unfolded.
struct Measured {
    /// Height as it opens, px.
    height: f64,
    /// How far the header reaches, px.
    header: f64,
    /// Height of all of it, px.
    unfolded: f64,
    /// How much wider than the window it is, px.
    overflow: f64,
    /// What axe-core complains of.
    violations: Vec<Value>,
}

/// The pages, made once: their commands are those of a newcomer, on logs that simulate what they need.
fn pages() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let folder = folder().join("pages");
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots");
        std::fs::copy(robots.join("arm.urdf"), folder.join("arm.urdf")).unwrap();
        for command in [
            "simulate --legs FR --typical --duration 8 --hide spring:FR_thigh=4 -o log.csv",
            "add viscous coulomb armature bias -m model.toml",
            "compare log.csv -m model.toml --html compare.html",
            "compare log.csv -m model.toml -m model.toml --html models.html",
            "diagnose log.csv --html diagnose.html",
            "identify log.csv -m model.toml -o fit.toml --html identify.html",
            "validate log.csv -m fit.toml --html validate.html",
            "compare --rollout log.csv -m fit.toml --html rollout.html",
            "diagnose log.csv -m found.toml --apply --html applied.html",
            "simulate --walk trot --typical --inertia-error 0.03 --duration 5 -o walk.csv",
            "compare --free-base walk.csv --html compare-walk.html",
            "identify --free-base walk.csv -o walk.toml --html identify-walk.html",
            "excite --legs FR --starts 1 --duration 4 -o motion.csv --html excite.html",
            "add viscous coulomb armature -m arm.toml --urdf arm.urdf --hold slide=0.0",
            "excite -m arm.toml --starts 1 --duration 4 -o arm-motion.csv --html excite-arm.html",
            "simulate --poses 20 -m arm.toml -o poses.csv",
            "calibrate poses.csv -m arm.toml --html calibrate.html",
            "simulate --frf -m arm.toml --hide elasticity:elbow=900,damping=0.8 --hide coulomb=0.8 -o frf.csv",
            "frf frf.csv -m arm.toml --html frf.html",
        ] {
            done(&folder, &command.split_whitespace().collect::<Vec<_>>());
        }
        folder
    };
    FOLDER.get_or_init(make).clone()
}

/// The pages of a folder by their names.
fn all(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut all: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "html"))
        .collect();
    all.sort();
    all
}

fn number(browser: &mut Browser, expression: &str) -> f64 {
    browser.eval(expression).as_f64().unwrap()
}

/// Opens a page at a size, measures it, unfolds it and measures again.
fn measure(browser: &mut Browser, page: &Path, (width, height): (u32, u32)) -> Measured {
    const HEIGHT: &str = "document.documentElement.scrollHeight";
    const OVERFLOW: &str =
        "Math.max(document.documentElement.scrollWidth, document.body.scrollWidth) - innerWidth";
    browser.resize(width, height, width < 800);
    browser.prefer("light");
    browser.open(page);
    let opened = number(browser, HEIGHT);
    let header = number(
        browser,
        "document.querySelector('header').getBoundingClientRect().bottom + scrollY",
    );
    let overflow = number(browser, OVERFLOW);
    browser.eval(UNFOLD);
    Measured {
        height: opened,
        header,
        unfolded: number(browser, HEIGHT),
        overflow: overflow.max(number(browser, OVERFLOW)).max(0.0),
        violations: axe(browser)["found"].as_array().unwrap().clone(),
    }
}

/// Opens every fold and waits until each plot in it is drawn.
const UNFOLD: &str = "(async () => { for (const d of document.querySelectorAll('details')) d.open = true; \
     for (let k = 0; k < 300 && document.querySelector('.plot:not(.js-plotly-plot)'); k++) await new Promise((done) => setTimeout(done, 50)); \
     await new Promise((done) => setTimeout(done, 300)); })()";

#[test]
fn every_page_fits_and_begins_with_a_headline() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let folder = pages();
    for page in all(&folder) {
        let name = page.file_name().unwrap().to_str().unwrap();
        for size in SIZES {
            let own = measure(&mut browser, &page, size);
            let at = format!("{name} at {} px", size.0);
            assert!(own.overflow <= 0.0, "{at}: {} px too wide", own.overflow);
            assert_eq!(json!(own.violations), json!([]), "{at}");
            if size.0 == SIZES[0].0 {
                assert!(own.height <= FIRST_VIEW, "{at}: {} px high", own.height);
            }
            let headline = browser.eval("document.querySelector('.headline').textContent");
            assert!(!headline.as_str().unwrap().is_empty(), "{at}");
            // Every plot can be saved as a picture.
            let plots = browser.eval("document.querySelectorAll('.plot').length");
            let buttons = browser.eval("document.querySelectorAll('.modebar-btn[data-attr=\"toImage\"], .modebar-btn[data-title^=\"Download\"]').length");
            assert_eq!(plots, buttons, "{at}");
            let picture = format!("{}-{}.png", name.trim_end_matches(".html"), size.0);
            browser.screenshot("header", &folder.join(picture));
        }
        assert_eq!(browser.complaints, [""; 0], "{name}");
        assert_eq!(browser.requests, [""; 0], "{name}");
    }
}

/// What a page tells to do next is not what was done.
#[test]
fn a_page_of_what_is_applied_tells_to_compare() {
    let page = std::fs::read_to_string(pages().join("applied.html")).unwrap();
    let (_, next) = page.split_once("<code id=\"next-0\">").unwrap();
    let next = next.split('<').next().unwrap();
    assert_eq!(next, "proprio compare log.csv -m found.toml");
}

/// From the words to the plot: a finding's link opens its joint's plot at its time, with a cursor in every plot.
#[test]
fn a_finding_leads_to_its_moment() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    browser.resize(1400, 900, false);
    browser.open(&pages().join("compare.html"));
    let shown = browser.eval(
        "(async () => { const link = document.querySelector('.moment'); link.click(); \
         await new Promise((done) => setTimeout(done, 3000)); \
         const plots = [...document.querySelectorAll('#torque .plot')]; \
         const own = plots.find((plot) => plot.parentElement.textContent.startsWith(link.dataset.joint)).getBoundingClientRect(); \
         return {time: Number(link.dataset.time), ranges: plots.map((plot) => plot._fullLayout.xaxis.range), \
           cursors: document.querySelectorAll('#torque .cursor:not([hidden])').length, \
           seen: own.top >= 0 && own.bottom <= innerHeight}; })()",
    );
    let time = shown["time"].as_f64().unwrap();
    assert_eq!(shown["ranges"], json!(vec![[time - 1.0, time + 1.0]; 3]));
    assert_eq!(shown["cursors"], 3);
    assert_eq!(shown["seen"], true);
    assert_eq!(browser.complaints, [""; 0]);
}

/// Writes `tests/pages.md`: pages of the same names in the two folders that `PROPRIO_PAGES` names, the earlier build's first.
#[test]
#[ignore = "writes a table of two builds' pages"]
fn the_table() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let folders = std::env::var("PROPRIO_PAGES").expect("PROPRIO_PAGES=before:after");
    let (before, after) = folders.split_once(':').expect("two folders");
    let mut text = String::from(
        "# Pages\n\nMade by `PROPRIO_PAGES=before:after cargo test -p proprio-tests --test all report::pages::the_table -- --ignored`, which opens each page of two \
         folders in Chromium. *as it opens*: height of the whole page, px, with what is folded folded; *header*: how far headline, findings, command and \
         drawing reach; *unfolded*: height of all of it; *too wide*: px beyond the window, folded or not; *axe*: kinds of findings of axe-core, unfolded.\n\n\
         | page | width | as it opens | header | unfolded | too wide | axe |\n|---|---|---|---|---|---|---|\n",
    );
    for page in all(Path::new(after)) {
        let name = page.file_name().unwrap();
        for size in SIZES {
            let is = measure(&mut browser, &page, size);
            let was = measure(&mut browser, &Path::new(before).join(name), size);
            writeln!(
                text,
                "| {} | {} | {} → {} | {} → {} | {} → {} | {} → {} | {} → {} |",
                page.file_stem().unwrap().display(),
                size.0,
                was.height,
                is.height,
                was.header.round(),
                is.header.round(),
                was.unfolded,
                is.unfolded,
                was.overflow,
                is.overflow,
                was.violations.len(),
                is.violations.len(),
            )
            .unwrap();
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("pages.md");
    std::fs::write(path, text).unwrap();
}
