//! What is measured in each kind of examination.

use serde::{Deserialize, Serialize};

use crate::settings::Exam;

/// Kind of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CaliperKind {
    /// Distance between two points, mm.
    Distance,
    /// Circumference and area: the ends of one axis, then half the other.
    Ellipse,
    /// Angle between two arms: a point on one, the vertex, a point on the other.
    Angle,
    /// Circumference and area of an outline of any form: points along it, the last joined to the first.
    Trace,
}

impl CaliperKind {
    /// Name of the kind.
    pub fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Ellipse => "ellipse",
            Self::Angle => "angle",
            Self::Trace => "trace",
        }
    }

    /// Number of its points; none where it may be any from three on.
    pub fn points(self) -> Option<usize> {
        match self {
            Self::Distance => Some(2),
            Self::Ellipse | Self::Angle => Some(3),
            Self::Trace => None,
        }
    }
}

/// The number of a measurement that an item takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Length, mm.
    Length,
    /// Circumference, mm.
    Circumference,
    /// Area, cm^2.
    Area,
    /// Angle, degrees.
    Angle,
    /// Volume within an outline from annulus to annulus, ml.
    Discs,
}

impl Quantity {
    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Length | Self::Circumference => "mm",
            Self::Area => "cm²",
            Self::Angle => "°",
            Self::Discs => "ml",
        }
    }

    fn is_of(self, kind: CaliperKind) -> bool {
        match self {
            Self::Length => kind == CaliperKind::Distance,
            Self::Circumference | Self::Area => {
                matches!(kind, CaliperKind::Ellipse | CaliperKind::Trace)
            }
            Self::Angle => kind == CaliperKind::Angle,
            Self::Discs => kind == CaliperKind::Trace,
        }
    }
}

/// Something that is measured in an examination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// Its name in the field.
    pub name: &'static str,
    /// What is measured, and between which edges.
    pub meaning: &'static str,
    /// The number that it takes.
    pub quantity: Quantity,
}

const fn item(name: &'static str, quantity: Quantity, meaning: &'static str) -> Item {
    Item { name, meaning, quantity }
}

use Quantity::{Angle, Area, Circumference, Discs, Length};

/// Three axes of which a volume is made, in every examination.
const VOLUME: [Item; 3] = [
    item("volume L", Length, "length of an ellipsoid"),
    item("volume AP", Length, "its depth"),
    item("volume W", Length, "its width, in a plane at a right angle to the first"),
];

const GENERAL: [Item; 4] = [
    item("cyst", Area, "area of a cyst"),
    item("lesion", Area, "area of a lesion"),
    item("lesion size", Length, "largest diameter of a lesion"),
    item("angle", Angle, "between two lines"),
];

/// ISUOG Practice Guidelines: Salomon et al., Ultrasound Obstet Gynecol 2019;53:715-723.
const OBSTETRIC: [Item; 11] = [
    item("BPD", Length, "biparietal diameter, outer to outer edge of the skull"),
    item("OFD", Length, "occipitofrontal diameter, outer to outer edge"),
    item("HC", Circumference, "head circumference, outside the skull"),
    item("AC", Circumference, "abdominal circumference, outside the skin"),
    item("FL", Length, "length of the femur's ossified shaft"),
    item("HL", Length, "length of the humerus' ossified shaft"),
    item("CRL", Length, "crown-rump length"),
    item("NT", Length, "nuchal translucency, inner to inner edge"),
    item("AFI", Length, "depth of a pocket of amniotic fluid"),
    item("cervix", Length, "length of the cervix"),
    item("progression", Angle, "angle of progression"),
];

/// Lang et al., J Am Soc Echocardiogr 2015;28:1-39.
const CARDIAC: [Item; 10] = [
    item("IVSd", Length, "septum in diastole"),
    item("LVIDd", Length, "inner diameter of the left ventricle in diastole"),
    item("LVPWd", Length, "back wall in diastole"),
    item("LVIDs", Length, "inner diameter of the left ventricle in systole"),
    item("LV ED 4C", Discs, "left ventricle in diastole, four chambers, annulus to annulus"),
    item("LV ES 4C", Discs, "left ventricle in systole, four chambers"),
    item("LV ED 2C", Discs, "left ventricle in diastole, two chambers"),
    item("LV ES 2C", Discs, "left ventricle in systole, two chambers"),
    item("LA area", Area, "left atrium at the end of systole"),
    item("LA", Length, "diameter of the left atrium"),
];

const ABDOMEN: [Item; 10] = [
    item("AAA", Length, "abdominal aorta, outer to outer edge, front to back"),
    item("CBD", Length, "common bile duct, inner to inner edge"),
    item("GB wall", Length, "wall of the gallbladder in front"),
    item("kidney L", Length, "length of the kidney"),
    item("kidney AP", Length, "its depth"),
    item("kidney W", Length, "its width, across"),
    item("spleen", Length, "length of the spleen"),
    item("liver", Length, "height of the liver in the midclavicular line"),
    item("portal vein", Length, "diameter of the portal vein"),
    item("cyst", Area, "area of a cyst"),
];

