//! The study that files belong to: who was examined, by whom, and when.

use dicom_core::chrono::{DateTime, Datelike as _, Local, NaiveDate};
use dicom_dictionary_std::tags;

use super::data::{DataSet, uid};

/// Forms in which a date of birth is read.
const DATES: [&str; 3] = ["%Y-%m-%d", "%d.%m.%Y", "%Y%m%d"];
/// No date of birth lies before this year; two digits are no year.
const FIRST_YEAR: i32 = 1800;
/// Most letters of a name or a line (PS3.5, 6.2).
const MOST: usize = 64;
/// Most parts of a name, between carets.
const PARTS: usize = 5;

/// A patient as typed; empty where nothing is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Patient {
    /// Name, its parts between carets: family, given, ...
    pub name: String,
    /// Number or other sign.
    pub number: String,
    /// Date of birth.
    pub born: String,
}

/// One examination of a patient: files that have it belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Study {
    /// The patient, as typed.
    pub patient: Patient,
    /// Name of the examiner; may be empty.
    pub examiner: String,
    /// Reason of the examination; may be empty.
    pub question: String,
    /// Kind of the examination.
    pub exam: String,
    began: DateTime<Local>,
    uid: String,
}

impl Study {
    /// A study that begins now.
    pub fn begin(patient: Patient) -> Self {
        let (examiner, question, exam) = Default::default();
        Self { patient, examiner, question, exam, began: Local::now(), uid: uid() }
    }

    /// Adds patient, study and who examined in the place of nobody; `scene` names the series.
    pub(super) fn put(&self, data: &mut DataSet, scene: &str) {
        let Patient { name, number, born } = &self.patient;
        data.put(tags::PATIENT_NAME, person(name));
        data.put(tags::PATIENT_ID, line(number));
        match birth(born) {
            Some(date) => data.put(tags::PATIENT_BIRTH_DATE, date.format("%Y%m%d").to_string()),
            None if born.trim().is_empty() => {}
            None => data.put(tags::PATIENT_COMMENTS, format!("Born: {}", line(born))),
        }
        data.put(tags::STUDY_INSTANCE_UID, self.uid.as_str());
        data.put(tags::STUDY_DATE, self.began.format("%Y%m%d").to_string());
        data.put(tags::STUDY_TIME, self.began.format("%H%M%S").to_string());
        data.put(tags::TIMEZONE_OFFSET_FROM_UTC, self.began.format("%z").to_string());
        data.put(tags::STUDY_DESCRIPTION, line(&self.exam));
        data.put(tags::SERIES_DESCRIPTION, line(scene));
        data.put(tags::OPERATORS_NAME, person(&self.examiner));
        data.put(tags::REASON_FOR_VISIT, plain(&self.question).collect::<String>());
    }
}

/// The letters of a text that every element can hold; a backslash stands between values.
fn plain(text: &str) -> impl Iterator<Item = char> {
    text.trim().chars().filter(|&c| c != '\\' && !c.is_control())
}

fn line(text: &str) -> String {
    plain(text).take(MOST).collect()
}

/// A name; an equals sign stands between its writings.
fn person(text: &str) -> String {
    let name: String = plain(text).filter(|&c| c != '=').take(MOST).collect();
    name.split('^').take(PARTS).collect::<Vec<_>>().join("^")
}

/// The date of birth, where it is typed in one of the forms that are read.
fn birth(text: &str) -> Option<NaiveDate> {
    let read = |form| NaiveDate::parse_from_str(text.trim(), form).ok();
    DATES.into_iter().filter_map(read).find(|date| (FIRST_YEAR..=9999).contains(&date.year()))
}

#[cfg(test)]
mod tests {
    use dicom_dictionary_std::{tags, uids};
    use dicom_object::{DefaultDicomObject, open_file};

    use super::super::{About, Loop, Transducer, still};
    use super::*;

    fn about(study: Option<Study>) -> About {
        About {
            name: "Liver".into(),
            pitch: 0.2,
            corner: [-0.3, 0.0],
            frequency: 5.0,
            transducer: Transducer::Linear,
            colours: None,
            study,
        }
    }

    fn text(file: &DefaultDicomObject, tag: dicom_core::Tag) -> String {
        file.element(tag).expect("there").to_str().expect("a text").into_owned()
    }

