//! A normal pregnancy of eight weeks: the uterus with its sac in the middle of the picture, ovaries on
//! both sides, the corpus luteum in the left one. Frame as in `adnexa`.

use glam::Vec3;

use crate::adnexa::{self, Luteum, ORGAN, Ovary};
use crate::embryo::Gestation;
use crate::field::{Point, ellipsoid, intersection, undulation};
use crate::part::{Part, part};
use crate::vaginal::Case;

/// Middle of the uterus and its half-axes: 63 mm wide, 52 mm deep (chosen, no source found).
const UTERUS: (Vec3, Vec3) = (Vec3::new(-2.0, 0.0, 39.0), Vec3::new(31.5, 34.0, 26.0));

/// Thickness of the decidua around the sac, mm, and the direction in which it is thicker: the placenta's.
const DECIDUA: (f32, Vec3) = (5.5, Vec3::new(-1.2, 0.0, 1.6));

const RIGHT: Ovary = Ovary {
    middle: Vec3::new(-43.5, 0.0, 47.5),
    radii: Vec3::new(12.0, 13.0, 8.8),
    follicles: &[
        ([-6.6, -1.0, 0.6], 3.4),
        ([-0.3, 1.0, -4.0], 2.7),
        ([0.8, -2.0, 3.2], 3.7),
        ([6.8, 0.5, -0.6], 3.2),
        ([-2.0, 7.0, 1.0], 3.0),
        ([3.0, -7.5, -1.0], 2.6),
    ],
};

const LEFT: Ovary = Ovary {
    middle: Vec3::new(42.0, 2.0, 46.5),
    radii: Vec3::new(12.5, 13.5, 10.5),
    follicles: &[
        ([-8.6, 0.0, -3.0], 2.3),
        ([9.0, -2.0, 3.0], 2.5),
        ([7.8, 2.0, -4.4], 2.3),
        ([0.0, -9.0, 2.0], 2.4),
    ],
};

const LUTEUM: Luteum = Luteum { middle: Vec3::new(42.5, 1.0, 47.0), radius: 7.6, wall: 3.8 };

fn gestation() -> Gestation {
    Gestation {
        middle: Vec3::new(1.0, 0.0, 38.0),
        scale: 1.0,
        yolk: (Vec3::new(11.2, 0.0, -1.8), 2.5),
        amnion: true,
        heart: 1.0,
        beats: 160.0,
    }
}

/// The pelvis, in rising priority.
fn parts() -> Vec<Part> {
    let p = &Point::world();
    let (middle, radii) = UTERUS;
    let uterus = adnexa::uterus(p, UTERUS);
    let gestation = gestation();
    let (wide, whither) = DECIDUA;
    let rim = |wider: f32| {
        let q = p.from(gestation.middle + whither);
        ellipsoid(&q, gestation.radii() + wider) + undulation(p, 0.8, 19.0, 1.4)
    };
    let inside = |field, depth: f32| intersection(field, uterus.clone() + depth, 3.0);
    let mut out = adnexa::around(p, [middle.x - radii.x, middle.x + radii.x]);
    out.extend(adnexa::organs(p, [&RIGHT, &LEFT], &LUTEUM, UTERUS));
    out.extend([
        part("junction", "junction", ORGAN, inside(rim(wide + 2.6), 4.0)),
        part("decidua", "decidua", ORGAN, inside(rim(wide), 5.0)),
        part("filling", "filling", ORGAN, gestation.sac(p, 0.0)),
    ]);
    out
}

/// The exam.
pub fn case() -> Case {
    Case {
        name: "early",
        title: "Embryo of eight weeks in an acquired pelvis",
        about: "# Fusion: an embryo of eight weeks with a beating heart, amnion and yolk sac, seen through the\n\
                # vagina in a volume of a pelvis, made by\n",
        gestation: gestation(),
        pelvis: parts(),
        mask: "decidua",
        sliders: "tgc_sliders = [-2, 0, 1, 1, 0, -3, -6, -7]\n",
        matched: "gain = \"10.2 dB\"\ndynamic_range = \"76 dB\"\npsf_scale = [1.9, 1.8, 1]\nnoise = \"-140 dB\" # black where nothing is shown\n",
        mother: r#"# Vaginal wall, connective tissue and muscle of the uterus as one medium: on the way to the sac
# their mean speed and attenuation.
[tissues.mother]
based_on = "uterus"
speed = "1550 m/s"
attenuation = "0.54 dB/cm/MHz"
source = "mean by their thickness in front of the sac"

"#,
    }
}
