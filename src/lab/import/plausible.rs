//! Organs whose volume is far from that of people's: most often a wrong unit, or numbers of labels that are exchanged.

use super::draft::Part;
use super::table::words;

/// An organ: its names, and the masses of the reference woman's and the reference man's, g.
struct Organ {
    names: &'static [&'static str],
    adult: [f64; 2],
}

/// Organs of which a whole one is segmented, and whose volume depends little on what is in them. The masses are those of
/// ICRP Publication 89, reference values for adults, the heart's with its blood; of kidneys and adrenal glands one of the
/// two. A gram is taken for a millilitre: soft tissue has 1.03 g/cm3, muscle 1.05 (ICRU Report 46, as in Health Phys.
/// 102(3), 2012, doi 10.1097/HP.0b013e318235163f, table 2).
const ORGANS: [Organ; 8] = [
    Organ { names: &["liver", "hepar"], adult: [1400.0, 1800.0] },
    Organ { names: &["spleen", "lien"], adult: [130.0, 150.0] },
    Organ { names: &["kidney", "ren"], adult: [138.0, 155.0] },
    Organ { names: &["pancreas"], adult: [120.0, 140.0] },
    Organ {
        names: &["adrenal gland", "suprarenal gland", "glandula suprarenalis"],
        adult: [6.5, 7.0],
    },
    Organ { names: &["thyroid", "thyroid gland", "glandula thyroidea"], adult: [17.0, 20.0] },
    Organ { names: &["heart", "cor"], adult: [620.0, 840.0] },
    Organ { names: &["brain"], adult: [1300.0, 1450.0] },
];

/// What a volume may be of the reference woman's at least, and of the reference man's at most. Adults' livers were found
/// from 0.42 times the woman's to 1.25 times the man's, spleens from 0.36 times to 19 times (594 to 2250 ml and 47 to 2892 ml,
/// 369 adults: World J. Gastroenterol. 23(27), 2017, doi 10.3748/wjg.v23.i27.4968); of healthy donors 95 in 100 have a spleen
/// of 0.62 to 2.1 times (81 to 322 ml of 2989: Kim et al., "Population-based and personalized reference intervals for liver
/// and spleen volumes"). A spleen beyond ten times is worth a word, which refuses nothing.
const BOUNDS: [f64; 2] = [1.0 / 3.0, 10.0];

/// Words of a name that say which one of two an organ is.
const SIDES: [&str; 6] = ["left", "right", "l", "r", "sinister", "dexter"];

/// The organ of this name as a whole; none for its parts, and for what is in it.
fn organ(name: &str) -> Option<&'static Organ> {
    let mut own = words(name);
    own.retain(|word| !SIDES.contains(&word.as_str()));
    own.sort();
    let is = |known: &&str| {
        let mut known = words(known);
        known.sort();
        known == own
    };
    ORGANS.iter().find(|organ| organ.names.iter().any(is))
}

/// The warning of a structure whose volume no such organ has, with its likely cause and the remedy.
pub(super) fn doubt(part: &Part) -> Option<String> {
    let Organ { adult: [woman, man], .. } = organ(&part.name)?;
    // One that is inside out is told elsewhere.
    let volume = part.volume.abs();
    let usual = (woman + man) / 2.0;
    // Lengths ten times as large or as small make the volume a thousand times that, to the factor by which people differ.
    let off = |times: f64| (times / 3.0..=times * 3.0).contains(&(volume / usual));
    let cause = if off(1e-3) {
        "its lengths look ten times too small: is the file in cm, and taken for mm? Give a mesh's unit (--units cm), or mend the \
         size of voxels in the header"
    } else if off(1e3) {
        "its lengths look ten times too large: is the file in mm, and taken for cm? Give a mesh's unit (--units mm), or mend the \
         size of voxels in the header"
    } else if volume < woman * BOUNDS[0] {
        "is it a part of the organ, or a small child's? Else numbers of labels may be exchanged (name them by --labels), or the \
         unit is another (--units of meshes, the size of voxels in the header of a label map)"
    } else if volume > man * BOUNDS[1] {
        "numbers of labels may be exchanged (name them by --labels), or the unit is another (--units of meshes, the size of \
         voxels in the header of a label map)"
    } else {
        return None;
    };
    Some(format!(
        "{}: {volume:.1} ml, and adults have {woman} to {man} ml (ICRP 89): {cause}",
        part.name
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, volume: f64) -> Option<String> {
        doubt(&Part { name: name.to_owned(), volume, ..Part::default() })
    }

    #[test]
    fn volumes_that_people_have_are_not_doubted_and_others_are_with_their_cause() {
        for (name, volume) in [
            ("liver", 1500.0),
            ("liver", 594.0),
            ("Liver", 2250.0),
            ("spleen", 81.1),
            // Of a patient with cirrhosis it is a remark too many; of one with less it is none.
            ("spleen", 1400.0),
            ("kidney_left", 120.0),
            ("RightKidney", -170.0),
            ("kidneys", 300.0),
            ("adrenal_gland_right", 5.0),
            ("thyroid_gland", 15.0),
            // Parts, what is in an organ, and organs of which nothing is known.
            ("liver_tumor", 3.0),
            ("Right hepatic lobe", 3.0),
            ("liver segment 4", 3.0),
            ("heart_ventricle_left", 3.0),
            ("wall of heart", 3.0),
            ("urinary_bladder", 1.0),
        ] {
            assert_eq!(of(name, volume), None, "{name}");
        }
        for (name, volume, cause) in [
            ("liver", 3.0, "ten times too small"),
            ("liver", 1.5e6, "ten times too large"),
            ("liver", 239.0, "small child"),
            ("kidney_right", 1700.0, "exchanged"),
            ("pancreas", 9.0, "exchanged"),
            ("brain", 0.0, "a part of the organ"),
            ("Lien", 30.0, "--labels"),
        ] {
            let said = of(name, volume).expect(name);
            assert!(said.contains(cause) && said.contains(name), "{said}");
        }
    }
}
