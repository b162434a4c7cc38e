//! The scenes that ship. They are packed into the program, and unpacked into the user's folder of data when one of them
//! is asked for: so they are found wherever the program stands, and read as all scenes are.

use std::io::{Error, Read as _, Result};
use std::path::{Component, Path, PathBuf};

use flate2::read::GzDecoder;

use crate::output::{self, files};

static ARCHIVE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/scenes.tar.gz"));

/// A scene that ships.
#[derive(Debug)]
pub struct Shipped {
    /// Its name: that of its file without `.toml`.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// A small picture of it, PNG.
    pub picture: &'static [u8],
}

include!(concat!(env!("OUT_DIR"), "/scenes.rs"));

/// Names of all scenes that ship, for messages.
pub fn names() -> String {
    let names: Vec<_> = SCENES.iter().map(|scene| scene.name).collect();
    names.join(", ")
}

/// The scene file that `path` means: the file itself where there is one; for `heart`, `heart.toml` and
/// `scenes/heart.toml` else the scene that ships, unpacked; and any other path as it is.
///
/// # Errors
/// There is no place to unpack it to.
pub fn find(path: &Path) -> Result<PathBuf> {
    match (path.is_file(), named(path)) {
        (false, Some(name)) => unpacked(name),
        _ => Ok(path.to_owned()),
    }
}

/// The file of the scene of this name, unpacked: into the user's folder of data, and where that cannot be, which is told once,
/// into the system's folder for passing files.
///
/// # Errors
/// There is no place to unpack it to.
pub fn unpacked(name: &str) -> Result<PathBuf> {
    unpacked_into(folder(), &passing(), name)
}

/// As [`unpacked`], into the folder `own` or `passing`.
fn unpacked_into(own: Option<PathBuf>, passing: &Path, name: &str) -> Result<PathBuf> {
    let file = format!("{name}.toml");
    let tried = own.as_ref().map(|folder| unpack(folder, same_size));
    let (place, cause) = match (own, tried) {
        (Some(folder), Some(Ok(()))) => return Ok(folder.join(file)),
        (folder, Some(Err(cause))) => (folder, cause.to_string()),
        (folder, _) => (folder, output::NO_FOLDER.to_owned()),
    };
    let what = format!(
        "the scenes that ship are unpacked into {}, which the system empties now and then, and what is saved from them names \
         meshes there",
        passing.display()
    );
    let said = output::not_kept(&what, place.as_deref(), &cause, "XDG_DATA_HOME");
    // Others may write there, too: what is there is compared to the last byte.
    unpack(passing, same_bytes).map_err(|e| {
        let remedy = "make one of them writable, or name other ones by the variables XDG_DATA_HOME and TMPDIR";
        let own = place.as_ref().map_or(String::new(), |place| format!("{}: ", place.display()));
        let message = format!(
            "the scenes that ship cannot be unpacked ({own}{cause}; {}: {e}); {remedy}",
            passing.display()
        );
        Error::new(e.kind(), message)
    })?;
    output::note_once(said);
    Ok(passing.join(file))
}

/// True for files that were unpacked: they are to stay as they ship.
pub fn is_shipped(path: &Path) -> bool {
    let Ok(path) = path.canonicalize() else { return false };
    let mut own = folder().into_iter().chain([passing()]);
    own.any(|own| own.canonicalize().is_ok_and(|own| path.starts_with(own)))
}

/// The way from `folder` to a scene's file, for what is written there and handed on: the name of a scene that ships; the
/// file's name alone where the way would lead through folders that name a person or a machine.
pub fn cited(scene: &Path, folder: &Path) -> String {
    let file = scene.file_name().unwrap_or(scene.as_os_str()).to_string_lossy().into_owned();
    if is_shipped(scene) {
        return file.trim_end_matches(".toml").to_owned();
    }
    // The parent of a bare name is empty, which means the folder of work.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let [scene, folder] = [scene, folder].map(std::path::absolute);
    let way = scene.ok().zip(folder.ok());
    way.and_then(|(scene, folder)| way_to(&scene, &folder, dirs::home_dir())).unwrap_or(file)
}

