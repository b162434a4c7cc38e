//! A real browser, driven through chromedriver (W3C WebDriver, the part that the tests need).

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use ureq::Agent;

use crate::common::skip::{Lacking, skip};

/// Longest wait for anything, on a busy machine, too.
pub const PATIENCE: Duration = Duration::from_secs(240);

/// Codes of keys in WebDriver.
pub const ENTER: &str = "\u{e007}";
pub const SPACE: &str = " ";
pub const RIGHT: &str = "\u{e014}";

/// A browser without a window, with a profile of its own.
pub struct Browser {
    agent: Agent,
    driver: Child,
    session: String,
    folder: TempDir,
}

fn found(names: &[&str]) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let all = std::env::split_paths(&path).flat_map(|f| names.iter().map(move |n| f.join(n)));
    all.into_iter().find(|file| file.is_file())
}

/// Starts chromedriver; returns it and its address. The port is chosen here, since not every version tells which one it
/// has found itself; where another program has taken it meanwhile the driver ends and another port is tried.
fn driver(program: &Path, agent: &Agent) -> (Child, String) {
    for _ in 0..5 {
        let free = TcpListener::bind("127.0.0.1:0").and_then(|port| port.local_addr());
        let free = free.expect("a free port");
        let address = format!("http://{free}");
        let mut driver = Command::new(program)
            .arg(format!("--port={}", free.port()))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver starts");
        let begun = Instant::now();
        while driver.try_wait().expect("a child").is_none() {
            let status = agent.get(format!("{address}/status")).call();
            if status.is_ok_and(|answer| answer.status().is_success()) {
                return (driver, address);
            }
            assert!(begun.elapsed() < PATIENCE, "chromedriver does not answer at {address}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    panic!("chromedriver ends at once, on five ports")
}

impl Browser {
    /// Starts a browser; none, with a message, where there is no Chromium with a driver that can start it.
    pub fn start() -> Option<Self> {
        let chromium = found(&["chromium", "chromium-browser", "google-chrome"]);
        let (Some(chromium), Some(driver)) = (chromium, found(&["chromedriver"])) else {
            skip(Lacking::Tool, "no chromium with chromedriver (./tools/setup.sh installs both)");
            return None;
        };
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("saved")).expect("made");
        let agent: Agent = Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(PATIENCE))
            .build()
            .into();
        let (driver, address) = self::driver(&driver, &agent);
        let mut browser = Self { agent, driver, session: format!("{address}/session"), folder };
        let profile = browser.folder.path().join("profile");
        let flags = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            "--window-size=1600,1000",
        ];
        let flags: Vec<String> = flags
            .map(str::to_owned)
            .into_iter()
            .chain([format!("--user-data-dir={}", profile.display())])
            .collect();
        let made = browser.answer(
            "",
            &json!({ "capabilities": { "alwaysMatch": {
            "browserName": "chrome",
            "unhandledPromptBehavior": "ignore",
            "goog:chromeOptions": {
                "binary": chromium,
                "args": flags,
                "prefs": { "download.default_directory": browser.saved() },
            },
        } } }),
        );
        let made = match made {
            Ok(made) => made,
            // Of another version than the driver, or one that cannot run here.
            Err(error) if error["error"] == "session not created" => {
                let said = error["message"].as_str().and_then(|text| text.lines().next());
                let why = said.unwrap_or("session not created");
                skip(Lacking::Tool, &format!("no chromium that chromedriver can start ({why})"));
                return None;
            }
            Err(error) => panic!("no session: {error}"),
        };
        let id = made["sessionId"].as_str().expect("a session");
        browser.session = format!("{}/{id}", browser.session);
        Some(browser)
    }

    /// Folder of downloads.
    pub fn saved(&self) -> PathBuf {
        self.folder.path().join("saved")
    }

    /// Posts a command; returns WebDriver's answer, or its error.
    fn answer(&self, command: &str, body: &Value) -> Result<Value, Value> {
        let url = format!("{}{command}", self.session);
        let mut response = self.agent.post(&url).send_json(body).expect("it answers");
        let mut answer: Value = response.body_mut().read_json().expect("JSON");
        let value = answer["value"].take();
        if response.status().is_success() { Ok(value) } else { Err(value) }
    }

    /// Posts a command that has to succeed; returns WebDriver's answer.
    fn post(&self, command: &str, body: &Value) -> Value {
        self.answer(command, body).unwrap_or_else(|error| panic!("{command} {body}: {error}"))
    }

    /// Opens a file.
    pub fn open(&self, page: &Path) {
        self.post("/url", &json!({ "url": format!("file://{}", page.display()) }));
    }

    /// Result of a script.
    pub fn run(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// Waits until a script returns true.
    pub fn wait(&self, script: &str) {
        self.until(script, || self.run(script) == json!(true));
    }

    /// Waits until something is so.
    pub fn until(&self, what: &str, is_so: impl Fn() -> bool) {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < PATIENCE, "never: {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn element(&self, css: &str) -> String {
        let found = self.post("/element", &json!({ "using": "css selector", "value": css }));
        let id = found.as_object().and_then(|o| o.values().next());
        let id = id.and_then(Value::as_str).expect("an element");
        format!("/element/{id}")
    }

    /// Clicks as a user does: hidden or covered elements cannot be clicked.
    pub fn click(&self, css: &str) {
        self.post(&format!("{}/click", self.element(css)), &json!({}));
    }

    /// Types into an element, or gives a file to it. What is outside Unicode's first plane, which not every chromedriver
    /// types (150 does not), is inserted as by an input method.
    pub fn type_into(&self, css: &str, text: &str) {
        let element = self.element(css);
        for part in text.split_inclusive(|c| c > '\u{ffff}') {
            let end = part.find(|c| c > '\u{ffff}').unwrap_or(part.len());
            let (typed, inserted) = part.split_at(end);
            if !typed.is_empty() {
                self.post(&format!("{element}/value"), &json!({ "text": typed }));
            }
            if !inserted.is_empty() {
                let inserted = json!(inserted);
                let done = self.run(&format!(
                    "document.querySelector({}).focus();
                     return document.execCommand('insertText', false, {inserted})",
                    json!(css)
                ));
                assert_eq!(done, json!(true), "{css}: {inserted}");
            }
        }
    }

    /// Presses a key at the present focus.
    pub fn press(&self, key: &str) {
        let each = ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key }));
        let source = json!({ "type": "key", "id": "keyboard", "actions": each });
        self.post("/actions", &json!({ "actions": [source] }));
    }

    /// Accepts a question of the page.
    pub fn accept(&self) {
        self.post("/alert/accept", &json!({}));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Closes the browser; a driver that has ended has closed it already.
        let _ = self.agent.delete(&self.session).call();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
