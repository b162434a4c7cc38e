//! Tests of the window, on a display of its own.

mod common {
    #[allow(dead_code, reason = "what only the tests of the server use")]
    pub mod client;
    pub mod skip;
    pub mod vessel;
}

mod view;
