//! Commands of clients, as COMMAND or STRING messages: settings, time, freezing, another scene. The program that has the
//! server carries them out and answers; the client is told the error of a wrong one.

use std::sync::Arc;

use super::answer::respond;
use super::client::{Answer, Client};
use super::message::{Content, ExtendedHeader, Message};
use super::wire::Label;
use crate::scene::file::{facts, keys_below, paths};
use crate::settings::units::DURATION;

/// Number of UTF-8 in the MIB of IANA.
const UTF8: u16 = 106;

/// What a client wants.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// To give keys of the scene file other values: pairs as `--set` takes them.
    Set(Vec<(String, String)>),
    /// To be told the value of a key.
    Get(String),
    /// To set the scene's time, s.
    Time(f64),
    /// To stop the image, or to let it go on.
    Freeze(bool),
    /// To see another scene: a file, or the name of one that ships.
    Scene(String),
}

/// An order that waits for its answer.
pub struct Request {
    /// What is wanted.
    pub order: Order,
    pub(super) client: Arc<Client>,
    /// The message without its text.
    pub(super) query: Message,
}

impl Order {
    /// The order of a text: `PATH = VALUE` in lines, `get PATH`, `time = 1.5 s`, `freeze`, `unfreeze`, `scene = heart`.
    ///
    /// # Errors
    /// A text that is none of these.
    pub fn of(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let parts = |line: &str| {
            let (path, value) = line.split_once('=')?;
            Some((path.trim().to_owned(), value.trim().to_owned()))
        };
        match (text, text.strip_prefix("get ")) {
            ("freeze", _) => return Ok(Self::Freeze(true)),
            ("unfreeze", _) => return Ok(Self::Freeze(false)),
            (_, Some(path)) => return Ok(Self::Get(path.trim().to_owned())),
            _ => {}
        }
        let lines = text.lines().filter(|line| !line.trim().is_empty());
        let pairs: Option<Vec<_>> = lines.map(parts).collect();
        match pairs.as_deref() {
            Some([(path, value)]) if path == "time" => DURATION.finite(value).map(Self::Time),
            Some([(path, value)]) if path == "scene" => {
                Ok(Self::Scene(value.trim_matches('"').to_owned()))
            }
            Some([]) | None => Err(format!(
                "`{}` is no command: write PATH = VALUE, get PATH, time = 1.5 s, freeze, unfreeze or scene = NAME",
                text.chars().take(60).collect::<String>()
            )),
            Some(pairs) => Ok(Self::Set(pairs.to_vec())),
        }
    }

    /// The order of a message; none of messages that carry none. The name of a COMMAND, and the device of a STRING, is a key
    /// where the text is but a value, and the whole command where there is no text.
    pub(super) fn of_message(message: &Message) -> Option<Result<Self, String>> {
        let (name, room, text) = match &message.content {
            Content::String { text, .. } => (message.device.text(), message.device.room(), text),
            Content::Command { reply: false, name, text, .. } => (name.text(), name.room(), text),
            _ => return None,
        };
        let text = String::from_utf8_lossy(text);
        Some(Self::of_named(&name, room, text.trim_matches(['\0', ' ', '\n', '\r'])))
    }

    /// The order of a text under a name, in a field with `room` bytes for that.
    fn of_named(name: &str, room: usize, text: &str) -> Result<Self, String> {
        let own = Self::of(text);
        let is_key = |name: &str| facts(name).is_ok() || ["time", "scene"].contains(&name);
        // A value may have equals signs of its own, as that of a pose has.
        let is_whole = match &own {
            Ok(Self::Set(pairs)) => pairs.iter().all(|(path, _)| is_key(path)),
            Ok(_) => true,
            Err(_) => false,
        };
        match name {
            _ if text.is_empty() => Self::of(name),
            "get" => Ok(Self::Get(text.to_owned())),
            _ if is_whole => own,
            "time" | "scene" => Self::of(&format!("{name} = {text}")),
            _ if name.len() == room && !is_key(name) => Err(cut(name)),
            _ if is_key(name) || name.contains('.') => {
                Ok(Self::Set(vec![(name.to_owned(), text.to_owned())]))
            }
            _ => own,
        }
    }
}

