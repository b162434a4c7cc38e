//! Contact sheets: images side by side on one page, each with its caption.

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};
use image::{GrayImage, Luma, imageops};

/// Grey level of the page, and of the text on it: paper and ink.
const PAPER: u8 = 255;
const INK: u8 = 0;
/// Grey level of the frame around each image: without it a white mask would have no visible end.
const LINE: u8 = 128;
/// Smallest letters that can be read, px.
const SMALLEST: f32 = 11.0;
/// Largest letters as a share of an image's width: 26 letters of this font in a line.
const LARGEST: f32 = 1.0 / 16.0;

/// Content of one tile of a sheet.
#[derive(Clone, Debug)]
pub enum Tile<'a> {
    /// An image, shown pixel by pixel, with its caption below.
    Image {
        /// One line.
        caption: String,
        /// 8-bit grey.
        image: &'a GrayImage,
    },
    /// Lines of text.
    Text(Vec<String>),
}

/// A page of tiles, row by row.
#[derive(Clone, Debug)]
pub struct Sheet<'a> {
    /// One line above the tiles.
    pub title: String,
    /// Tiles side by side, at least 1.
    pub columns: usize,
    /// The tiles, row by row.
    pub tiles: Vec<Tile<'a>>,
}

/// A sheet that was drawn.
#[derive(Clone, Debug)]
pub struct Page {
    /// The page.
    pub image: GrayImage,
    /// Left upper corner of every tile, px.
    pub places: Vec<[u32; 2]>,
    /// Height of a line of text, px.
    pub line: u32,
}

/// Letters of one size.
struct Letters {
    font: FontRef<'static>,
    size: f32,
}

impl Letters {
    fn new(size: f32) -> Self {
        let font = FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR);
        let font = font.expect("the font is part of the program");
        Self { font, size }
    }

    /// Width of a text, px.
    fn width(&self, text: &str) -> f32 {
        let font = self.font.as_scaled(PxScale::from(self.size));
        text.chars().map(|c| font.h_advance(font.glyph_id(c))).sum()
    }

    /// Height of a line, px.
    fn line(&self) -> u32 {
        (1.4 * self.size).ceil() as u32
    }

    /// Writes one line whose left upper corner is at (`left`, `top`); text beyond the page is cut.
    fn write(&self, page: &mut GrayImage, [left, top]: [u32; 2], text: &str) {
        let font = self.font.as_scaled(PxScale::from(self.size));
        let baseline = top as f32 + 0.2 * self.size + font.ascent();
        let mut x = left as f32;
        for c in text.chars() {
            let id = font.glyph_id(c);
            let glyph = id.with_scale_and_position(self.size, point(x, baseline));
            x += font.h_advance(id);
            let Some(outline) = font.outline_glyph(glyph) else {
                continue;
            };
            let bounds = outline.px_bounds();
            outline.draw(|dx, dy, share| {
                let at = [bounds.min.x + dx as f32, bounds.min.y + dy as f32];
                if at[0] < 0.0 || at[1] < 0.0 {
                    return;
                }
                if let Some(pixel) = page.get_pixel_mut_checked(at[0] as u32, at[1] as u32) {
                    let share = share.clamp(0.0, 1.0);
                    let mixed = f32::from(pixel.0[0]) * (1.0 - share) + f32::from(INK) * share;
                    *pixel = Luma([mixed.round() as u8]);
                }
            });
        }
    }
}

