//! COCO: one file of annotations for each split; each class of an image is one annotation, whose mask is run-length coded.

use serde_json::{Value, json};

use super::super::DatasetError;
use super::{Labelled, Licence, Out, Set, placed};

pub(super) fn write(
    set: &Set,
    licence: &Licence,
    out: &Out,
    counted: &mut dyn FnMut(&Labelled),
) -> Result<(), DatasetError> {
    let mut splits: Vec<(Vec<Value>, Vec<Value>)> = vec![Default::default(); set.splits.len()];
    set.each(&mut |sample| {
        let (images, annotations) = &mut splits[sample.place];
        let (width, height) = sample.classes.dimensions();
        let file = placed(&sample, "png");
        out.write(&file, &sample.image)?;
        images.push(json!({
            "id": sample.number, "file_name": file, "width": width, "height": height, "license": 1,
        }));
        for (class, _) in (0_u8..).zip(&set.classes) {
            let Some(found) = Region::of(&sample.classes, class) else { continue };
            annotations.push(json!({
                "id": annotations.len() + 1,
                "image_id": sample.number,
                "category_id": u32::from(class) + 1,
                "segmentation": { "size": [height, width], "counts": found.counts },
                "area": found.area,
                "bbox": found.bounds,
                // Run-length coded, as COCO has it for regions of many parts.
                "iscrowd": 1,
            }));
        }
        counted(&sample);
        Ok(())
    })?;
    let categories = (1_u32..).zip(&set.classes);
    let categories: Vec<Value> = categories
        .map(|(id, name)| json!({ "id": id, "name": name, "supercategory": "tissue" }))
        .collect();
    for (split, (images, annotations)) in set.splits.iter().zip(splits) {
        out.write_json(
            &format!("annotations/{split}.json"),
            &json!({
                "info": { "description": "simulated ultrasound", "contributor": set.manifest["program"] },
                "licenses": [{ "id": 1, "name": licence.name(), "url": "" }],
                "images": images,
                "annotations": annotations,
                "categories": categories,
            }),
        )?;
    }
    Ok(())
}

/// The pixels of a class.
#[derive(Debug, PartialEq)]
struct Region {
    /// Lengths of the runs without and with it in turn, column by column.
    counts: Vec<u32>,
    area: u32,
    /// Left, top, width, height.
    bounds: [u32; 4],
}

impl Region {
    /// Those of `class` in an image; none where it is not there.
    fn of(classes: &image::GrayImage, class: u8) -> Option<Self> {
        let (width, height) = classes.dimensions();
        let (mut counts, mut inside, mut run, mut area) = (Vec::new(), false, 0, 0);
        let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
        for x in 0..width {
            for y in 0..height {
                let is = classes.get_pixel(x, y).0[0] == class;
                if is != inside {
                    counts.push(std::mem::take(&mut run));
                    inside = is;
                }
                run += 1;
                if is {
                    area += 1;
                    low = [low[0].min(x), low[1].min(y)];
                    high = [high[0].max(x + 1), high[1].max(y + 1)];
                }
            }
        }
        counts.push(run);
        let bounds = || [low[0], low[1], high[0] - low[0], high[1] - low[1]];
        (area > 0).then(|| Self { counts, area, bounds: bounds() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_go_down_the_columns_and_begin_without_the_class() {
        // 7 0 0
        // 7 7 0
        let image = image::GrayImage::from_raw(3, 2, vec![7, 0, 0, 7, 7, 0]).expect("six pixels");
        let found = Region::of(&image, 7).expect("it is there");
        assert_eq!(found, Region { counts: vec![0, 2, 1, 1, 2], area: 3, bounds: [0, 0, 2, 2] });
        let black = Region::of(&image, 0).expect("it is there");
        assert_eq!((black.counts, black.area), (vec![2, 1, 1, 2], 3));
        assert_eq!(Region::of(&image, 9), None);
    }
}
