//! The shipped tissues: single numbers inside the published ranges, a source on each.
//!
//! Echogenicity is relative to healthy liver, whose backscatter coefficient is 0.5e-3 per cm and sr at 3 MHz
//! (Lu, Zagzebski, Lee 1999). Where a measurement or the order that textbooks give was found it is named; other
//! echogenicities, textures and surfaces are tuned by eye against clinical pictures and say so. Muscle and liver are chosen so that a flat
//! interface between them reflects -36 dB; the published ranges allow anything from -30 to zero.

use super::{Surface, Tissue};

/// Attenuation at 1 MHz: Diagnostics 13:855 (2023), table 4.
const A: &str = "Diagnostics 13:855 (2023) table 4";
/// Density and speed measured ex vivo: Bioengineering 12:946 (2025), appendix A.
const B: &str = "Bioengineering 12:946 (2025) appendix A";
/// Values of Burger et al. 2013 as published with its implementation.
const BURGER: &str = "Burger et al. 2013, parameter table";
/// Values of the NVIDIA ray-traced ultrasound simulator, v0.6.0.
const I4H: &str = "Isaac for Healthcare sensor simulation 0.6.0";
/// Values of the IT'IS tissue database, checked against a stored copy.
const ITIS: &str = "IT'IS tissue database";
/// Values of the IT'IS tissue database, quoted from memory.
const ITIS_UNVERIFIED: &str = "IT'IS tissue database, unverified";
/// Textbook values that nobody here traced to a measurement.
const UNVERIFIED: &str = "unverified";
/// Obstetric values: Zana and Lang 1974.
const ZANA: &str = "Zana and Lang 1974, unverified";
/// Attenuation of uterine tissues at 5 MHz, divided by 5.
const UTERUS: &str = "PMC3056396 (at 5 MHz, per MHz)";
/// Values chosen by this project because no source was found.
const CHOICE: &str = "chosen by this project, no source found";

/// Tuned by eye against clinical pictures.
const EYE: &str = "tuned by eye";
/// Breast fat backscatters 0.004 per cm and sr at 6 to 12 MHz, as the frequency to the power of 2.49: 0.26e-3 at 3 MHz.
const FAT: &str = "PMC4618705 (breast fat), against liver in Ultrasound Med Biol 25:1047 (1999)";
/// In the belly fat is mostly brighter than the organs; no number was found.
const VISCERAL: &str = "brighter than organs: J Ultrason 15:318 (2015); number tuned by eye";
/// Grey levels of healthy liver are 1.14 (0.2) times those of renal cortex: at 100 of 255 levels of a 60 dB
/// picture 3 dB (2 to 6 dB within one deviation).
const HEPATORENAL: &str = "hepatorenal index, J Ultrasound Med 34:1051 (2015)";
/// Muscle is described as darker than fat, with bright septa; no number was found.
const DARK: &str = "darker than fat, by descriptions of normal tissue; number tuned by eye";
/// The spleen is as bright as the liver, or slightly brighter or darker.
const SPLEEN: &str = "as liver within 1 to 2 dB, by descriptions of normal tissue";

