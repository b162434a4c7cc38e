use super::*;

fn file(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("written");
    (folder, path)
}

fn read(name: &str, text: &str, stated: Option<Frame>) -> Result<Vec<Point>, FileError> {
    load(&file(name, text).1, stated)
}

const FCSV: &str = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n\
    # columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n\
    0,-19.5,13.25,29.5,0,0,0,1,1,1,0,fundus,,,2,0\n1,7,-8.5,1e1,0,0,0,1,1,1,0,\"a, b\",,\n";

const MARKUPS: &str = r#"{"@schema": "s", "markups": [{"type": "Fiducial", "coordinateSystem": "LPS",
    "coordinateUnits": "mm", "controlPoints": [
    {"label": "fundus", "position": [-19.5, 13.25, 29.5], "positionStatus": "defined"},
    {"label": "later", "position": [], "positionStatus": "undefined"},
    {"label": "a, b", "position": [7, -8.5, 10]}]}]}"#;

#[test]
fn every_kind_of_file_gives_the_same_points() {
    let csv = "# segmented by hand\nname,X_mm,Y_mm,Z_mm,comment\nfundus,-19.5,13.25,29.5,\n\n\
        \"a, b\", 7 , -8.5,10,x\n";
    let turned = |text: &str| text.replace("LPS", "RAS").replace("-19.5", "19.5");
    let turned = |text: &str| {
        let text = turned(text).replace("13.25", "-13.25");
        text.replace("7,-8.5", "-7,8.5").replace("7, -8.5", "-7, 8.5")
    };
    let all = [
        read("p.csv", csv, None),
        read("p.CSV", &turned(&csv.replace(" 7 , -8.5", "7,-8.5")), Some(Frame::Ras)),
        read("p.fcsv", FCSV, None),
        read("p.fcsv", &FCSV.replace("= LPS", "= 1"), Some(Frame::Lps)),
        read("p.fcsv", &turned(FCSV), None),
        read("p.fcsv", &turned(FCSV).replace("= RAS", "= 0"), None),
        read("p.mrk.json", MARKUPS, None),
        read("p.mrk.json", &turned(MARKUPS), Some(Frame::Ras)),
        read(
            "p.csv",
            "label,l,p,s,defined\nfundus,-19.5,13.25,29.5,1\n\"a, b\",7,-8.5,10,1\n",
            None,
        ),
        read("p.csv", "label,r,a,s\nfundus,19.5,-13.25,29.5\n\"a, b\",-7,8.5,10\n", None),
    ];
    for (i, points) in all.into_iter().enumerate() {
        let points = points.expect("sound");
        let named = points.iter().map(|p| (p.name.as_str(), p.position.to_array()));
        let expected = [("fundus", [-19.5, 13.25, 29.5]), ("a, b", [7.0, -8.5, 10.0])];
        assert_eq!(named.collect::<Vec<_>>(), expected, "case {i}");
    }
    let bare = read("p.csv", "\u{feff}1,2,3\n4,5,6\n", None).expect("sound");
    assert_eq!(bare[1].position, DVec3::new(4.0, 5.0, 6.0));
}

#[test]
fn mistakes_in_points_are_explained() {
    let ras = Some(Frame::Ras);
    for (name, text, stated, cause, remedy) in [
        ("p.txt", "1,2,3\n", None, "no file of points", ".fcsv"),
        ("p.csv", "", None, "holds no points", "x,y,z"),
        ("p.csv", "# nothing\nx,y,z\n", None, "holds no points", "x,y,z"),
        ("p.csv", "a,y,z\n1,2,3\n", None, ":1: has no column `x`", "x,y,z"),
        ("p.csv", "x,y,z\n1,2,3\n1,two,3\n", None, ":3: y: `two` is not a number", "like 1.5"),
        ("p.csv", "x,y,z\n1,2,NaN\n", None, ":2: a coordinate is NaN", "at most"),
        ("p.csv", "x,y,z\n1,2,inf\n", None, "a coordinate is inf", "at most"),
        ("p.csv", "x,y,z\n1,2\n", None, ":2: the row ends before column `z`", "mm"),
        ("p.csv", "1,2,3e9\n", None, "a coordinate is 3000000000", "at most"),
        ("p.fcsv", FCSV, ras, "it is in LPS, and --frame RAS", "leave --frame out"),
        (
            "p.fcsv",
            "# CoordinateSystem = 2\n# columns = x,y,z\n1,2,3\n",
            None,
            ":1: is in the frame `2`",
            "LPS or RAS",
        ),
        ("p.mrk.json", "{\"markups\": 3}", None, "no markups file", ".mrk.json"),
        ("p.mrk.json", &MARKUPS.replace("\"mm\"", "[\"mm\", \"um\"]"), None, "in \"um\"", "mm"),
        ("p.mrk.json", &MARKUPS.replace("-8.5, 10", "-8.5"), None, "`a, b` is not three", "again"),
        ("p.mrk.json", &MARKUPS.replace("10]", "1e300]"), None, "a coordinate is 1", "at most"),
        ("p.mrk.json", MARKUPS, ras, "it is in LPS", "leave --frame out"),
    ] {
        let error = read(name, text, stated).expect_err(cause);
        assert!(error.to_string().contains(cause), "{error}");
        assert!(error.to_string().contains(name), "{error}");
        assert!(error.remedy.contains(remedy), "{error}: {}", error.remedy);
    }
    let gone = load(Path::new("nowhere/p.csv"), None).expect_err("gone");
    assert!(gone.to_string().contains("cannot be read"), "{gone}");
    let folder = tempfile::tempdir().expect("a folder");
    let error = load(folder.path(), None).expect_err("a folder");
    assert!(error.to_string().contains("not a regular file"), "{error}");
}

