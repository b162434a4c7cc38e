//! Images of indices, as PNG: of 8-bit grey levels, which every program reads as the numbers that they are, or with a
//! palette, in which a viewer shows colours. Programs that take a palette's colours for grey levels read other numbers.

use std::path::Path;

use super::files;

/// The index of pixels that show nothing; transparent.
pub const NOTHING: u8 = 255;

/// A PNG file of `indices` as 8-bit grey levels, row by row, with a `text` under the keyword `insonify`; `size` is width and
/// height.
///
/// # Panics
/// When there is not one index per pixel.
pub fn plain([width, height]: [u32; 2], indices: &[u8], text: &str) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    finished(encoder, indices, text);
    out
}

/// Writes an image's indices.
fn finished(mut encoder: png::Encoder<'_, &mut Vec<u8>>, indices: &[u8], text: &str) {
    encoder.set_depth(png::BitDepth::Eight);
    let added = encoder.add_itxt_chunk("insonify".into(), text.into());
    added.expect("nothing is written yet");
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(indices)?;
        writer.finish()
    });
    written.expect("one byte per pixel, into memory");
}

/// Writes [`bytes`] as the file `path`, whole or not at all.
///
/// # Panics
/// Those of [`bytes`].
///
/// # Errors
/// Errors of the file system.
pub fn write(
    path: &Path,
    size: [u32; 2],
    indices: &[u8],
    colours: &[[u8; 3]],
    text: &str,
) -> std::io::Result<()> {
    files::replace(path, &bytes(size, indices, colours, text))
}

/// A PNG file of `indices`, row by row, with a colour for each of them (sRGB; of those without one black), and a `text`
/// under the keyword `insonify`; `size` is width and height.
///
/// # Panics
/// When there is not one index per pixel, or there are more colours than indices below [`NOTHING`].
pub fn bytes(
    [width, height]: [u32; 2],
    indices: &[u8],
    colours: &[[u8; 3]],
    text: &str,
) -> Vec<u8> {
    assert!(
        colours.len() <= usize::from(NOTHING),
        "an index for each of {} colours",
        colours.len()
    );
    let mut palette = colours.concat();
    palette.resize(3 * 256, 0);
    let mut opacity = [255; 256];
    opacity[usize::from(NOTHING)] = 0;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(palette);
    encoder.set_trns(&opacity[..]);
    finished(encoder, indices, text);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_numbers_are_those_that_every_reader_has() {
        let file = plain([3, 1], &[1, NOTHING, 0], "{}");
        let shown = image::load_from_memory(&file).unwrap();
        assert_eq!(shown.color(), image::ColorType::L8);
        assert_eq!(shown.into_luma8().into_raw(), [1, NOTHING, 0]);
    }

    #[test]
    fn numbers_and_colours_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        write(&path, [3, 1], &[1, NOTHING, 0], &[[9, 8, 7], [1, 2, 3]], "{}").unwrap();
        let shown = image::open(&path).unwrap().into_rgba8();
        assert_eq!(shown.into_raw(), [1, 2, 3, 255, 0, 0, 0, 0, 9, 8, 7, 255]);
        let mut decoder =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
        decoder.set_transformations(png::Transformations::IDENTITY);
        let mut reader = decoder.read_info().unwrap();
        let mut indices = [0; 3];
        reader.next_frame(&mut indices).unwrap();
        assert_eq!(indices, [1, NOTHING, 0]);
        assert_eq!(reader.info().utf8_text[0].get_text().unwrap(), "{}");
    }
}
