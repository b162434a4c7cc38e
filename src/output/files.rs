//! Files that are written whole or not at all.

use std::io::Write as _;
use std::path::Path;

/// Writes `bytes` beside `path` (as `.NAME.` with the number of the process), then takes its place: no
/// failure leaves half a file. A link stays one; permissions stay as they were.
///
/// # Errors
/// Errors of the file system; `path` is then unchanged.
pub fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.{}", std::process::id()));
    let written = || {
        let mut file = std::fs::File::create_new(&beside)?;
        file.write_all(bytes)?;
        if let Ok(before) = std::fs::metadata(&path) {
            file.set_permissions(before.permissions())?;
        }
        file.sync_all()?;
        std::fs::rename(&beside, &path)
    };
    written().inspect_err(|_| {
        // A partial file is of no use; the first error is the one to report.
        let _ = std::fs::remove_file(&beside);
    })
}
