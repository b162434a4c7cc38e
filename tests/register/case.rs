//! A model and a volume with a known relative placement.

use glam::{DAffine3, DQuat, DVec3};
use insonify::random::{gaussian, pcg4d, unit};
use insonify::register::surface::{Triangle, samples};
use insonify::scene::{Mesh, Scene, shapes};

use crate::common::program::insonify;

/// A model under a moved parent, and a volume that is turned, shifted and displaced by the unknown transform.
pub const SCENE: &str = r#"# A sac.
[probe]
preset = "abdominal"

[volume]
file = "volume.mha" # a pelvis
# Placed by eye.
translate = [301, -40, 12] # later
rotate = { axis = [0, 0.6, 0.8], angle = "35 deg" }
scale = 0.9

[fusion]
mask = ["model"]

[[transform]]
name = "womb"
translate = [4, 5, 60]
rotate = { axis = [1, 0, 0], angle = "20 deg" }
motion = { kind = "sine", period = "4 s", translate = ["3 mm", 0, 0] }

# The sac itself.
[[mesh]]
name = "model"
parent = "womb"
tissue = "liver"
file = "model.obj"
translate = [1, 2, 3]
"#;

/// Voxels of the volume: axes of their own, and 7 mm apart.
const VOLUME: &str = "NDims = 3\nDimSize = 40 40 40\nElementType = MET_UCHAR\n\
    ElementSpacing = 7 7 7\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = -128 65 -193\n\
    ElementDataFile = LOCAL\n";

/// Place of the model's bump at its largest, in its own space.
pub fn apex() -> DVec3 {
    let direction = DVec3::new(0.7, 0.5, 0.5).normalize();
    1.25 * direction / (direction / DVec3::new(40.0, 28.0, 22.0)).length()
}

/// An ellipsoid with a bump beside its longest axis: no motion takes it to itself, and no reflection.
pub fn model() -> Mesh {
    let mut mesh = shapes::ellipsoid([40.0, 28.0, 22.0], 5);
    for position in &mut mesh.positions {
        let p = DVec3::from(position.map(f64::from));
        let near = (p.normalize().dot(apex().normalize()) - 1.0) / 0.05;
        *position = (p * (1.0 + 0.25 * near.exp())).to_array().map(|x| x as f32);
    }
    mesh
}

