//! nnU-Net: images and labels of one channel, numbers of classes from 1 on, 0 where nothing is.

use serde_json::{Map, Value, json};

use super::super::DatasetError;
use super::{Labelled, Out, Set};
use crate::output::indexed::{self, NOTHING};

/// Writes training and validation samples as `Tr`, with which is which in `splits_final.json`, and those of the split `test` as
/// `Ts`.
pub(super) fn write(
    set: &Set,
    out: &Out,
    counted: &mut dyn FnMut(&Labelled),
) -> Result<(), DatasetError> {
    let (mut training, mut validation) = (Vec::new(), Vec::new());
    set.each(&mut |sample| {
        let (width, height) = sample.classes.dimensions();
        let indices: Vec<u8> = sample.classes.iter().map(|class| index(*class)).collect();
        let end = if sample.split == "test" { "Ts" } else { "Tr" };
        let case = format!("insonify_{}", sample.name);
        out.write(&format!("images{end}/{case}_0000.png"), &sample.image)?;
        let labels = indexed::plain([width, height], &indices, "");
        out.write(&format!("labels{end}/{case}.png"), &labels)?;
        match sample.split.as_str() {
            "test" => {}
            "val" | "validation" => validation.push(case),
            _ => training.push(case),
        }
        counted(&sample);
        Ok(())
    })?;
    let mut labels = Map::from_iter([("background".to_owned(), json!(0))]);
    let classes = (1..).zip(&set.classes);
    labels.extend(classes.map(|(i, name): (u32, _)| (name.clone(), json!(i))));
    let count = training.len() + validation.len();
    if !validation.is_empty() {
        let fold = json!([{ "train": training, "val": validation }]);
        out.write_json("splits_final.json", &fold)?;
    }
    out.write_json(
        "dataset.json",
        &json!({
            "channel_names": { "0": "ultrasound" },
            "labels": Value::Object(labels),
            "numTraining": count,
            "file_ending": ".png",
        }),
    )
}

/// The label of a class.
fn index(class: u8) -> u8 {
    match class {
        NOTHING => 0,
        class => class + 1,
    }
}
