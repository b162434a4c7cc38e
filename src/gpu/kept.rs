//! Compiled pipelines, kept in a folder from one start to the next, and a message to the user where a
//! start has to compile.
//!
//! Drivers keep compiled kernels themselves, but not all, and not everywhere (containers, MoltenVK).
//! One file per device and driver holds the driver's own pipeline cache and the list of kernels that
//! have run there before. A file that is broken, or of another device, is no error: its kernels are
//! compiled again.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use ash::vk;
use insonify_base::output::{self, files};
use parking_lot::Mutex;

/// First bytes of a file; the number counts the format's versions.
const MAGIC: &[u8] = b"insonify pipelines 1\n";

/// Largest file that is written or read, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// Most files kept: one per device and driver version. The oldest are removed first.
const MAX_FILES: usize = 8;

/// The variables of the environment by which Mesa's driver for the processor compiles: the width of its vectors, and
/// the folder in which it keeps what it has compiled.
pub(crate) const MESA_VARIABLES: [&str; 2] = ["LP_NATIVE_VECTOR_WIDTH", "MESA_SHADER_CACHE_DIR"];

/// Length of a wait after which the user is told its reason.
const PATIENCE: Duration = Duration::from_secs(1);

/// The variable of the environment that names the user's cache folder.
const CACHE_VARIABLE: &str = "XDG_CACHE_HOME";
/// What follows where nothing can be kept.
const NOT_KEPT: &str = "compiled kernels are not kept, and the next start compiles them again";

/// The folder for files that this program can make again: its own in the user's cache folder; none
/// where the system names none, which is told once.
pub fn cache_folder() -> Option<PathBuf> {
    let folder = dirs::cache_dir().map(|folder| folder.join("insonify").join("pipelines"));
    if folder.is_none() {
        output::note_once(output::not_kept(NOT_KEPT, None, output::NO_FOLDER, CACHE_VARIABLE));
    }
    folder
}

/// The folder for kernels that Mesa compiles for this program, see [`super::prepare_process`]; none where the
/// system names no cache folder.
pub(crate) fn mesa_folder() -> Option<PathBuf> {
    dirs::cache_dir().map(|folder| folder.join("insonify").join("mesa"))
}

/// Returns whether Mesa, which compiles for the processor when a kernel first runs, has kept nothing from before.
/// It makes the folder when a device is opened.
pub(crate) fn llvmpipe_has_nothing() -> bool {
    let named = |name| std::env::var_os(name).map(PathBuf::from);
    let folder = named("MESA_SHADER_CACHE_DIR").or_else(dirs::cache_dir);
    let ours = |entry: fs::DirEntry| {
        let name = entry.file_name();
        name.to_string_lossy().starts_with("mesa_shader_cache")
    };
    let entries = folder.and_then(|folder| fs::read_dir(folder).ok());
    !entries.is_some_and(|mut entries| entries.any(|entry| entry.is_ok_and(ours)))
}

/// The pipeline cache of a device, and the content of its file.
pub(crate) struct PipelineStore {
    raw: ash::Device,
    cache: vk::PipelineCache,
    device: String,
    properties: vk::PhysicalDeviceProperties,
    /// The file; without one nothing is kept.
    file: Option<PathBuf>,
    /// Kernels that have run on this device with this driver, and further numbers to be remembered for
    /// them.
    known: Mutex<BTreeSet<u64>>,
    /// True once the user has been told the reason for the wait.
    announced: Arc<AtomicBool>,
}

