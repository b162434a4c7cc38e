use std::path::{Path, PathBuf};

use super::{Mp4, Mp4Error, even_rgb, rate};
use crate::skip::{Lacking, skip};

/// A stand-in for `ffmpeg`: a script that does `what`, where `$out` is the file that it is told to write.
#[cfg(unix)]
fn stand_in(folder: &Path, what: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt as _;
    let path = folder.join("ffmpeg");
    let script = format!("#!/bin/sh\nfor last; do :; done\nout=${{last#file:}}\n{what}\n");
    std::fs::write(&path, script).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("mine");
    path
}

/// Three frames of 5 by 3 pixels, shown for 0.1, 0.2 and 0.1 s: at ten a second, four.
fn film(program: &Path, path: &Path) -> Result<(), Mp4Error> {
    let ends = [0.1, 0.3, 0.4];
    let mut film = Mp4::by(program.as_os_str(), path, rate(ends.into_iter()));
    for (level, end) in (0..).zip(ends) {
        film.add(5, 3, &[40 * level; 60], end)?;
    }
    film.finish()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[cfg(unix)]
#[test]
fn the_encoder_gets_even_frames_at_the_loops_rate_and_no_shell() {
    let folder = tempfile::tempdir().expect("a folder");
    let says = "echo \"$@\" > \"${0%/*}/said\"; wc -c | tr -d ' ' > \"$out\"";
    let program = stand_in(folder.path(), says);
    // A name that a shell would take apart.
    let path = folder.path().join("-a; touch b $(touch c).mp4");
    film(&program, &path).expect("written");
    let count = std::fs::read_to_string(&path).expect("in its place");
    assert_eq!(count.trim(), (4 * 6 * 4 * 3).to_string(), "four frames of 6 by 4 pixels");
    let log = std::fs::read_to_string(folder.path().join("said")).expect("there");
    for part in
        ["-video_size 6x4", "-framerate 10.0000", "-c:v libx264", "-pix_fmt yuv420p", "rgb24"]
    {
        assert!(log.contains(part), "{part}: {log}");
    }
    assert_eq!(names(folder.path()).len(), 3, "nothing else was made");
}

#[cfg(unix)]
#[test]
fn an_encoder_that_fails_is_quoted_and_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mp4");
    for (what, cause) in [
        (
            "cat > /dev/null; echo half > \"$out\"; echo one >&2; echo 'no libx264' >&2; exit 3",
            "no libx264",
        ),
        ("echo half > \"$out\"; kill -9 $$", "signal: 9"),
        ("exec <&-; exit 1", "said: nothing"),
    ] {
        let program = stand_in(folder.path(), what);
        let error = film(&program, &path).expect_err("it failed").to_string();
        assert!(error.contains(cause) && error.contains("GIF"), "{error}");
        assert_eq!(names(folder.path()), ["ffmpeg"], "{what}");
    }
    // Dropped in the middle, as when the user cancels.
    let program = stand_in(folder.path(), "echo half > \"$out\"; cat > /dev/null");
    let mut film = Mp4::by(program.as_os_str(), &path, 10.0);
    film.add(2, 2, &[9; 16], 0.1).expect("taken");
    drop(film);
    assert_eq!(names(folder.path()), ["ffmpeg"]);
}

#[test]
fn without_the_encoder_the_remedy_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = film(&folder.path().join("no"), &folder.path().join("a.mp4")).expect_err("none");
    assert!(matches!(error, Mp4Error::Missing) && error.to_string().contains("apt install"));
}

#[test]
fn frames_are_made_even_and_none_is_left_out() {
    assert_eq!(even_rgb([1, 1], &[1, 2, 3, 255]), [1, 2, 3].repeat(4));
    let square = even_rgb([2, 2], &[7; 16]);
    assert_eq!(square, [7; 12]);
    assert!((rate([0.04, 0.14, 0.18].into_iter()) - 25.0).abs() < 1e-9);
    assert_eq!(rate([0.001].into_iter()), 60.0);
    assert_eq!(rate([3.0].into_iter()), 5.0);
}

/// The program itself, where there is one.
#[test]
fn ffmpeg_makes_an_mp4_of_them() {
    if Mp4::check().is_err() {
        return skip(Lacking::Tool, "no ffmpeg on the PATH (./tools/setup.sh installs it)");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mp4");
    let mut film = Mp4::new(&path, 25.0);
    for index in 0..10u8 {
        let frame: Vec<u8> = (0..65 * 33).flat_map(|_| [20 * index, 9, 9, 255]).collect();
        film.add(65, 33, &frame, f64::from(index + 1) / 25.0).expect("taken");
    }
    film.finish().expect("written");
    let bytes = std::fs::read(&path).expect("in its place");
    assert_eq!(&bytes[4..8], b"ftyp");
    assert!(bytes.windows(4).any(|four| four == b"avc1"), "H.264");
}
