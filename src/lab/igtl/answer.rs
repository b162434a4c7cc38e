//! Effects of messages from a client, and answers to its queries.
//!
//! A query of type GET_X, STT_X or STP_X always has an answer: an X, or an RTS_X with a status of 0 (done)
//! or 1 (there is none).

use std::time::Duration;

use super::client::{Answer, Client, Subscriptions};
use super::command::{self, Order};
use super::message::{self, Content, ExtendedHeader, Header, Message, PlacedTool, TrackedTool};
use super::picture::Published;
use super::server::Shared;
use super::tracking::TrackerState;
use super::wire::Label;
use super::{IMAGE_DEVICE, POSE_DEVICE};

/// Types of messages from a client that have an effect.
const ACCEPTED_TYPES: [&str; 16] = [
    "TRANSFORM",
    "TDATA",
    "POSITION",
    "QTDATA",
    "STRING",
    "COMMAND",
    "GET_CAPABIL",
    "GET_STATUS",
    "GET_IMAGE",
    "GET_TRANS",
    "GET_TDATA",
    "STT_IMAGE",
    "STP_IMAGE",
    "STT_TRANS",
    "STP_TRANS",
    "STT_TDATA",
];
const OK: u8 = 0;
const ERROR: u8 = 1;
/// Kind of a tool with six degrees of freedom.
const SIX_DEGREES_OF_FREEDOM: u8 = 2;
/// Codes of STATUS: an unknown error, all is well, and there is no room.
const STATUS_UNKNOWN: u16 = 0;
const STATUS_OK: u16 = 1;
const STATUS_BUSY: u16 = 6;

/// The reason why a message has no effect.
pub(super) enum Refused {
    /// A pose that no probe can have, in a message as it should be.
    Pose(String),
    /// The client is to be disconnected.
    Client(String),
}

/// Returns whether a message's body is read here; others are skipped, as the protocol demands.
pub(super) fn is_understood(header: &Header) -> bool {
    let kind = header.kind.text();
    let own = ["TRANSFORM", "TDATA", "POSITION", "QTDATA", "STRING", "COMMAND"];
    own.contains(&&*kind) || query(&kind).is_some()
}

/// Prefix and type of a query.
fn query(kind: &str) -> Option<(&str, &str)> {
    let (prefix, of) = kind.split_at_checked(4)?;
    ["GET_", "STT_", "STP_"].contains(&prefix).then_some((prefix, of))
}

/// Carries out a message and answers it.
///
/// # Errors
/// The fault of the message, or of its sender.
pub(super) fn answer(client: &Client, shared: &Shared, message: &Message) -> Result<(), Refused> {
    match &message.content {
        Content::Transform(matrix) => poses(shared, message, [(message.device, *matrix)]),
        Content::Tracking(tools) => {
            poses(shared, message, tools.iter().map(|tool| (tool.name, tool.matrix)))
        }
        Content::Position { place, turn } => {
            let turn = match turn[..] {
                [x, y, z, w] => [x, y, z, w],
                [x, y, z] => [x, y, z, (1.0 - (x * x + y * y + z * z)).max(0.0).sqrt()],
                _ => [0.0, 0.0, 0.0, 1.0],
            };
            poses(shared, message, [(message.device, message::matrix(*place, turn))])
        }
        Content::Placed(tools) => {
            let pose = |tool: &PlacedTool| (tool.name, message::matrix(tool.place, tool.turn));
            poses(shared, message, tools.iter().map(pose))
        }
        _ => match Order::of_message(message) {
            Some(order) => take(client, shared, message, order),
            None => reply(client, shared, message),
        },
    }
}

/// Hands an order to the program, or answers one that is none.
fn take(
    client: &Client,
    shared: &Shared,
    message: &Message,
    order: Result<Order, String>,
) -> Result<(), Refused> {
    let refused = match order {
        Ok(order) => match shared.request(client, command::stub(message), order) {
            true => return Ok(()),
            false => "too many commands wait; wait for the answers".to_owned(),
        },
        Err(cause) => cause,
    };
    match client.answer(Answer::Message(command::reply(message, Err(refused)))) {
        true => Ok(()),
        false => Err(unread()),
    }
}

fn unread() -> Refused {
    Refused::Client("it asks and does not read the answers".to_owned())
}

/// Takes the poses of tools, each of which may be the one that moves the probe.
///
/// # Errors
/// The fault of the first pose that is none; the others are taken.
fn poses(
    shared: &Shared,
    message: &Message,
    tools: impl IntoIterator<Item = (Label<20>, [f32; 12])>,
) -> Result<(), Refused> {
    let (mut taken, mut fault) = (false, Ok(()));
    for (tool, matrix) in tools {
        match shared.tracking.report(tool, &matrix, message) {
            Ok(true) => taken = true,
            Ok(false) => shared.count(|status| {
                status.hear(&format!("{tool} ({})", message.content.kind().text()))
            }),
            Err(why) => fault = fault.and(Err(Refused::Pose(why))),
        }
    }
    shared.count(|status| match taken {
        true => status.poses += 1,
        false => status.ignored += 1,
    });
    if taken {
        shared.tell();
    }
    fault
}

