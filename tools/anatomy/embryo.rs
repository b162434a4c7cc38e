//! An embryo of eight weeks with its cord; amnion and yolk sac around it; a younger one is the same,
//! smaller.
//!
//! Frame, mm: x to the crown, y to the left, z to the back; the crown lies at x = 8 and the rump at
//! x = -8. A crown-rump length of 16 mm is 8 weeks (Robinson and Fleming, Br J Obstet Gynaecol
//! 1975;82:702-710). Proportions of head, trunk and limbs: chosen by this project, no source found.

use std::path::Path;

use fidget::context::Tree;
use glam::Vec3;

use crate::fetus_scene::about;
use crate::field::{Point, cone, ellipsoid, undulation, union, union_all};
use crate::model::Extent;
use crate::part::{Part, part};
use crate::{model, output};

/// The box that holds the embryo with its cord.
const EXTENT: Extent =
    Extent { low: Vec3::new(-16.0, -7.0, -10.0), high: Vec3::new(10.0, 7.0, 8.0), step: 0.4 };

/// Triangles of all its meshes.
const BUDGET: usize = 6_000;

/// Crown to rump.
const CROWN_RUMP: f32 = 16.0;

/// Half-axes of the chorionic sac: 27 mm in the mean. By the common rule, days =
/// diameter + 30, that is 8 weeks; the source of the rule was not found.
const SAC: Vec3 = Vec3::new(16.0, 12.5, 12.5);

/// Middle of the amnion in the sac, and its half-axes.
const AMNION: (Vec3, Vec3) = (Vec3::new(-2.6, 0.0, 1.5), Vec3::new(10.4, 8.2, 8.6));

/// Place of the embryo in the sac, and the angle about y by which its head is turned back, degrees.
const REST: (Vec3, f32) = (Vec3::new(-2.6, 0.0, 3.2), 10.0);

/// The joint about which the head nods.
const NECK: Vec3 = Vec3::new(2.6, 0.0, 2.0);

/// Middle of the heart.
const HEART: Vec3 = Vec3::new(0.2, 0.0, -1.3);

/// Half-axes of the heart, and of the blood in it.
const HEART_RADII: [Vec3; 2] = [Vec3::new(2.7, 2.3, 2.2), Vec3::new(1.85, 1.55, 1.5)];

/// An embryo in a scene.
pub struct Gestation {
    /// Middle of the sac in the world, mm.
    pub middle: Vec3,
    /// Factor on all lengths but the yolk sac's: 1 is 8 weeks.
    pub scale: f32,
    /// Middle of the yolk sac from that of the sac, and its radius, mm; chosen, no source found.
    pub yolk: (Vec3, f32),
    /// True where the amnion is seen: not before it has left the embryo.
    pub amnion: bool,
    /// Factor on the heart: the younger the embryo, the larger its share of the body.
    pub heart: f32,
    /// Heartbeats per minute: on the mean 123 at six weeks and 177 at nine (Robinson and Shaw-Dunn, J Obstet
    /// Gynaecol Br Commonw 1973;80:805-809), linear between.
    pub beats: f32,
}

impl Gestation {
    /// The sac, `wider` mm larger all around.
    pub fn sac(&self, p: &Point, wider: f32) -> Tree {
        let smooth = ellipsoid(&p.from(self.middle), SAC * self.scale + wider);
        smooth + undulation(p, 0.35 * self.scale, 17.0 * self.scale, 0.6)
    }

    /// Half-axes of the sac, mm.
    pub fn radii(&self) -> Vec3 {
        SAC * self.scale
    }

    /// Returns the sizes of the embryo as text, for the scene file.
    pub fn biometry(&self) -> String {
        let length = CROWN_RUMP * self.scale;
        let days = 8.052 * (1.037 * length).sqrt() + 23.73;
        format!(
            "crown-rump length {length:.0} mm ({:.0} weeks {:.0} days), mean sac diameter {:.0} mm, yolk \
             sac {:.1} mm, {:.0} heartbeats a minute",
            (days / 7.0).floor(),
            (days % 7.0).floor(),
            2.0 * self.radii().element_sum() / 3.0,
            2.0 * self.yolk.1,
            self.beats
        )
    }

