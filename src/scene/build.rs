//! Packs the scenes that ship, so that the program has them wherever it stands (`scene/shipped.rs`).

use std::env;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;

/// The scenes and their files.
const SCENES: &str = "../../scenes";
/// Their pictures, one for each scene; not in the archive.
const PICTURES: &str = "../../scenes/pictures";

fn main() {
    println!("cargo::rerun-if-changed={SCENES}");
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let mut files = Vec::new();
    collect(Path::new(SCENES), &mut files);
    files.sort();
    let file = File::create(out.join("scenes.tar.gz")).expect("the folder is ours");
    let mut archive = tar::Builder::new(GzEncoder::new(BufWriter::new(file), Compression::new(6)));
    let (mut listed, mut shown) = (String::new(), String::new());
    let mut sum = flate2::Crc::new();
    for path in &files {
        let bytes = fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        sum.update(&bytes);
        let name = path.strip_prefix(SCENES).expect("it lies there").to_str().expect("plain");
        let name = name.replace('\\', "/");
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        archive.append_data(&mut header, &name, &bytes[..]).expect("it is written to");
        listed += &format!("({name:?}, {}),\n", bytes.len());
        let Some(stem) = name.strip_suffix(".toml") else { continue };
        let picture = Path::new(PICTURES).join(format!("{stem}.png"));
        assert!(picture.exists(), "{} is missing: tools/pictures.sh makes it", picture.display());
        let picture = fs::canonicalize(&picture).expect("it is there");
        let title = title(&bytes).unwrap_or(stem.to_owned());
        shown += &format!(
            "Shipped {{ name: {stem:?}, title: {title:?}, picture: include_bytes!({picture:?}) }},\n"
        );
    }
    let rest = archive.into_inner().and_then(GzEncoder::finish);
    rest.and_then(|mut file| file.flush()).expect("it is written to");
    let text = format!(
        "const STAMP: u32 = {};\nconst FILES: &[(&str, u64)] = &[\n{listed}];\n\
         /// The scenes that ship, by name.\npub const SCENES: &[Shipped] = &[\n{shown}];\n",
        sum.sum()
    );
    fs::write(out.join("scenes.rs"), text).expect("the folder is ours");
}

/// All files below a folder but the pictures.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("it is there").path();
        match path.is_dir() {
            true if path == Path::new(PICTURES) => {}
            true => collect(&path, files),
            false => files.push(path),
        }
    }
}

/// The name that a scene file gives itself: `name = "..."` before its first table.
fn title(text: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(text);
    let mut lines = text.lines().take_while(|line| !line.starts_with('['));
    lines.find_map(|line| Some(line.strip_prefix("name = \"")?.strip_suffix('"')?.to_owned()))
}