/// The way from a folder to a file, both absolute, with `/` between its parts; none where they have nothing but the root in
/// common, or where it leads from elsewhere into a user's home folder.
fn way_to(file: &Path, folder: &Path, home: Option<PathBuf>) -> Option<String> {
    let [to, from]: [Vec<_>; 2] = [file, folder].map(|path| path.components().collect());
    let common = to.iter().zip(&from).take_while(|(a, b)| a == b).count();
    let shared: PathBuf = to[..common].iter().collect();
    let enters = home.is_some_and(|home| file.starts_with(&home) && !shared.starts_with(&home));
    if !to[..common].iter().any(|part| matches!(part, Component::Normal(_))) || enters {
        return None;
    }
    let up = from[common..].iter().map(|_| "..".into());
    let down = to[common..].iter().map(|part| part.as_os_str().to_string_lossy());
    Some(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// Not in a cache: scenes saved elsewhere go on naming the meshes in it. Each content has a folder of its own.
fn folder() -> Option<PathBuf> {
    dirs::data_local_dir().map(|data| data.join("insonify").join(format!("scenes-{STAMP:08x}")))
}

/// The folder where there is no other.
fn passing() -> PathBuf {
    std::env::temp_dir().join(format!("insonify-scenes-{STAMP:08x}"))
}

/// The scene that ships under this name: `heart`, `heart.toml` or `scenes/heart.toml`.
pub fn named(path: &Path) -> Option<&'static str> {
    let bare =
        path.parent().is_none_or(|folder| folder.as_os_str().is_empty() || folder == "scenes");
    let stem = path.with_extension("");
    let is_file = path.extension().is_none_or(|e| e == "toml");
    let stem = stem.file_name().filter(|_| bare && is_file)?.to_str()?;
    SCENES.iter().map(|scene| scene.name).find(|name| *name == stem)
}

/// True for a file of the size that a file of the archive has.
fn same_size(path: &Path, size: u64, _: Option<&[u8]>) -> bool {
    std::fs::metadata(path).is_ok_and(|file| file.len() == size)
}

/// True for a file with the bytes of one of the archive; false without looking where they are not known yet.
fn same_bytes(path: &Path, size: u64, bytes: Option<&[u8]>) -> bool {
    let read = || std::fs::read(path).ok();
    bytes.is_some_and(|bytes| same_size(path, size, None) && read().as_deref() == Some(bytes))
}

/// Writes the files of the archive that are not in `folder` as they should be: by `is_there`, which is told size and bytes,
/// none as long as they are packed.
fn unpack(folder: &Path, is_there: fn(&Path, u64, Option<&[u8]>) -> bool) -> Result<()> {
    if FILES.iter().all(|&(name, size)| is_there(&folder.join(name), size, None)) {
        return Ok(());
    }
    let mut archive = tar::Archive::new(GzDecoder::new(ARCHIVE));
    for entry in archive.entries()? {
        let mut entry = entry?;
        let path = folder.join(entry.path()?);
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes)?;
        if is_there(&path, bytes.len() as u64, Some(&bytes)) {
            continue;
        }
        std::fs::create_dir_all(path.parent().expect("it lies in the folder"))?;
        files::replace(&path, &bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn scenes_are_meant_by_name_and_no_other_path_is() {
        for path in ["heart", "heart.toml", "scenes/heart.toml", "scenes/heart"] {
            assert_eq!(named(Path::new(path)), Some("heart"), "{path}");
        }
        for path in
            ["hart", "heart.obj", "mine/heart.toml", "/heart.toml", "", "scenes", "../heart"]
        {
            assert_eq!(named(Path::new(path)), None, "{path}");
        }
        assert!(names().starts_with("abdomen, artery, carotid"), "{}", names());
    }

    #[test]
    fn what_is_handed_on_does_not_say_whose_machine_it_was_made_on() {
        let home = || Some(PathBuf::from("/home/anna"));
        let way = |file: &str, folder: &str| way_to(Path::new(file), Path::new(folder), home());
        for (file, folder, expected) in [
            ("/home/anna/us/a.toml", "/home/anna/us", Some("a.toml")),
            ("/home/anna/us/a.toml", "/home/anna/out/1", Some("../../us/a.toml")),
            ("/data/scenes/a.toml", "/data/out", Some("../scenes/a.toml")),
            ("/home/anna/us/a.toml", "/home/shared", None),
            ("/home/anna/us/a.toml", "/tmp", None),
            ("/data/scenes/a.toml", "/tmp", None),
        ] {
            assert_eq!(way(file, folder).as_deref(), expected, "{file} from {folder}");
        }
        let heart = unpacked("heart").expect("a folder of data");
        assert_eq!(cited(&heart, Path::new("/tmp")), "heart");
        let elsewhere = tempfile::tempdir().expect("a folder").path().join("liver.toml");
        assert_eq!(cited(&elsewhere, Path::new("/nowhere/else")), "liver.toml");
    }

    #[test]
    fn all_that_ships_comes_out_as_it_went_in_and_is_mended() {
        let folder = tempfile::tempdir().expect("a folder");
        unpack(folder.path(), same_size).expect("room");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        for (name, _) in FILES {
            let [there, here] = [&source, folder.path()].map(|at| std::fs::read(at.join(name)));
            assert!(there.expect("it ships") == here.expect("unpacked"), "{name}");
        }
        let (scene, _) = Scene::load(&folder.path().join("pregnancy.toml"), &[]).expect("sound");
        assert_eq!(
            scene.name,
            SCENES.iter().find(|s| s.name == "pregnancy").expect("it ships").title
        );
        let broken = folder.path().join("heart.toml");
        std::fs::write(&broken, "half").expect("written");
        std::fs::remove_file(folder.path().join("fetus/sac.obj")).expect("it was there");
        unpack(folder.path(), same_size).expect("room");
        assert_eq!(
            std::fs::read(&broken).expect("there"),
            std::fs::read(source.join("heart.toml")).expect("there")
        );
        assert!(folder.path().join("fetus/sac.obj").exists());
    }

    #[test]
    fn without_a_folder_of_data_they_come_out_elsewhere_and_are_not_anybodys() {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, passing] = ["file", "passing"].map(|name| folder.path().join(name));
        std::fs::write(&file, "no folder").expect("written");
        // What another user has put there, of the right size.
        let (name, size) = FILES.iter().find(|(name, _)| *name == "heart.toml").expect("it ships");
        std::fs::create_dir(&passing).expect("made");
        std::fs::write(passing.join(name), vec![b'#'; *size as usize]).expect("written");
        for own in [None, Some(file.join("below"))] {
            let heart = unpacked_into(own, &passing, "heart").expect("room");
            assert_eq!(heart, passing.join("heart.toml"));
            let [source, found] =
                [Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes"), passing.clone()]
                    .map(|at| std::fs::read(at.join(name)).expect("there"));
            assert!(source == found);
            assert!(Scene::load(&heart, &[]).is_ok());
        }
        let none = unpacked_into(None, &file, "heart").expect_err("no place").to_string();
        assert!(none.contains("file") && none.contains("TMPDIR"), "{none}");
    }

    #[test]
    fn pictures_of_all_scenes_can_be_read() {
        for scene in SCENES {
            let picture = image::load_from_memory(scene.picture).expect(scene.name);
            assert!(picture.height() >= 150 && picture.width() >= 150, "{}", scene.name);
            assert!(!scene.title.is_empty());
        }
        assert!(SCENES.len() >= 10);
    }
}