pub fn obj(mesh: &Mesh, change: impl Fn(DVec3) -> DVec3) -> String {
    let mut out = String::new();
    for p in &mesh.positions {
        let p = change(DVec3::from(p.map(f64::from)));
        out += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    for t in &mesh.triangles {
        out += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
    out
}

/// A mesh in VTK's XML, with the frame that 3D Slicer states in its field data.
pub fn vtp_in_ras(mesh: &Mesh, change: impl Fn(DVec3) -> DVec3) -> String {
    let points = mesh.positions.iter().map(|p| change(DVec3::from(p.map(f64::from))));
    let points: String = points.map(|p| format!("{} {} {} ", p.x, p.y, p.z)).collect();
    let corners: String = mesh.triangles.iter().flatten().map(|v| format!("{v} ")).collect();
    let ends: String = (1..=mesh.triangles.len()).map(|n| format!("{} ", 3 * n)).collect();
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    format!(
        "<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\"><PolyData>\
         <FieldData><DataArray type=\"String\" Name=\"SPACE\" format=\"ascii\">82 65 83 0</DataArray></FieldData>\
         <Piece NumberOfPoints=\"{vertices}\" NumberOfPolys=\"{triangles}\"><Points>\
         <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">{points}</DataArray></Points>\
         <Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">{corners}</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">{ends}</DataArray></Polys>\
         </Piece></PolyData></VTKFile>"
    )
}

/// A folder with the scene, and the known transforms.
pub struct Case {
    pub folder: tempfile::TempDir,
    pub mesh: Mesh,
    /// World from the model's own space.
    pub world_from_model: DAffine3,
    /// World from LPS, the right placement of the volume.
    pub truth: DAffine3,
    /// World from LPS, the present placement.
    pub present: DAffine3,
}

impl Case {
    /// A case 12 mm and 9 degrees off, `scale` times too small, and shifted by `shift` more.
    pub fn new(mesh: Mesh, scale: f64, shift: DVec3) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, data: &[u8]| {
            std::fs::write(folder.path().join(name), data).expect("written");
        };
        write("model.obj", obj(&mesh, |p| p).as_bytes());
        write("volume.mha", &[VOLUME.as_bytes(), &[0; 64_000]].concat());
        write("scene.toml", SCENE.as_bytes());
        let (scene, _) = Scene::load(&folder.path().join("scene.toml"), &[]).expect("sound");
        let world_from_model = scene.instances[0].world_from_object;
        let present = scene.volume.expect("placed").world_from_lps;
        let middle = world_from_model.translation;
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        let motion = DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::from_axis_angle(axis, 9f64.to_radians()),
            middle + shift + 12.0 * DVec3::new(0.6, 0.64, -0.48),
        ) * DAffine3::from_translation(-middle);
        let truth = motion * present;
        Self { folder, mesh, world_from_model, truth, present }
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("written");
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("there")
    }

    pub fn load(&self, name: &str) -> Scene {
        Scene::load(&self.folder.path().join(name), &[]).expect("sound").0
    }

    /// LPS from the model's own space.
    pub fn lps_from_model(&self) -> DAffine3 {
        self.truth.inverse() * self.world_from_model
    }

    /// Writes points of the model at their places in the volume, with noise of `sigma` mm, `share` of them anywhere in
    /// twice their box. Returns the share that is.
    pub fn points(&self, sigma: f64, share: f64) -> f64 {
        let at = |i: u32| DVec3::from(self.mesh.positions[i as usize].map(f64::from));
        let triangles: Vec<Triangle> = self.mesh.triangles.iter().map(|t| t.map(at)).collect();
        let placed = self.lps_from_model();
        let all = samples(&triangles, 2500).into_iter().enumerate();
        let all: Vec<DVec3> = all
            .map(|(i, p)| {
                let words = pcg4d([i as u32, 2, 4, 8]);
                let noise = DVec3::from([0, 1, 2].map(|axis| gaussian(words[axis])));
                placed.transform_point3(p) + sigma * noise
            })
            .collect();
        let low = all.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = all.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let mut text = "x_mm,y_mm,z_mm\n".to_owned();
        let (count, mut strays) = (all.len() as f64, 0.0);
        for (i, p) in all.into_iter().enumerate() {
            let words = pcg4d([i as u32, 3, 9, 27]);
            let anywhere = DVec3::from([0, 1, 2].map(|axis| 2.0 * unit(words[axis]) - 1.0));
            let stray = unit(words[3]) < share;
            strays += f64::from(u8::from(stray));
            let p = match stray {
                true => (low + high) / 2.0 + (high - low) * anywhere,
                false => p,
            };
            text += &format!("{},{},{}\n", p.x, p.y, p.z);
        }
        self.write("points.csv", &text);
        strays / count
    }

    /// Writes landmarks, those of the volume each 10 mm off, mostly in the same direction.
    pub fn landmarks(&self) {
        let mut text = "name,model_x,model_y,model_z,volume_x,volume_y,volume_z\n".to_owned();
        let step = self.mesh.positions.len() / 6;
        for i in 0..6 {
            let words = pcg4d([i as u32, 1, 1, 1]);
            let own = DVec3::from([0, 1, 2].map(|axis| gaussian(words[axis]))).normalize();
            let off = 10.0 * (DVec3::Y + 0.6 * own).normalize();
            let p = DVec3::from(self.mesh.positions[i * step + 7].map(f64::from));
            let model = self.world_from_model.transform_point3(p);
            let volume = self.lps_from_model().transform_point3(p) + off;
            text += &format!(
                "L{i},{},{},{},{},{},{}\n",
                model.x, model.y, model.z, volume.x, volume.y, volume.z
            );
        }
        self.write("landmarks.csv", &text);
    }

    /// Runs the command on scene.toml; returns its output.
    pub fn register(&self, args: &[&str]) -> String {
        let (ok, text) = self.run(args);
        assert!(ok, "{text}");
        text
    }

    pub fn run(&self, args: &[&str]) -> (bool, String) {
        let all = [&["register", "scene.toml"], args].concat();
        insonify(self.folder.path(), &all)
    }

    /// Error of the model's surface when `found` places the volume instead of `truth`: largest distance (mm), angle
    /// (degrees), and relative error of the scale.
    pub fn error(&self, found: &DAffine3) -> (f64, f64, f64) {
        let off = self.mesh.positions.iter().map(|p| {
            let p = DVec3::from(p.map(f64::from));
            let seen = found.transform_point3(self.lps_from_model().transform_point3(p));
            seen.distance(self.world_from_model.transform_point3(p))
        });
        let parts = |t: &DAffine3| t.to_scale_rotation_translation();
        let ((a, p, _), (b, q, _)) = (parts(found), parts(&self.truth));
        let angle = p.angle_between(q).to_degrees();
        (off.fold(0.0, f64::max), angle, (a.x / b.x - 1.0).abs())
    }

    pub fn placement(&self, name: &str) -> DAffine3 {
        self.load(name).volume.expect("placed").world_from_lps
    }
}