/// The remedy for a name as long as names can be that is no key: it may have been cut.
fn cut(name: &str) -> String {
    let whole = paths().find(|path| path.starts_with(name));
    format!(
        "`{name}` is no key, and has {} bytes, the most that OpenIGTLink has room for there; longer names are cut: write the key \
         into the text, as {} = VALUE",
        name.len(),
        whole.as_deref().unwrap_or("PATH")
    )
}

/// A simulation that clients command.
pub trait Commanded {
    /// Gives keys of the scene file other values.
    ///
    /// # Errors
    /// The fault of a value, in words; nothing has changed then.
    fn set(&mut self, pairs: &[(String, String)]) -> Result<(), String>;

    /// The value of a key, as a scene file writes it.
    ///
    /// # Errors
    /// The reason why there is none.
    fn value(&self, path: &str) -> Result<String, String>;

    /// The reason why no key of a table has a value.
    fn nothing_of(&self, table: &str) -> String;

    /// Sets the scene's time, s.
    fn seek(&mut self, seconds: f64);

    /// Stops the image, or lets it go on.
    fn freeze(&mut self, frozen: bool);

    /// Opens another scene, by its file or its name; returns what is said of it.
    ///
    /// # Errors
    /// The reason why it stays closed; the scene is then as it was.
    fn open(&mut self, name: &str) -> Result<String, String>;
}

impl Order {
    /// Carries the order out; returns the answer.
    ///
    /// # Errors
    /// Its fault, in words; nothing has changed then.
    pub fn carry_out(&self, on: &mut impl Commanded) -> Result<String, String> {
        match self {
            Self::Set(pairs) => {
                on.set(pairs)?;
                let lines = pairs.iter().map(|(path, value)| format!("{path} = {value}"));
                Ok(lines.collect::<Vec<_>>().join("\n"))
            }
            Self::Get(path) => values(path, on),
            Self::Time(seconds) => {
                on.seek(*seconds);
                Ok(format!("time = {seconds} s"))
            }
            Self::Freeze(frozen) => {
                on.freeze(*frozen);
                Ok(if *frozen { "frozen" } else { "running" }.to_owned())
            }
            Self::Scene(name) => on.open(name),
        }
    }
}

/// A line of a key and its value, or the lines of all keys of a table that have one.
fn values(path: &str, on: &impl Commanded) -> Result<String, String> {
    let line = |key: &str| Ok::<_, String>(format!("{key} = {}", on.value(key)?));
    let keys = keys_below(path);
    if keys.is_empty() {
        return line(path);
    }
    let set: Vec<String> = keys.iter().filter_map(|key| line(key).ok()).collect();
    if set.is_empty() { Err(on.nothing_of(path)) } else { Ok(set.join("\n")) }
}

impl Request {
    /// Tells the client what came of it: the text of a success, or the error.
    pub fn answer(self, outcome: Result<String, String>) {
        // A client that does not read its answers is ended by its own thread.
        self.client.answer(Answer::Message(reply(&self.query, outcome)));
    }
}

/// The message for the outcome of a command: RTS_COMMAND under its number, or a STRING. An error begins with `error: `.
pub(super) fn reply(query: &Message, outcome: Result<String, String>) -> Vec<u8> {
    let text = outcome.unwrap_or_else(|cause| format!("error: {cause}")).into_bytes();
    let content = match &query.content {
        Content::Command { id, name, .. } => {
            Content::Command { reply: true, id: *id, name: *name, encoding: UTF8, text }
        }
        _ => Content::String { encoding: UTF8, text },
    };
    respond(query, content)
}

