//! A tubal pregnancy of about seven weeks: the uterus is empty, its lining thick, with a little fluid in
//! it; between it and the left ovary with its corpus luteum the tube holds a bright ring of trophoblast
//! around a sac; blood behind the uterus. Frame as in `adnexa`.

use glam::Vec3;

use crate::adnexa::{self, Luteum, ORGAN, Ovary};
use crate::embryo::Gestation;
use crate::field::{Point, cone, ellipsoid, intersection, undulation, union};
use crate::part::{Part, part};
use crate::vaginal::Case;

/// Middle of the uterus and its half-axes: 52 mm wide, 42 mm deep (chosen, no source found).
const UTERUS: (Vec3, Vec3) = (Vec3::new(-20.0, 0.0, 38.0), Vec3::new(26.0, 34.0, 20.5));

/// Half-axes of the lining, and of the fluid in it (pseudosac), about the uterus' middle.
const LINING: [Vec3; 2] = [Vec3::new(14.5, 22.0, 6.8), Vec3::new(6.5, 9.0, 1.0)];

/// Thickness of the ring; below, the additional thickness of the tube. Both in mm.
const RING: f32 = 4.6;
/// See [`RING`].
const TUBE: f32 = 2.2;

const RIGHT: Ovary = Ovary {
    middle: Vec3::new(-57.0, 1.0, 47.0),
    radii: Vec3::new(10.5, 13.0, 8.0),
    follicles: &[
        ([-5.0, -1.0, -1.0], 2.3),
        ([1.0, 1.0, -3.6], 2.0),
        ([1.4, -2.0, 2.8], 2.6),
        ([5.8, 0.5, -0.6], 2.0),
        ([-2.0, 7.0, 1.0], 2.6),
    ],
};

const LEFT: Ovary = Ovary {
    middle: Vec3::new(50.0, 2.0, 48.0),
    radii: Vec3::new(12.0, 14.0, 10.0),
    follicles: &[
        ([-8.2, 0.0, 1.0], 1.9),
        ([8.2, -2.0, 2.2], 2.1),
        ([6.0, 3.0, -5.6], 1.8),
        ([0.0, -10.0, 2.0], 2.4),
    ],
};

const LUTEUM: Luteum = Luteum { middle: Vec3::new(50.0, 1.0, 48.0), radius: 6.6, wall: 3.0 };

fn gestation() -> Gestation {
    Gestation {
        middle: Vec3::new(24.0, 0.0, 39.0),
        scale: 0.5,
        yolk: (Vec3::new(4.3, 0.0, -2.5), 1.9),
        amnion: false,
        heart: 1.35,
        beats: 134.0,
    }
}

/// The pelvis, in rising priority.
fn parts() -> Vec<Part> {
    let p = &Point::world();
    let (middle, radii) = UTERUS;
    let uterus = adnexa::uterus(p, UTERUS);
    let gestation = gestation();
    let ring = |wider: f32| {
        let smooth = ellipsoid(&p.from(gestation.middle), gestation.radii() + wider);
        smooth + undulation(p, 0.35, 13.0, 1.9)
    };
    // From the horn of the uterus to the mass.
    let isthmus = cone(p, Vec3::new(-1.0, 0.0, 47.0), 3.0, Vec3::new(14.0, 0.0, 43.0), 5.0);
    let tube = union(ring(RING + TUBE), isthmus, 4.0);
    let lining =
        |r: Vec3, uneven: f32| ellipsoid(&p.from(middle), r) + undulation(p, uneven, 15.0, 0.4);
    let blood = ellipsoid(&p.from(Vec3::new(5.0, 3.0, 56.5)), Vec3::new(33.0, 27.0, 6.8));
    let blood = adnexa::within(p, blood + undulation(p, 1.2, 26.0, 0.7));
    let junction = lining(LINING[0] + 2.4, 0.7);
    let mut out = adnexa::around(p, [middle.x - radii.x, middle.x + radii.x]);
    out.push(part("blood", "free_blood", ORGAN, blood));
    out.extend(adnexa::organs(p, [&RIGHT, &LEFT], &LUTEUM, UTERUS));
    out.extend([
        part("junction", "junction", ORGAN, intersection(junction, uterus + 4.0, 3.0)),
        part("endometrium", "decidua", ORGAN, lining(LINING[0], 0.7)),
        part("pseudosac", "luteal_fluid", (0.4, 1.5), lining(LINING[1], 0.25)),
        part("tube", "tube", ORGAN, tube),
        part("ring", "decidua", ORGAN, ring(RING)),
        part("filling", "filling", ORGAN, gestation.sac(p, 0.0)),
    ]);
    out
}

/// The exam.
pub fn case() -> Case {
    Case {
        name: "ectopic",
        title: "Tubal pregnancy in an acquired pelvis",
        about: "# Fusion: a tubal pregnancy of about seven weeks, a ring with a living embryo beside an empty uterus,\n\
                # seen through the vagina in a volume of a pelvis, made by\n",
        gestation: gestation(),
        pelvis: parts(),
        mask: "ring",
        sliders: "tgc_sliders = [-2, 0, 1, 1, 0, -3, -5, -6]\n",
        matched: "gain = \"9 dB\"\ndynamic_range = \"76 dB\"\npsf_scale = [1.9, 1.8, 1]\nnoise = \"-140 dB\" # black where nothing is shown\n",
        mother: r#"# Vaginal wall, connective tissue and tube as one medium: on the way to the ring their mean speed
# and attenuation.
[tissues.mother]
based_on = "uterus"
speed = "1550 m/s"
attenuation = "0.54 dB/cm/MHz"
source = "mean by their thickness in front of the ring"

"#,
    }
}