impl Sheet<'_> {
    /// Draws the sheet. All tiles are as large as the largest image; letters are as large as the longest
    /// line allows.
    ///
    /// # Panics
    /// Without columns.
    pub fn draw(&self) -> Page {
        let sizes = self.tiles.iter().map(|tile| match tile {
            Tile::Image { image, .. } => image.dimensions(),
            Tile::Text(_) => (0, 0),
        });
        let (width, height) = sizes.fold((1, 1), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        let letters = self.letters(width, height);
        let title = Letters::new(1.3 * letters.size);
        let (gap, line) = (letters.size.ceil() as u32, letters.line());
        let head = match self.title.is_empty() {
            true => gap,
            false => 2 * gap + title.line(),
        };
        let columns = self.columns.min(self.tiles.len().max(1)) as u32;
        let rows = (self.tiles.len() as u32).div_ceil(columns);
        let step = [width + gap, height + line + gap];
        let mut page =
            GrayImage::from_pixel(columns * step[0] + gap, head + rows * step[1], Luma([PAPER]));
        title.write(&mut page, [gap, gap], &self.title);
        let mut places = Vec::with_capacity(self.tiles.len());
        for (i, tile) in (0..).zip(&self.tiles) {
            let place = [gap + i % columns * step[0], head + i / columns * step[1]];
            places.push(place);
            match tile {
                Tile::Image { caption, image } => {
                    let framed = (image.width() + 2, image.height() + 2);
                    let frame = GrayImage::from_pixel(framed.0, framed.1, Luma([LINE]));
                    let [x, y] = place.map(i64::from);
                    imageops::replace(&mut page, &frame, x - 1, y - 1);
                    imageops::replace(&mut page, *image, x, y);
                    letters.write(&mut page, [place[0], place[1] + height + 1], caption);
                }
                Tile::Text(lines) => {
                    for (n, text) in (0..).zip(lines) {
                        letters.write(&mut page, [place[0], place[1] + n * line], text);
                    }
                }
            }
        }
        Page { image: page, places, line }
    }

    /// Letters with which every caption fits below its image, and every text into its tile.
    fn letters(&self, width: u32, height: u32) -> Letters {
        let unit = Letters::new(1.0);
        let share = |tile: &Tile| match tile {
            Tile::Image { caption, .. } => width as f32 / unit.width(caption).max(1.0),
            Tile::Text(lines) => {
                let widest = lines.iter().map(|l| unit.width(l)).fold(1.0, f32::max);
                let deep = height as f32 / (1.4 * lines.len().max(1) as f32);
                deep.min(width as f32 / widest)
            }
        };
        let fits = self.tiles.iter().map(share).fold(f32::INFINITY, f32::min);
        Letters::new(fits.min(LARGEST * width as f32).max(SMALLEST).floor())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: u32, height: u32, offset: u8) -> GrayImage {
        GrayImage::from_fn(width, height, |x, y| {
            Luma([(x as u8).wrapping_mul(3).wrapping_add(y as u8) ^ offset])
        })
    }

    fn sheet(images: &[GrayImage], columns: usize) -> Sheet<'_> {
        let tile = |(i, image)| Tile::Image { caption: format!("{i} gain"), image };
        let mut tiles: Vec<_> = (1..).zip(images).map(tile).collect();
        tiles.insert(1, Tile::Text(vec!["as the scene says:".to_owned(); 3]));
        Sheet { title: "a sheet".to_owned(), columns, tiles }
    }

    #[test]
    fn images_lie_apart_and_are_shown_pixel_by_pixel() {
        let images: Vec<_> = (0..6).map(|i| ramp(90, 60, i)).collect();
        for columns in [1, 2, 4, 9] {
            let page = sheet(&images, columns).draw();
            assert_eq!(page.places.len(), 7);
            let mut free = page.image.clone();
            let shown = page.places.iter().enumerate().filter(|(i, _)| *i != 1);
            for (image, (_, &[x, y])) in images.iter().zip(shown) {
                let cut = imageops::crop_imm(&page.image, x, y, 90, 60).to_image();
                assert!(cut == *image, "{columns} columns");
                imageops::replace(&mut free, &GrayImage::new(90, 60), x.into(), y.into());
            }
            let again = sheet(&images, columns).draw();
            assert!(page.image == again.image, "drawn twice alike");
        }
    }

    /// Ink of a caption lies below its image, within its width, and differs from that of another.
    #[test]
    fn captions_are_written_below_their_images() {
        let images = [ramp(300, 200, 0), ramp(300, 200, 1)];
        let page = sheet(&images, 3).draw();
        let caption = |i: usize| {
            let [x, y] = page.places[i];
            imageops::crop_imm(&page.image, x, y + 200, 300, 20).to_image()
        };
        let ink = |image: &GrayImage| image.pixels().filter(|p| p.0[0] < 128).count();
        let [first, third] = [0, 2].map(caption);
        assert!(ink(&first) > 60 && ink(&third) > 60, "{}", ink(&first));
        assert!(first != third);
        let margin = imageops::crop_imm(&page.image, page.places[2][0] + 300, 0, 11, 300);
        assert_eq!(ink(&margin.to_image()), 0);
    }

    #[test]
    fn letters_are_as_large_as_the_longest_line_allows() {
        let images = [ramp(300, 200, 0)];
        let of = |caption: &str| {
            let sheet = Sheet {
                title: String::new(),
                columns: 1,
                tiles: vec![Tile::Image { caption: caption.to_owned(), image: &images[0] }],
            };
            let letters = sheet.letters(300, 200);
            (letters.size, letters.width(caption))
        };
        let (size, _) = of("7");
        assert_eq!(size, (300.0 * LARGEST).floor());
        let (size, width) = of("a caption that is nearly too long for it");
        assert!((11.0..18.0).contains(&size) && width <= 300.0, "{size} {width}");
        assert_eq!(of(&"far too long".repeat(9)).0, SMALLEST);
    }
}
