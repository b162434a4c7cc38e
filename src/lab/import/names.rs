//! Names of labels as files carry them: 3D Slicer's segments in NRRD, label tables in extensions of NIfTI.

use std::io::Read;
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::issue::FileError;

/// A segment of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Segment {
    /// Layer of voxels that it lies in: segments of one layer do not overlap.
    pub layer: usize,
    /// Value of its voxels there.
    pub value: u32,
    /// Its name, then what it is in the words of a terminology; empty where nothing is said.
    pub names: Vec<String>,
}

/// Most bytes that are looked at for names.
const MAX_HEAD: u64 = 8 << 20;
/// Bytes of a NIfTI-1 header.
const NIFTI: usize = 348;

/// Segments as a file describes them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Described {
    /// The segments; none where the file's format or writer has no words for them.
    pub segments: Vec<Segment>,
    /// Remarks on what of that cannot be used.
    pub remarks: Vec<String>,
}

impl Described {
    /// Notes segments that share a value in a layer: they are one structure, which has the first one's names.
    fn unite(mut self) -> Self {
        let mut kept: Vec<Segment> = Vec::new();
        for segment in self.segments {
            let same = |s: &&Segment| (s.layer, s.value) == (segment.layer, segment.value);
            match kept.iter().find(same) {
                Some(first) => {
                    let [first, second] =
                        [first, &segment].map(|s| s.names.first().map_or("", |n| n));
                    self.remarks.push(format!(
                        "`{second}`: has the value {} of `{first}`, in the same layer: both are one mesh, `{first}`",
                        segment.value
                    ));
                }
                None => kept.push(segment),
            }
        }
        Self { segments: kept, ..self }
    }
}

/// Reads the description of a file's segments. What is malformed there is passed over: the voxels are the segmentation.
///
/// # Errors
/// A file that cannot be read.
pub fn of(path: &Path) -> Result<Described, FileError> {
    let name = path.to_string_lossy().to_ascii_lowercase();
    let fail =
        |e: std::io::Error| FileError::file(path, format!("cannot be read: {e}"), "check the path");
    let open = || std::fs::File::open(path).map_err(fail);
    if name.ends_with(".nrrd") || name.ends_with(".nhdr") {
        Ok(of_nrrd(&head(open()?)).unite())
    } else if name.ends_with(".nii.gz") {
        Ok(plain(of_nifti(&head(MultiGzDecoder::new(open()?)))))
    } else if name.ends_with(".nii") {
        Ok(plain(of_nifti(&head(open()?))))
    } else {
        Ok(Described::default())
    }
}

fn plain(segments: Vec<Segment>) -> Described {
    Described { segments, remarks: Vec::new() }.unite()
}

/// The first bytes of a stream. What follows a fault is missing; the reader of the voxels names it.
fn head(stream: impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    let _ = stream.take(MAX_HEAD).read_to_end(&mut bytes);
    bytes
}

/// `SegmentN_Name` and the like, as 3D Slicer writes them
/// (slicer.readthedocs.io, "Segmentation file format"). Versions before 4.11 gave each segment a layer of its own and no
/// values: there its voxels are 1.
fn of_nrrd(bytes: &[u8]) -> Described {
    let mut found: std::collections::BTreeMap<usize, (Segment, Option<String>, Option<usize>)> =
        Default::default();
    let lines = bytes.split(|&b| b == b'\n').map(|l| String::from_utf8_lossy(l).into_owned());
    for line in lines.take_while(|l| !l.trim_end().is_empty()) {
        let Some((key, value)) = line.trim_end().split_once(":=") else { continue };
        let Some((number, field)) = key.strip_prefix("Segment").and_then(|k| k.split_once('_'))
        else {
            continue;
        };
        let Ok(number) = number.parse() else { continue };
        let (segment, stated, layer) = found.entry(number).or_default();
        match field {
            "Name" => segment.names.insert(0, value.to_owned()),
            "LabelValue" => *stated = Some(value.to_owned()),
            "Layer" => *layer = value.parse().ok(),
            "Tags" => {
                let entry = value.split('|').find_map(|tag| tag.strip_prefix("TerminologyEntry:"));
                segment.names.extend(entry.into_iter().flat_map(terms));
            }
            _ => {}
        }
    }
    let is_old = found.values().all(|(_, stated, _)| stated.is_none());
    let mut out = Described::default();
    for (number, (segment, stated, layer)) in found {
        let usual = if is_old { number } else { 0 };
        let layer = layer.unwrap_or(usual);
        let value = match &stated {
            None => Some(1),
            Some(text) => text.parse().ok().filter(|value| *value > 0),
        };
        match value {
            Some(value) => out.segments.push(Segment { layer, value, ..segment }),
            None => {
                let name = segment.names.first().map_or("", |name| name.as_str());
                let text = stated.unwrap_or_default();
                out.remarks.push(format!(
                    "`{name}`: its value, {text}, is that of no voxel: a structure without a name may be it"
                ));
            }
        }
    }
    out
}

/// Meanings in a terminology entry, the most telling first: `context~category~type~modifier~region context~region~
/// region modifier`, each of them `scheme^value^meaning`.
fn terms(entry: &str) -> Vec<String> {
    let parts: Vec<_> = entry.split('~').map(|p| p.split('^').nth(2).unwrap_or_default()).collect();
    let order = [2, 5, 1].into_iter().filter_map(|n| parts.get(n));
    order.filter(|t| !t.is_empty()).map(|t| (*t).to_owned()).collect()
}

