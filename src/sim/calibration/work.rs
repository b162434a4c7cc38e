//! Work of a frame, known before it is begun.

use super::Calibration;
use crate::scene::Scene;
use crate::settings::ScatterMode;

/// Lattice cells of a frame from which on a user is told: minutes on a software driver.
const MANY: f64 = 5e9;
/// Most lattice cells of a frame: minutes on the fastest GPU.
const MOST: f64 = 2e11;
/// Depths at which cells are counted.
const DEPTHS: u32 = 64;

/// A scene whose scatterers are much work.
#[derive(Clone, Debug, PartialEq)]
pub struct Work {
    /// True where a frame would not end in any reasonable time.
    pub too_much: bool,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: &'static str,
}

impl Work {
    /// The excess of work that a scene asks for; none as a rule.
    pub fn of(scene: &Scene) -> Option<Self> {
        let cells = Calibration::new(scene).lattice_cells();
        (cells > MANY).then(|| Self {
            too_much: cells > MOST,
            message: format!(
                "a frame looks at about {cells:.0e} lattice cells of scatterers; {MANY:.0e} take \
                 minutes without a GPU, {MOST:.0e} are the limit"
            ),
            remedy: "enlarge simulation.cell, lower simulation.density_scale, or set \
                     simulation.scatterers_per_resolution_cell to 8, which thins the lattice",
        })
    }
}

impl Calibration<'_> {
    /// Lattice cells that a frame looks at, were all of it the tissue that needs most: along every scanline those in
    /// its strip and the slice, at the level of the lattice of each depth. Reflections come on top.
    pub fn lattice_cells(&self) -> f64 {
        let (probe, simulation) = (&self.scene.probe, &self.scene.simulation);
        if simulation.scatter_mode == ScatterMode::Voxel {
            return 0.0;
        }
        let sounding = self.scene.tissues.iter().filter(|tissue| {
            tissue.density_of_scatterers > 0.0 && tissue.echogenicity > f64::NEG_INFINITY
        });
        let fewest = |z: f64| {
            let octaves = sounding.clone().map(|tissue| self.lattice_octaves(tissue, z));
            octaves.reduce(f64::min).map(|octaves| simulation.cell.powi(3) * octaves.exp2())
        };
        let step = probe.depth / f64::from(DEPTHS);
        let along = (0..DEPTHS).filter_map(|k| {
            let z = (f64::from(k) + 0.5) * step;
            let across = 2.0 * self.strip(z).half * self.pitch(z) * probe.slice_thickness;
            Some(across * step / fewest(z)?)
        });
        along.sum::<f64>() * f64::from(probe.scanlines)
    }
}

#[cfg(test)]
mod tests {
    use crate::probe::Probe;
    use crate::scene::Tissue;

    use super::*;

    fn scene(cell: f64, scatterers: f64) -> Scene {
        let liver = Tissue::shipped("liver").expect("shipped");
        let mut scene = Scene::homogeneous(liver, Probe::paper_table1());
        scene.simulation.cell = cell;
        scene.simulation.scatterers_per_resolution_cell = scatterers;
        scene
    }

    #[test]
    fn cells_follow_their_size_unless_they_are_thinned() {
        let cells = |cell, scatterers| Calibration::new(&scene(cell, scatterers)).lattice_cells();
        let ratio = cells(0.05, 0.0) / cells(0.1, 0.0);
        assert!((ratio - 8.0).abs() < 1e-9, "{ratio}");
        // Thinned, the finer lattice is as coarse as the other one, but for half an octave.
        let ratio = cells(0.05, 8.0) / cells(0.1, 8.0);
        assert!((0.7..1.42).contains(&ratio), "{ratio}");
        let ratio = cells(0.02, 80.0) / cells(0.02, 8.0);
        assert!((7.0..14.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_is_much_is_told_and_what_does_not_end_is_refused() {
        assert_eq!(Work::of(&scene(0.15, 8.0)), None);
        assert_eq!(Work::of(&scene(0.01, 8.0)), None, "thinned");
        let most = Calibration::new(&scene(1.0, 0.0)).lattice_cells();
        let judged = |cells: f64| Work::of(&scene((most / cells).cbrt(), 0.0)).map(|w| w.too_much);
        assert_eq!(
            [4e9, 6e9, 1e11, 3e11].map(judged),
            [None, Some(false), Some(false), Some(true)]
        );
    }
}
