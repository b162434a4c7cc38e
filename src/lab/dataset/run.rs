//! A shard of a plan made from beginning to end.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;

use super::{DatasetError, Event, Gallery, Part, Plan, Store, Studio, hold};
use crate::gpu::Device;
use crate::sim::Tracer;

/// Most samples of a shard whose draws are checked before it is made: a second of work.
pub const MOST_CHECKED: u32 = 4000;

/// A shard that is to be made.
pub struct Run<'p> {
    /// The plan.
    pub plan: &'p Plan,
    /// Folder of the data set.
    pub root: &'p Path,
    /// Index of the shard, from 0, and number of shards.
    pub shard: [u32; 2],
    /// True to go on with what a stopped run left.
    pub resume: bool,
}

/// Number of samples in these parts.
fn count(parts: &[Part]) -> u32 {
    parts.iter().map(|part| part.samples.len() as u32).sum()
}

impl Run<'_> {
    /// The parts of the shard; none where there are more shards than parts.
    pub fn parts(&self) -> Vec<Part> {
        let [index, count] = self.shard;
        self.plan.shard(index, count)
    }

    /// Number of samples of the shard.
    pub fn samples(&self) -> u32 {
        count(&self.parts())
    }

    /// Checks what the shard's samples draw, without making one: of more than [`MOST_CHECKED`] so many, evenly among them.
    /// Returns their number. The ends of all ranges are checked with the plan, and each sample once more when it is made.
    ///
    /// # Errors
    /// The first draw that does not fit, with its place in the plan.
    pub fn check(&self) -> Result<u32, DatasetError> {
        let parts = self.parts();
        let all = count(&parts);
        let step = all.div_ceil(MOST_CHECKED).max(1) as usize;
        let numbers = parts.iter().flat_map(|part| part.samples.clone()).step_by(step);
        self.plan.check(numbers)?;
        Ok(all.div_ceil(step as u32))
    }

    /// Makes the shard and its contact sheet; `progress` hears of each sample and part, and may end the run by an error.
    /// `wanted` is the tracer, none the device's best. Returns the sheet.
    ///
    /// # Errors
    /// Another run that makes samples of this shard in the folder; the cause that keeps a sample from being made or written;
    /// what was finished before stays.
    pub fn make(
        &self,
        device: &Arc<Device>,
        wanted: Option<Tracer>,
        progress: &mut dyn FnMut(&Store<'_>, Event<'_>) -> Result<(), DatasetError>,
    ) -> Result<PathBuf, DatasetError> {
        let parts = self.parts();
        let store = Store::new(self.plan, self.root);
        let tracer = wanted.map(|tracer| tracer.to_string());
        let _held = hold::take(self.root, self.shard, self.plan.parts().len())?;
        let about = json!({ "name": device.name(), "driver": device.driver(), "tracer": tracer });
        store.begin(&parts, &about, self.resume)?;
        let mut studio = Studio::new(self.plan, device, wanted);
        let mut gallery = Gallery::new(self.plan, &parts);
        store.fill(&mut studio, &parts, &mut |news| {
            if let Event::Made(made) = &news {
                gallery.take(made);
            }
            progress(&store, news)
        })?;
        let sheet = match self.shard {
            [_, 1] => "sheet.png".to_owned(),
            [index, count] => format!("sheet-{index}-of-{count}.png"),
        };
        let sheet = store.path(&sheet);
        let mut png = Cursor::new(Vec::new());
        let page = gallery.draw(&store, &mut studio)?;
        page.write_to(&mut png, image::ImageFormat::Png).expect("into memory");
        store.write(&sheet, png.get_ref())?;
        Ok(sheet)
    }
}
