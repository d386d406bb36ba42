//! How a report looks: in light and dark, on a phone, on paper.

use proprio_tests::browser::Browser;
use serde_json::{from_value, json};

use super::{example, folder, open, pictures};

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
