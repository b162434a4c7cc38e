//! How the patient lies in the world of a scene.

use glam::{DMat3, DVec3};

/// The sides of the patient to which the world's x, y and z grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Orientation([Side; 3]);

/// One of the six sides of a patient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Right,
    Left,
    Anterior,
    Posterior,
    Head,
    Feet,
}

impl Side {
    /// The side of a letter as formats of volumes have it (NIfTI, NRRD), or as it stands beside images (DICOM).
    fn of(letter: char) -> Option<Self> {
        Some(match letter.to_ascii_uppercase() {
            'R' => Self::Right,
            'L' => Self::Left,
            'A' => Self::Anterior,
            'P' => Self::Posterior,
            'S' | 'H' => Self::Head,
            'I' | 'F' => Self::Feet,
            _ => return None,
        })
    }

    /// Its direction in LPS, the frame of DICOM.
    fn lps(self) -> DVec3 {
        match self {
            Self::Right => DVec3::NEG_X,
            Self::Left => DVec3::X,
            Self::Anterior => DVec3::NEG_Y,
            Self::Posterior => DVec3::Y,
            Self::Head => DVec3::Z,
            Self::Feet => DVec3::NEG_Z,
        }
    }
}

/// The letters beside images (DICOM PS3.3, C.7.6.1.1.1), each with its direction in LPS.
const LETTERS: [(&str, Side); 6] = [
    ("R", Side::Right),
    ("L", Side::Left),
    ("A", Side::Anterior),
    ("P", Side::Posterior),
    ("H", Side::Head),
    ("F", Side::Feet),
];

impl Orientation {
    /// The orientation of three letters such as `LPS`; where they are none, the reason.
    ///
    /// # Errors
    /// Other than three letters of R L A P S I (H F for S I); an axis named twice; a mirrored frame.
    pub fn of(text: &str) -> Result<Self, &'static str> {
        let sides: Option<Vec<Side>> = text.chars().map(Side::of).collect();
        let sides: [Side; 3] =
            sides.and_then(|sides| sides.try_into().ok()).ok_or("is not three such letters")?;
        let [x, y, z] = sides.map(Side::lps);
        match DMat3::from_cols(x, y, z).determinant() {
            turn if turn > 0.5 => Ok(Self(sides)),
            mirror if mirror < -0.5 => Err("is mirrored: its frame is left-handed"),
            _ => Err("names an axis of the patient twice"),
        }
    }

    /// The patient's six sides: the letter that stands for it beside an image, and its direction in the world.
    pub fn sides(&self) -> [(&'static str, DVec3); 6] {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        LETTERS.map(|(letter, side)| {
            let parts = self.0.iter().zip(axes);
            (letter, parts.map(|(own, axis)| own.lps().dot(side.lps()) * axis).sum())
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::Orientation;

    #[test]
    fn each_side_lies_where_its_axis_grows() {
        // A probe's frame on a mother's belly: x to the feet, y to her right, z to her back.
        let sides = Orientation::of("IRP").unwrap().sides();
        let at = |letter: &str| sides.iter().find(|side| side.0 == letter).unwrap().1;
        assert_eq!([at("F"), at("R"), at("P")], [DVec3::X, DVec3::Y, DVec3::Z]);
        assert_eq!([at("H"), at("L"), at("A")], [-DVec3::X, -DVec3::Y, -DVec3::Z]);
        assert_eq!(Orientation::of("frp"), Orientation::of("IRP"));
    }

    #[test]
    fn what_is_no_frame_of_a_patient_is_refused() {
        for (text, reason) in [
            ("LP", "three"),
            ("LPSA", "three"),
            ("LPX", "three"),
            ("LPR", "twice"),
            ("RPS", "mirrored"),
        ] {
            assert!(Orientation::of(text).unwrap_err().contains(reason), "{text}");
        }
    }
}
