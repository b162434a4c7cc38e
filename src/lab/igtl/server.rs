//! The server: one thread that lets clients in, two for each of them.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use glam::DAffine3;
use parking_lot::Mutex;

use super::client::{CHECK_INTERVAL, Client};
use super::command::{Order, Request};
use super::message::Message;
use super::picture::{Picture, Published};
use super::status::Status;
use super::tracking::{TrackerState, Tracking};
use super::{answer, receive};
use crate::scene::tracker::Tracker;

/// Time between two looks of the listener for clients.
const ACCEPT_INTERVAL: Duration = Duration::from_millis(10);
/// Most orders of clients that may wait for the program.
const MOST_REQUESTS: usize = 64;
/// Most refused clients whose last bytes are read before they are dropped, and for how long: a
/// connection that is closed over unread bytes is reset, and the refusal would never arrive.
const MOST_LINGERING: usize = 16;
pub(super) const LINGER_TIME: Duration = Duration::from_millis(300);

/// The reason why the server cannot run.
#[derive(Debug, thiserror::Error)]
pub enum IgtlError {
    /// The address cannot be listened at.
    #[error("listening at {address} for OpenIGTLink: {cause}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The system's message.
        cause: std::io::Error,
    },
}

impl IgtlError {
    /// The remedy for the user.
    pub fn remedy(&self) -> &'static str {
        let Self::Bind { cause, .. } = self;
        match cause.kind() {
            ErrorKind::AddrInUse => {
                "another program listens there, such as a PlusServer or this program: choose another \
                 port (--igtl-port)"
            }
            ErrorKind::AddrNotAvailable => {
                "give --igtl-bind an address of this machine, such as 127.0.0.1 or 0.0.0.0"
            }
            _ => "choose another --igtl-port or --igtl-bind",
        }
    }
}

/// Settings for clients.
#[derive(Clone, Debug)]
pub struct ServerSettings {
    /// The tool that moves the probe, and its calibration.
    pub tracker: Tracker,
    /// Most clients at a time. A further one takes the place of the one that has been silent longest, if for [`Self::silence`];
    /// else it is told so and disconnected.
    pub clients: usize,
    /// Time without a message after which a client gives way to another.
    pub silence: Duration,
    /// Time between the first and the last byte of a message from a client; messages that are
    /// skipped have a second more for each megabyte.
    pub message_timeout: Duration,
    /// Time within which a client has to take a message.
    pub send_timeout: Duration,
    /// Longest body that is skipped, bytes.
    pub skipped_bytes: u64,
}

impl ServerSettings {
    /// The usual limits.
    pub fn new(tracker: Tracker) -> Self {
        Self {
            tracker,
            clients: 8,
            silence: Duration::from_secs(60),
            message_timeout: Duration::from_secs(5),
            send_timeout: Duration::from_secs(20),
            skipped_bytes: 1 << 30,
        }
    }
}

/// State shared by all threads.
pub(super) struct Shared {
    pub settings: ServerSettings,
    pub tracking: Tracking,
    latest: Mutex<Option<Arc<Published>>>,
    clients: Mutex<Vec<Arc<Client>>>,
    requests: Mutex<VecDeque<Request>>,
    status: Mutex<Status>,
    stopping: AtomicBool,
    /// True where the last published frame no longer shows the present scene.
    outdated: AtomicBool,
    notify: Box<dyn Fn() + Send + Sync>,
}

impl Shared {
    /// The last published frame.
    pub fn latest(&self) -> Option<Arc<Published>> {
        self.latest.lock().clone()
    }

    /// The frame for a client that has just come.
    fn first(&self) -> Option<Arc<Published>> {
        match self.outdated.load(Ordering::Relaxed) {
            true => None,
            false => self.latest(),
        }
    }

    /// The reason for which the probe stays although messages come in.
    pub fn silent(&self) -> Option<String> {
        let tracker = self.tracking.tracker();
        self.status.lock().silence(tracker.device.as_deref())
    }

    /// Queues a client's order for the program; returns false where too many wait.
    pub fn request(&self, client: &Client, query: Message, order: Order) -> bool {
        let clients = self.clients.lock();
        let Some(client) = clients.iter().find(|own| std::ptr::eq(&***own, client)).cloned() else {
            // It is being disconnected, and hears no answer.
            return true;
        };
        drop(clients);
        let mut requests = self.requests.lock();
        if requests.len() >= MOST_REQUESTS {
            return false;
        }
        requests.push_back(Request { order, client, query });
        drop(requests);
        self.tell();
        true
    }

