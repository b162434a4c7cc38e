//! Pictures that say how large they are and what they show.

/// The grey levels of RGBA pixels that are grey: their red.
pub fn grey(rgba: &[u8]) -> impl Iterator<Item = u8> {
    rgba.chunks_exact(4).map(|pixel| pixel[0])
}

/// A PNG file in 8-bit grey, the red channel of `rgba`: pixels of `pitch` mm (`pHYs`), and a text under the
/// keyword `insonify` (`iTXt`).
///
/// # Panics
/// When `rgba` has not `4 * width * height` bytes.
pub fn grey_png([width, height]: [u32; 2], rgba: &[u8], pitch: f64, text: Option<&str>) -> Vec<u8> {
    let grey: Vec<u8> = grey(rgba).collect();
    encoded([width, height], png::ColorType::Grayscale, &grey, pitch, text)
}

/// The PNG of the colours of RGBA pixels whose edges are `pitch` mm, with `text` in it as [`grey_png`] has it.
pub fn colour_png(size: [u32; 2], rgba: &[u8], pitch: f64, text: Option<&str>) -> Vec<u8> {
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    encoded(size, png::ColorType::Rgb, &rgb, pitch, text)
}

fn encoded(
    [width, height]: [u32; 2],
    kind: png::ColorType,
    pixels: &[u8],
    pitch: f64,
    text: Option<&str>,
) -> Vec<u8> {
    let per_metre = (1000.0 / pitch).round() as u32;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(kind);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    if let Some(text) = text {
        let added = encoder.add_itxt_chunk("insonify".into(), text.into());
        added.expect("nothing is written yet");
    }
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(pixels)?;
        writer.finish()
    });
    written.expect("as many bytes as its pixels have, into memory");
    out
}

#[cfg(test)]
mod tests {
    use super::grey_png;

    #[test]
    fn a_picture_keeps_its_greys_and_says_what_it_is() {
        let rgba: Vec<u8> = (0..=255).flat_map(|g| [g, g, g, 255]).collect();
        let text = "{\"title\": \"Fœtus\"}";
        let png = grey_png([32, 8], &rgba, 0.2, Some(text));
        let back = image::load_from_memory(&png).expect("a PNG").to_luma8();
        assert_eq!(back.into_raw(), (0..=255).collect::<Vec<u8>>());
        let chunks = chunks(&png);
        let kinds: Vec<&str> = chunks.iter().map(|c| c.0).collect();
        assert_eq!(kinds, ["IHDR", "pHYs", "iTXt", "IDAT", "IEND"]);
        assert_eq!(chunks[1].1, [0, 0, 0x13, 0x88, 0, 0, 0x13, 0x88, 1], "5000 a metre");
        let (keyword, rest) = chunks[2].1.split_at(13);
        assert_eq!((keyword, rest), (&b"insonify\0\0\0\0\0"[..], text.as_bytes()));
    }

    /// Type and content of each, with the sum that the format's own program computes (PNG, third
    /// edition, annex D): independent of the one that wrote it.
    fn chunks(mut png: &[u8]) -> Vec<(&str, &[u8])> {
        let word = |bytes: &[u8]| u32::from_be_bytes(bytes[..4].try_into().unwrap());
        let mut out = Vec::new();
        png = &png[8..];
        while !png.is_empty() {
            let length = word(png) as usize;
            let body = &png[4..8 + length];
            let sum = body.iter().fold(u32::MAX, |sum, &byte| {
                (0..8).fold(sum ^ u32::from(byte), |c, _| {
                    if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 }
                })
            });
            assert_eq!(!sum, word(&png[8 + length..]));
            out.push((std::str::from_utf8(&body[..4]).unwrap(), &body[4..]));
            png = &png[12 + length..];
        }
        out
    }
}
