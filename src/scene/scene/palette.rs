//! The look of tissues in pictures of the anatomy and of its labels.

/// Visibility of a surface, and of the things behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// The surface is left out.
    Hidden,
    /// Transparent: only outlines are visible.
    SeeThrough,
    /// The surface hides everything behind it.
    Solid,
}

use Show::{Hidden, SeeThrough, Solid};

/// Colours (sRGB) of tissues as in anatomical atlases, by a word of their names; the first word
/// found counts. Layers and vessels that enclose organs are glass; layers around everything, except
/// the skin, are left out, so that the organs can be seen.
const KNOWN: [(&str, [u8; 3], Show); 36] = [
    ("membranous", [236, 226, 200], Solid),
    ("bone", [236, 226, 200], Solid),
    ("cartilage", [196, 214, 216], Solid),
    ("skin", [226, 178, 150], SeeThrough),
    ("fascia", [214, 204, 196], Hidden),
    ("fat", [238, 208, 128], Hidden),
    ("muscle", [172, 78, 70], Hidden),
    ("lung", [232, 164, 166], SeeThrough),
    ("pelvis", [204, 150, 132], SeeThrough),
    ("chest", [204, 150, 132], Hidden),
    ("liver", [158, 78, 58], Solid),
    ("spleen", [128, 58, 84], Solid),
    ("pancreas", [222, 178, 108], Solid),
    ("pyramid", [206, 118, 92], Solid),
    ("sinus", [236, 204, 132], Solid),
    ("kidney", [176, 92, 74], Solid),
    ("thyroid", [200, 96, 80], Solid),
    ("blood", [204, 46, 46], Solid),
    ("vessel", [222, 128, 118], SeeThrough),
    ("myocardium", [186, 82, 74], SeeThrough),
    ("valve", [240, 222, 190], Solid),
    ("bile", [104, 152, 72], Solid),
    ("gallbladder", [104, 152, 72], Solid),
    ("amniotic", [112, 168, 206], SeeThrough),
    ("urine", [224, 200, 92], Solid),
    ("cyst", [96, 164, 210], Solid),
    ("fluid", [112, 168, 206], SeeThrough),
    ("tumour", [214, 196, 84], Solid),
    ("stool", [140, 110, 70], Solid),
    ("air", [150, 178, 208], SeeThrough),
    ("brain", [224, 184, 172], Solid),
    ("choroid", [210, 132, 148], Solid),
    ("placenta", [182, 70, 82], SeeThrough),
    ("decidua", [206, 116, 122], SeeThrough),
    ("uterus", [194, 104, 104], SeeThrough),
    ("soft_tissue", [234, 184, 158], Solid),
];

/// Colour and visibility of a tissue of this name; `index` chooses a colour for unknown names.
pub fn look(name: &str, index: usize) -> ([u8; 3], Option<Show>) {
    let known = KNOWN.iter().find(|(word, ..)| name.contains(word));
    match known {
        Some((_, colour, show)) => (*colour, Some(*show)),
        None => (distinct(index), None),
    }
}

/// Colour `index` of a list in which neighbours differ: hues a golden angle apart at one lightness and
/// chroma of OKLCH (Ottosson 2020).
fn distinct(index: usize) -> [u8; 3] {
    let hue = (40.0 + 137.508 * index as f64).to_radians();
    let (lightness, chroma) = (0.74, 0.125);
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let cubed = |x: f64| x * x * x;
    let l = cubed(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cubed(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cubed(lightness - 0.089_484_177_5 * a - 1.291_485_548 * b);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701 * s,
    ];
    linear.map(|c| {
        let c = c.clamp(0.0, 1.0);
        let c = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * c).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_they_are() {
        assert_eq!(look("cortical_bone", 3).1, Some(Solid));
        assert_eq!(look("fetal_liver", 3).0, look("liver", 9).0);
        assert_eq!(look("plus_15", 3), (distinct(3), None));
    }

    // Hues 52 degrees apart, the least among any six in a row, differ by 30 levels.
    #[test]
    fn neighbours_in_the_list_differ() {
        for i in 0..20 {
            for j in i + 1..(i + 6).min(20) {
                let (a, b) = (distinct(i), distinct(j));
                let apart = (0..3).map(|k| a[k].abs_diff(b[k])).max();
                assert!(apart > Some(29), "{i} {j}: {a:?} {b:?}");
            }
            // Legible on black.
            assert!(distinct(i).into_iter().max() > Some(150), "{i}");
        }
    }
}