    #[test]
    fn dates_of_birth_are_read_in_some_forms_and_no_others() {
        let date = NaiveDate::from_ymd_opt(1990, 4, 12);
        for typed in ["1990-04-12", " 1990-4-12 ", "12.4.1990", "12.04.1990", "19900412"] {
            assert_eq!(birth(typed), date, "{typed}");
        }
        for typed in ["", "90-04-12", "12.4.90", "4/12/1990", "1990", "spring", "1990-02-30"] {
            assert_eq!(birth(typed), None, "{typed}");
        }
    }

    #[test]
    fn names_and_lines_hold_what_dicom_allows() {
        assert_eq!(person(" Müller^Anna=x\\y "), "Müller^Annaxy");
        assert_eq!(person("a^b^c^d^e^f"), "a^b^c^d^e");
        assert_eq!(line("one\ntwo"), "onetwo");
        assert_eq!(line(&"ä".repeat(99)).chars().count(), 64);
    }

    #[test]
    fn a_file_says_whose_it_is_and_files_of_a_study_belong_together() {
        let folder = tempfile::tempdir().unwrap();
        let born = "12.4.1990".to_owned();
        let patient = Patient { name: "Müller^Anna".into(), number: "77-a".into(), born };
        let mut study = Study::begin(patient);
        study.examiner = "Weiß".into();
        study.question = "Zyste?".into();
        study.exam = "abdomen".into();
        let (image, film) = (folder.path().join("a.dcm"), folder.path().join("b.dcm"));
        let grey = [7, 7, 7, 255, 9, 9, 9, 255];
        still(&image, about(Some(study.clone())), [2, 1], &grey).unwrap();
        let mut made = Loop::new(&film, about(Some(study)));
        (0..3).for_each(|_| made.add(2, 1, &grey).unwrap());
        made.finish_at(&[40.0, 100.0, 130.5]).unwrap();
        let [image, film] = [image, film].map(|path| open_file(path).unwrap());
        for (tag, expected) in [
            (tags::PATIENT_NAME, "Müller^Anna"),
            (tags::PATIENT_ID, "77-a"),
            (tags::PATIENT_BIRTH_DATE, "19900412"),
            (tags::OPERATORS_NAME, "Weiß"),
            (tags::REASON_FOR_VISIT, "Zyste?"),
            (tags::STUDY_DESCRIPTION, "abdomen"),
            (tags::SERIES_DESCRIPTION, "Liver"),
        ] {
            assert_eq!(text(&image, tag), expected);
            assert_eq!(text(&film, tag), expected);
        }
        let same = |tag| text(&image, tag) == text(&film, tag);
        assert!(same(tags::STUDY_INSTANCE_UID) && same(tags::STUDY_DATE) && same(tags::STUDY_TIME));
        assert!(!same(tags::SERIES_INSTANCE_UID) && !same(tags::SOP_INSTANCE_UID));
        let class =
            |file: &DefaultDicomObject| file.meta().media_storage_sop_class_uid().to_owned();
        assert_eq!(class(&image).trim_end_matches('\0'), uids::ULTRASOUND_IMAGE_STORAGE);
        assert!(image.element(tags::NUMBER_OF_FRAMES).is_err(), "an image is no film");
        let times = film.element(tags::FRAME_TIME_VECTOR).unwrap().to_multi_float64().unwrap();
        assert_eq!(times, [0.0, 40.0, 60.0]);
        let pointer = film.element(tags::FRAME_INCREMENT_POINTER).unwrap();
        assert_eq!(pointer.value().to_tag().unwrap(), tags::FRAME_TIME_VECTOR);
    }

    #[test]
    fn what_is_not_typed_is_empty_and_a_date_of_another_form_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.dcm");
        let study = Study::begin(Patient { born: "4/12/1990".into(), ..Patient::default() });
        still(&file, about(Some(study)), [1, 1], &[7, 7, 7, 255]).unwrap();
        let read = open_file(&file).unwrap();
        for tag in [tags::PATIENT_NAME, tags::PATIENT_ID, tags::PATIENT_BIRTH_DATE] {
            assert_eq!(text(&read, tag), "", "{tag}");
        }
        assert_eq!(text(&read, tags::PATIENT_COMMENTS), "Born: 4/12/1990");
        assert!(text(&read, tags::IMAGE_COMMENTS).contains("not of a patient"));
        // Where nobody says, the file says that nobody was examined.
        still(&file, about(None), [1, 1], &[7, 7, 7, 255]).unwrap();
        let read = open_file(&file).unwrap();
        assert_eq!(text(&read, tags::PATIENT_NAME), "Liver^Simulated");
    }
}