fn reply(client: &Client, shared: &Shared, message: &Message) -> Result<(), Refused> {
    let kind = message.content.kind();
    let kind = kind.text();
    let Some((prefix, of)) = query(&kind) else {
        return Ok(());
    };
    let published = shared.latest().is_some();
    let named = |own: &str| published && (message.device.is_empty() || message.device.is(own));
    let status = |ok: bool| {
        let status = if ok { OK } else { ERROR };
        Answer::Message(respond(message, rts(of, status)))
    };
    let choose = |change: &dyn Fn(&mut Subscriptions)| {
        client.choose(change);
        status(true)
    };
    let answer = match (prefix, of) {
        ("GET_", "CAPABIL") => Answer::Message(respond(message, capability())),
        ("GET_", "STATUS") => Answer::Message(respond(message, state(shared))),
        ("GET_", "IMAGE") if named(IMAGE_DEVICE) => Answer::Image,
        ("GET_", "TRANS" | "TRANSFOR") if named(POSE_DEVICE) => Answer::Transform,
        ("GET_", "TDATA") if published => Answer::Tracking,
        ("STT_", "IMAGE") => choose(&|wants| wants.image = true),
        ("STP_", "IMAGE") => choose(&|wants| wants.image = false),
        ("STT_", "TRANS" | "TRANSFOR") => choose(&|wants| wants.transform = true),
        ("STP_", "TRANS" | "TRANSFOR") => choose(&|wants| wants.transform = false),
        ("STP_", "TDATA") => choose(&|wants| wants.tracking = None),
        ("STT_", "TDATA") => match &message.content {
            // There is one frame, whose name is empty.
            Content::StartTracking { resolution, coordinates } if coordinates.is_empty() => {
                let least = Duration::from_millis((*resolution).into());
                choose(&|wants| wants.tracking = Some(least))
            }
            _ => status(false),
        },
        _ => status(false),
    };
    match client.answer(answer) {
        true => Ok(()),
        false => Err(unread()),
    }
}

/// An answer under the query's name, in its header version and with its number.
pub(super) fn respond(query: &Message, content: Content) -> Vec<u8> {
    let extension =
        query.extension.as_ref().map(|e| ExtendedHeader { id: e.id, metadata: Vec::new() });
    Message { device: query.device, extension, ..Message::new("", content) }.encode()
}

fn rts(of: &str, status: u8) -> Content {
    Content::Other { kind: Label::new(&format!("RTS_{of}")), bytes: vec![status] }
}

fn capability() -> Content {
    let mut kinds: Vec<_> = ACCEPTED_TYPES.iter().map(|k| Label::new(k)).collect();
    kinds.push(Label::new("STP_TDATA"));
    Content::Capability(kinds)
}

fn status(code: u16, name: &str, text: &str) -> Content {
    Content::Status {
        code,
        subcode: 0,
        name: Label::new(name),
        message: [text.as_bytes(), &[0]].concat(),
    }
}

/// The present state, for GET_STATUS.
fn state(shared: &Shared) -> Content {
    let text = match shared.tracking.now() {
        TrackerState::Never => match shared.silent() {
            Some(text) => text,
            None => "no pose has arrived yet".to_owned(),
        },
        TrackerState::Live(_) => "the tracker moves the probe".to_owned(),
        TrackerState::Lost(_) => "the tracker is lost".to_owned(),
    };
    status(STATUS_OK, "OK", &text)
}

/// The message to a client that is disconnected for its faults.
pub(super) fn dismissal(why: &str) -> Vec<u8> {
    Message::new("", status(STATUS_UNKNOWN, "Disconnected", why)).encode()
}

/// The message to a client for which there is no room.
pub(super) fn no_room(most: usize) -> Vec<u8> {
    let text = format!("{most} clients are connected and that is all; close one of them");
    Message::new("", status(STATUS_BUSY, "Busy", &text)).encode()
}

/// The probe's pose as a TDATA message.
pub(super) fn tracking_message(frame: &Published) -> Vec<u8> {
    let tool = TrackedTool {
        name: Label::new(POSE_DEVICE),
        kind: SIX_DEGREES_OF_FREEDOM,
        reserved: 0,
        matrix: frame.matrix(),
    };
    Message::new(POSE_DEVICE, Content::Tracking(vec![tool])).encode()
}
