//! Texts about volumes over time: mistakes, and the report of a scene.

use insonify::scene::check;

use super::{ALL, FILES, SCENE, bytes, folder, header, load, values};

#[test]
fn mistakes_name_line_cause_and_remedy() {
    let folder = folder();
    let write = |name: &str, text: String, data: &[u8]| {
        let file = [text.into_bytes(), data.to_vec()].concat();
        std::fs::write(folder.path().join(name), file).expect("written");
    };
    let data = bytes(&values(0));
    write("flat.mha", header(1).replace("7 5 6", "7 6 5"), &data);
    write("off.mha", header(1).replace("-18", "-15"), &data);
    let bare = header(2).replace("ElementSpacing = 6 6 6 0.25\n", "");
    write("bare.mha", bare, &[data.clone(), data.clone()].concat());
    let many = header(2).replace("7 5 6 2", "1 1 1 1001");
    write("many.mha", many, &[0; 2002]);
    let slow = header(2).replace("0.25", "1e6");
    write("slow.mha", slow, &[data.clone(), data.clone()].concat());
    let line = SCENE.lines().count() + 1;
    let list = |files: &str| format!("file = [{files}]\n");
    for (text, at, cause, remedy) in [
        (list(""), 0, "has 0 files", "name 1 to 1000"),
        (list("7"), 0, "expected text or list of texts", ""),
        ("file = 7\n".to_owned(), 0, "expected text or list of texts", ""),
        (list("\"t0.mha\", \"none.mha\""), 0, "cannot be read", "check the name"),
        (
            list("\"t0.mha\", \"flat.mha\""),
            0,
            "flat.mha: has 7 x 6 x 5 voxels, not 7 x 5 x 6 as in",
            "the same grid",
        ),
        (
            list("\"t0.mha\", \"t1.mha\", \"off.mha\""),
            0,
            "off.mha: lies up to 0.50 voxels from where it does in",
            "the same grid",
        ),
        (
            list("\"t0.mha\", \"all.mha\""),
            0,
            "holds 4 volumes, where each file is to hold one",
            "name it alone",
        ),
        (
            list("\"t0.mha\", \"t1.mha\""),
            0,
            "2 volumes over time, and nothing says how fast",
            "rate = \"20 Hz\"",
        ),
        (
            "file = \"bare.mha\"\n".to_owned(),
            0,
            "2 volumes over time, and nothing says how fast",
            "period = ",
        ),
        ("file = \"many.mha\"\n".to_owned(), 0, "holds 1001 volumes", "up to 1000"),
        ("file = \"slow.mha\"\n".to_owned(), 0, "all 2 volumes together take 2000000 s", "86400"),
        (format!("{FILES}rate = 1e-5\n"), 1, "all 4 volumes together take", "86400"),
        (format!("{FILES}rate = 0\n"), 1, "rate is 0 Hz", "between"),
        (format!("{FILES}rate = nan\n"), 1, "a rate cannot be NaN", ""),
        (format!("{FILES}period = 0\n"), 1, "period is 0 s", "between"),
        (format!("{FILES}period = 1\nphase = 2\n"), 2, "phase is 2", "between"),
        (format!("{FILES}period = 1\nrate = 3\n"), 2, "both say how fast", "remove one"),
        (format!("{FILES}loop = \"hold\"\n"), 1, "unknown variant", "`once`"),
        (
            "file = \"t0.mha\"\nrate = 3\n".to_owned(),
            1,
            "`rate` is for volumes that follow each other",
            "name several",
        ),
        (
            "file = [\"t0.mha\"]\nloop = \"once\"\n".to_owned(),
            1,
            "`loop` is for volumes",
            "remove it",
        ),
    ] {
        let error = load(folder.path(), &text).map(|_| ()).expect_err(cause);
        let help = error.remedy.clone().unwrap_or_default();
        assert!(error.message.contains(cause), "{cause}: {error}");
        assert!(help.contains(remedy), "{cause}: {help}");
        assert_eq!(error.line, line + at, "{error}");
    }
}

#[test]
fn the_report_of_a_scene_tells_of_the_series() {
    let folder = folder();
    for (text, lines) in [
        (
            format!("{ALL}loop = \"ping-pong\"\n"),
            [
                "volume all.mha",
                "  4 volumes over time, one every 0.25 s",
                "  plays: 4 volumes, period 0.75 s, to and fro",
            ],
        ),
        (
            format!("{FILES}rate = 8\n"),
            [
                "volume t0.mha to t3.mha, 4 files",
                "  4 volumes over time, how fast they follow each other is not stated",
                "  plays: 4 volumes, period 0.5 s",
            ],
        ),
    ] {
        load(folder.path(), &text).expect("sound");
        let report = check::report(&folder.path().join("scene.toml")).to_string();
        for line in lines {
            assert!(report.lines().any(|l| l == line), "{line}\nin\n{report}");
        }
        assert!(report.ends_with("0 errors, 0 warnings"), "{report}");
    }
}