/// `<Label Key="1">liver</Label>` of a Caret extension, as TotalSegmentator and Connectome Workbench write it.
fn of_nifti(bytes: &[u8]) -> Vec<Segment> {
    let offset = bytes.get(108..112).and_then(|b| b.first_chunk::<4>());
    let big = bytes.first_chunk::<4>().map(|b| i32::from_be_bytes(*b)) == Some(NIFTI as i32);
    let end = offset.map_or(0, |b| {
        let value = if big { f32::from_be_bytes(*b) } else { f32::from_le_bytes(*b) };
        value as usize
    });
    let Some(extension) = bytes.get(NIFTI..end.min(bytes.len())) else { return Vec::new() };
    let text = String::from_utf8_lossy(extension);
    let inner = text.find("<CaretExtension").and_then(|from| {
        let close = "</CaretExtension>";
        let to = text[from..].find(close)?;
        Some(&text[from..from + to + close.len()])
    });
    let Some(document) = inner.and_then(|t| roxmltree::Document::parse(t).ok()) else {
        return Vec::new();
    };
    let labels = document.descendants().filter(|n| n.has_tag_name("Label"));
    labels
        .filter_map(|label| {
            let value = label.attribute("Key")?.parse().ok().filter(|v| *v > 0)?;
            let name = label.text().unwrap_or_default().trim();
            let names = if name.is_empty() { vec![] } else { vec![name.to_owned()] };
            Some(Segment { layer: 0, value, names })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_of_slicer_have_layer_value_name_and_terms() {
        let text = "NRRD0004\ntype: uchar\nSegment0_ID:=Segment_1\nSegment0_LabelValue:=3\nSegment0_Layer:=1\n\
            Segment0_Tags:=Segmentation.Status:inprogress|TerminologyEntry:Segmentation category and type\
            ~SCT^123037004^Anatomical Structure~SCT^10200004^Liver~SCT^7771000^Left~Anatomic codes~SCT^1^Abdomen~^^|\n\
            Segment0_Name:=big one\nSegment1_LabelValue:=2\nSegmentation_MasterRepresentation:=x\n\nSegment2_LabelValue:=9\n";
        let Described { segments: found, remarks } = of_nrrd(text.as_bytes());
        assert!(remarks.is_empty(), "{remarks:?}");
        let names = ["big one", "Liver", "Abdomen", "Anatomical Structure"].map(str::to_owned);
        let first = Segment { layer: 1, value: 3, names: names.to_vec() };
        assert_eq!(found, [first, Segment { value: 2, ..Segment::default() }]);
    }

    #[test]
    fn segments_without_values_have_a_layer_each_and_bad_values_are_told() {
        let old = "Segment0_Name:=liver\nSegment1_Name:=aorta\nSegment1_Extent:=0 1 0 1 0 1\n";
        let found = of_nrrd(old.as_bytes()).segments;
        let places: Vec<_> =
            found.iter().map(|s| (s.layer, s.value, s.names[0].as_str())).collect();
        assert_eq!(places, [(0, 1, "liver"), (1, 1, "aorta")]);
        let bad = "Segment0_Name:=a\nSegment0_LabelValue:=-1\nSegment1_Name:=b\nSegment1_LabelValue:=2\n\
            Segment2_Name:=c\nSegment2_LabelValue:=2\nSegment3_Name:=d\n\
            Segment3_LabelValue:=99999999999999999999\n";
        let found = of_nrrd(bad.as_bytes()).unite();
        assert_eq!(found.segments.len(), 1);
        let remarks = found.remarks.join("\n");
        for part in ["`a`: its value, -1", "`d`: its value, 9999", "`c`: has the value 2 of `b`"] {
            assert!(remarks.contains(part), "{part}: {remarks}");
        }
    }

    #[test]
    fn label_tables_in_nifti_are_read() {
        let xml = "<?xml version=\"1.0\"?> <CaretExtension><VolumeInformation><LabelTable>\
            <Label Key=\"1\" Red=\"1\"><![CDATA[spleen]]></Label>\n<Label Key=\"0\">none</Label>\
            <Label Key=\"5\"><![CDATA[liver]]></Label></LabelTable></VolumeInformation></CaretExtension>   ";
        let mut bytes = vec![0; NIFTI + 12];
        bytes.extend(xml.as_bytes());
        bytes[..4].copy_from_slice(&348i32.to_le_bytes());
        let end = bytes.len() as f32;
        bytes[108..112].copy_from_slice(&end.to_le_bytes());
        let found = of_nifti(&bytes);
        let names: Vec<_> = found.iter().map(|s| (s.value, s.names[0].as_str())).collect();
        assert_eq!(names, [(1, "spleen"), (5, "liver")]);
        // Offsets that lie outside, or before the extension, are passed over.
        for end in [f32::NAN, -1.0, 1e30, 10.0] {
            bytes[108..112].copy_from_slice(&end.to_le_bytes());
            let _ = of_nifti(&bytes);
        }
        assert!(of_nifti(&[]).is_empty());
    }
}