impl PipelineStore {
    /// Takes over the content of `folder` for a device; `forgotten`: the driver has lost everything that it
    /// compiled before.
    pub(crate) fn new(
        raw: &ash::Device,
        properties: &vk::PhysicalDeviceProperties,
        device: &str,
        folder: Option<&Path>,
        forgotten: bool,
    ) -> Result<Self, vk::Result> {
        let file = folder.map(|folder| folder.join(file_name(properties)));
        let (mut known, mut data) = (BTreeSet::new(), Vec::new());
        match file.as_ref().map(|file| read(file, properties)) {
            Some(Ok(Some(content))) => (known, data) = content,
            Some(Err(problem)) => {
                let file = file.as_ref().map(|f| f.display().to_string());
                output::note(format!(
                    "{}: {problem}; its kernels are compiled again",
                    file.unwrap_or_default()
                ));
            }
            Some(Ok(None)) | None => {}
        }
        if forgotten {
            known.clear();
        }
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the data is empty or what this device and driver gave, whole by its check sum.
        let cache = unsafe { raw.create_pipeline_cache(&info, None) }?;
        Ok(Self {
            raw: raw.clone(),
            cache,
            device: device.to_owned(),
            properties: *properties,
            file,
            known: Mutex::new(known),
            announced: Arc::default(),
        })
    }

    pub(crate) fn cache(&self) -> vk::PipelineCache {
        self.cache
    }

    /// Returns whether a number was learnt.
    pub(crate) fn knows(&self, what: u64) -> bool {
        self.known.lock().contains(&what)
    }

    /// Returns whether anything is kept from one start to the next.
    pub(crate) fn keeps(&self) -> bool {
        self.file.is_some()
    }

    /// Returns whether a kernel has never run here before; false where nothing is kept.
    pub(crate) fn is_new(&self, kernel: u64) -> bool {
        self.file.is_some() && !self.known.lock().contains(&kernel)
    }

    /// Tells the user the reason for the wait, once, if the returned value is not dropped within a second
    /// and one of `kernels` is new here.
    pub(crate) fn patience(&self, kernels: impl IntoIterator<Item = u64>) -> Option<WaitNotice> {
        let new = kernels.into_iter().any(|kernel| self.is_new(kernel));
        if !new || self.announced.load(Ordering::Relaxed) {
            return None;
        }
        let (done, wait) = mpsc::channel::<()>();
        let (device, announced) = (self.device.clone(), self.announced.clone());
        thread::spawn(move || {
            let late = wait.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout);
            if late && !announced.swap(true, Ordering::Relaxed) {
                output::note(format!("compiling kernels for {device}, the first time only"));
            }
        });
        Some(WaitNotice { _done: done })
    }

    /// Notes that these kernels have run; writes the driver's data if any is new.
    pub(crate) fn learn(&self, kernels: impl IntoIterator<Item = u64>) {
        let Some(file) = &self.file else { return };
        let mut known = self.known.lock();
        let before = known.len();
        known.extend(kernels);
        if known.len() == before {
            return;
        }
        // SAFETY: the cache is alive and synchronises itself.
        let mut data = unsafe { self.raw.get_pipeline_cache_data(self.cache) }.unwrap_or_default();
        // Mesa 26.2's driver for the processor gives less than a header.
        if !is_of(&data, &self.properties) {
            data.clear();
        }
        if let Err(error) = write(file, &encode(&known, &data)) {
            let (place, cause) = (Some(file.as_path()), error.to_string());
            output::note_once(output::not_kept(NOT_KEPT, place, &cause, CACHE_VARIABLE));
        }
    }

    /// Destroys the cache.
    ///
    /// # Safety
    /// The device is alive and makes no pipelines any more.
    pub(crate) unsafe fn destroy(&self) {
        // SAFETY: by the contract above.
        unsafe { self.raw.destroy_pipeline_cache(self.cache, None) };
    }
}

/// Guard of a wait, dropped when it is over.
pub(crate) struct WaitNotice {
    _done: Sender<()>,
}

