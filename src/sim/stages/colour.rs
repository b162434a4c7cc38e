//! `wall_filter`, `autocorrelation`, `gate` and `colour`: the pulses of a packet to colours over the image.

use super::super::layout::{COLOUR_COLUMNS, COLOUR_ROWS};
use super::super::pass::{Array, Extent, Pass, Sizes, per_pixel};
use super::super::passes::Passes;
use super::super::push;
use super::display::PIXELS;
use super::inputs::{FRAME, ROWS};
use crate::gpu::{Buffer, Commands, GpuError, Stage};
use crate::output::npy::Element::{Float, Word};
use crate::settings::Doppler;

/// Polynomials over the pulses of a packet.
pub const POLYNOMIALS: Array = Array::new("polynomials", Float, 1, |_| {
    u64::from(Doppler::MOST_PULSES) * u64::from(Doppler::MOST_ORDER + 1)
});
/// Echoes by pulse, scanline and sample of the box.
pub const PULSES: Array = Array::given("pulses", Float, 2);
/// Autocorrelation and power by scanline and sample of the box.
pub const LAGS: Array = Array::given("lags", Float, 3);
/// The same, averaged along the scanlines.
pub const CORRELATIONS: Array = Array::given("correlations", Float, 3);
/// Colours by variance or direction, and by velocity or power.
pub const COLOUR_MAP: Array =
    Array::new("colour_map", Word, 1, |_| u64::from(COLOUR_ROWS * COLOUR_COLUMNS));
/// The finished image with what flows in colours, RGBA.
pub const COLOURED: Array = Array::new("coloured", Word, 1, Sizes::pixels);

/// The stages, in order. Nothing in a scene needs them; [`Simulator::colour`](crate::Simulator::colour) asks for them.
pub const COLOUR: [Pass; 4] = [
    Pass {
        name: "wall_filter",
        binds: &[&POLYNOMIALS, &PULSES],
        makes: &[&POLYNOMIALS],
        needed: |_| false,
        ..Pass::USUAL
    },
    Pass { name: "autocorrelation", binds: &[&PULSES, &LAGS], needed: |_| false, ..Pass::USUAL },
    Pass { name: "gate", binds: &[&LAGS, &CORRELATIONS], needed: |_| false, ..Pass::USUAL },
    Pass {
        name: "colour",
        binds: &[&FRAME, &ROWS, &CORRELATIONS, &COLOUR_MAP, &PIXELS, &COLOURED],
        makes: &[&COLOUR_MAP, &COLOURED],
        extent: Some(per_pixel),
        then: Stage::Transfer,
        needed: |_| false,
        ..Pass::USUAL
    },
];

/// The work that the stages do on a packet.
pub(crate) struct Work {
    /// Orthonormal polynomials that are taken off its pulses, one after the other.
    pub(crate) polynomials: Vec<f32>,
    pub(crate) filter: push::WallFilter,
    /// Samples on each side that correlations are averaged over.
    pub(crate) reach: u32,
    /// Rows of the colour map, one after the other; red in the lowest byte.
    pub(crate) colours: Vec<u32>,
    pub(crate) colour: push::Colour,
}

impl Passes {
    /// Records the stages from `first` on for the first lane's packet and its finished image, which they leave as it is. Returns the coloured
    /// one, ready to be copied.
    pub(crate) fn colour(
        &mut self,
        cmd: &mut Commands<'_>,
        work: &Work,
        first: usize,
        fused: bool,
    ) -> Result<&Buffer, GpuError> {
        let buffers = &mut self.lanes[0].buffers;
        let made = COLOUR.iter().flat_map(|pass| pass.makes).copied();
        buffers.add(cmd.device(), made)?;
        cmd.write(&buffers[&POLYNOMIALS], 0, bytemuck::cast_slice(&work.polynomials))?;
        cmd.write(&buffers[&COLOUR_MAP], 0, bytemuck::cast_slice(&work.colours))?;
        cmd.barrier(Stage::Transfer, Stage::Compute);
        let push::WallFilter { count, lines, samples, taken } = work.filter;
        let lags = push::Autocorrelation { count, lines, samples };
        let gate = push::Gate { lines, samples, reach: work.reach };
        let pushes = [
            bytemuck::bytes_of(&work.filter),
            bytemuck::bytes_of(&lags),
            bytemuck::bytes_of(&gate),
            bytemuck::bytes_of(&work.colour),
        ];
        for (pass, push) in COLOUR.iter().zip(pushes).skip(first.max(usize::from(taken == 0))) {
            cmd.scope(pass.name);
            let of_box = Extent::Threads([samples, lines, 1]);
            let extent = pass.extent.map_or(of_box, |extent| extent(self.frame()));
            self.record(cmd, pass, extent, push, &|lane| {
                let packets = &lane.packets;
                let given = [
                    (&PULSES, &packets.pulses),
                    (&LAGS, &packets.lags),
                    (&CORRELATIONS, &packets.correlations),
                ];
                let given = given.into_iter().filter_map(|(of, held)| Some((of, held.as_ref()?)));
                given.chain([(&PIXELS, lane.pixels(fused))]).collect()
            })?;
        }
        Ok(&self.lanes[0].buffers[&COLOURED])
    }
}
