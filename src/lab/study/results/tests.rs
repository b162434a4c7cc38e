//! Tables of invented answers, compared with numbers worked out by hand.

use serde_json::json;

use super::super::answers::Answers;
use super::super::answers::tests::{content, file};
use super::super::key::tests::small;
use super::super::key::{Key, Row};
use super::*;

/// Two filled forms: the first complete, the second without its last ranking and one degree.
fn answered(key: &Key) -> Vec<Answers> {
    let mut second = content();
    second["response"] = json!("fedcba9876543210");
    second["rankings"][0]["ranks"] = json!([2, 1, 3]);
    second["rankings"][1]["ranks"] = json!([1, 2, null]);
    for (i, degree) in [5, 4, 3, 2, 1].iter().enumerate() {
        second["cases"][i]["agreement"] = json!(degree);
    }
    second["cases"][5]["agreement"] = json!(null);
    let folder = tempfile::tempdir().expect("a folder");
    let read = |content: &serde_json::Value| {
        let path = folder.path().join("answers.json");
        std::fs::write(&path, file(key, content).to_string()).expect("written");
        Answers::read(&path, key).expect("sound")
    };
    vec![read(&content()), read(&second)]
}

/// Cases 1 to 6 are: lying none, standing volume, lying volume, standing scatterers, lying scatterers,
/// standing none. Complete rankings, as volume, scatterers, none: 1 2 3, 1 2 3 (first form), 1 3 2.
#[test]
fn tables_are_those_worked_out_by_hand() {
    let key = small();
    let results = Results::new(&key, &answered(&key));
    let [one, total] = results.parts.as_slice() else {
        panic!("one scenario and all");
    };
    assert_eq!(one.rated, total.rated);
    let found: Vec<_> =
        total.rated.iter().map(|r| (r.background.as_str(), r.ranks.clone(), r.agreement)).collect();
    let by_hand = [
        // Degrees of the first form are all 4; of the second 5 4 3 2 1 by case.
        ("volume", vec![3, 0, 0], [0, 0, 1, 3, 0]),
        ("scatterers", vec![0, 2, 1], [1, 1, 0, 2, 0]),
        ("none", vec![0, 1, 2], [0, 0, 0, 2, 1]),
    ];
    assert_eq!(found, by_hand);
    let mean: Vec<f64> = total.rated.iter().map(BackgroundRatings::mean_rank).collect();
    assert_eq!(mean, [1.0, 7.0 / 3.0, 8.0 / 3.0]);
    let medians: Vec<f64> = total.rated.iter().map(BackgroundRatings::median_agreement).collect();
    assert_eq!(medians, [4.0, 3.0, 4.0]);
    // Rank sums 3, 7, 8 of 3 blocks: 12 / (3 3 4) (9 + 1 + 4) = 14 / 3; Siegel's table N: p = 0.194.
    let test = results.friedman.expect("three blocks");
    assert_eq!(test.blocks, 3);
    assert!((test.statistic - 14.0 / 3.0).abs() < 1e-12, "{test:?}");
    assert!((test.p - 7.0 / 36.0).abs() < 1e-12, "{test:?}");
    assert!((test.concordance - 7.0 / 9.0).abs() < 1e-12, "{test:?}");
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    let pairs: Vec<_> = results.pairs.iter().map(|p| (p.before, p.p, p.corrected)).collect();
    let by_hand = [([3, 0], 0.25, 0.75), ([3, 0], 0.25, 0.75), ([2, 1], 1.0, 1.0)];
    for (found, by_hand) in pairs.iter().zip(by_hand) {
        assert_eq!(found.0, by_hand.0);
        assert!(near(found.1, by_hand.1) && near(found.2, by_hand.2), "{found:?}");
    }
    // Images 1 2 1 2 1 1 of cases 1 to 6, twice: the scene itself is image 2 in odd cases, 1 in even.
    assert_eq!((results.unperturbed, results.choices), (2, 12));
    assert_eq!(results.by_chance, 6.0);
    assert_eq!(results.chosen.len(), 1);
    assert_eq!((&*results.chosen[0].parameter, results.chosen[0].counts), ("gain", [10, 0, 0]));
    assert_eq!(results.missing.iter().map(|m| m.1).collect::<Vec<_>>(), [[0; 3], [0, 1, 1]]);
}

/// A key in which two backgrounds are exchanged is another study, and would give another table.
#[test]
fn a_key_with_backgrounds_exchanged_is_noticed() {
    let key = small();
    let exchange = |row: &Row| Row {
        background: match row.background.as_str() {
            "volume" => "none".to_owned(),
            "none" => "volume".to_owned(),
            other => other.to_owned(),
        },
        ..row.clone()
    };
    let wrong = Key::new(key.rows().iter().map(exchange).collect()).expect("a study of its own");
    assert_ne!(wrong.id(), key.id());
    let answers = answered(&key);
    let (right, wrong) = (Results::new(&key, &answers), Results::new(&wrong, &answers));
    assert_eq!(right.parts[1].rated[0].ranks, [3, 0, 0]);
    assert_eq!(wrong.parts[1].rated[0].ranks, [0, 1, 2]);
    assert_ne!(csv(&right), csv(&wrong));
}

#[test]
fn texts_hold_the_tables() {
    let key = small();
    let results = Results::new(&key, &answered(&key));
    let plain = plain(&results);
    for line in [
        "  all scenarios    volume           3       0       0       1.00",
        "  all scenarios    scatterers         1         1         0         2         0    3.00",
        "  none changed      0         2      0       2",
        "  backgrounds       3       4.67  0.1944         0.78",
        "  scatterers, none               2              1  1.0000       1.0000",
    ] {
        assert!(plain.lines().any(|l| l == line), "{line}\n{plain}");
    }
    assert!(
        plain.contains(
            "is not complete (cases without an image: 0, images without a degree of agreement: 1"
        ),
        "{plain}"
    );
    assert!(plain.contains("once for each of 2 assessors"), "{plain}");
    let markdown = markdown(&results);
    assert!(markdown.contains("| a, with a comma | none | 0 | 1 | 2 | 2.67 |"), "{markdown}");
    let csv = csv(&results);
    let line = "Order of the backgrounds,all scenarios,none,mean rank,2.6666666666666665";
    assert!(csv.lines().any(|l| l == line), "{csv}");
    let all = answered(&key);
    let ratings = ratings(&key, &all);
    assert_eq!(ratings.lines().count(), 13);
    let second: Vec<&str> = ratings.lines().filter(|l| l.starts_with("fedc")).collect();
    // The form's first case: another image than the scene's own, degree 5, second of three.
    let rated = "lying,none,1,1,gain,-6,0.5,dB,5,2,";
    assert!(second[0].ends_with(rated), "{}", second[0]);
    // The form's last case: the scene itself, neither rated nor ranked.
    let bare = "standing,none,6,1,none,,,,,,";
    assert!(second[5].ends_with(bare), "{}", second[5]);
    let one = Results::new(&key, &all[..1]);
    assert!(
        super::plain(&one)
            .contains("One assessor: the blocks are slices (there are 2, scenarios: 1)")
    );
    let none = Results::new(&key, &[]);
    assert!(none.friedman.is_none() && none.parts[1].rated[0].mean_rank().is_nan());
    assert!(super::plain(&none).contains("  -"));
}
