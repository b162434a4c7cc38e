//! Files and scenes that once took memory or time without bound, were misread in silence, or were refused with a
//! word about something else.

#[path = "common/limited.rs"]
#[allow(dead_code, reason = "only single files")]
mod limited;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use limited::{Outcome, check};
use tempfile::TempDir;

/// A folder for the files of a test.
fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

/// `insonify check` on a file of this content.
fn checked(folder: &TempDir, name: &str, content: impl AsRef<[u8]>) -> Outcome {
    let path = folder.path().join(name);
    fs::write(&path, content).expect("written");
    check(&path)
}

/// A file of `size` zeros behind `head`, which takes no room on the disk.
fn sparse(folder: &TempDir, name: &str, head: &[u8], size: u64) -> PathBuf {
    let path = folder.path().join(name);
    let mut file = fs::File::create(&path).expect("created");
    file.write_all(head).expect("written");
    file.set_len(head.len() as u64 + size).expect("sized");
    path
}

/// Asserts that a file is refused, and that all of `words` are said about it.
fn refused(outcome: &Outcome, words: &[&str]) {
    assert_eq!(outcome.code, Some(1), "{}", outcome.text);
    for word in words {
        assert!(outcome.text.contains(word), "`{word}` is not in:\n{}", outcome.text);
    }
}

#[test]
fn buffers_of_gltf_are_files_in_its_folder() {
    let folder = folder();
    for uri in ["%2Fdev%2Fzero", "file:/dev/zero", "file:../../../dev/zero", "..%2fa", "%2e%2e/a"] {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":4,"uri":"{uri}"}}]}}"#
        );
        let outcome = checked(&folder, "zero.gltf", text);
        refused(&outcome, &["which is not beside the file"]);
    }
}

/// PLUS writes 880 bytes for a frame; a quarter of an hour has 27,000.
#[test]
fn headers_of_long_sequences_are_read() {
    let folder = folder();
    let frames = 27_000;
    let mut text = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = 2 2 {frames}\nElementSpacing = 1 1 1\n\
         ElementType = MET_UCHAR\nKinds = domain domain list\n"
    );
    for frame in 0..frames {
        for name in ["ProbeToTracker", "ReferenceToTracker", "StylusToTracker"] {
            text += &format!(
                "Seq_Frame{frame:04}_{name}Transform = 1.000000 0.000000 0.000000 10.000000 \
                 0.000000 1.000000 0.000000 20.000000 0.000000 0.000000 1.000000 30.000000 0 0 0 1\n\
                 Seq_Frame{frame:04}_{name}TransformStatus = OK\n"
            );
        }
        text += &format!("Seq_Frame{frame:04}_Timestamp = {}\n", f64::from(frame) / 30.0);
    }
    text += "ElementDataFile = LOCAL\n";
    assert!(text.len() > 16 << 20, "{}", text.len());
    let mut bytes = text.into_bytes();
    bytes.resize(bytes.len() + 4 * frames as usize, 7);
    let outcome = checked(&folder, "long.igs.mha", &bytes);
    assert_eq!(outcome.code, Some(0), "{}", outcome.text);
    assert!(outcome.text.contains("27000"), "{}", outcome.text);
    // Without an end, the reason is the length, and only so much is read.
    let endless = sparse(&folder, "endless.mha", b"NDims = 3\n", 8 << 30);
    refused(&check(&endless), &["the header does not end within 64 MB"]);
    let lines = [&b"NDims = 3\n"[..], &b"a =\n".repeat(2 << 20)].concat();
    refused(&checked(&folder, "lines.mha", lines), &["the header does not end within"]);
}

#[test]
fn only_what_is_dicom_is_read_as_dicom() {
    let folder = folder();
    let zeros = sparse(&folder, "zeros.dcm", b"", 5 << 30);
    refused(&check(&zeros), &["is no DICOM file"]);
    let mut head = vec![0; 128];
    head.extend(b"DICM");
    let big = sparse(&folder, "big.dcm", &head, 5 << 30);
    refused(&check(&big), &["is 5120 MB, the limit is 2048 MB"]);
}

/// The limits of the child leave no room for a second copy.
#[test]
fn a_volume_is_in_memory_once() {
    let folder = folder();
    let head = "ObjectType = Image\nNDims = 3\nDimSize = 810 810 810\nElementType = MET_UCHAR\n\
                ElementDataFile = LOCAL\n";
    let volume = sparse(&folder, "volume.mha", head.as_bytes(), 810 * 810 * 810);
    let outcome = check(&volume);
    assert_eq!(outcome.code, Some(0), "{}", outcome.text);
}

/// Nobody reads what is said: the exit code is that of the work.
#[test]
fn a_closed_standard_error_is_no_panic() {
    let folder = folder();
    let path = folder.path().join("self.toml");
    fs::write(&path, "[tissues.a]\nbased_on = \"a\"\n").expect("written");
    let run = |args: &[&str], path: &Path| {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        command.args(args).arg(path).stdout(Stdio::null()).stderr(writer);
        command.status().expect("the program starts").code()
    };
    assert_eq!(run(&["check"], &path), Some(1));
    assert_eq!(run(&["render"], &path), Some(1));
    // A word on the way is dropped as well.
    let sound = folder.path().join("sound.toml");
    fs::write(&sound, "[tissues.a]\nbased_on = \"fat\"\n").expect("written");
    assert_eq!(run(&["check"], &sound), Some(0));
}