/// Speed mm/us, density g/cm3, attenuation dB/(cm MHz), each with its source.
type Bulk = [(f64, &'static str); 3];

/// Echogenicity dB re liver with its source, scatterer probability per cell, texture depth and length mm.
type Speckle = ((f64, &'static str), f64, f64, f64);

/// Roughness exponent, thickness mm, specularity exponent.
type Skin = (f64, f64, f64);

const SOFT: Skin = (1000.0, 0.1, 1.0);
const FLUID: Skin = (1000.0, 0.05, 1.0);
const BONE: Skin = (100.0, 0.3, 0.0);
/// No scatterers.
const ANECHOIC: Speckle = ((f64::NEG_INFINITY, "no scatterers"), 1.0, 0.0, 4.0);

const TABLE: &[(&str, Bulk, Speckle, Skin)] = &[
    (
        "water",
        [(1.524, "at 37 C, unverified"), (0.993, "at 37 C, unverified"), (0.0022, I4H)],
        ANECHOIC,
        FLUID,
    ),
    ("gel", [(1.524, "as water, unverified"), (0.998, UNVERIFIED), (0.0022, I4H)], ANECHOIC, FLUID),
    (
        "amniotic_fluid",
        [(1.525, ZANA), (1.008, ZANA), (0.0075, ZANA)],
        ((-60.0, EYE), 1.0, 0.0, 4.0),
        FLUID,
    ),
    (
        "bile",
        [(1.540, UNVERIFIED), (1.015, UNVERIFIED), (0.01, UNVERIFIED)],
        ((-60.0, EYE), 1.0, 0.0, 4.0),
        (1000.0, 0.1, 2.0),
    ),
    (
        "urine",
        [(1.540, UNVERIFIED), (1.015, UNVERIFIED), (0.01, UNVERIFIED)],
        ((-60.0, EYE), 1.0, 0.0, 4.0),
        FLUID,
    ),
    (
        "cyst_fluid",
        [
            (1.540, "as bile, unverified"),
            (1.015, "as bile, unverified"),
            (0.01, "as bile, unverified"),
        ],
        ((-60.0, EYE), 1.0, 0.0, 4.0),
        FLUID,
    ),
    (
        "blood",
        [(1.575, ITIS_UNVERIFIED), (1.050, ITIS_UNVERIFIED), (0.16, A)],
        ((-32.0, EYE), 1.0, 0.0, 4.0),
        FLUID,
    ),
    ("fat", [(1.450, I4H), (0.920, B), (0.63, BURGER)], ((-3.0, FAT), 0.5, 0.35, 5.0), SOFT),
    (
        "visceral_fat",
        [(1.450, I4H), (0.920, B), (0.63, BURGER)],
        ((5.0, VISCERAL), 0.5, 0.35, 5.0),
        SOFT,
    ),
    ("skin", [(1.655, B), (1.131, B), (0.35, A)], ((6.0, EYE), 1.0, 0.1, 3.0), SOFT),
    (
        "muscle",
        [(1.588, ITIS), (1.090, ITIS_UNVERIFIED), (1.09, BURGER)],
        ((-6.0, DARK), 0.5, 0.5, 3.0),
        SOFT,
    ),
    (
        "liver",
        [
            (1.555, "between 1.540 (B-mode nominal) and 1.586 (IT'IS)"),
            (1.080, ITIS_UNVERIFIED),
            (0.50, A),
        ],
        ((0.0, "the reference"), 1.0, 0.12, 4.0),
        (1000.0, 0.1, 2.0),
    ),
    (
        "kidney",
        [(1.557, ITIS_UNVERIFIED), (1.061, ITIS_UNVERIFIED), (1.0, A)],
        ((-4.0, HEPATORENAL), 1.0, 0.2, 4.0),
        SOFT,
    ),
    (
        "spleen",
        [(1.567, UNVERIFIED), (1.054, UNVERIFIED), (0.40, A)],
        ((1.0, SPLEEN), 1.0, 0.1, 4.0),
        SOFT,
    ),
    (
        "myocardium",
        [
            (1.570, "between 1.561 (IT'IS, unverified) and 1.586"),
            (1.081, ITIS_UNVERIFIED),
            (0.52, A),
        ],
        ((-3.0, EYE), 1.0, 0.25, 4.0),
        (1000.0, 0.15, 1.0),
    ),
    (
        "uterus",
        [(1.590, UNVERIFIED), (1.052, UNVERIFIED), (0.83, UTERUS)],
        ((-2.0, EYE), 1.0, 0.25, 4.0),
        SOFT,
    ),
    (
        "fibroid",
        [(1.590, UNVERIFIED), (1.052, UNVERIFIED), (1.02, UTERUS)],
        ((-8.0, EYE), 1.0, 0.35, 5.0),
        SOFT,
    ),
    (
        "cervix",
        [(1.590, UNVERIFIED), (1.052, UNVERIFIED), (1.26, UTERUS)],
        ((-3.0, EYE), 1.0, 0.2, 4.0),
        SOFT,
    ),
    (
        "placenta",
        [(1.541, UNVERIFIED), (1.050, UNVERIFIED), (0.55, UNVERIFIED)],
        ((1.0, EYE), 1.0, 0.2, 5.0),
        SOFT,
    ),
    (
        "fetal_soft_tissue",
        [(1.540, CHOICE), (1.040, CHOICE), (0.5, CHOICE)],
        ((-1.0, EYE), 1.0, 0.2, 4.0),
        SOFT,
    ),
    (
        "fetal_bone",
        [(2.400, CHOICE), (1.450, CHOICE), (7.0, CHOICE)],
        ((3.0, EYE), 0.5, 0.0, 4.0),
        BONE,
    ),
    (
        "cortical_bone",
        [(3.515, ITIS_UNVERIFIED), (1.908, ITIS_UNVERIFIED), (5.0, BURGER)],
        ((3.0, EYE), 0.5, 0.0, 4.0),
        BONE,
    ),
    (
        "lung",
        [(0.949, ITIS_UNVERIFIED), (0.394, ITIS_UNVERIFIED), (40.0, A)],
        ((6.0, EYE), 0.5, 0.3, 4.0),
        (100.0, 0.3, 0.0),
    ),
    (
        "air",
        [(0.343, "textbook, 20 C"), (0.0012, "textbook, 20 C"), (7.5, A)],
        ANECHOIC,
        (100.0, 0.1, 0.0),
    ),
    (
        "vessel_wall",
        [(1.570, UNVERIFIED), (1.100, UNVERIFIED), (1.09, BURGER)],
        ((0.0, EYE), 1.0, 0.0, 4.0),
        FLUID,
    ),
    (
        "tumour",
        [(1.565, CHOICE), (1.070, CHOICE), (0.6, CHOICE)],
        ((-6.0, EYE), 1.0, 0.2, 5.0),
        SOFT,
    ),
];

/// Every shipped tissue.
pub fn shipped() -> Vec<Tissue> {
    TABLE.iter().map(tissue).collect()
}

/// Names of the shipped tissues, in the table's order.
pub fn names() -> impl Iterator<Item = &'static str> + Clone {
    TABLE.iter().map(|row| row.0)
}

fn tissue(row: &(&str, Bulk, Speckle, Skin)) -> Tissue {
    let &(name, [speed, density, attenuation], speckle, skin) = row;
    let (echogenicity, density_of_scatterers, texture_depth, texture_length) = speckle;
    Tissue {
        name: name.to_owned(),
        speed: speed.0,
        density: density.0,
        attenuation: attenuation.0,
        // Single numbers per MHz are what most sources give.
        attenuation_exponent: 1.0,
        echogenicity: echogenicity.0,
        density_of_scatterers,
        mean_over_sigma: 0.0,
        texture_depth,
        texture_length,
        surface: Surface { roughness: skin.0, thickness: skin.1, specularity: skin.2, gain: 0.0 },
        source: format!(
            "speed: {}\ndensity: {}\nattenuation: {}\nechogenicity: {}\ntexture, surface: {EYE}",
            speed.1, density.1, attenuation.1, echogenicity.1
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(a: &str, b: &str) -> f64 {
        let z = |n| Tissue::shipped(n).expect(n).impedance();
        20.0 * ((z(b) - z(a)) / (z(b) + z(a))).abs().log10()
    }

    #[test]
    fn interfaces_have_the_levels_of_textbooks() {
        // Half a decibel: the third digit of the tabulated speeds.
        approx::assert_abs_diff_eq!(level("muscle", "liver"), -36.4, epsilon = 0.5);
        approx::assert_abs_diff_eq!(level("fat", "muscle"), -17.8, epsilon = 0.5);
        approx::assert_abs_diff_eq!(level("muscle", "cortical_bone"), -4.4, epsilon = 0.5);
        assert!(level("muscle", "air") > -0.02);
    }

    // 2 dB are seen as a step in a 60 dB picture: 8 of 255 grey levels.
    #[test]
    fn neighbours_in_the_belly_can_be_told_apart() {
        let echo = |n| Tissue::shipped(n).expect(n).echogenicity;
        for (a, b) in [
            ("skin", "fat"),
            ("fat", "muscle"),
            ("liver", "fat"),
            ("liver", "muscle"),
            ("liver", "kidney"),
            ("spleen", "kidney"),
            ("kidney", "muscle"),
            ("visceral_fat", "liver"),
            ("visceral_fat", "spleen"),
            ("visceral_fat", "kidney"),
        ] {
            assert!(echo(a) >= echo(b) + 2.0, "{a} {b}");
        }
        // Fat's two measured backscatter coefficients: at 9 MHz, brought to 3 MHz by its own exponent.
        let fat = 0.004 * (3.0_f64 / 9.0).powf(2.49);
        approx::assert_abs_diff_eq!(echo("fat"), 10.0 * (fat / 0.5e-3).log10(), epsilon = 0.5);
    }

    #[test]
    fn every_tissue_is_physical_named_once_and_sourced() {
        let all = shipped();
        for (i, t) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|other| other.name != t.name), "{}", t.name);
            assert!(t.speed > 0.3 && t.speed < 4.5, "{}", t.name);
            assert!(t.density > 0.001 && t.density < 2.1, "{}", t.name);
            assert!((0.0..=40.0).contains(&t.attenuation), "{}", t.name);
            assert!((0.0..=0.5).contains(&t.texture_depth) && t.texture_length > 0.0);
            assert!((0.0..=1.0).contains(&t.density_of_scatterers));
            assert_eq!(t.source.lines().count(), 5, "{}", t.name);
            assert!(t.source.lines().all(|l| !l.ends_with(": ")), "{}", t.name);
        }
        assert!(Tissue::shipped("placenta").is_some_and(|t| t.source.contains("unverified")));
    }
}
