//! Tests of the program `insonify`, run as by a user.

mod common {
    pub mod client;
    pub mod limited;
    pub mod moments;
    pub mod program;
    pub mod python;
    pub mod shared_data;
    pub mod skip;
    pub mod timestamps;
    pub mod tracers;
    pub mod vessel;
}

mod acquire;
mod cli;
mod dataset;
mod defects;
mod doppler;
mod drivers;
mod homeless;
mod igtl;
mod import;
mod inputs;
mod loops;
mod matching;
mod paths;
mod reconstruct;
mod register;
mod study;
mod vary;
