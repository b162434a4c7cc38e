//! Every rating with its image, for other programs.

use serde::Serialize;

use crate::study::answers::Answers;
use crate::study::key::Key;

/// One assessor's rating of one case. Columns are named as the fields.
#[derive(Debug, Serialize)]
struct Rating<'a> {
    response: &'a str,
    assessor: &'a str,
    experience: &'a str,
    scenario: &'a str,
    slice: &'a str,
    background: &'a str,
    case: usize,
    image: Option<usize>,
    parameter: &'a str,
    value: &'a str,
    own: &'a str,
    unit: &'a str,
    agreement: Option<usize>,
    rank: Option<usize>,
    remark: &'a str,
}

/// The ratings as CSV, one row per filled form and case; empty where nothing was answered.
pub fn ratings(key: &Key, all: &[Answers]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for answers in all {
        for (case, choice) in (1..).zip(&answers.cases) {
            let row = choice.image.map(|image| &key.images(case)[image - 1]);
            let of = |field: fn(&crate::study::key::Row) -> &str| row.map_or("", field);
            let rank = answers.rankings.iter().find_map(|ranking| {
                let place = ranking.cases.iter().position(|&c| c == case)?;
                ranking.ranks[place]
            });
            let rating = Rating {
                response: &answers.response,
                assessor: &answers.assessor.name,
                experience: &answers.assessor.experience,
                scenario: key.scenario(case),
                slice: key.slice(case),
                background: key.background(case),
                case,
                image: choice.image,
                parameter: of(|r| &r.parameter),
                value: of(|r| &r.value),
                own: of(|r| &r.own),
                unit: of(|r| &r.unit),
                agreement: choice.agreement,
                rank,
                remark: &choice.remark,
            };
            writer.serialize(rating).expect("plain fields, into memory");
        }
    }
    let bytes = writer.into_inner().expect("into memory");
    String::from_utf8(bytes).expect("made of text")
}
