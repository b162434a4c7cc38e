use glam::{DAffine3, DVec2, dvec2};

use super::super::calipers::{CaliperKind, Reading};
use super::{Moment, Sheet, Tool, What};

const REACH: f64 = 1.0;
const NOW: Moment = Moment { pose: DAffine3::IDENTITY, seconds: 0.5 };

fn click(sheet: &mut Sheet, x: f64, z: f64) {
    sheet.press(dvec2(x, z), REACH, NOW);
    sheet.release(dvec2(x, z), REACH);
}

fn drag(sheet: &mut Sheet, from: [f64; 2], to: [f64; 2]) {
    sheet.press(from.into(), REACH, NOW);
    sheet.motion((DVec2::from(from) + DVec2::from(to)) / 2.0);
    sheet.release(to.into(), REACH);
}

fn distance(sheet: &Sheet, mark: usize) -> f64 {
    match &sheet.marks()[mark].what {
        What::Caliper(caliper) => match caliper.reading() {
            Reading::Distance(mm) => mm,
            other => panic!("{other:?}"),
        },
        What::Note(note) => panic!("{note:?}"),
    }
}

#[test]
fn two_clicks_or_a_drag_are_a_distance() {
    let mut sheet = Sheet::default();
    click(&mut sheet, 0.0, 0.0);
    assert!(sheet.marks().is_empty(), "no tool");
    sheet.take(Some(Tool::Measure(CaliperKind::Distance)));
    click(&mut sheet, 0.0, 10.0);
    sheet.motion(dvec2(0.0, 33.0));
    assert_eq!(sheet.draft().unwrap().points, [dvec2(0.0, 10.0), dvec2(0.0, 33.0)]);
    click(&mut sheet, 0.0, 40.0);
    drag(&mut sheet, [10.0, 20.0], [13.0, 24.0]);
    assert_eq!([distance(&sheet, 0), distance(&sheet, 1)], [30.0, 5.0]);
    let letters: String = sheet.marks().iter().map(|m| m.letter).collect();
    assert_eq!(letters, "AB");
    assert_eq!(sheet.marks()[0].of, NOW);
}

#[test]
fn an_ellipse_takes_a_drag_and_a_click_and_an_angle_three_clicks() {
    let mut sheet = Sheet::default();
    sheet.take(Some(Tool::Measure(CaliperKind::Ellipse)));
    drag(&mut sheet, [0.0, 20.0], [10.0, 20.0]);
    assert!(sheet.marks().is_empty());
    click(&mut sheet, 5.0, 23.0);
    sheet.take(Some(Tool::Measure(CaliperKind::Angle)));
    for (x, z) in [(30.0, 10.0), (20.0, 10.0), (20.0, 50.0)] {
        click(&mut sheet, x, z);
    }
    let readings: Vec<_> = (sheet.marks().iter())
        .map(|m| match &m.what {
            What::Caliper(caliper) => caliper.reading(),
            What::Note(note) => panic!("{note:?}"),
        })
        .collect();
    assert!(matches!(readings[0], Reading::Ellipse { axes: [10.0, 6.0], .. }));
    assert!(matches!(readings[1], Reading::Angle(a) if (a - 90.0).abs() < 1e-12));
}

#[test]
fn ends_are_taken_moved_and_deleted() {
    let mut sheet = Sheet::default();
    sheet.take(Some(Tool::Measure(CaliperKind::Distance)));
    drag(&mut sheet, [0.0, 10.0], [20.0, 10.0]);
    drag(&mut sheet, [0.0, 30.0], [20.0, 30.0]);
    // Near an end, the end is taken, although a tool is active.
    drag(&mut sheet, [20.3, 10.4], [25.3, 10.4]);
    assert_eq!(sheet.marks().len(), 2);
    assert!((distance(&sheet, 0) - 25.0).abs() < 1e-12);
    assert_eq!(sheet.selected(), Some((0, 1)));
    // Taken and released at one place, it stays.
    click(&mut sheet, 25.6, 9.8);
    assert!((distance(&sheet, 0) - 25.0).abs() < 1e-12);
    assert!(sheet.nudge(dvec2(-0.5, 0.0)));
    assert!((distance(&sheet, 0) - 24.5).abs() < 1e-12);
    assert!(sheet.delete() && !sheet.delete());
    assert_eq!((sheet.marks().len(), distance(&sheet, 0)), (1, 20.0));
    drag(&mut sheet, [50.0, 10.0], [60.0, 10.0]);
    assert_eq!(sheet.marks()[1].letter, 'A', "the first that is free");
    sheet.clear();
    assert!(sheet.marks().is_empty() && sheet.selected().is_none() && !sheet.nudge(DVec2::X));
}

