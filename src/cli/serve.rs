//! `insonify serve`: the simulator without a window. A tracker moves the probe over OpenIGTLink, and all
//! connected clients receive the images.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use glam::DAffine3;
use miette::{IntoDiagnostic, Result, miette};

use super::common::{self, Common};
use insonify::igtl::{self, Order, Picture, Server, Status, TrackerState};
use insonify::live::{self, Level, Pace};
use insonify::output;
use insonify::scene::Scene;
use insonify::sim;

mod session;

use session::{Served, Session};

/// Pause where nothing has changed: a tracker sends 30 to 100 poses a second.
const REST: Duration = Duration::from_millis(3);
/// Time between reports about clients and errors.
const NOTICE_PERIOD: Duration = Duration::from_secs(1);

/// Arguments of `insonify serve`.
#[derive(Debug, clap::Args)]
pub struct Serve {
    /// Scene file (.toml). Its [tracker] says which tool moves the probe.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// Port for OpenIGTLink; 0 takes any that is free, and says which.
    #[arg(long, value_name = "PORT", default_value_t = igtl::PORT)]
    igtl_port: u16,
    /// Address of this machine to listen at; 0.0.0.0 lets other machines in.
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    igtl_bind: IpAddr,
    /// Ends after as many images [default: goes on until it is stopped, as by Ctrl-C]. An image is
    /// made only when the probe or the anatomy has moved.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Images per second at most.
    #[arg(long, default_value_t = 30.0, value_parser = common::between(0.1, 1000.0))]
    fps: f64,
    #[command(flatten)]
    common: Common,
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Serve) -> Result<()> {
    let mut session = Session::new(args)?;
    let address = SocketAddr::new(args.igtl_bind, args.igtl_port);
    let settings = igtl::ServerSettings::new(session.scene.tracker.clone());
    let server = Server::bind(address, settings)
        .map_err(|error| miette!(help = error.remedy(), "{error}"))?;
    if !args.igtl_bind.is_loopback() {
        output::note(format!("warning: {}", igtl::OPEN));
    }
    output::line(format!("listening at {} (OpenIGTLink)", server.address()));
    simulate(&mut session, &server, args)?;
    args.common.validated(&session.device)
}

/// The last image: its state of the scene, and its level of quality.
struct Shown {
    state: (DAffine3, Vec<Placed>),
    level: usize,
    at: Instant,
}

/// Makes an image whenever probe, anatomy or settings have changed, at a level of quality that keeps the budget, and
/// finer ones once they rest; offers them to the clients, and carries out what they order.
fn simulate(session: &mut Session, server: &Server, args: &Serve) -> Result<()> {
    let pause = Duration::from_secs_f64(1.0 / args.fps);
    let mut notices = Notices::default();
    let mut pace = Pace::new(sim::machine(&session.device));
    let mut shown: Option<Shown> = None;
    let mut frames = 0;
    let mut due = Instant::now();
    loop {
        notices.update(server);
        while let Some(request) = server.request() {
            let outcome = request.order.carry_out(&mut Served { session, server });
            if outcome.is_ok() && !matches!(request.order, Order::Get(_)) {
                shown = None;
            }
            request.answer(outcome);
        }
        if session.is_frozen() {
            thread::sleep(REST);
            continue;
        }
        let seconds = session.seconds();
        let scene = &mut session.scene;
        scene.set_time(seconds);
        if let Some(pose) = server.pose().pose() {
            scene.world_from_probe = pose.world_from_probe;
        }
        let now = state(scene);
        let last = shown.as_ref().filter(|last| last.state == now);
        let finer = last.filter(|last| last.at.elapsed() >= live::REST);
        let finer = finer.and_then(|last| pace.refined(last.level));
        if (last.is_some() && finer.is_none()) || Instant::now() < due {
            thread::sleep(REST);
            continue;
        }
        let start = Instant::now();
        due = start + pause;
        let own = Level::of(scene);
        let level = finer.unwrap_or_else(|| pace.moving(scene));
        pace.apply(level, scene);
        // The scene's own image at rest is that of `render`.
        let noise = match (level, finer) {
            (0, Some(_)) => 0,
            _ => frames,
        };
        let simulator = &mut session.simulator;
        simulator.frame(scene, noise).into_diagnostic()?;
        let (_, _, rgba) = simulator.pixels().into_diagnostic()?;
        own.apply(scene);
        // The very first frame includes kernels that the driver compiles late.
        if frames > 0 {
            pace.finished(level, start.elapsed().as_secs_f64() * 1e3);
        }
        let picture = Picture::new(simulator.constants(), &rgba);
        server.publish(picture, &scene.world_from_probe);
        shown = Some(Shown { state: now, level, at: Instant::now() });
        frames += 1;
        if Some(frames) == args.frames {
            return Ok(());
        }
    }
}

/// Placement, visibility and shape of an instance.
type Placed = (DAffine3, bool, usize, [(usize, f64); 4]);

/// The part of a scene that changes with time and tracker.
fn state(scene: &Scene) -> (DAffine3, Vec<Placed>) {
    let placed = scene.instances.iter();
    let placed = placed.map(|i| (i.world_from_object, i.shown, i.mesh, i.keyframes.blend));
    (scene.world_from_probe, placed.collect())
}

/// Reports already made to the user.
#[derive(Default)]
struct Notices {
    tracker: String,
    /// Time of that report.
    tracked: Option<Instant>,
    /// Reason for which nothing moves the probe; empty without one.
    silence: String,
    status: Status,
    at: Option<Instant>,
}

impl Notices {
    /// Reports news of the tracker at once, but no more than once a second: a tool that is seen in every other message is
    /// neither lost nor found as often. So are clients and errors.
    fn update(&mut self, server: &Server) {
        let tracker = match server.pose() {
            TrackerState::Never => String::new(),
            TrackerState::Live(pose) => format!("tracker: {} moves the probe", pose.device),
            TrackerState::Lost(pose) => {
                format!("tracker: {} is lost; the probe stays", pose.device)
            }
        };
        let recent = |at: Option<Instant>| at.is_some_and(|at| at.elapsed() < NOTICE_PERIOD);
        if tracker != self.tracker && !recent(self.tracked) {
            output::note(&tracker);
            (self.tracker, self.tracked) = (tracker, Some(Instant::now()));
        }
        if recent(self.at) {
            return;
        }
        self.at = Some(Instant::now());
        let status = server.status();
        if status.clients != self.status.clients {
            output::note(format!("clients: {}", status.clients));
        }
        if status.refused != self.status.refused {
            output::note(format!("clients refused, because there is no room: {}", status.refused));
        }
        let silence = server.silent().unwrap_or_default();
        if silence != self.silence {
            if !silence.is_empty() {
                output::note(format!("warning: {silence}"));
            }
            self.silence = silence;
        }
        if status.unchecked > 0 && self.status.unchecked == 0 {
            output::note(
                "warning: messages come without checksums: what is damaged on its way is not noticed",
            );
        }
        if status.errors != self.status.errors {
            let last = status.last_error.as_deref().unwrap_or_default();
            output::note(format!("errors: {}, the last: {last}", status.errors));
        }
        self.status = status;
    }
}