    /// Reports that a pose has arrived, or that clients or errors have changed.
    pub fn tell(&self) {
        (self.notify)();
    }

    /// Changes the counts.
    pub fn count(&self, change: impl FnOnce(&mut Status)) {
        change(&mut self.status.lock());
    }

    /// Counts a client's fault.
    pub fn fault(&self, client: &Client, why: &str) {
        self.error(format!("{}: {why}", client.peer));
    }

    fn error(&self, why: String) {
        self.count(|status| {
            status.errors += 1;
            status.last_error = Some(why);
        });
        self.tell();
    }
}

/// Listens for OpenIGTLink clients until it is dropped, which ends their connections.
pub struct Server {
    shared: Arc<Shared>,
    address: SocketAddr,
    listener: Option<JoinHandle<()>>,
}

impl Server {
    /// Listens at `address`; port 0 takes any that is free.
    ///
    /// # Errors
    /// The address is taken, or not this machine's.
    pub fn bind(address: SocketAddr, settings: ServerSettings) -> Result<Self, IgtlError> {
        Self::bind_and_tell(address, settings, || {})
    }

    /// Like [`Server::bind`]; `notify` is called, from threads of the server, whenever a pose or an order has arrived and when
    /// clients or errors have changed. It must not wait.
    ///
    /// # Errors
    /// Those of [`Server::bind`].
    pub fn bind_and_tell(
        address: SocketAddr,
        settings: ServerSettings,
        notify: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, IgtlError> {
        let fail = |cause| IgtlError::Bind { address, cause };
        let listener = TcpListener::bind(address).map_err(fail)?;
        // A listener that waited could not be stopped.
        listener.set_nonblocking(true).map_err(fail)?;
        let bound = listener.local_addr().map_err(fail)?;
        let shared = Arc::new(Shared {
            tracking: Tracking::new(settings.tracker.clone()),
            settings,
            latest: Mutex::new(None),
            clients: Mutex::new(Vec::new()),
            requests: Mutex::default(),
            status: Mutex::new(Status::default()),
            stopping: AtomicBool::new(false),
            outdated: AtomicBool::new(false),
            notify: Box::new(notify),
        });
        let thread = {
            let shared = Arc::clone(&shared);
            let builder = thread::Builder::new().name("igtl listener".to_owned());
            builder.spawn(move || Acceptor::new(shared).run(&listener)).map_err(fail)?
        };
        Ok(Self { shared, address: bound, listener: Some(thread) })
    }

    /// Address at which it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The oldest order of a client that has not been taken; whoever takes it answers it. Does not wait for the network.
    pub fn request(&self) -> Option<Request> {
        self.shared.requests.lock().pop_front()
    }

    /// State of the tracker. Does not wait for the network.
    pub fn pose(&self) -> TrackerState {
        self.shared.tracking.now()
    }

    /// Goes on with another scene's tracker. Poses from the one before are forgotten.
    pub fn calibrate(&self, tracker: Tracker) {
        self.shared.tracking.calibrate(tracker);
    }

    /// Offers a picture and its pose to every client: those still taking an older one get the newest
    /// afterwards. Does not wait for the network.
    pub fn publish(&self, picture: Picture, world_from_probe: &DAffine3) {
        let axes = self.shared.tracking.tracker().axes;
        let frame = Arc::new(Published::new(picture, axes.to_ras() * *world_from_probe));
        *self.shared.latest.lock() = Some(Arc::clone(&frame));
        self.shared.outdated.store(false, Ordering::Relaxed);
        let clients = self.shared.clients.lock().clone();
        let late = clients.iter().filter(|c| c.offer(Arc::clone(&frame)));
        let late = late.count() as u64;
        self.shared.count(|status| status.images_dropped += late);
    }

    /// Marks the last published picture as outdated, since without clients no newer one is published: the
    /// next client is not sent it unasked.
    pub fn outdate(&self) {
        self.shared.outdated.store(true, Ordering::Relaxed);
    }

    /// The reason for which the probe stays although messages come in: none of them is the tool that it is to follow.
    pub fn silent(&self) -> Option<String> {
        self.shared.silent()
    }

    /// Counts of events so far.
    pub fn status(&self) -> Status {
        self.shared.status.lock().clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stopping.store(true, Ordering::Relaxed);
        if let Some(listener) = self.listener.take() {
            // It panics only through a bug that has been reported already.
            let _ = listener.join();
        }
    }
}

/// Lets clients in, and removes those that have gone.
struct Acceptor {
    shared: Arc<Shared>,
    threads: Vec<(Arc<Client>, [JoinHandle<()>; 2])>,
    refused: VecDeque<(TcpStream, Instant)>,
}

impl Acceptor {
    fn new(shared: Arc<Shared>) -> Self {
        Self { shared, threads: Vec::new(), refused: VecDeque::new() }
    }

