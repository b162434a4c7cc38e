//! A virtual display with the program running on it.

use std::io::{BufRead, BufReader, IoSlice};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::protocol::xproto::{self, ConnectionExt as _, ImageFormat, InputFocus};
use x11rb::rust_connection::RustConnection;

use super::skip::{Lacking, skip};

/// Longest wait for anything: a debug build on a busy machine takes long to upload a scene.
const PATIENCE: Duration = Duration::from_secs(240);

/// Keys that the tests press.
#[derive(Clone, Copy)]
pub enum Key {
    Right,
    Home,
    PageUp,
    PageDown,
    Shift,
    Space,
    Escape,
    /// `F1`, which is also `?`.
    Help,
    Enter,
    F2,
    F3,
    /// A letter, or another sign of Latin-1.
    Letter(char),
    Control,
    /// Any other key, by its X symbol.
    Symbol(u32),
}

impl Key {
    fn symbol(self) -> u32 {
        match self {
            Self::Right => 0xff53,
            Self::Home => 0xff50,
            Self::PageUp => 0xff55,
            Self::PageDown => 0xff56,
            Self::Shift => 0xffe1,
            Self::Space => 0x20,
            Self::Escape => 0xff1b,
            Self::Help => 0xffbe,
            Self::Enter => 0xff0d,
            Self::F2 => 0xffbf,
            Self::F3 => 0xffc0,
            Self::Letter(letter) => u32::from(letter),
            Self::Control => 0xffe3,
            Self::Symbol(symbol) => symbol,
        }
    }
}

