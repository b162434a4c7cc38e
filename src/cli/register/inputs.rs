//! Inputs of a registration: the model's surface, and points of the volume.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use insonify::issue::FileError;
use insonify::register::landmarks::Landmark;
use insonify::register::points;
use insonify::register::surface::{Triangle, TriangleSurface, samples};
use insonify::scene::graph::{Placed, is_even};
use insonify::scene::{Acquired, Mesh, Scene, mesh};
use insonify::settings::suggest;
use insonify::volume::Frame;
use miette::{Result, miette};

use super::Register;
use crate::cli::common::notes;

/// Points of the surface in the volume, LPS in mm; none where there are only landmarks.
pub fn points(args: &Register) -> Result<Option<Vec<DVec3>>> {
    if let Some(file) = &args.points {
        let points = points::load(file, args.frame)?;
        return Ok(Some(points.into_iter().map(|p| p.position).collect()));
    }
    let Some(file) = &args.volume_surface else {
        return Ok(None);
    };
    let (mesh, ras) = mesh_file(file)?;
    let own = if ras { Frame::Ras } else { points::frame_of_mesh(file)? };
    let frame = points::agreed(file, own, args.frame)?;
    // A file that states its frame was read into LPS.
    let read = if own == Frame::Unstated { frame } else { Frame::Lps };
    let signs = read.lps_signs();
    let triangles = placed(&mesh, &DAffine3::from_scale(signs));
    Ok(Some(samples(&triangles, args.samples as usize)))
}

/// The landmarks; those of the volume in the world at its present place.
pub fn landmarks(
    args: &Register,
    world_from_lps: &DAffine3,
    warnings: &mut Vec<String>,
) -> Result<Vec<Landmark>> {
    let mut out = match (&args.landmarks, &args.model_landmarks, &args.volume_landmarks) {
        (Some(file), ..) => points::load_landmarks(file, args.frame)?,
        (None, Some(model), Some(volume)) => {
            let (of_model, of_volume) =
                (points::load(model, None)?, points::load(volume, args.frame)?);
            let (pairs, single) = points::pair((model, &of_model), (volume, &of_volume))?;
            warnings.extend(single.iter().map(|name| {
                format!("landmark `{name}` is in one of the two files only, and does not count")
            }));
            pairs
        }
        _ => Vec::new(),
    };
    for landmark in &mut out {
        landmark.from = world_from_lps.transform_point3(landmark.from);
    }
    Ok(out)
}

/// A warning about points, LPS, if most of them lie outside the volume.
pub fn outside(points: &[DVec3], volume: &Acquired) -> Option<String> {
    let voxel_from_lps = volume.world_from_voxel.inverse() * volume.world_from_lps;
    let most = DVec3::from(volume.size.map(|n| n as f64)) - 0.5;
    let share = |signs: DVec3| {
        let voxels = points.iter().map(|p| voxel_from_lps.transform_point3(signs * *p));
        let inside = voxels.filter(|v| v.cmpge(DVec3::splat(-0.5)).all() && v.cmple(most).all());
        inside.count() as f64 / points.len().max(1) as f64
    };
    let (here, turned) = (share(DVec3::ONE), share(DVec3::new(-1.0, -1.0, 1.0)));
    if here >= 0.5 {
        return None;
    }
    let hint = match turned > 0.5 {
        true => "with x and y turned round most do: they are in the other frame, see --frame",
        false => "are they of this volume, in its own frame and in mm?",
    };
    Some(format!("only {:.0} % of the points lie in the volume; {hint}", 100.0 * here))
}

/// The model's surface in the world, in the scene's present state.
pub fn surface(args: &Register, scene: &Scene) -> Result<TriangleSurface> {
    let still = scene.still();
    let mut triangles = Vec::new();
    for name in &args.surface {
        let instances = instances(scene, name);
        if instances.is_empty() {
            triangles.extend(placed(&mesh_file(&file(scene, name)?)?.0, &DAffine3::IDENTITY));
        }
        for i in instances {
            if !scene.instances[i].shown {
                return Err(miette!(
                    help = "choose a time at which it is, with --time",
                    "mesh `{name}` is not in the scene at {} s",
                    args.time
                ));
            }
            let instance = &still.instances[i];
            triangles.extend(placed(&still.meshes[instance.mesh], &instance.world_from_object));
        }
    }
    Ok(TriangleSurface::new(&triangles)?)
}