    fn run(mut self, listener: &TcpListener) {
        while !self.shared.stopping.load(Ordering::Relaxed) {
            match listener.accept() {
                Ok((stream, peer)) => {
                    self.see_out();
                    if let Err(error) = self.let_in(stream, peer) {
                        self.shared.error(format!("{peer}: letting it in: {error}"));
                    }
                }
                Err(error) => {
                    if error.kind() != ErrorKind::WouldBlock {
                        self.shared.error(format!("accepting a client: {error}"));
                    }
                    self.see_out();
                    thread::sleep(ACCEPT_INTERVAL);
                }
            }
        }
        for (client, threads) in self.threads {
            client.close();
            for thread in threads {
                let _ = thread.join();
            }
        }
    }

    /// Removes the clients that have gone.
    fn see_out(&mut self) {
        let ended = |threads: &[JoinHandle<()>; 2]| threads.iter().all(JoinHandle::is_finished);
        self.threads.retain(|(_, threads)| !ended(threads));
        self.shared.clients.lock().retain(|client| !client.is_closed());
        let mut scratch = [0; 4096];
        self.refused.retain_mut(|(stream, since)| {
            let open = match stream.read(&mut scratch) {
                Ok(count) => count > 0,
                Err(error) => error.kind() == ErrorKind::WouldBlock,
            };
            open && since.elapsed() < LINGER_TIME
        });
        let seated = self.threads.len();
        let mut before = seated;
        self.shared.count(|status| before = std::mem::replace(&mut status.clients, seated));
        if seated != before {
            self.shared.tell();
        }
    }

    fn let_in(&mut self, stream: TcpStream, peer: SocketAddr) -> std::io::Result<()> {
        let most = self.shared.settings.clients;
        // Threads, not connections: one that is ending still takes room.
        if self.threads.len() >= most && !self.make_room() {
            self.shared.count(|status| status.refused += 1);
            self.shared.tell();
            return self.refuse(stream, most);
        }
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(CHECK_INTERVAL))?;
        stream.set_write_timeout(Some(CHECK_INTERVAL))?;
        // Both under one lock: a frame that is published now reaches it one way or the other.
        let client = {
            let mut clients = self.shared.clients.lock();
            let client = Arc::new(Client::new(stream, peer, self.shared.first()));
            clients.push(Arc::clone(&client));
            client
        };
        let start = |name: &str, work: fn(&Client, &Shared)| {
            let (client, shared) = (Arc::clone(&client), Arc::clone(&self.shared));
            let builder = thread::Builder::new().name(format!("igtl {name}"));
            builder.spawn(move || work(&client, &shared))
        };
        let threads = start("sender", Client::send_all)
            .and_then(|sender| Ok([sender, start("receiver", receive::receive_all)?]));
        match threads {
            Ok(threads) => self.threads.push((client, threads)),
            // A sender without its receiver ends with the connection.
            Err(error) => {
                client.close();
                return Err(error);
            }
        }
        let seated = self.threads.len();
        self.shared.count(|status| {
            status.accepted += 1;
            status.clients = seated;
        });
        self.shared.tell();
        Ok(())
    }

    /// Asks the client that has been silent longest to go; returns false where none has been silent for long enough. There is
    /// one more than may be until it has gone.
    fn make_room(&self) -> bool {
        let silent = self.threads.iter().filter_map(|(c, _)| Some((c, c.silence()?)));
        let longest = silent.max_by_key(|(_, silence)| *silence);
        let least = self.shared.settings.silence;
        let Some((client, silence)) = longest.filter(|(_, silence)| *silence >= least) else {
            return false;
        };
        client.ask_to_go(format!(
            "nothing came from it for {:.0} s, and another client needs its place",
            silence.as_secs_f64()
        ));
        true
    }

    /// Refuses a client; the message fits into the buffers of a new connection.
    fn refuse(&mut self, mut stream: TcpStream, most: usize) -> std::io::Result<()> {
        stream.set_nonblocking(true)?;
        stream.write_all(&answer::no_room(most))?;
        stream.shutdown(Shutdown::Write)?;
        self.refused.truncate(MOST_LINGERING - 1);
        self.refused.push_front((stream, Instant::now()));
        Ok(())
    }
}
