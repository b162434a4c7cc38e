//! A volume as the planes of a DICOM file.

use glam::{DAffine3, DMat3, DVec3};

use insonify::acquire::{Station, middle};
use insonify::exchange;
use insonify::output::dicom::{self, Motion};
use insonify::scene::Scene;
use insonify::scene::tracker::Axes;
use insonify::volume::{Volume, Voxels};

/// Probe space from the transducer's frame of DICOM: x across, y in depth, z so that the three are right-handed.
fn probe_from_transducer() -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y))
}

/// The volume that was acquired at `stations`: planes across the elevation axis, in the order of the transducer's z.
///
/// # Panics
/// When its axes are not those of the probe at the middle station, or its voxels not bytes, as an acquired one's are.
pub fn of(volume: &Volume, scene: &Scene, stations: &[Station]) -> dicom::Volume {
    let world_from_probe = middle(stations).world_from_probe;
    let probe_from_voxel = world_from_probe.inverse() * volume.world_from_voxel;
    let spacing = volume.spacing();
    let along = probe_from_voxel.matrix3.abs_diff_eq(DMat3::from_diagonal(spacing), 1e-9);
    assert!(along, "axes of the probe: {probe_from_voxel}");
    let [lateral, elevation, depth] = volume.size;
    let Voxels::U8(voxels) = &volume.voxels else { panic!("bytes") };
    let row = |j: usize, k: usize| lateral * (j + elevation * k);
    let rows = (0..elevation).rev().flat_map(|j| (0..depth).map(move |k| row(j, k)));
    let last = DVec3::Y * (elevation - 1) as f64;
    let first = probe_from_transducer().inverse() * probe_from_voxel;
    // Half a turn about z or nothing, from the world's axes over RAS to LPS.
    let patient_from_world = Axes::Lps.to_ras() * scene.tracker.axes.to_ras();
    dicom::Volume {
        name: scene.name.clone(),
        size: [lateral, depth, elevation],
        voxels: rows.flat_map(|start| &voxels[start..start + lateral]).copied().collect(),
        spacing: DVec3::new(spacing.x, spacing.z, spacing.y),
        first: first.transform_point3(last),
        patient_from_transducer: patient_from_world * world_from_probe * probe_from_transducer(),
        motion: motion(stations),
        duration: stations[stations.len() - 1].time - stations[0].time,
        transducer: exchange::transducer(&scene.probe),
        focus: scene.probe.focus,
        depth: scene.probe.depth,
    }
}

/// The changes of the probe's pose over the stations: of its place, its direction, both or none.
fn motion(stations: &[Station]) -> Motion {
    let pose = |station: &Station| station.world_from_probe;
    let first = pose(&stations[0]);
    let differs = |far: &dyn Fn(DAffine3) -> bool| stations.iter().any(|s| far(pose(s)));
    let shifted = differs(&|p| p.translation.distance(first.translation) > 1e-6);
    let turned = differs(&|p| !p.matrix3.abs_diff_eq(first.matrix3, 1e-9));
    match (shifted, turned) {
        (false, false) => Motion::None,
        (true, false) => Motion::Shifted,
        (false, true) => Motion::Turned,
        (true, true) => Motion::Both,
    }
}
