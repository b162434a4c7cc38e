//! Effects of messages from a client, and answers to its queries.
//!
//! A query of type GET_X, STT_X or STP_X always has an answer: an X, or an RTS_X with a status of 0 (done)
//! or 1 (there is none).

use std::time::Duration;

use super::client::{Answer, Client, Subscriptions};
use super::command::{self, Order};
use super::message::{Content, ExtendedHeader, Header, Message, TrackedTool};
use super::picture::Published;
use super::server::Shared;
use super::tracking::TrackerState;
use super::wire::Label;
use super::{IMAGE_DEVICE, POSE_DEVICE};

/// Types of messages from a client that have an effect.
const ACCEPTED_TYPES: [&str; 14] = [
    "TRANSFORM",
    "TDATA",
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
/// Codes of STATUS: all is well, and there is no room.
const STATUS_OK: u16 = 1;
const STATUS_BUSY: u16 = 6;

/// The reason why a message has no effect.
pub(super) enum Refused {
    /// The message is wrong; the next may be right.
    Message(String),
    /// The client is to be disconnected.
    Client(String),
}

/// Returns whether a message's body is read here; others are skipped, as the protocol demands.
pub(super) fn is_understood(header: &Header) -> bool {
    let kind = header.kind.text();
    ["TRANSFORM", "TDATA", "STRING", "COMMAND"].contains(&&*kind) || query(&kind).is_some()
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
    let tracking = &shared.tracking;
    match &message.content {
        Content::Transform(matrix) => {
            let taken = tracking.report(message.device, matrix, message);
            count(shared, taken.map_err(Refused::Message)?);
            Ok(())
        }
        Content::Tracking(tools) => {
            let mut taken = false;
            for tool in tools {
                let own = tracking.report(tool.name, &tool.matrix, message);
                taken |= own.map_err(Refused::Message)?;
            }
            count(shared, taken);
            Ok(())
        }
        content => match Order::of_message(content) {
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

fn count(shared: &Shared, taken: bool) {
    shared.count(|status| match taken {
        true => status.poses += 1,
        false => status.ignored += 1,
    });
    if taken {
        shared.tell();
    }
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
        TrackerState::Never => "no pose has arrived yet",
        TrackerState::Live(_) => "the tracker moves the probe",
        TrackerState::Lost(_) => "the tracker is lost",
    };
    status(STATUS_OK, "OK", text)
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