    /// The nodes, below the node `carrier`.
    pub fn transforms(&self, carrier: &str) -> String {
        let node = |name: &str, parent: &str, at: Vec3, rest: &str| {
            format!(
                "[[transform]]\nname = \"{name}\"\nparent = \"{parent}\"\n\
                 translate = [{:.2}, {:.2}, {:.2}]\n{rest}\n",
                at.x, at.y, at.z
            )
        };
        let factor = |by: f32| match by {
            1.0 => String::new(),
            by => format!("scale = {by}\n"),
        };
        let scale = factor(self.scale);
        let (rest, turn) = REST;
        // Small movements begin at seven to eight weeks (de Vries, Visser and Prechtl 1982).
        let body = format!(
            "{scale}rotate = {{ axis = [0, 1, 0], angle = \"{turn} deg\" }}\n\
             motion = {{ kind = \"fetal\", translate = [0.6, 0.2, 0.5], rotate = {{ axis = [0, 1, 0], angle = \
             \"4 deg\" }}, seed = 1, duration = \"1.5 s\", pause = \"3 s\" }}\n"
        );
        let nod = "motion = { kind = \"fetal\", rotate = { axis = [0, 1, 0], angle = \"5 deg\" }, seed = 2, \
                   duration = \"1.5 s\", pause = \"3 s\" }\n";
        let beat = format!(
            "{}motion = {{ kind = \"sine\", period = \"{:.3} s\", scale = [1.2, 1.3, 1.3] }}\n",
            factor(self.heart),
            60.0 / self.beats
        );
        let membranes = if self.amnion {
            let middle = self.middle + AMNION.0 * self.scale;
            node("membranes", carrier, middle, &scale)
        } else {
            String::new()
        };
        node("embryo", carrier, self.middle + rest * self.scale, &body)
            + &node("nod", "embryo", NECK, nod)
            + "# It beats: the walls come together and part.\n"
            + &node("heartbeat", "embryo", HEART, &beat)
            + &membranes
            + &node("vesicle", carrier, self.middle + self.yolk.0, "")
    }

    /// The meshes; the first one has the priority `first`.
    pub fn meshes(&self, first: usize) -> String {
        let mut out = String::new();
        let mut priority = first;
        let mut add = |name: &str, tissue: &str, parent: &str, shape: &str| {
            let rest = format!("parent = \"{parent}\"\n{shape}\n");
            out += &output::mesh_entry(name, tissue, priority, &rest);
            priority += 1;
        };
        let round = |r: Vec3| {
            format!(
                "shape = {{ ellipsoid = {{ radii = [{:.2}, {:.2}, {:.2}], subdivisions = 4 }} }}",
                r.x, r.y, r.z
            )
        };
        let file = |name: &str| format!("file = \"embryo/{name}.obj\"");
        if self.amnion {
            let amnion = AMNION.1;
            add(
                "amnion",
                "membrane",
                "membranes",
                &(round(amnion) + "\nsurface_gain = \"-15 dB\""),
            );
            let inner = round(amnion - MEMBRANE) + "\nsurface_gain = \"-15 dB\"";
            add("amniotic-cavity", "amniotic_fluid", "membranes", &inner);
        }
        for (node, part) in parts() {
            add(part.name, part.tissue, node.name(), &file(part.name));
        }
        add("heart-wall", "embryonic_heart", "heartbeat", &round(HEART_RADII[0]));
        add("heart", "blood", "heartbeat", &round(HEART_RADII[1]));
        let yolk = self.yolk.1;
        let faint = "\nsurface_gain = \"-10 dB\"";
        add("yolk-sac", "yolk_wall", "vesicle", &(round(Vec3::splat(yolk)) + faint));
        add("yolk", "amniotic_fluid", "vesicle", &(round(Vec3::splat(yolk - YOLK_WALL)) + faint));
        out
    }
}

/// Thickness of the amnion at 8 weeks. The real one is thinner than any pulse.
const MEMBRANE: f32 = 0.2;

/// Thickness of the yolk sac's wall.
const YOLK_WALL: f32 = 0.5;

/// Tissues of embryo and yolk sac.
pub const TISSUES: &str = r#"# Watery and dense with cells.
[tissues.embryonic]
based_on = "fetal_soft_tissue"
speed = "1530 m/s"
echogenicity = "-1 dB"
source = "chosen by this project, no source found"

[tissues.embryonic_heart]
based_on = "fetal_soft_tissue"
speed = "1530 m/s"
echogenicity = "+6 dB"
source = "chosen by this project, no source found"

[tissues.neural_tube]
based_on = "fetal_soft_tissue"
speed = "1530 m/s"
echogenicity = "-12 dB"
source = "chosen by this project, no source found"

[tissues.yolk_wall]
based_on = "fetal_soft_tissue"
speed = "1530 m/s"
echogenicity = "+7 dB"
source = "chosen by this project, no source found"
"#;

/// Tissue of the amnion, for scenes that show it.
pub const AMNIOTIC: &str = r#"
[tissues.membrane]
based_on = "fetal_soft_tissue"
speed = "1530 m/s"
echogenicity = "-8 dB"
source = "chosen by this project, no source found"
"#;

/// Transform node that a mesh belongs to.
#[derive(Clone, Copy)]
enum Node {
    Body,
    Head,
}

impl Node {
    fn name(self) -> &'static str {
        match self {
            Self::Body => "embryo",
            Self::Head => "nod",
        }
    }
}