/// A command without its text, for the answer.
pub(super) fn stub(message: &Message) -> Message {
    let content = match &message.content {
        Content::Command { id, name, encoding, .. } => Content::Command {
            reply: false,
            id: *id,
            name: *name,
            encoding: *encoding,
            text: Vec::new(),
        },
        _ => Content::String { encoding: UTF8, text: Vec::new() },
    };
    let extension = message.extension.as_ref();
    let extension = extension.map(|e| ExtendedHeader { id: e.id, metadata: Vec::new() });
    Message { device: message.device, time: message.time, extension, content }
}

/// A COMMAND of this name and text, for clients.
pub fn command(id: u32, name: &str, text: &str) -> Message {
    let text = text.as_bytes().to_vec();
    let name = Label::new(name);
    Message::new("", Content::Command { reply: false, id, name, encoding: UTF8, text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_orders_or_refused() {
        let pair = |path: &str, value: &str| (path.to_owned(), value.to_owned());
        for (text, expected) in [
            ("probe.depth = 80 mm", Order::Set(vec![pair("probe.depth", "80 mm")])),
            ("a.b=1\n\n c.d = [1, 2]\n", Order::Set(vec![pair("a.b", "1"), pair("c.d", "[1, 2]")])),
            ("get imaging.gain", Order::Get("imaging.gain".to_owned())),
            ("time = 400 ms", Order::Time(0.4)),
            ("scene = \"heart\"", Order::Scene("heart".to_owned())),
            (" freeze\n", Order::Freeze(true)),
            ("unfreeze", Order::Freeze(false)),
        ] {
            assert_eq!(Order::of(text), Ok(expected), "{text}");
        }
        for text in ["", "louder", "time = 4 mm", "a = 1\nlouder"] {
            assert!(Order::of(text).is_err(), "{text}");
        }
    }

    #[test]
    fn commands_and_strings_may_have_a_key_as_their_name() {
        let string = |name: &str, text: &str| {
            let text = text.as_bytes().to_vec();
            let message = Message::new(name, Content::String { encoding: UTF8, text });
            Order::of_message(&message).expect("an order")
        };
        let of = |name: &str, text: &str| {
            let order = Order::of_message(&command(1, name, text)).expect("an order");
            assert_eq!(string(name, text), order, "{name}");
            order
        };
        let set = Order::of("probe.depth = 80 mm");
        assert_eq!(of("probe.depth", "80 mm"), set);
        for name in ["set", "", "Text", "probe.depth", "imaging.gain"] {
            assert_eq!(of(name, "probe.depth = 80 mm"), set, "{name}");
            assert_eq!(of(name, "unfreeze"), Ok(Order::Freeze(false)), "{name}");
        }
        assert_eq!(of("freeze", ""), Ok(Order::Freeze(true)));
        assert_eq!(of("get", "imaging.gain"), Order::of("get imaging.gain"));
        assert_eq!(of("time", "2 s\0"), Ok(Order::Time(2.0)));
        assert_eq!(of("scene", "heart"), Ok(Order::Scene("heart".to_owned())));
        // A value with equals signs, and a key that there is not, whose error names those that there are.
        for (name, text) in [
            ("probe.pose", "{ position = [0, 0, 0] }"),
            ("imaging.gian", "3"),
            ("tissues.liver.speed", "1550 m/s"),
        ] {
            let set = Order::Set(vec![(name.to_owned(), text.to_owned())]);
            assert_eq!(of(name, text), Ok(set), "{name}");
        }
        // Names that are no keys say nothing.
        assert!(of("Text", "louder").is_err_and(|cause| cause.contains("`louder` is no command")));
        // As a STRING arrives: 24 letters are cut to 20. A COMMAND has room for 128.
        let [key, text] = ["simulation.density_scale", "simulation.density_scale = 0.5"];
        let cut = string(key, "0.5").expect_err("no key");
        for part in ["`simulation.density_s`", "20 bytes", "simulation.density_scale = VALUE"] {
            assert!(cut.contains(part), "{part}: {cut}");
        }
        assert_eq!(string(key, text), Order::of(text));
        assert_eq!(Order::of_message(&command(1, key, "0.5")), Some(Order::of(text)));
    }
}