#[test]
fn escape_takes_back_one_thing_after_the_other() {
    let mut sheet = Sheet::default();
    sheet.take(Some(Tool::Measure(CaliperKind::Distance)));
    drag(&mut sheet, [0.0, 10.0], [20.0, 10.0]);
    click(&mut sheet, 40.0, 40.0);
    assert!(sheet.draft().is_some() && sheet.cancel() && sheet.draft().is_none());
    sheet.select(0);
    assert!(sheet.cancel() && sheet.selected().is_none());
    assert!(sheet.cancel() && sheet.tool().is_none());
    assert!(!sheet.cancel());
    assert_eq!(sheet.marks().len(), 1);
}

#[test]
fn a_text_is_placed_by_a_click_and_points_after_a_drag() {
    let mut sheet = Sheet::default();
    sheet.take(Some(Tool::Note));
    click(&mut sheet, 5.0, 10.0);
    assert_eq!(sheet.editing(), Some(0));
    sheet.set_text(0, "liver".into());
    drag(&mut sheet, [20.0, 20.0], [30.0, 25.0]);
    let note = |sheet: &Sheet, i: usize| match &sheet.marks()[i].what {
        What::Note(note) => note.clone(),
        What::Caliper(caliper) => panic!("{caliper:?}"),
    };
    assert_eq!((note(&sheet, 0).text.as_str(), note(&sheet, 0).arrow), ("liver", None));
    assert_eq!(note(&sheet, 1).arrow, Some(dvec2(20.0, 20.0)));
    assert_eq!(note(&sheet, 1).at, dvec2(30.0, 25.0));
    // Nothing was typed, so there is nothing to keep.
    sheet.stop_editing();
    assert_eq!((sheet.marks().len(), sheet.editing()), (1, None));
    drag(&mut sheet, [5.0, 10.0], [7.0, 11.0]);
    assert_eq!(note(&sheet, 0).at, dvec2(7.0, 11.0));
    sheet.edit(0);
    sheet.set_text(0, String::new());
    sheet.take(None);
    assert!(sheet.marks().is_empty());
}

#[test]
fn an_outline_is_drawn_in_one_stroke_or_clicked_and_closed_at_its_beginning() {
    let mut sheet = Sheet::default();
    sheet.take(Some(Tool::Measure(CaliperKind::Trace)));
    sheet.press(dvec2(0.0, 10.0), REACH, NOW);
    for (x, z) in [(10.0, 10.0), (10.1, 10.0), (10.0, 20.0), (0.0, 20.0)] {
        sheet.motion(dvec2(x, z));
    }
    sheet.release(dvec2(0.0, 20.0), REACH);
    for (x, z) in [(0.0, 30.0), (6.0, 30.0), (6.0, 38.0), (0.2, 30.1)] {
        click(&mut sheet, x, z);
    }
    // Twice at one place.
    for (x, z) in [(0.0, 50.0), (3.0, 50.0), (3.0, 54.0), (3.0, 54.0)] {
        click(&mut sheet, x, z);
    }
    // A line encloses nothing.
    for (x, z) in [(0.0, 60.0), (5.0, 60.0), (5.0, 60.0)] {
        click(&mut sheet, x, z);
    }
    let areas: Vec<f64> = (sheet.marks().iter())
        .map(|mark| match &mark.what {
            What::Caliper(caliper) => match caliper.reading() {
                Reading::Trace { area, .. } => area,
                other => panic!("{other:?}"),
            },
            What::Note(note) => panic!("{note:?}"),
        })
        .collect();
    assert_eq!(areas, [100.0, 24.0, 6.0]);
    assert!(!sheet.is_drawing());
    // The tool put away in the middle leaves nothing behind.
    sheet.press(dvec2(0.0, 70.0), REACH, NOW);
    sheet.motion(dvec2(9.0, 70.0));
    sheet.take(Some(Tool::Measure(CaliperKind::Distance)));
    sheet.motion(dvec2(9.0, 79.0));
    drag(&mut sheet, [0.0, 80.0], [3.0, 84.0]);
    assert_eq!(distance(&sheet, 3), 5.0);
}