const VASCULAR: [Item; 5] = [
    item("IMT", Length, "intima and media of the far wall"),
    item("diameter", Length, "inner diameter of the vessel"),
    item("residual", Length, "diameter that a narrowing leaves"),
    item("lumen", Area, "area of the lumen"),
    item("residual lumen", Area, "area that a narrowing leaves"),
];

const SMALL_PARTS: [Item; 6] = [
    item("thyroid L", Length, "length of a lobe"),
    item("thyroid AP", Length, "its depth"),
    item("thyroid W", Length, "its width"),
    item("nodule", Length, "largest diameter of a nodule"),
    item("tendon", Length, "thickness of a tendon"),
    item("muscle", Area, "cross-section of a muscle"),
];

const LUNG: [Item; 2] = [
    item("effusion", Length, "depth of a pleural effusion"),
    item("consolidation", Length, "largest diameter of a consolidation"),
];

/// What is measured in an examination, in the usual order.
pub fn items(exam: Exam) -> impl Iterator<Item = &'static Item> {
    let of: &[Item] = match exam {
        Exam::General => &GENERAL,
        Exam::Abdomen => &ABDOMEN,
        Exam::Cardiac => &CARDIAC,
        Exam::Obstetric => &OBSTETRIC,
        Exam::Vascular => &VASCULAR,
        Exam::SmallParts => &SMALL_PARTS,
        Exam::Lung => &LUNG,
    };
    of.iter().chain(&VOLUME)
}

/// The items that a measurement of a kind may be.
pub fn names(exam: Exam, kind: CaliperKind) -> impl Iterator<Item = &'static Item> {
    items(exam).filter(move |item| item.quantity.is_of(kind))
}

/// Texts that are usual on the images of an examination, the commonest first.
pub fn annotations(exam: Exam) -> &'static [&'static str] {
    match exam {
        Exam::General => &["right", "left", "trans", "sag", "cyst", "lesion"],
        Exam::Abdomen => &[
            "liver",
            "gallbladder",
            "CBD",
            "portal vein",
            "IVC",
            "aorta",
            "pancreas",
            "spleen",
            "right kidney",
            "left kidney",
            "bladder",
            "trans",
            "sag",
        ],
        Exam::Cardiac => &[
            "PLAX",
            "PSAX",
            "4CH",
            "2CH",
            "3CH",
            "5CH",
            "subcostal",
            "LV",
            "RV",
            "LA",
            "RA",
            "RVOT",
            "LVOT",
            "MV",
            "AV",
            "TV",
            "PV",
        ],
        Exam::Obstetric => &[
            "head", "abdomen", "femur", "face", "spine", "4CH", "RVOT", "LVOT", "stomach",
            "bladder", "cord", "placenta", "cervix", "amnion", "yolk sac", "trans", "sag",
        ],
        Exam::Vascular => {
            &["CCA", "ICA", "ECA", "bulb", "IJV", "plaque", "right", "left", "trans", "long"]
        }
        Exam::SmallParts => &[
            "right lobe",
            "left lobe",
            "isthmus",
            "trachea",
            "nodule",
            "muscle",
            "tendon",
            "bone",
            "nerve",
            "trans",
            "long",
        ],
        Exam::Lung => &["pleura", "A lines", "B lines", "rib", "diaphragm", "effusion"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Words as _;

    #[test]
    fn every_examination_has_texts_that_fit_beside_an_image() {
        for &exam in Exam::ALL {
            let all = annotations(exam);
            let once: std::collections::BTreeSet<_> = all.iter().collect();
            assert!(all.len() >= 6 && once.len() == all.len(), "{exam}");
            assert!(all.iter().all(|text| (1..=14).contains(&text.len())), "{exam}");
        }
        assert!(annotations(Exam::Cardiac).contains(&"4CH"));
    }

    #[test]
    fn names_suit_the_examination_and_are_there_once() {
        for &exam in Exam::ALL {
            let mut all: Vec<_> = items(exam).map(|item| item.name).collect();
            all.sort_unstable();
            let count = all.len();
            all.dedup();
            assert_eq!(all.len(), count, "{exam}");
        }
        let has = |exam, kind, name| names(exam, kind).any(|item| item.name == name);
        assert!(has(Exam::Obstetric, CaliperKind::Ellipse, "HC"));
        assert!(has(Exam::Obstetric, CaliperKind::Trace, "AC"));
        assert!(!has(Exam::Obstetric, CaliperKind::Distance, "HC"));
        assert!(!has(Exam::Obstetric, CaliperKind::Distance, "LVIDd"));
        assert!(has(Exam::Cardiac, CaliperKind::Trace, "LV ED 4C"));
        assert!(has(Exam::Abdomen, CaliperKind::Distance, "GB wall"));
    }
}