fn chain(p: &Point, bends: &[(Vec3, f32)], k: f32) -> Tree {
    let pieces = bends.windows(2).map(|w| cone(p, w[0].0, w[0].1, w[1].0, w[1].1));
    union_all(pieces.collect(), k)
}

fn at(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Trunk with limb buds.
fn body(p: &Point) -> Tree {
    let back = [
        (NECK, 2.2),
        (at(-0.5, 0.0, 1.7), 2.9),
        (at(-3.4, 0.0, 1.2), 2.9),
        (at(-5.7, 0.0, 0.1), 2.2),
        (at(-6.3, 0.0, -1.5), 1.4),
    ];
    let belly = ellipsoid(&p.from(at(-0.9, 0.0, -1.1)), at(3.3, 2.8, 2.7));
    let limb = |side: f32, bends: [(Vec3, f32); 3]| {
        let bends = bends.map(|(v, r)| (at(v.x, side * v.y, v.z), r));
        chain(p, &bends, 0.5)
    };
    let arm = [(at(0.8, 2.2, -0.6), 1.1), (at(-0.6, 3.9, -2.2), 0.85), (at(0.4, 3.2, -4.0), 0.8)];
    let leg =
        [(at(-4.9, 1.8, -0.8), 1.2), (at(-5.2, 3.0, -2.8), 0.85), (at(-4.4, 2.4, -4.2), 0.75)];
    let limbs =
        union_all(vec![limb(1.0, arm), limb(-1.0, arm), limb(1.0, leg), limb(-1.0, leg)], 0.3);
    union(union(chain(p, &back, 1.2), belly, 1.0), limbs, 0.5)
}

/// Head with the face, bent on the chest.
fn head(p: &Point) -> Tree {
    let (sin, cos) = 0.3f32.sin_cos();
    let axes = [at(cos, 0.0, -sin), Vec3::Y, at(sin, 0.0, cos)];
    let skull = ellipsoid(&p.from(at(4.5, 0.0, -0.7)).along(axes), at(3.4, 3.1, 4.2));
    let face = ellipsoid(&p.from(at(2.3, 0.0, -3.6)), at(1.6, 1.7, 1.5));
    let nape = cone(p, at(3.4, 0.0, 1.2), 2.3, NECK, 2.1);
    union(union(skull, face, 1.2), nape, 1.2)
}

/// Fluid in the hindbrain, which is the largest cavity now, and in the hemispheres.
fn vesicles(p: &Point) -> Tree {
    let hind = ellipsoid(&p.from(at(5.3, 0.0, 1.3)), at(1.5, 1.6, 1.25));
    let fore = |side: f32| ellipsoid(&p.from(at(5.6, 0.9 * side, -2.4)), at(1.1, 0.75, 1.3));
    hind.min(fore(1.0)).min(fore(-1.0))
}

/// The cord: from the belly around the rump to the chorion.
fn cord(p: &Point) -> Tree {
    let bends = [
        (at(-2.8, 0.0, -3.0), 0.9),
        (at(-5.5, -1.0, -6.0), 0.85),
        (at(-9.2, -1.2, -5.0), 0.8),
        (at(-11.3, -0.4, -1.0), 0.8),
        (at(-12.4, 0.0, 3.0), 0.8),
    ];
    chain(p, &bends, 1.0)
}

/// All parts with their nodes, in rising priority.
fn parts() -> Vec<(Node, Part)> {
    let p = &Point::world();
    let tube = [
        (at(3.0, 0.0, 3.2), 0.5),
        (at(-0.5, 0.0, 3.4), 0.5),
        (at(-3.6, 0.0, 2.8), 0.45),
        (at(-5.9, 0.0, 1.2), 0.4),
    ];
    let soft = "embryonic";
    vec![
        (Node::Body, part("cord", soft, (0.5, 0.6), cord(p))),
        (Node::Body, part("body", soft, (0.5, 1.0), body(p))),
        (Node::Head, part("head", soft, (0.5, 1.0), head(p))),
        (Node::Body, part("neural-tube", "neural_tube", (0.3, 0.6), chain(p, &tube, 0.3))),
        (Node::Head, part("vesicles", "amniotic_fluid", (0.35, 0.6), vesicles(p))),
    ]
}

/// Writes `embryo/*.obj` in `output`, each mesh about the joint of its node.
pub fn make(output: &Path) -> Result<(), String> {
    let (nodes, parts): (Vec<Node>, Vec<Part>) = parts().into_iter().unzip();
    let surfaces = model::surfaces(&parts, EXTENT, BUDGET)?;
    for ((part, node), surface) in parts.iter().zip(&nodes).zip(&surfaces) {
        let joint = match node {
            Node::Body => Vec3::ZERO,
            Node::Head => NECK,
        };
        let path = output.join(format!("embryo/{}.obj", part.name));
        let axes = "x to the crown, y to the left, z to the back";
        output::write(&path, &output::obj(part.name, axes, &about(surface, joint)))?;
    }
    Ok(())
}
