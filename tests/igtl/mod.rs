//! OpenIGTLink: the codec against messages of other programs, the server against good and bad clients, and
//! the program. All traffic stays on this machine.

mod codec;
mod hostile;
mod program;
mod queries;
mod session;
mod table;
mod vectors;
