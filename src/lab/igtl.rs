//! OpenIGTLink: a server to which trackers and viewers connect (protocol versions 1 to 3; Tokuda et
//! al., Int J Med Robotics 5, 2009). A client moves the probe by TRANSFORM or TDATA messages; every
//! client that has room receives the B-mode image and the probe's pose. COMMAND and STRING messages set
//! keys of the scene file, time and scene, and are answered.
//!
//! In messages everything is in RAS and mm: 3D Slicer reads matrices so, whatever axes an image states.

mod answer;
mod client;
pub mod command;
pub mod image;
pub mod message;
mod metadata;
mod picture;
mod reach;
mod receive;
mod server;
mod status;
mod tools;
mod tracking;
pub mod wire;

pub use command::{Order, Request};
pub use picture::Picture;
pub use reach::Reach;
pub use server::{IgtlError, Server, ServerSettings};
pub use status::Status;
pub use tracking::{TrackedPose, TrackerState};

/// Device name of the images.
pub const IMAGE_DEVICE: &str = "BMode";
/// Device name of the probe's pose.
pub const POSE_DEVICE: &str = "ProbeToWorld";
/// The protocol's usual port.
pub const PORT: u16 = 18944;

/// Warning about a server that other machines can reach.
pub const OPEN: &str = "whoever reaches this machine can move the probe and see the images; OpenIGTLink \
    knows no passwords";
