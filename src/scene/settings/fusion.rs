//! Settings of fusion: the display of an acquired volume, and its mixing with the simulation.

use glam::DAffine3;

use super::group;
use super::words;

const INF: f64 = f64::INFINITY;
const OFF: f64 = f64::NEG_INFINITY;

words! {
    /// The picture around the masking meshes.
    pub enum Surroundings {
        /// The acquired volume.
        Volume = "volume",
        /// Nothing: sound passes and is absorbed there, but does not echo.
        None = "none",
        /// The scene's own anatomy with its scatterers: as without fusion.
        Scatterers = "scatterers",
    }
}

words! {
    /// The transition between the two images at the border of the mask.
    pub enum Blend {
        /// Along the ramp that the box blur makes of the mask (the paper).
        Linear = "linear",
        /// The same ramp through the smoothstep 3 m^2 - 2 m^3.
        Smooth = "smooth",
        /// By bands of an image pyramid, each over as many pixels as its structures are wide (Burt and
        /// Adelson, ACM Transactions on Graphics 2(4), 1983).
        Multiband = "multiband",
    }
}

words! {
    /// The speed at which the scanlines' samples pass through the masking meshes; mask and volume are looked up
    /// there.
    #[derive(Default)]
    pub enum MaskSpeed {
        /// The speed of the tissue that the masking mesh encloses, as for sound (the paper). The mask's far
        /// border lies where its surface echoes.
        #[default]
        Enclosing = "enclosing",
        /// The probe's speed, as around the meshes: the volume is shown undistorted.
        Probe = "probe",
    }
}

group! {
    /// On-the-fly fusion of the acquired volume with the simulation.
    pub struct Fusion in "fusion" {
        /// Around the mask: the acquired volume; nothing; or the scene's own anatomy and scatterers, as without
        /// `[fusion]`.
        surroundings: Surroundings = Surroundings::Volume,
            Facts::word::<Surroundings>().label("Around the mask");
        /// Edge of the box by which the scan-converted mask is blurred: the two images fade into each other over as
        /// many pixels.
        blur: u32 = 32,
            Facts::whole(1, 512).counted("pixels").label("Blur").usual(1.0, 128.0);
        /// Blending of both images: by the blurred mask itself, as in the paper; by its smoothstep; or by bands, so
        /// that brightness fades over `blur` pixels and speckle over few.
        blend: Blend = Blend::Linear,
            Facts::word::<Blend>().label("Blend");
        /// Speed of sound at which the samples of mask and volume go through a masking mesh: that of its tissue, as in
        /// the paper, or the probe's `speed`.
        mask_speed: MaskSpeed = MaskSpeed::Enclosing,
            Facts::word::<MaskSpeed>().label("Mask speed");
        /// Shadows of what is simulated fall into the acquired volume.
        background_shadows: bool = false,
            Facts::switch().label("Shadows");
    } beside {
        /// The masking meshes, as indices into the scene's instances; their union is simulated.
        masks: Vec<usize> = Vec::new();
    }
}

group! {
    /// The display of an acquired volume: its placement and its grey levels.
    #[derive(Copy)]
    pub struct Display in "volume", from files {
        /// Stored value that is shown black.
        black: f64,
            Facts::number(OFF, INF).by_default("a byte's 0, else the file's least")
                .limits("finite, not `white`").label("Black");
        /// Stored value that is shown white. Grey is linear between the two and clamped beyond; the grey map of
        /// `[imaging]` does not apply to it.
        white: f64,
            Facts::number(OFF, INF).by_default("a byte's 255, else the file's largest")
                .limits("finite, not `black`").label("White");
    } beside {
        /// The volume's own frame, LPS in mm, to the world: its placement.
        world_from_lps: DAffine3;
    }
}
