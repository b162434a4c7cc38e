//! The acquired volume of a scene and its masks as text.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::mesh::Facts;
use super::nodes::periods;
use crate::scene::fusion::{Acquired, TEXTURE_BUDGET};
use crate::scene::{Issue, Scene, file};
use crate::settings::{Surroundings, Words};
use crate::volume::Volume;

/// A description of the scene's surroundings, as rows of text, for the scene file at `path`, and masks
/// without effect. `facts` measures an instance by its number.
pub fn describe(
    path: &Path,
    scene: &Scene,
    facts: impl Fn(usize) -> Facts,
) -> (Vec<String>, Vec<Issue>) {
    let (mut lines, mut issues) = (Vec::new(), Vec::new());
    let named = file::volume_of(path);
    if let (Some(acquired), Some(first)) = (&scene.volume, named.first()) {
        let more = match named.as_slice() {
            [_, .., last] => format!(" to {}, {} files", last.display(), named.len()),
            _ => String::new(),
        };
        lines.push(format!("volume {}{more}", first.display()));
        lines.extend(stored(path, &named));
        lines.extend(placed(acquired));
    }
    let Some(fusion) = &scene.fusion else {
        return (lines, issues);
    };
    let around = match fusion.surroundings {
        Surroundings::Volume => "the volume",
        Surroundings::None => "nothing",
        Surroundings::Scatterers => "the scene's own scatterers",
    };
    let (blur, blend) = (fusion.blur, fusion.blend.word());
    let speed = fusion.mask_speed.word();
    lines.push(format!(
        "fusion: around the masks {around}; over {blur} pixels, blend {blend}; mask speed {speed}"
    ));
    let off = scene.masks_off_the_image();
    for &mask in &fusion.masks {
        let name = &scene.instances[mask].name;
        let volume = facts(mask).volume.map_or("open".to_owned(), |ml| format!("{ml:.3} ml"));
        let seen = if off.contains(&mask) { "off the image" } else { "on the image" };
        lines.push(format!("  mask {name}: {volume}, {seen}"));
        if off.contains(&mask) {
            issues.push(Issue::warning(
                path,
                1,
                format!("the mask `{name}` does not meet the image: nothing is simulated in it"),
                "move the mesh or the probe",
            ));
        }
    }
    (lines, issues)
}

/// The content of the files of the scene at `path`, as `insonify check` describes a file alone.
fn stored(path: &Path, named: &[PathBuf]) -> Vec<String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let files: Vec<_> = named.iter().map(|file| folder.join(file)).collect();
    match Volume::load_series(&files) {
        Ok((volume, _)) => volume.to_string().lines().map(str::to_owned).collect(),
        // The scene was loaded with it, so it must have changed since.
        Err((_, error)) => vec![format!("  {error}")],
    }
}

/// Place in the world, black and white, and size on the device.
fn placed(acquired: &Acquired) -> Vec<String> {
    let vector = |v: DVec3| {
        // Turns -0 into 0.
        let v = v + DVec3::ZERO;
        format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z)
    };
    let m = acquired.world_from_voxel;
    let size = DVec3::from(acquired.size.map(|n| n as f64));
    let corners = (0..8u32).map(|i| {
        let upper = DVec3::from([0, 1, 2].map(|axis| f64::from(i >> axis & 1)));
        m.transform_point3(upper * size - DVec3::splat(0.5))
    });
    let (low, high) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let [i, j, k] = axes.map(|axis| vector(axis.normalize()));
    let bytes = acquired.texture_bytes();
    let averaged = match bytes > TEXTURE_BUDGET {
        true => format!(", averaged to fit {} MiB", TEXTURE_BUDGET >> 20),
        false => String::new(),
    };
    let mut lines = vec![
        format!("  in the world: axes {i}, {j}, {k}, box {} to {} mm", vector(low), vector(high)),
        format!("  shown from {} (black) to {} (white)", acquired.black, acquired.white),
        format!("  {:.1} MB on the device{averaged}", bytes as f64 / 1e6),
    ];
    if let Some(sequence) = &acquired.sequence {
        let (count, periods) = (sequence.count(), periods(sequence.clock()));
        lines.push(format!("  plays: {count} volumes, {periods}"));
    }
    lines
}

#[cfg(test)]
mod tests {
    use crate::scene::check::report;

    #[test]
    fn a_scene_report_tells_of_volume_and_masks() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).expect("written");
        };
        let header = "NDims = 3\nDimSize = 5 4 3\nElementSpacing = 2 1 4\nOffset = 1 2 3\n\
            ElementType = MET_SHORT\nElementDataFile = LOCAL\n";
        let values: Vec<u8> = (0..60i16).flat_map(|i| (i - 7).to_le_bytes()).collect();
        write("volume.mha", &[header.as_bytes(), &values].concat());
        let scene = |x: i32| {
            let text = format!(
                "[volume]\nfile = \"volume.mha\"\ntranslate = [10, 0, 0]\n[fusion]\nmask = [\"ball\"]\n\
                 blend = \"smooth\"\nblur = 9\n[[mesh]]\nname = \"ball\"\ntissue = \"liver\"\n\
                 shape = {{ sphere = {{ radius = 5, subdivisions = 3 }} }}\ntranslate = [{x}, 0, 30]\n"
            );
            write("scene.toml", text.as_bytes());
            report(&folder.path().join("scene.toml"))
        };
        let text = scene(0).to_string();
        for line in [
            "volume volume.mha",
            "  MetaImage, 5 x 4 x 3 voxels, 16-bit signed integer",
            "  spacing 2.0000 x 1.0000 x 4.0000 mm",
            "  orientation in the file: LPS",
            "  values -7 to 52, mean 22.500",
            "  in the world: axes (1.000, 0.000, 0.000), (0.000, 1.000, 0.000), (0.000, 0.000, 1.000), \
             box (10.000, 1.500, 1.000) to (20.000, 5.500, 13.000) mm",
            "  shown from -7 (black) to 52 (white)",
            "  0.0 MB on the device",
            "fusion: around the masks the volume; over 9 pixels, blend smooth; mask speed enclosing",
            "  mask ball: 0.519 ml, on the image",
        ] {
            assert!(text.lines().any(|l| l == line), "{line}\nin\n{text}");
        }
        assert!(text.ends_with("0 errors, 0 warnings"), "{text}");
        let text = scene(200).to_string();
        assert!(text.contains("mask ball: 0.519 ml, off the image"), "{text}");
        assert!(text.ends_with("0 errors, 1 warning"), "{text}");
    }
}
