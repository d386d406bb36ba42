//! `proprio monitor --web` as its user meets it: the page in a browser that the test drives, and what is refused.
//!
//! Without Chromium the page's test fails, unless `PROPRIO_SKIP_BROWSER` is set; then it says that it was skipped.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use proprio_tests::browser::Browser;
use proprio_tests::command::{binary, done, folder, proprio, stderr};

use crate::report::axe;

/// Height of the page on a phone at most, px: joints, plots in two columns, six candidates, and as many events as are shown at once.
const HIGHEST_ON_A_PHONE: f64 = 2600.0;

/// A monitor that serves a page.
struct Monitor {
    child: Child,
    /// `127.0.0.1:40123`.
    address: String,
}

impl Monitor {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = Command::new(binary())
            .args(["monitor", "sim", "--web=127.0.0.1:0"])
            .args(arguments)
            .current_dir(folder)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        while !said.contains("http://") {
            assert!(stderr.read_line(&mut said).unwrap() > 0, "{said}");
        }
        let address = said
            .split("http://")
            .nth(1)
            .and_then(|rest| rest.split('/').next());
        Self {
            address: address.unwrap().to_owned(),
            child,
        }
    }

    /// What the server answers to a request.
    fn asked(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }
}

impl Drop for Monitor {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until an expression of the page is true.
fn until(browser: &mut Browser, expression: &str) {
    let start = Instant::now();
    while browser.eval(expression) != true {
        assert!(
            start.elapsed() < Duration::from_secs(120),
            "{expression}: {}",
            browser.eval("document.body.innerText")
        );
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Whether the text of the element with this id has `text`.
fn says(id: &str, text: &str) -> String {
    format!("document.getElementById('{id}').innerText.includes('{text}')")
}

#[test]
fn the_page_shows_what_the_screen_shows_and_does_what_its_keys_do() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let folder = folder();
    let monitor = Monitor::start(folder.path(), &["--speed", "0"]);
    let page = format!("http://{}/", monitor.address);
    browser.open_address(&page);
    until(&mut browser, &says("device", "desktop"));
    until(&mut browser, &says("ranking", "quadratic_drag:FR_calf"));
    until(&mut browser, &says("ranking", "MISSING"));
    until(
        &mut browser,
        &says("events", "FR_calf lacks quadratic_drag"),
    );
    until(&mut browser, &says("joints", "RL_calf"));
    until(&mut browser, &says("buses", "RL"));
    until(&mut browser, &says("link", "0 missed, 0 bad"));
    // The plots live: a residual of each joint, more of it from second to second, and the band.
    let points = "Math.min(...[...document.querySelectorAll('#residuals polyline')].map((line) => line.points.length))";
    assert_eq!(
        browser.eval("document.querySelectorAll('#residuals figure').length"),
        12
    );
    until(&mut browser, &format!("{points} > 12"));
    let now = browser.eval(points).as_f64().unwrap();
    until(&mut browser, &format!("{points} > {now}"));
    until(
        &mut browser,
        "document.querySelectorAll('#residuals .band').length === 12",
    );
    // On a phone and on a desk it is usable by everyone, no wider than the screen, and what gains nothing beyond its error is folded.
    for (width, most) in [(400, HIGHEST_ON_A_PHONE), (1400, f64::INFINITY)] {
        browser.resize(width, 800, width < 800);
        let height = browser.eval("document.documentElement.scrollHeight");
        assert!(height.as_f64().unwrap() <= most, "{height} px at {width}");
        let wider = browser.eval("document.documentElement.scrollWidth - innerWidth");
        assert!(wider.as_f64().unwrap() <= 0.0, "{wider} px at {width}");
        assert_eq!(axe(&mut browser)["found"], serde_json::json!([]), "{width}");
    }
    // What is found missing is added, and then is the model's.
    browser.eval("document.querySelector('[aria-label=\"add quadratic_drag:FR_calf\"]').click()");
    until(
        &mut browser,
        &says("events", "add quadratic_drag:FR_calf: done"),
    );
    // A leg's parameters with their error bars against the CAD.
    browser.eval("document.getElementById('tab-FR').click()");
    until(&mut browser, &says("parameters", "quadratic_drag:FR_calf"));
    until(
        &mut browser,
        "document.querySelectorAll('#parameters .error').length >= 30",
    );
    browser.eval("document.getElementById('tab-robot').click()");
    browser.eval("document.getElementById('save').click()");
    until(
        &mut browser,
        &says("events", "the model is in monitor-1.toml"),
    );
    browser.eval("document.getElementById('reset').click()");
    browser.eval("document.getElementById('reset').click()");
    until(&mut browser, &says("events", "reset: done"));
    browser.eval("document.getElementById('pause').click()");
    until(&mut browser, &says("state", "paused"));
    // Everything that the page asked for is the monitor's own.
    let own = browser
        .requests
        .iter()
        .all(|request| request.starts_with(&page));
    assert!(own, "{:?}", browser.requests);
    assert_eq!(browser.complaints, [""; 0]);
    let shown = done(folder.path(), &["show", "monitor-1.toml"]);
    assert!(shown.contains("quadratic_drag"), "{shown}");
    drop(monitor);
    until(&mut browser, &says("state", "the monitor has ended"));
}

#[test]
fn only_the_page_may_ask_and_a_browser_that_does_nothing_keeps_nobody_waiting() {
    let folder = folder();
    let monitor = Monitor::start(folder.path(), &["--speed", "0"]);
    let address = &monitor.address;
    let page = monitor.asked(&format!("GET / HTTP/1.1\r\nHost: {address}\r\n\r\n"));
    assert!(page.starts_with("HTTP/1.1 200 OK"), "{page}");
    assert!(
        page.contains("Content-Security-Policy: default-src 'none';"),
        "{page}"
    );
    let ask = |host: &str, origin: &str| {
        monitor.asked(&format!(
            "POST /ask HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nContent-Length: 5\r\n\r\nreset"
        ))
    };
    let own = format!("http://{address}");
    assert!(ask(address, &own).starts_with("HTTP/1.1 204"));
    for (host, origin) in [
        (&address[..], "http://elsewhere.org"),
        ("elsewhere.org", &own[..]),
    ] {
        let answer = ask(host, origin);
        assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    }
    // Nonsense, a stream that is not read, and one that says nothing.
    let nonsense = "POST /ask HTTP/1.1\r\nContent-Length: many\r\n\r\n";
    assert!(monitor.asked(nonsense).starts_with("HTTP/1.1 400"));
    let mut idle = TcpStream::connect(address).unwrap();
    let events = format!("GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n");
    idle.write_all(events.as_bytes()).unwrap();
    let _silent = TcpStream::connect(address).unwrap();
    let mut stream = BufReader::new(TcpStream::connect(address).unwrap());
    stream.get_mut().write_all(events.as_bytes()).unwrap();
    let states = stream.lines().map(Result::unwrap);
    let states = states.filter_map(|line| {
        let text = line.strip_prefix("data: ")?;
        Some(serde_json::from_str::<serde_json::Value>(text).unwrap())
    });
    let seconds: Vec<f64> = states
        .take(8)
        .map(|state| state["seconds"].as_f64().unwrap())
        .collect();
    assert!(seconds[7] > seconds[1], "{seconds:?}");
}

#[test]
fn a_port_that_is_taken_is_said_in_words() {
    let folder = folder();
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = other.local_addr().unwrap().to_string();
    let web = format!("--web={address}");
    let output = proprio(folder.path(), &["monitor", "sim", &web]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let taken = format!("{address}: another program uses this port");
    assert!(
        said.contains(&taken) && said.contains("hint: take another port"),
        "{said}"
    );
    let output = proprio(folder.path(), &["monitor", "sim", "--web=here"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    // An address that this machine does not have.
    let output = proprio(folder.path(), &["monitor", "sim", "--web=192.0.2.1:7700"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("an address of this machine"), "{said}");
}
