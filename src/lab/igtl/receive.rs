//! Reading a client's messages: bounded in bytes and in time.

use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::answer;
use super::client::{Client, has_left};
use super::message::{HEADER, Header, Message};
use super::server::{LINGER_TIME, ServerSettings, Shared};
use super::wire::checksum;

/// Most bytes of a message of a type that is read here: a thousand tools.
const LONGEST_MESSAGE: u64 = 70_000;
/// Least rate at which a long message that is skipped has to arrive, bytes per second.
const LEAST_RATE: f64 = 1e6;
/// Faulty messages in a row after which the connection is ended.
const MOST_FAULTS: u32 = 16;

/// A fault, by its effect.
enum Fault {
    /// A fault of one message; the next one can be found.
    Message(String),
    /// A pose that is none, in a message as it should be: trackers send them now and then.
    Pose(String),
    /// The connection cannot go on.
    Connection(String),
}

/// Reads and answers until the connection ends.
pub(super) fn receive_all(client: &Client, shared: &Shared) {
    let mut faults = 0;
    loop {
        let fault = match receive(client, shared) {
            Ok(true) => {
                faults = 0;
                continue;
            }
            Ok(false) => break,
            Err(fault) => fault,
        };
        if client.is_closed() {
            break;
        }
        match fault {
            Fault::Pose(why) => shared.fault(client, &why),
            Fault::Message(why) => {
                shared.fault(client, &why);
                faults += 1;
                if faults == MOST_FAULTS {
                    let count = format!("{MOST_FAULTS} faulty messages in a row");
                    shared.fault(client, &count);
                    dismiss(client, &format!("{count}, the last: {why}"));
                    break;
                }
            }
            Fault::Connection(why) => {
                shared.fault(client, &why);
                dismiss(client, &why);
                break;
            }
        }
    }
    client.close();
}

/// Tells a client why its connection ends. Its last bytes are read for a while: a connection that is closed over unread
/// bytes is reset, and the reason would never arrive.
fn dismiss(client: &Client, why: &str) {
    client.dismiss(answer::dismissal(why));
    let (end, mut scratch) = (Instant::now() + LINGER_TIME, [0; 4096]);
    while Instant::now() < end {
        match (&client.stream).read(&mut scratch) {
            Ok(0) => break,
            Err(error) if !waits(&error) => break,
            Ok(_) | Err(_) => {}
        }
    }
}

/// Reads the next message; returns false where the connection has ended between two messages.
fn receive(client: &Client, shared: &Shared) -> Result<bool, Fault> {
    let mut source = MessageStream::new(&client.stream, &shared.settings);
    let mut header = [0; HEADER];
    if !source.first(&mut header[..1], || client.unwanted())? {
        return Ok(false);
    }
    client.hear();
    source.fill(&mut header[1..])?;
    let header = Header::decode(&header).map_err(|why| Fault::Connection(why.to_string()))?;
    if !answer::is_understood(&header) {
        if header.body_size > shared.settings.skipped_bytes {
            return Err(too_long(&header));
        }
        source.skip(header.body_size)?;
        shared.count(|status| {
            status.ignored += 1;
            status.hear(&format!("the type {}, which is not read", header.kind));
        });
        return Ok(true);
    }
    if header.body_size > LONGEST_MESSAGE {
        return Err(too_long(&header));
    }
    let mut body = vec![0; header.body_size as usize];
    source.fill(&mut body)?;
    let message = Message::decode(&header, &body)
        .map_err(|why| Fault::Message(format!("a message of type {}: {why}", header.kind)))?;
    // The checksum of a body of zeros is 0.
    let unchecked = header.is_unchecked() && checksum(&body) != 0;
    shared.count(|status| {
        status.messages += 1;
        status.unchecked += u64::from(unchecked);
    });
    answer::answer(client, shared, &message).map_err(|refused| match refused {
        answer::Refused::Pose(why) => Fault::Pose(why),
        answer::Refused::Client(why) => Fault::Connection(why),
    })?;
    Ok(true)
}

fn too_long(header: &Header) -> Fault {
    let (kind, bytes) = (header.kind, header.body_size);
    Fault::Connection(format!("a message of type {kind} with {bytes} bytes"))
}

/// A stream whose reads return now and then, and one message's time.
struct MessageStream<'s> {
    stream: &'s TcpStream,
    limit: Duration,
    /// Time by which the message has to be here.
    end: Instant,
}

impl<'s> MessageStream<'s> {
    fn new(stream: &'s TcpStream, settings: &ServerSettings) -> Self {
        Self { stream, limit: settings.message_timeout, end: Instant::now() }
    }

    /// Waits for the first byte, for as long as there is no reason to end the connection; the message's time begins with it.
    /// Returns false where the connection has ended.
    fn first(
        &mut self,
        byte: &mut [u8],
        reason: impl Fn() -> Option<String>,
    ) -> Result<bool, Fault> {
        loop {
            match self.stream.read(byte) {
                Ok(0) => return Ok(false),
                Ok(_) => {
                    self.end = Instant::now() + self.limit;
                    return Ok(true);
                }
                Err(error) if waits(&error) => {
                    if let Some(why) = reason() {
                        return Err(Fault::Connection(why));
                    }
                }
                Err(error) if has_left(&error) => return Ok(false),
                Err(error) => return Err(Fault::Connection(format!("receiving: {error}"))),
            }
        }
    }

    fn fill(&mut self, mut bytes: &mut [u8]) -> Result<(), Fault> {
        while !bytes.is_empty() {
            let count = self.some(bytes)?;
            bytes = &mut bytes[count..];
        }
        Ok(())
    }

    /// Reads bytes without keeping them.
    fn skip(&mut self, mut count: u64) -> Result<(), Fault> {
        self.end += Duration::from_secs_f64(count as f64 / LEAST_RATE);
        let mut scratch = [0; 16 << 10];
        while count > 0 {
            let part = count.min(scratch.len() as u64) as usize;
            count -= self.some(&mut scratch[..part])? as u64;
        }
        Ok(())
    }

    /// Reads at least one byte.
    fn some(&mut self, bytes: &mut [u8]) -> Result<usize, Fault> {
        loop {
            match self.stream.read(bytes) {
                Ok(0) => {
                    let why = "it ended the connection within a message";
                    return Err(Fault::Connection(why.to_owned()));
                }
                Ok(count) if Instant::now() <= self.end => return Ok(count),
                Ok(_) => {}
                Err(error) if waits(&error) => {}
                Err(error) => return Err(Fault::Connection(format!("receiving: {error}"))),
            }
            if Instant::now() > self.end {
                let limit = self.limit.as_secs_f64();
                return Err(Fault::Connection(format!(
                    "a message did not arrive within {limit} s"
                )));
            }
        }
    }
}

/// Returns whether there is merely nothing to read yet.
fn waits(error: &std::io::Error) -> bool {
    let kind = error.kind();
    matches!(kind, ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
