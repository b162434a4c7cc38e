//! Data of others that some tests read and that do not ship.

use std::path::{Path, PathBuf};

use super::skip::{Lacking, skip};

/// The folder of the data; none without it, with a message.
pub fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    if !folder.is_dir() {
        skip(Lacking::Data, "no shared data");
        return None;
    }
    Some(folder)
}
