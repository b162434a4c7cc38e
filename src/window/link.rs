//! OpenIGTLink beside the window: its server, which may be opened and closed at any time, and the
//! pictures for its clients.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use glam::DAffine3;
use parking_lot::Mutex;

use super::wake::Bell;
use crate::gpu::{GpuError, Image};
use crate::igtl::{IgtlError, Picture, Request, Server, ServerSettings, Status, TrackerState};
use crate::scene::Tracker;
use crate::sim::layout;

/// State of the server.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Report {
    /// Address at which it listens.
    pub(super) address: SocketAddr,
    /// Numbers of clients and messages so far.
    pub(super) status: Status,
    /// Reason for which the probe stays although messages come in.
    pub(super) silence: Option<String>,
    /// State of the tracker.
    pub(super) tracked: TrackerState,
}

/// The server, if there is one; window and simulation share it. Nothing done under its lock waits for
/// the network.
#[derive(Clone, Default)]
pub(super) struct Link(Arc<Mutex<Option<Server>>>);

impl Link {
    /// Starts a server in place of the one before; port 0 takes any that is free.
    pub(super) fn open(
        &self,
        (address, port): (IpAddr, u16),
        tracker: Tracker,
        bell: Bell,
    ) -> Result<SocketAddr, IgtlError> {
        let mut server = self.0.lock();
        // The old one first: it may hold the port.
        *server = None;
        let (at, settings) = (SocketAddr::new(address, port), ServerSettings::new(tracker));
        let opened = Server::bind_and_tell(at, settings, move || bell.ring())?;
        Ok(server.insert(opened).address())
    }

    /// Goes on with another scene's tracker.
    pub(super) fn calibrate(&self, tracker: Tracker) {
        if let Some(server) = &*self.0.lock() {
            server.calibrate(tracker);
        }
    }

    /// Ends all connections.
    pub(super) fn close(&self) {
        *self.0.lock() = None;
    }

    /// The oldest order of a client that nobody has taken.
    pub(super) fn request(&self) -> Option<Request> {
        self.0.lock().as_ref().and_then(Server::request)
    }

    /// State of the server; none without one.
    pub(super) fn report(&self) -> Option<Report> {
        self.0.lock().as_ref().map(|server| Report {
            address: server.address(),
            status: server.status(),
            silence: server.silent(),
            tracked: server.pose(),
        })
    }
}

/// The last picture of the simulation, for clients.
pub(super) struct Broadcast {
    link: Link,
    last: Option<(Image, layout::Frame, DAffine3)>,
}

impl Broadcast {
    pub(super) fn new(link: Link) -> Self {
        Self { link, last: None }
    }

    /// Offers a finished picture, with its pixels where they have been read, its constants and its pose.
    pub(super) fn offer(
        &mut self,
        image: &Image,
        rgba: Option<&[u8]>,
        constants: &layout::Frame,
        pose: DAffine3,
    ) -> Result<(), GpuError> {
        self.last = Some((image.clone(), *constants, pose));
        self.send(rgba)
    }

    /// Sends the last picture, also for a client that has just come. It is copied to the host only where there is a
    /// client; the server decides which client takes it and when.
    pub(super) fn send(&self, rgba: Option<&[u8]>) -> Result<(), GpuError> {
        let Some((image, constants, pose)) = &self.last else {
            return Ok(());
        };
        let clients = match &*self.link.0.lock() {
            Some(server) => {
                // Valid until there is a client, or until the next picture is published.
                server.outdate();
                server.status().clients
            }
            None => 0,
        };
        if clients == 0 {
            return Ok(());
        }
        let picture = match rgba {
            Some(rgba) => Picture::new(constants, rgba),
            None => Picture::new(constants, &image.read_back()?),
        };
        if let Some(server) = &*self.link.0.lock() {
            server.publish(picture, pose);
        }
        Ok(())
    }
}
