//! A connected client: messages waiting for it, and the thread that sends them.

use std::collections::VecDeque;
use std::io::{ErrorKind, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

use super::answer::tracking_message;
use super::picture::Published;
use super::server::Shared;

/// Most answers that may wait. Nobody asks for so many before reading one.
const MOST_ANSWERS: usize = 64;
/// Time after which a thread that waits for the network checks its own time limit.
pub(super) const CHECK_INTERVAL: Duration = Duration::from_millis(250);

/// An answer to a query. Images and poses are looked up when they are sent, so that many queries
/// hold no more memory than one.
pub(super) enum Answer {
    Message(Vec<u8>),
    Image,
    Transform,
    Tracking,
}

/// Messages that a client receives unasked.
pub(super) struct Subscriptions {
    pub image: bool,
    pub transform: bool,
    /// Least time between TDATA messages; none: they are not wanted.
    pub tracking: Option<Duration>,
}

struct Outbox {
    answers: VecDeque<Answer>,
    /// The newest frame not yet sent to the client.
    frame: Option<Arc<Published>>,
    wants: Subscriptions,
    tracking_sent: Option<Instant>,
    /// True where nothing follows the answers that wait.
    dismissed: bool,
    /// The reason for which it has been asked to go.
    unwanted: Option<String>,
    closed: bool,
    /// Arrival of its last message, or its own.
    heard: Instant,
}

pub(super) struct Client {
    pub stream: TcpStream,
    pub peer: SocketAddr,
    outbox: Mutex<Outbox>,
    changed: Condvar,
}

/// The reason why nothing more can be sent.
enum ConnectionEnd {
    /// The client has left, as it may at any time.
    Left,
    Fault(String),
}

/// Returns whether the other side has ended the connection, having read everything or not.
pub(super) fn has_left(error: &std::io::Error) -> bool {
    let kind = error.kind();
    matches!(
        kind,
        ErrorKind::BrokenPipe | ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted
    )
}

/// The next item that its thread sends.
enum NextMessage {
    Answer(Answer),
    Frame(Arc<Published>),
}

impl Client {
    pub fn new(stream: TcpStream, peer: SocketAddr, frame: Option<Arc<Published>>) -> Self {
        Self {
            stream,
            peer,
            outbox: Mutex::new(Outbox {
                answers: VecDeque::new(),
                frame,
                wants: Subscriptions { image: true, transform: true, tracking: None },
                tracking_sent: None,
                dismissed: false,
                unwanted: None,
                closed: false,
                heard: Instant::now(),
            }),
            changed: Condvar::new(),
        }
    }

    /// Hands over a frame; returns whether it replaces one that was not sent yet.
    pub fn offer(&self, frame: Arc<Published>) -> bool {
        let mut outbox = self.outbox.lock();
        // A client that has just come may have been given this very frame already.
        let late = |old: &Arc<Published>| !Arc::ptr_eq(old, &frame);
        let late = outbox.frame.as_ref().is_some_and(late);
        outbox.frame = Some(frame);
        self.changed.notify_one();
        late
    }

    /// Queues an answer; returns false when too many wait.
    pub fn answer(&self, answer: Answer) -> bool {
        let mut outbox = self.outbox.lock();
        if outbox.answers.len() >= MOST_ANSWERS {
            return false;
        }
        outbox.answers.push_back(answer);
        self.changed.notify_one();
        true
    }

    /// Changes the messages that it receives unasked.
    pub fn choose(&self, change: impl FnOnce(&mut Subscriptions)) {
        change(&mut self.outbox.lock().wants);
    }

    /// Notes that a message of its comes.
    pub fn hear(&self) {
        self.outbox.lock().heard = Instant::now();
    }

    /// Time since its last message; none where it has been asked to go, or has gone.
    pub fn silence(&self) -> Option<Duration> {
        let outbox = self.outbox.lock();
        (!outbox.closed && outbox.unwanted.is_none()).then(|| outbox.heard.elapsed())
    }

    /// Asks it to go: the thread that waits for its messages ends the connection.
    pub fn ask_to_go(&self, why: String) {
        self.outbox.lock().unwanted = Some(why);
    }

    /// The reason for which it has been asked to go.
    pub fn unwanted(&self) -> Option<String> {
        self.outbox.lock().unwanted.clone()
    }

    /// Sends a last message, and nothing after it.
    pub fn dismiss(&self, last: Vec<u8>) {
        let mut outbox = self.outbox.lock();
        outbox.answers.clear();
        outbox.answers.push_back(Answer::Message(last));
        outbox.dismissed = true;
        self.changed.notify_one();
    }

    /// Ends the connection: both threads return soon.
    pub fn close(&self) {
        self.outbox.lock().closed = true;
        self.changed.notify_one();
        // It fails where the other side has ended the connection already.
        let _ = self.stream.shutdown(Shutdown::Both);
    }

    pub fn is_closed(&self) -> bool {
        self.outbox.lock().closed
    }

    /// Waits for the next item to send; none when the connection has ended.
    fn next(&self) -> Option<NextMessage> {
        let mut outbox = self.outbox.lock();
        loop {
            if outbox.closed {
                return None;
            }
            if let Some(answer) = outbox.answers.pop_front() {
                return Some(NextMessage::Answer(answer));
            }
            if outbox.dismissed {
                return None;
            }
            if let Some(frame) = outbox.frame.take() {
                return Some(NextMessage::Frame(frame));
            }
            self.changed.wait(&mut outbox);
        }
    }

    /// Returns whether image, pose and TDATA are to be sent now.
    fn due(&self) -> (bool, bool, bool) {
        let outbox = &mut *self.outbox.lock();
        let now = Instant::now();
        let tracking = outbox.wants.tracking.is_some_and(|least| {
            let sent = outbox.tracking_sent;
            sent.is_none_or(|sent| now.duration_since(sent) >= least)
        });
        if tracking {
            outbox.tracking_sent = Some(now);
        }
        (outbox.wants.image, outbox.wants.transform, tracking)
    }

    /// Sends until the connection ends.
    pub fn send_all(&self, shared: &Shared) {
        while let Some(next) = self.next() {
            if let Err(end) = self.send(next, shared) {
                match end {
                    ConnectionEnd::Fault(why) if !self.is_closed() => shared.fault(self, &why),
                    _ => {}
                }
                break;
            }
        }
        let dismissed = self.outbox.lock().dismissed;
        match dismissed {
            // Who receives closes it; it fails where the other side has done so.
            true => drop(self.stream.shutdown(Shutdown::Write)),
            false => self.close(),
        }
    }

    fn send(&self, next: NextMessage, shared: &Shared) -> Result<(), ConnectionEnd> {
        let limit = shared.settings.send_timeout;
        let put = |bytes: &[u8]| write(&self.stream, bytes, limit);
        match next {
            NextMessage::Answer(Answer::Message(bytes)) => put(&bytes),
            NextMessage::Answer(answer) => {
                // Queued only where there is one, and from then on there always is.
                let frame = shared.latest().expect("a frame was published");
                match answer {
                    Answer::Image => put(frame.image()),
                    Answer::Transform => put(frame.transform()),
                    _ => put(&tracking_message(&frame)),
                }
            }
            NextMessage::Frame(frame) => {
                let (image, transform, tracking) = self.due();
                if transform {
                    put(frame.transform())?;
                }
                if tracking {
                    put(&tracking_message(&frame))?;
                }
                if image {
                    put(frame.image())?;
                    shared.count(|status| status.images_sent += 1);
                }
                Ok(())
            }
        }
    }
}

/// Writes all of `bytes`, or fails after `limit`, however little and often the other side reads.
fn write(mut stream: &TcpStream, mut bytes: &[u8], limit: Duration) -> Result<(), ConnectionEnd> {
    let end = Instant::now() + limit;
    while !bytes.is_empty() {
        match stream.write(bytes) {
            Ok(0) => return Err(ConnectionEnd::Left),
            Ok(count) => bytes = &bytes[count..],
            Err(error) => match error.kind() {
                ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut => {}
                _ if has_left(&error) => return Err(ConnectionEnd::Left),
                _ => return Err(ConnectionEnd::Fault(format!("sending: {error}"))),
            },
        }
        if !bytes.is_empty() && Instant::now() > end {
            let limit = limit.as_secs_f64();
            let why = format!("it did not take a message within {limit} s");
            return Err(ConnectionEnd::Fault(why));
        }
    }
    Ok(())
}
