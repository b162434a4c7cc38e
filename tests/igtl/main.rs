//! OpenIGTLink: the codec against messages of other programs, the server against good and bad clients, and
//! the program. All traffic stays on this machine.

mod client;
mod codec;
mod hostile;
mod program;
mod queries;
mod session;
#[path = "../common/shared_data.rs"]
mod shared_data;
mod table;
mod vectors;