/// The node called `name`, which carries the whole surface.
pub fn carrier(args: &Register, scene: &Scene, name: &str) -> Result<Placed> {
    let node = scene.placed(name, args.time).ok_or_else(|| {
        let meshes = scene.origins.instances.iter().map(|o| o.mesh.as_str());
        let nodes = scene.graph.nodes.iter().map(|n| n.name.as_str());
        miette!(
            help = suggest::among(name, nodes.chain(meshes)),
            "there is no mesh or transform `{name}` that has a placement"
        )
    })?;
    if ![node.rest, node.world_from_parent].iter().all(is_even) {
        return Err(miette!(
            help = "name a [[transform]] above it that does not scale, or leave --move out: the volume moves then",
            "`{name}` is scaled unevenly, and a shift, a turn and one factor do not make up for that"
        ));
    }
    let carried = |surface: &&String| {
        let all = instances(scene, surface);
        !all.is_empty() && all.iter().all(|i| node.instances.contains(i))
    };
    match args.surface.iter().find(|s| !carried(s)) {
        None => Ok(node),
        Some(other) => Err(miette!(
            help = "name a [[transform]] above all of the surface, or leave --move out: the volume moves then",
            "`{name}` does not carry the surface `{other}`: moving it would lay nothing onto the volume"
        )),
    }
}

/// The sources of the surface, for a note: names of meshes, and of files without their folders.
pub fn names(args: &Register) -> Vec<String> {
    let file = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let model = args.surface.iter().map(|name| {
        let path = PathBuf::from(name);
        if mesh::is_mesh(&path) { file(&path) } else { name.clone() }
    });
    let volume = [&args.points, &args.volume_surface, &args.landmarks, &args.volume_landmarks];
    model.chain(volume.into_iter().flatten().map(file)).collect()
}

/// The instances of the `[[mesh]]` called `name`, or those of that name themselves.
fn instances(scene: &Scene, name: &str) -> Vec<usize> {
    let origins = scene.origins.instances.iter().zip(&scene.instances).enumerate();
    let of = origins.filter(|(_, (origin, instance))| origin.mesh == name || instance.name == name);
    of.map(|(i, _)| i).collect()
}

/// `name` as a mesh file, since no mesh of the scene has this name.
fn file(scene: &Scene, name: &str) -> Result<PathBuf> {
    let path = PathBuf::from(name);
    match mesh::is_mesh(&path) {
        true => Ok(path),
        false => Err(miette!(
            help = suggest::among(name, scene.origins.instances.iter().map(|o| o.mesh.as_str())),
            "there is no mesh `{name}` in the scene, and it is no mesh file"
        )),
    }
}

/// The mesh of a file; true if the file states that its frame is RAS, from which it has been turned into LPS.
fn mesh_file(path: &Path) -> Result<(Mesh, bool)> {
    let mesh::Inspected { mesh, ras, issues, .. } = mesh::inspect(path, &mesh::Options::default());
    let Some(mesh) = mesh else {
        let first = issues.into_iter().find(insonify::scene::Issue::is_error);
        let (message, remedy) = first.map_or_else(Default::default, |i| (i.message, i.remedy));
        return Err(FileError::file(path, message, remedy).into());
    };
    notes(issues);
    Ok((mesh, ras))
}

fn placed(mesh: &Mesh, world_from_object: &DAffine3) -> Vec<Triangle> {
    let at = |i: u32| {
        let p = DVec3::from(mesh.positions[i as usize].map(f64::from));
        world_from_object.transform_point3(p)
    };
    mesh.triangles.iter().map(|t| t.map(at)).collect()
}
