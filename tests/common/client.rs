//! A client controlled by a test, and its server.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use insonify::igtl::message::{Content, HEADER, Header, Message};
use insonify::igtl::{Picture, Server, ServerSettings};
use insonify::scene::Tracker;
use insonify::sim::layout;

/// Longest wait: on an idle machine everything here is much faster.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Short limits, so that a test can wait for them; but a pose never grows old, and no client too silent, however busy
/// the machine is.
pub fn settings() -> ServerSettings {
    let tracker = Tracker { timeout: 3600.0, ..Tracker::default() };
    ServerSettings {
        clients: 4,
        silence: Duration::from_secs(3600),
        message_timeout: Duration::from_millis(400),
        send_timeout: Duration::from_millis(800),
        ..ServerSettings::new(tracker)
    }
}

pub fn serve(settings: ServerSettings) -> Server {
    let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    Server::bind(any, settings).expect("a free port")
}

/// Waits until something holds.
pub fn until(what: &str, holds: impl Fn() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !holds() {
        assert!(Instant::now() < end, "in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// An image of 2 x 1 mm a pixel column and row, with its top at the face.
pub fn picture(width: u32, height: u32, colour: impl Fn(u32) -> [u8; 4]) -> Picture {
    let frame = layout::Frame {
        image_width: width,
        image_height: height,
        pixel_pitch: 0.5,
        image_left: -0.25 * width as f32,
        image_top: 0.0,
        slice_thickness: 3.0,
        ..layout::Frame::default()
    };
    let rgba: Vec<u8> = (0..width * height).flat_map(colour).collect();
    Picture::new(&frame, &rgba)
}

/// A grey image.
pub fn grey(width: u32, height: u32) -> Picture {
    picture(width, height, |i| [i as u8, i as u8, i as u8, 255])
}

pub struct Client {
    pub stream: TcpStream,
}

impl Client {
    pub fn connect(server: &Server) -> Self {
        Self::at(server.address())
    }

    pub fn at(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("set");
        stream.set_write_timeout(Some(PATIENCE)).expect("set");
        Self { stream }
    }

    /// Sends bytes; the other side may have ended the connection already.
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes);
    }

    pub fn send(&mut self, message: &Message) {
        self.send_bytes(&message.encode());
    }

    pub fn transform(&mut self, device: &str, matrix: [f32; 12]) {
        self.send(&Message::new(device, Content::Transform(matrix)));
    }

    /// A query without content.
    pub fn ask(&mut self, kind: &str, device: &str) {
        self.send(&query(kind, device));
    }

    /// The next message; none where the server has ended the connection.
    pub fn receive(&mut self) -> Option<Message> {
        let mut header = [0; HEADER];
        if self.stream.read(&mut header[..1]).expect("in time") == 0 {
            return None;
        }
        self.stream.read_exact(&mut header[1..]).expect("whole");
        let header = Header::decode(&header).expect("a header");
        let mut body = vec![0; header.body_size as usize];
        self.stream.read_exact(&mut body).expect("whole");
        Some(Message::decode(&header, &body).expect("sound"))
    }

    /// The next message of a type.
    pub fn receive_kind(&mut self, kind: &str) -> Message {
        loop {
            let message = self.receive().expect("a message");
            if message.content.kind().is(kind) {
                return message;
            }
        }
    }

    /// Returns whether the server ends the connection, whatever it sends before.
    pub fn is_ended(&mut self) -> bool {
        let mut scratch = [0; 1 << 16];
        loop {
            match self.stream.read(&mut scratch) {
                Ok(0) => return true,
                Ok(_) => {}
                Err(error) => {
                    return matches!(
                        error.kind(),
                        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted
                    );
                }
            }
        }
    }
}

/// A query without content.
pub fn query(kind: &str, device: &str) -> Message {
    let kind = insonify::igtl::wire::Label::new(kind);
    Message::new(device, Content::Other { kind, bytes: Vec::new() })
}

/// A shift in mm in the form of messages.
pub fn shift(x: f32, y: f32, z: f32) -> [f32; 12] {
    [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, x, y, z]
}