/// An X server without a screen.
pub struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts a display; none, with a message, where there is no X server.
    pub fn open() -> Option<Self> {
        Self::sized([1366, 768])
    }

    /// Starts a display of so many pixels.
    pub fn sized([width, height]: [u16; 2]) -> Option<Self> {
        let screen = format!("{width}x{height}x24");
        let started = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = match started {
            Ok(server) => server,
            Err(error) => {
                skip(Lacking::Tool, &format!("no X server (Xvfb: {error})"));
                return None;
            }
        };
        let mut number = String::new();
        let out = server.stdout.take().expect("piped");
        BufReader::new(out).read_line(&mut number).expect("a number");
        assert!(!number.trim().is_empty(), "Xvfb ended at once");
        let name = format!(":{}", number.trim());
        Some(Self { server, name })
    }

    /// The program's command for this display.
    pub fn program(&self, scene: &Path, arguments: &[&str]) -> Command {
        let mut command = program(scene, arguments);
        command.env("DISPLAY", &self.name);
        command
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The command `insonify view`.
pub fn program(scene: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.arg("view").arg(scene).args(arguments);
    command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    command
}

/// The program in its window.
pub struct Desk {
    program: Child,
    x: RustConnection,
    root: xproto::Window,
    window: xproto::Window,
    _display: Display,
    folder: Arc<tempfile::TempDir>,
    /// The system's folder for the state of programs.
    state: tempfile::TempDir,
    command: Command,
}

impl Desk {
    /// Opens a scene's window at the upper left corner; none where there is no X server.
    pub fn open(scene: &str, arguments: &[&str]) -> Option<Self> {
        Self::open_scaled(scene, arguments, 1.0)
    }

    /// Like [`Self::open`], on a display where a point is `scale` pixels.
    pub fn open_scaled(scene: &str, arguments: &[&str], scale: f64) -> Option<Self> {
        let scaled = |_: &Path, command: &mut Command| {
            command.env("WINIT_X11_SCALE_FACTOR", scale.to_string());
        };
        Self::open_on(Display::open()?, scene, arguments, scaled)
    }

    /// Like [`Self::open`], on a display, with other files in the scene's folder, or another environment: `prepare`
    /// changes both.
    pub fn open_on(
        display: Display,
        scene: &str,
        arguments: &[&str],
        prepare: impl FnOnce(&Path, &mut Command),
    ) -> Option<Self> {
        let folder = Arc::new(tempfile::tempdir().expect("a folder"));
        let state = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, scene).expect("written");
        let (x, screen) = x11rb::connect(Some(&display.name)).expect("the X server answers");
        let root = x.setup().roots[screen].root;
        let mut command = display.program(&file, arguments);
        command.env("XDG_STATE_HOME", state.path());
        prepare(folder.path(), &mut command);
        let program = command.spawn().expect("started");
        let mut desk =
            Self { program, x, root, window: 0, _display: display, folder, state, command };
        desk.wait_for("a window", Desk::find);
        desk.focus();
        Some(desk)
    }

    /// Finds the program's window, once it is shown.
    fn find(&mut self) -> bool {
        let tree = self.x.query_tree(self.root).unwrap().reply().unwrap();
        let shown = tree.children.into_iter().find(|&child| {
            let attributes = self.x.get_window_attributes(child).unwrap().reply();
            let geometry = self.x.get_geometry(child).unwrap().reply();
            attributes.is_ok_and(|a| a.map_state == xproto::MapState::VIEWABLE)
                && geometry.is_ok_and(|g| g.width > 300)
        });
        self.window = shown.unwrap_or_default();
        shown.is_some()
    }

    /// Gives the window a place and the keyboard, which no window manager does here.
    fn focus(&self) {
        let place = xproto::ConfigureWindowAux::new().x(0).y(0);
        self.x.configure_window(self.window, &place).unwrap();
        let now = x11rb::CURRENT_TIME;
        self.x.set_input_focus(InputFocus::PARENT, self.window, now).unwrap();
        self.x.flush().unwrap();
        std::thread::sleep(Duration::from_millis(100));
    }

    /// Colours in a part of the display: left, top, width, height.
    pub fn grab(&self, [x, y, width, height]: [u16; 4]) -> Vec<u8> {
        let (format, all) = (ImageFormat::Z_PIXMAP, u32::MAX);
        let (left, top) = (x as i16, y as i16);
        let cookie = self.x.get_image(format, self.root, left, top, width, height, all);
        let data = cookie.unwrap().reply().expect("a part of the display").data;
        // Blue, green, red and one unused.
        data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect()
    }

    /// Waits until a part has not changed for half a second and the program has nothing left to do.
    pub fn settle(&mut self, part: [u16; 4]) -> Vec<u8> {
        self.quiet(part, Duration::from_millis(500), true)
    }

    /// Waits until a part stays unchanged because the program has nothing left to do: on a slow device the last
    /// change, such as the finest picture of the anatomy, may come after seconds.
    pub fn rest(&mut self, part: [u16; 4]) -> Vec<u8> {
        self.quiet(part, Duration::from_secs(1), true)
    }

    /// Waits until a part has not changed for a while, also where a cursor blinks in a text field: then the part
    /// changes twice a second, and the program never rests for long.
    pub fn still(&mut self, part: [u16; 4]) {
        self.quiet(part, Duration::from_millis(250), false);
    }

    /// Writes the whole display as PNG beside the tests; returns where.
    fn shot(&self, name: &str) -> String {
        let screen = &self.x.setup().roots[0];
        let [width, height] = [screen.width_in_pixels, screen.height_in_pixels];
        let pixels = self.grab([0, 0, width, height]);
        let file =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}.png", name.replace(' ', "-")));
        let (width, height) = (width.into(), height.into());
        image::save_buffer(&file, &pixels, width, height, image::ColorType::Rgb8).expect("written");
        file.display().to_string()
    }

    /// Waits for the image at the scene's own quality, which comes once everything is at rest: until then the program
    /// works. `works`: whether that counts for all of the time, or only at its end. A program kept from the processor
    /// has work to do although it uses no time: its threads' states show that.
    fn quiet(&mut self, part: [u16; 4], time: Duration, works: bool) -> Vec<u8> {
        // Shorter than between two drawings of a blinking cursor, on a busy machine, too.
        const REST: Duration = Duration::from_millis(80);
        let (mut last, mut spent) = (self.grab(part), self.processor_time());
        let (mut since, mut rested) = (Instant::now(), Instant::now());
        self.wait_for("the program to come to rest", |desk| {
            let (now, spends) = (desk.grab(part), desk.processor_time());
            // A tick of the clock that counts.
            let worked = spends - spent > Duration::from_millis(10) || desk.at_work();
            if worked {
                (spent, rested) = (spends, Instant::now());
            }
            if now != last || (works && worked) {
                (last, since) = (now, Instant::now());
            }
            since.elapsed() > time && rested.elapsed() > REST
        });
        last
    }

    /// Returns whether a thread of the program runs or waits for a processor or a disk (proc(5), state).
    fn at_work(&self) -> bool {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.program.id()));
        let mut tasks = tasks.expect("the program runs").flatten();
        tasks.any(|task| {
            // A thread may have ended meanwhile.
            let text = std::fs::read_to_string(task.path().join("stat")).unwrap_or_default();
            let state = text.rsplit(')').next().and_then(|rest| rest.trim_start().chars().next());
            matches!(state, Some('R' | 'D'))
        })
    }

    /// Waits for three seconds in which the program uses no more than `most` of the processor. What it still does
    /// on a slow machine ends some time; what it does for ever is never over.
    pub fn idles(&mut self, most: Duration) {
        let (mut begun, mut before) = (Instant::now(), self.processor_time());
        self.wait_for("the program to do nothing", |desk| {
            if desk.processor_time() - before > most {
                (begun, before) = (Instant::now(), desk.processor_time());
            }
            begun.elapsed() > Duration::from_secs(3)
        });
    }

    /// Waits until a condition holds.
    pub fn wait_for(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let began = Instant::now();
        while !is_so(self) {
            if let Some(status) = self.program.try_wait().expect("a child") {
                panic!("the program ended ({status}) before {what}");
            }
            if began.elapsed() > PATIENCE {
                panic!("waited in vain for {what}; what is shown: {}", self.shot(what));
            }
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    fn code(&self, key: Key) -> u8 {
        let setup = self.x.setup();
        let (first, count) = (setup.min_keycode, setup.max_keycode - setup.min_keycode + 1);
        let map = self.x.get_keyboard_mapping(first, count).unwrap().reply().unwrap();
        let each = usize::from(map.keysyms_per_keycode);
        let found = map.keysyms.chunks(each).position(|k| k[0] == key.symbol());
        first + found.expect("the keyboard has the key") as u8
    }

    /// Sends XTestFakeInput (The X11 Test Extension, version 2.2). Written here, since the feature of x11rb with it
    /// would build the whole window system a second time for the tests.
    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        let extension = self.x.extension_information("XTEST").unwrap();
        let mut request = vec![extension.expect("Xvfb has XTEST").major_opcode, 2, 9, 0];
        request.extend([kind, detail, 0, 0]);
        request.extend(x11rb::CURRENT_TIME.to_ne_bytes());
        request.extend(self.root.to_ne_bytes());
        request.extend([0; 8]);
        request.extend(x.to_ne_bytes());
        request.extend(y.to_ne_bytes());
        request.extend([0; 8]);
        let sent = self.x.send_request_without_reply(&[IoSlice::new(&request)], vec![]);
        sent.unwrap();
        self.x.flush().unwrap();
        // As fast as a hand; the server delivers each on its own.
        std::thread::sleep(Duration::from_millis(15));
    }

    /// Presses and releases a key.
    pub fn press(&self, key: Key) {
        let code = self.code(key);
        self.fake(xproto::KEY_PRESS_EVENT, code, (0, 0));
        self.fake(xproto::KEY_RELEASE_EVENT, code, (0, 0));
    }

    /// Presses and releases a key while Ctrl is held.
    pub fn hold_control(&self, key: Key) {
        let control = self.code(Key::Control);
        self.fake(xproto::KEY_PRESS_EVENT, control, (0, 0));
        self.press(key);
        self.fake(xproto::KEY_RELEASE_EVENT, control, (0, 0));
    }

    /// The present scene file.
    pub fn scene(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("scene.toml")).expect("a scene")
    }

    /// The folder of the scene file, which stays as long as this is kept.
    pub fn keep(&self) -> Arc<tempfile::TempDir> {
        self.folder.clone()
    }

    /// The folder of the scene file.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Waits until the program has ended by itself.
    pub fn ended(self) -> ExitStatus {
        self.ended_by(|| ())
    }

    /// Does something again and again until the program has ended by it.
    pub fn ended_by(mut self, act: impl Fn()) -> ExitStatus {
        let began = Instant::now();
        loop {
            act();
            if let Some(status) = self.program.try_wait().expect("a child") {
                return status;
            }
            assert!(began.elapsed() < PATIENCE, "the program does not end");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Holds a key down, or releases it.
    pub fn hold(&self, key: Key, down: bool) {
        let kind = match down {
            true => xproto::KEY_PRESS_EVENT,
            false => xproto::KEY_RELEASE_EVENT,
        };
        self.fake(kind, self.code(key), (0, 0));
    }

    /// Clicks at a place of the display.
    pub fn click(&self, at: (u16, u16)) {
        self.drag(at, at);
    }

    /// Turns the wheel by a notch, away from the hand: nearer.
    pub fn wheel(&self, (x, y): (u16, u16)) {
        self.fake(xproto::MOTION_NOTIFY_EVENT, 0, (x as i16, y as i16));
        self.fake(xproto::BUTTON_PRESS_EVENT, 4, (0, 0));
        self.fake(xproto::BUTTON_RELEASE_EVENT, 4, (0, 0));
    }

    /// Clicks with the right button.
    pub fn click_right(&self, (x, y): (u16, u16)) {
        self.fake(xproto::MOTION_NOTIFY_EVENT, 0, (x as i16, y as i16));
        std::thread::sleep(Duration::from_millis(100));
        self.fake(xproto::BUTTON_PRESS_EVENT, 3, (0, 0));
        self.fake(xproto::BUTTON_RELEASE_EVENT, 3, (0, 0));
    }

    /// Presses the button at one place of the display and releases it at another.
    pub fn drag(&self, from: (u16, u16), to: (u16, u16)) {
        let motion = |(x, y): (u16, u16)| {
            self.fake(xproto::MOTION_NOTIFY_EVENT, 0, (x as i16, y as i16));
            std::thread::sleep(Duration::from_millis(100));
        };
        motion(from);
        self.fake(xproto::BUTTON_PRESS_EVENT, 1, (0, 0));
        if to != from {
            // Through places between, as a hand does.
            let between = |share: u16| {
                let at = |a: u16, b: u16| (a * (4 - share) + b * share) / 4;
                (at(from.0, to.0), at(from.1, to.1))
            };
            (1..=4).for_each(|share| motion(between(share)));
        }
        self.fake(xproto::BUTTON_RELEASE_EVENT, 1, (0, 0));
    }

    /// Drags so slowly that a busy program, too, sees it under way.
    pub fn pull(&self, from: (u16, u16), to: (u16, u16)) {
        const STEPS: i32 = 8;
        let pause = || std::thread::sleep(Duration::from_millis(150));
        let motion = |step: i32| {
            let between = |a: u16, b: u16| {
                (i32::from(a) + (i32::from(b) - i32::from(a)) * step / STEPS) as i16
            };
            let at = (between(from.0, to.0), between(from.1, to.1));
            self.fake(xproto::MOTION_NOTIFY_EVENT, 0, at);
            pause();
        };
        motion(0);
        self.fake(xproto::BUTTON_PRESS_EVENT, 1, (0, 0));
        pause();
        (1..=STEPS).for_each(motion);
        self.fake(xproto::BUTTON_RELEASE_EVENT, 1, (0, 0));
    }

    /// Gives the window another size.
    pub fn resize(&self, width: u16, height: u16) {
        let size =
            xproto::ConfigureWindowAux::new().width(u32::from(width)).height(u32::from(height));
        self.x.configure_window(self.window, &size).unwrap();
        self.x.flush().unwrap();
    }

    /// Takes the window off the screen, as minimising does.
    pub fn hide(&self) {
        self.x.unmap_window(self.window).unwrap();
        self.x.flush().unwrap();
    }

    /// Shows the window again.
    pub fn show(&self) {
        self.x.map_window(self.window).unwrap();
        self.x.flush().unwrap();
        std::thread::sleep(Duration::from_millis(200));
        self.focus();
    }

    /// Processor time that the program has used so far, to a hundredth of a second.
    pub fn processor_time(&self) -> Duration {
        let path = format!("/proc/{}/stat", self.program.id());
        let text = std::fs::read_to_string(path).expect("the program runs");
        // Fields are counted behind the name, which is in brackets and may hold anything.
        let rest = text.rsplit(')').next().expect("a name");
        let fields: Vec<u64> = rest.split_whitespace().map(|f| f.parse().unwrap_or(0)).collect();
        let ticks = fields[11] + fields[12];
        Duration::from_millis(10 * ticks)
    }

    /// Most memory that the program has held so far, bytes.
    pub fn memory(&self) -> u64 {
        self.status("VmHWM:")
    }

    /// Memory that the program holds now, bytes.
    pub fn memory_now(&self) -> u64 {
        self.status("VmRSS:")
    }

    fn status(&self, row: &str) -> u64 {
        let path = format!("/proc/{}/status", self.program.id());
        let text = std::fs::read_to_string(path).expect("the program runs");
        let line = text.lines().find_map(|l| l.strip_prefix(row));
        let value = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
        1024 * value.expect("a size")
    }

    /// Discards what is not saved once that is asked, and waits until something is so. Before the question the key has no
    /// meaning, and whether the question is there yet a picture does not say.
    pub fn discard(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let mut pressed = Instant::now();
        self.wait_for(what, |desk| {
            if pressed.elapsed() > Duration::from_millis(200) {
                desk.hold_control(Key::Letter('d'));
                pressed = Instant::now();
            }
            is_so(desk)
        });
    }

    /// Presses Ctrl+Q, and discards what is not saved; asserts that the program ends by itself, without an error.
    pub fn quit(mut self) {
        self.hold_control(Key::Letter('q'));
        let began = Instant::now();
        while self.program.try_wait().expect("a child").is_none() {
            assert!(began.elapsed() < PATIENCE, "the program does not end");
            // Once the question is there; before, the key has no meaning.
            std::thread::sleep(Duration::from_millis(200));
            self.hold_control(Key::Letter('d'));
        }
        let status = self.ended();
        assert!(status.success(), "{status}");
    }

    /// Closes the window by the button of a window manager.
    pub fn close(&self) {
        let atom =
            |name: &str| self.x.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let data = [atom("WM_DELETE_WINDOW"), x11rb::CURRENT_TIME, 0, 0, 0];
        let protocols = atom("WM_PROTOCOLS");
        let message = xproto::ClientMessageEvent::new(32, self.window, protocols, data);
        self.x.send_event(false, self.window, xproto::EventMask::NO_EVENT, message).unwrap();
        self.x.flush().unwrap();
    }

    /// Types a text of small letters, digits and signs into a field in the place of what it holds.
    pub fn retype(&self, text: &str) {
        self.hold_control(Key::Letter('a'));
        text.chars().for_each(|letter| self.press(Key::Letter(letter)));
    }

    /// Kills the program, as a crash does, and starts it again as it was started.
    pub fn crash(&mut self) {
        self.program.kill().expect("it runs");
        self.program.wait().expect("a child");
        self.program = self.command.spawn().expect("started");
        self.wait_for("a window", Desk::find);
        self.focus();
    }

    /// Texts of what the program keeps of unsaved work.
    pub fn kept(&self) -> Vec<String> {
        let all = std::fs::read_dir(self.state.path().join("insonify/unsaved"));
        let files = all.into_iter().flatten().flatten().map(|e| e.path().join("session.json"));
        files.filter_map(|file| std::fs::read_to_string(file).ok()).collect()
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        // It has ended, or a test has failed.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}
