//! A real browser, headless, driven over the DevTools protocol.
//!
//! Chromium speaks it through a pair of pipes (`--remote-debugging-pipe`): JSON with a zero byte after each message, no
//! port, no websocket. <https://chromedevtools.github.io/devtools-protocol/> lists what can be said.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Longest silence of the browser: a loaded machine draws slowly.
const PATIENCE: Duration = Duration::from_secs(120);

/// A browser with one tab, and what went wrong in it. It ends with this value.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    /// Identifier of the last message.
    last: u64,
    /// The tab's.
    session: Option<String>,
    /// What the page complained of: exceptions, errors in the console, violations of its policy.
    pub complaints: Vec<String>,
    /// Addresses that the page asked for, other than files; they were refused, but for the server's that was
    /// [opened](Self::open_address).
    pub requests: Vec<String>,
    /// What the addresses that may be asked for begin with.
    allowed: String,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts Chromium with an empty profile. None, and a line that says so, if it is not installed and
    /// `PROPRIO_SKIP_BROWSER` is set.
    ///
    /// # Panics
    /// If it is not installed or does not start.
    pub fn start() -> Option<Self> {
        let names = ["chromium", "chromium-browser", "google-chrome"];
        let is_there = |name: &&str| {
            let asked = Command::new(name).arg("--version").output();
            asked.is_ok_and(|output| output.status.success())
        };
        let Some(program) = names.into_iter().find(is_there) else {
            assert!(
                std::env::var_os("PROPRIO_SKIP_BROWSER").is_some(),
                "chromium is missing: install Debian's package `chromium`, or set PROPRIO_SKIP_BROWSER"
            );
            println!("SKIPPED: no chromium (PROPRIO_SKIP_BROWSER is set)");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        // The protocol's pipes are descriptors 3 and 4, which the shell makes of the standard ones.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>&1"])
            .args(["sh", program, "--remote-debugging-pipe", "--headless"])
            .args([
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
            ])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
            ])
            .args([
                "--disable-sync",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
            ])
            // A mouse, which a machine without a screen has not: hover types 2, pointer types 4 of Blink's settings.
            .arg(
                "--blink-settings=primaryHoverType=2,availableHoverTypes=2,primaryPointerType=4,\
                 availablePointerTypes=4",
            )
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let to = child.stdin.take().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let (sender, from) = channel();
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while output
                .read_until(0, &mut message)
                .is_ok_and(|read| read > 0)
            {
                message.pop();
                let parsed = serde_json::from_slice(&message).unwrap_or(Value::Null);
                message.clear();
                if sender.send(parsed).is_err() {
                    return;
                }
            }
        });
        let mut browser = Self {
            child,
            to,
            from,
            last: 0,
            session: None,
            complaints: Vec::new(),
            requests: Vec::new(),
            allowed: "file://".to_owned(),
            _profile: profile,
        };
        browser.open_tab();
        Some(browser)
    }

    fn open_tab(&mut self) {
        let target =
            self.call("Target.createTarget", json!({"url": "about:blank"}))["targetId"].take();
        let attach = json!({"targetId": target, "flatten": true});
        let session = self.call("Target.attachToTarget", attach);
        self.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log"] {
            self.call(&format!("{domain}.enable"), json!({}));
        }
        // Every request comes by here first.
        self.call("Fetch.enable", json!({"patterns": [{"urlPattern": "*"}]}));
    }

    /// Opens a page of proprio and waits until it has drawn everything.
    ///
    /// # Panics
    /// If it does not.
    pub fn open(&mut self, page: &Path) {
        self.go(&format!(
            "file://{}",
            page.canonicalize().unwrap().display()
        ));
    }

    /// Opens a page that a server of this machine serves, from `http://` to the slash, and waits until it has drawn everything. Only
    /// that server's addresses may be asked for from then on.
    ///
    /// # Panics
    /// If it does not.
    pub fn open_address(&mut self, address: &str) {
        self.allowed = address.to_owned();
        self.go(address);
    }

    fn go(&mut self, address: &str) {
        self.call("Page.navigate", json!({"url": address}));
        let ready = "new Promise((done) => { const look = () => document.documentElement?.dataset.ready ? \
                     done(document.documentElement.dataset.ready) : setTimeout(look, 20); look(); })";
        let state = self.eval(ready);
        assert_eq!(state, "yes", "{:?}", self.complaints);
    }

    /// The value of a JavaScript expression; a promise is awaited.
    ///
    /// # Panics
    /// If it throws.
    pub fn eval(&mut self, expression: &str) -> Value {
        let parameters =
            json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let mut result = self.call("Runtime.evaluate", parameters);
        assert!(
            result.get("exceptionDetails").is_none(),
            "{expression}: {}",
            result["exceptionDetails"]
        );
        result["result"]["value"].take()
    }

    /// The window's size, px, and whether it is a phone's.
    pub fn resize(&mut self, width: u32, height: u32, phone: bool) {
        let size = json!({"width": width, "height": height, "mobile": phone, "deviceScaleFactor": if phone { 2 } else { 1 }});
        self.call("Emulation.setDeviceMetricsOverride", size);
        self.call(
            "Emulation.setTouchEmulationEnabled",
            json!({"enabled": phone}),
        );
    }

    /// What the system prefers: `light` or `dark`.
    pub fn prefer(&mut self, scheme: &str) {
        let features = [json!({"name": "prefers-color-scheme", "value": scheme})];
        self.call("Emulation.setEmulatedMedia", json!({"features": features}));
    }

    /// Writes a picture of the element that the selector finds to `path`.
    ///
    /// # Panics
    /// If there is none.
    pub fn screenshot(&mut self, selector: &str, path: &Path) {
        let mut clip = self.eval(&format!(
            "(() => {{ const r = document.querySelector('{selector}').getBoundingClientRect(); \
             return {{x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height}}; }})()"
        ));
        clip["scale"] = json!(1);
        let wanted = json!({"format": "png", "captureBeyondViewport": true, "clip": clip});
        let picture = self.call("Page.captureScreenshot", wanted);
        std::fs::write(path, bytes(&picture)).unwrap();
    }

    /// The page as PDF.
    pub fn pdf(&mut self) -> Vec<u8> {
        let wanted = json!({"preferCSSPageSize": true, "printBackground": true});
        bytes(&self.call("Page.printToPDF", wanted))
    }

    /// Says something of the protocol and returns the answer.
    ///
    /// # Panics
    /// If the browser refuses, or falls silent.
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        let id = self.send(method, parameters);
        loop {
            let mut message = self
                .from
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|error| panic!("{method}: the browser says nothing: {error}"));
            if message["id"] == id {
                assert!(
                    message.get("error").is_none(),
                    "{method}: {}",
                    message["error"]
                );
                return message["result"].take();
            }
            self.hear(&message);
        }
    }

    fn send(&mut self, method: &str, parameters: Value) -> u64 {
        self.last += 1;
        let mut message = json!({"id": self.last, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to
            .write_all(format!("{message}\0").as_bytes())
            .unwrap();
        self.to.flush().unwrap();
        self.last
    }

    /// Takes note of what happened.
    fn hear(&mut self, event: &Value) {
        let about = &event["params"];
        match event["method"].as_str() {
            Some("Fetch.requestPaused") => {
                let address = about["request"]["url"].as_str().unwrap_or_default();
                let id = json!({"requestId": about["requestId"]});
                if !address.starts_with("file://") {
                    self.requests.push(address.to_owned());
                }
                if address.starts_with(&self.allowed) {
                    self.send("Fetch.continueRequest", id);
                } else {
                    let reason =
                        json!({"requestId": about["requestId"], "errorReason": "AccessDenied"});
                    self.send("Fetch.failRequest", reason);
                }
            }
            Some("Runtime.exceptionThrown") => {
                self.complaints.push(about["exceptionDetails"].to_string());
            }
            Some("Runtime.consoleAPICalled") if about["type"] == "error" => {
                self.complaints.push(about["args"].to_string());
            }
            Some("Log.entryAdded") if about["entry"]["level"] == "error" => {
                self.complaints.push(about["entry"]["text"].to_string());
            }
            _ => {}
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let goodbye = json!({"id": self.last + 1, "method": "Browser.close"});
        // It may have ended by itself.
        let _ = self.to.write_all(format!("{goodbye}\0").as_bytes());
        let _ = self.to.flush();
        for _ in 0..100 {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn bytes(answer: &Value) -> Vec<u8> {
    STANDARD.decode(answer["data"].as_str().unwrap()).unwrap()
}