#[test]
fn landmarks_come_from_a_table_of_pairs() {
    let text = "name,model_x,model_y,model_z,volume_x_mm,volume_y_mm,volume_z_mm\n\
        apex,1,2,3,-4,-5,6\n,7,8,9,1,1,1\n";
    let (_folder, path) = file("l.csv", text);
    let made = load_landmarks(&path, Some(Frame::Ras)).expect("sound");
    assert_eq!(made[0].name, "apex");
    assert_eq!(made[0].to, DVec3::new(1.0, 2.0, 3.0), "the model's are the world's");
    assert_eq!(made[0].from, DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(made[1].name, "line 3");
    let (_folder, path) = file("l.csv", &text.replace("volume_y_mm", "volume_why"));
    let error = load_landmarks(&path, None).expect_err("no such column");
    assert!(error.to_string().contains("no column `volume_y`; `volume_"), "{error}");
}

#[test]
fn landmarks_of_two_files_are_paired_by_label() {
    let points = |names: &[&str]| -> Vec<Point> {
        let all = names.iter().zip(1..).map(|(name, x)| Point {
            name: (*name).to_owned(),
            position: DVec3::splat(f64::from(x)),
        });
        all.collect()
    };
    let (a, b) = (Path::new("model.fcsv"), Path::new("volume.fcsv"));
    let paired = |x: &[&str], y: &[&str]| pair((a, &points(x)), (b, &points(y)));
    let (made, single) = paired(&["p", "q", "r"], &["r", "s", "p"]).expect("common ones");
    let made: Vec<_> = made.iter().map(|l| (l.name.as_str(), l.from.x, l.to.x)).collect();
    assert_eq!(made, [("p", 3.0, 1.0), ("r", 1.0, 3.0)]);
    assert_eq!(single, ["q", "s"]);
    let error = paired(&["p", "q"], &["p", "p"]).expect_err("twice");
    assert!(error.to_string().contains("volume.fcsv: has several points called `p`"), "{error}");
    let error = paired(&["p", "q"], &["F-1"]).expect_err("none in common");
    assert!(error.to_string().contains("shares no label with model.fcsv"), "{error}");
    assert!(error.remedy.contains("here `F-1`, there `p`, `q`"), "{}", error.remedy);
}

#[test]
fn meshes_of_slicer_say_their_frame() {
    let binary = [&b"exported SPACE=RAS by something"[..], &[0; 80]].concat();
    let (_folder, path) = file("s.stl", "");
    std::fs::write(&path, binary).expect("written");
    assert_eq!(frame_of_mesh(&path).expect("read"), Frame::Ras);
    for (text, frame) in [("# SPACE=LPS\nv 0 0 0\n", Frame::Lps), ("v 0 0 0\n", Frame::Unstated)] {
        let (_folder, path) = file("s.obj", text);
        assert_eq!(frame_of_mesh(&path).expect("read"), frame);
    }
    let (_folder, path) = file("s.obj", "# SPACE=IJK\n");
    let error = frame_of_mesh(&path).expect_err("no such frame");
    assert!(error.to_string().contains("`IJK`"), "{error}");
}