/// Name of the file: one per device, driver, driver version, and folder and width with which Mesa compiles for the
/// processor, since a kernel that has run with others is compiled again.
fn file_name(properties: &vk::PhysicalDeviceProperties) -> String {
    let hex = |bytes: &[u8]| -> String { bytes.iter().map(|b| format!("{b:02x}")).collect() };
    let named = MESA_VARIABLES.map(|name| std::env::var_os(name).unwrap_or_default());
    let of_mesa = named.each_ref().map(|value| value.as_encoded_bytes()).join(&b'\n');
    format!(
        "{:x}-{:x}-{:x}-{}-{:x}.bin",
        properties.vendor_id,
        properties.device_id,
        properties.driver_version,
        hex(&properties.pipeline_cache_uuid),
        check_sum(&of_mesa)
    )
}

/// Known kernels and the driver's data.
type Content = (BTreeSet<u64>, Vec<u8>);

fn check_sum(bytes: &[u8]) -> u64 {
    crc::Crc::<u64>::new(&crc::CRC_64_XZ).checksum(bytes)
}

/// The bytes of a file: magic, check sum of the rest, number of kernels, their ids, the driver's data.
fn encode(known: &BTreeSet<u64>, data: &[u8]) -> Vec<u8> {
    let mut rest = (known.len() as u64).to_le_bytes().to_vec();
    rest.extend(known.iter().flat_map(|id| id.to_le_bytes()));
    rest.extend(data);
    let mut out = MAGIC.to_vec();
    out.extend(check_sum(&rest).to_le_bytes());
    out.extend(rest);
    out
}

/// The content of a file; none where it is broken.
fn decode(bytes: &[u8]) -> Option<Content> {
    let (sum, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    if check_sum(rest) != u64::from_le_bytes(*sum) {
        return None;
    }
    let (count, rest) = rest.split_first_chunk::<8>()?;
    let bytes = usize::try_from(u64::from_le_bytes(*count)).ok()?.checked_mul(8)?;
    let (ids, data) = rest.split_at_checked(bytes)?;
    let (ids, _) = ids.as_chunks::<8>();
    let known = ids.iter().map(|id| u64::from_le_bytes(*id)).collect();
    Some((known, data.to_vec()))
}

/// Returns whether a pipeline cache's header names this device: drivers should check that themselves, but not all do.
fn is_of(data: &[u8], properties: &vk::PhysicalDeviceProperties) -> bool {
    let word = |at: usize| {
        let bytes = data.get(4 * at..4 * at + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    };
    let version = vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32;
    data.is_empty()
        || (word(1) == Some(version)
            && word(2) == Some(properties.vendor_id)
            && word(3) == Some(properties.device_id)
            && data.get(16..32) == Some(&properties.pipeline_cache_uuid[..]))
}

/// Content of a file for a device; none where there is no file, and a problem where it cannot be used.
fn read(
    file: &Path,
    properties: &vk::PhysicalDeviceProperties,
) -> Result<Option<Content>, &'static str> {
    let Ok(about) = fs::metadata(file) else {
        return Ok(None);
    };
    if about.len() > MAX_BYTES {
        return Err("kept kernels of more than 64 MiB are ignored");
    }
    let bytes = fs::read(file).map_err(|_| "kept kernels cannot be read")?;
    let content = decode(&bytes).ok_or("kept kernels are broken")?;
    match is_of(&content.1, properties) {
        true => Ok(Some(content)),
        false => Err("kept kernels are of another device or driver"),
    }
}

/// Writes a file as a whole or not at all, even if others write it at the same time.
fn write(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if bytes.len() as u64 > MAX_BYTES {
        return Err(std::io::Error::other("more than 64 MiB"));
    }
    let folder = file.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    files::replace(file, bytes)?;
    forget_oldest(folder)
}

fn forget_oldest(folder: &Path) -> std::io::Result<()> {
    let mut files: Vec<_> = fs::read_dir(folder)?
        .filter_map(Result::ok)
        .filter(|entry| entry.path().extension().is_some_and(|e| e == "bin"))
        .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
        .collect();
    files.sort();
    let excess = files.len().saturating_sub(MAX_FILES);
    // Another process may have been faster.
    files[..excess].iter().for_each(|(_, file)| drop(fs::remove_file(file)));
    Ok(())
}

#[cfg(test)]
mod tests;
