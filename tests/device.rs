//! Tests of what the library computes on a Vulkan device.

mod common {
    pub mod crossings;
    pub mod moments;
    pub mod program;
    pub mod shared_data;
    pub mod signal;
    pub mod skip;
    pub mod timestamps;
    pub mod tracers;
}

mod animation;
mod biometry;
mod bumps;
mod contact;
mod extremes;
mod fascia;
mod frame;
mod fusion;
mod gpu;
mod greys;
mod intersect;
mod kernels;
mod labels;
mod lattice;
mod line;
mod live;
mod packet;
mod physics;
mod probe;
mod series;
mod shipped;
mod shots;
mod skipping;
mod spectrum;
mod strain;
mod tasks;
mod texture;
mod view3d;
