//! Hugging Face: images by split, a line of `metadata.jsonl` for each.

use serde_json::{Value, json};

use super::super::DatasetError;
use super::{Labelled, Out, Set, placed};
use crate::output::indexed;

pub(super) fn write(
    set: &Set,
    out: &Out,
    counted: &mut dyn FnMut(&Labelled),
) -> Result<(), DatasetError> {
    let mut lines: Vec<String> = vec![String::new(); set.splits.len()];
    set.each(&mut |sample| {
        let (width, height) = sample.classes.dimensions();
        let [image, segmentation] = ["png", "seg.png"].map(|end| placed(&sample, end));
        out.write(&image, &sample.image)?;
        out.write(&segmentation, &indexed::plain([width, height], &sample.classes, ""))?;
        // Paths from the folder of the split, where the file lies.
        let within = |path: &str| path[sample.split.len() + 1..].to_owned();
        let facts = &sample.facts;
        let line = json!({
            "file_name": within(&image),
            "segmentation_file_name": within(&segmentation),
            "sample": sample.number,
            "scene": facts["scene"],
            "anatomy": facts["anatomy"],
            "time_s": facts["time_s"],
            "position_mm": facts["position_mm"],
            "rotation_wxyz": facts["rotation_wxyz"],
            "pixel_mm": facts["image"]["pixel_mm"],
            "classes": facts["classes"].as_object().map(|all| all.keys().cloned().collect::<Vec<_>>()),
            "drawn": facts["drawn"],
        });
        lines[sample.place] += &format!("{line}\n");
        counted(&sample);
        Ok(())
    })?;
    for (split, text) in set.splits.iter().zip(lines) {
        out.write(&format!("{split}/metadata.jsonl"), text.as_bytes())?;
    }
    let names: Vec<Value> = set.classes.iter().map(|name| json!(name)).collect();
    out.write_json("classes.json", &json!({ "classes": names, "nothing": indexed::NOTHING }))
}
