//! Limits of what clients may read of the machine: scenes in the folder of the one that was opened, and those that ship.

use std::path::{Component, Path, PathBuf};

use crate::scene::file::names_files;
use crate::scene::shipped;

/// The folder whose scenes clients may open.
pub struct Reach(PathBuf);

impl Reach {
    /// The folder of the scene file at `scene`.
    pub fn of(scene: &Path) -> Self {
        let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        Self(folder.canonicalize().unwrap_or_else(|_| folder.to_owned()))
    }

    /// The scene file that a client means: a path in the folder, as seen from there or from the folder of work, or the name
    /// of a scene that ships.
    ///
    /// # Errors
    /// A file that is elsewhere or nowhere: the answer is the same for both, so that nobody learns which files there are.
    pub fn scene(&self, name: &str) -> Result<PathBuf, String> {
        let asked = Path::new(name);
        let work = std::env::current_dir().unwrap_or_default();
        for folder in [&self.0, &work] {
            // What leaves the folder is not even looked up, and links do not lead out of it.
            let path = plain(&folder.join(asked));
            if path.starts_with(&self.0)
                && let Ok(real) = path.canonicalize()
                && real.starts_with(&self.0)
                && real.is_file()
            {
                return Ok(real);
            }
        }
        match shipped::named(asked) {
            Some(name) => shipped::unpacked(name).map_err(|e| e.to_string()),
            None => Err(format!(
                "no scene `{}` in the folder of the one that was opened, and clients open none elsewhere; scenes that \
                 ship: {}",
                name.chars().take(60).collect::<String>(),
                shipped::names()
            )),
        }
    }

    /// Fails at a setting that would make the simulator read a file, whichever.
    ///
    /// # Errors
    /// Cause and remedy.
    pub fn settings(pairs: &[(String, String)]) -> Result<(), String> {
        match pairs.iter().find(|(path, value)| names_files(path, value)) {
            Some((path, _)) => Err(format!(
                "`{path}` names a file, which clients may not; put it into a scene file in the folder of the one that was \
                 opened, and send scene = NAME"
            )),
            None => Ok(()),
        }
    }
}

/// The path without `.` and `..`, whether or not there is such a file.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            _ => out.push(part),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_the_folder_and_those_that_ship_are_opened_and_no_others() {
        let root = tempfile::tempdir().expect("a folder");
        let at = |name: &str| root.path().canonicalize().expect("there").join(name);
        for name in ["ours/a.toml", "ours/more/b.toml", "theirs/c.toml", "d.toml"] {
            std::fs::create_dir_all(at(name).parent().expect("a folder")).expect("room");
            std::fs::write(at(name), "").expect("room");
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("theirs/c.toml"), at("ours/link.toml")).expect("room");
        let reach = Reach::of(&at("ours/a.toml"));
        let whole = at("ours/a.toml").display().to_string();
        for (name, file) in [
            ("a.toml", "ours/a.toml"),
            ("./more/../a.toml", "ours/a.toml"),
            ("more/b.toml", "ours/more/b.toml"),
            ("../ours/a.toml", "ours/a.toml"),
            (whole.as_str(), "ours/a.toml"),
        ] {
            assert_eq!(reach.scene(name), Ok(at(file)), "{name}");
        }
        for name in ["heart", "heart.toml", "scenes/heart.toml"] {
            assert!(reach.scene(name).is_ok_and(|path| path.ends_with("heart.toml")), "{name}");
        }
        let elsewhere = at("theirs/c.toml").display().to_string();
        for name in [
            "../d.toml",
            "../theirs/c.toml",
            &elsewhere,
            "link.toml",
            "more",
            "/etc/passwd",
            "/etc/none",
            "",
        ] {
            let answer = reach.scene(name).expect_err(name).replace(name, "");
            assert_eq!(answer, reach.scene("?").expect_err("?").replace('?', ""), "{name}");
        }
    }

    #[test]
    fn settings_that_name_files_are_refused_wherever_they_name_them() {
        let one = |path: &str, value: &str| Reach::settings(&[(path.to_owned(), value.to_owned())]);
        for (path, value) in [
            ("mesh.liver.file", "/etc/passwd"),
            ("mesh.0.file", "\"a.obj\""),
            ("mesh.0.keyframes.2", "a.obj"),
            ("volume.file", "a.nii"),
            ("volume", "{ file = \"a.nii\" }"),
            ("transform.0.motion", "{ kind = \"trajectory\", file = \"a.csv\" }"),
            ("mesh", "[{ name = \"a\", file = \"a.obj\" }]"),
        ] {
            let message = one(path, value).expect_err(path);
            assert!(message.contains("names a file") && message.contains(path), "{message}");
        }
        for (path, value) in [
            ("imaging.gain", "3 dB"),
            ("mesh.file.priority", "3"),
            ("probe.pose", "{ position = [0, 0, 0] }"),
            ("name", "file"),
        ] {
            assert_eq!(one(path, value), Ok(()), "{path}");
        }
    }
}
