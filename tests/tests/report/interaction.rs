//! What a reader does with a report: zoom, filter, sort.

use serde_json::{Value, from_value, json};

use proprio_tests::browser::Browser;

use super::{example, folder, open};

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

#[test]
fn legend_and_tables_do_what_they_offer() {
    let Some(mut browser) = open(&example()) else {
        return;
    };
    let lines = "document.querySelectorAll('#torque .js-line').length";
    // Measured, two models and the residual of three joints.
    assert_eq!(browser.eval(lines), 12);
    browser.eval("document.querySelector('#torque [data-trace=\"1\"]').click()");
    browser.eval("new Promise((done) => setTimeout(done, 500))");
    assert_eq!(browser.eval(lines), 9);

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
