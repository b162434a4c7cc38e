//! A contact sheet of samples with their segmentation in colour.

use image::{GrayImage, Luma, Rgb, RgbImage, imageops};

use super::DatasetError;
use super::members::colours;
use super::plan::{Part, Plan};
use super::store::Store;
use super::studio::{Made, Studio};
use crate::output::sheet::{Sheet, Tile};

/// Most samples of a sheet.
const MOST: usize = 64;
/// Samples side by side.
const COLUMNS: usize = 8;
/// Largest height of an image on the sheet, px.
const HEIGHT: u32 = 160;
/// Names of classes in a tile.
const LINES: usize = 10;
/// Share of the class's colour in a pixel of the segmented image.
const SHARE: f64 = 0.45;

/// Samples for a contact sheet, spread evenly over those of a shard.
pub struct Gallery<'p> {
    plan: &'p Plan,
    /// Each with its image and classes, once they are known.
    places: Vec<(Part, u32, Option<[GrayImage; 2]>)>,
}

impl<'p> Gallery<'p> {
    /// A gallery of the samples of `parts`.
    pub fn new(plan: &'p Plan, parts: &[Part]) -> Self {
        let count: usize = parts.iter().map(|p| p.samples.len()).sum();
        let shown = count.min(MOST);
        let all = || parts.iter().flat_map(|part| part.samples.clone().map(move |n| (part, n)));
        let places =
            all().enumerate().filter(|(i, _)| (i * shown) / count != ((i + 1) * shown) / count);
        Self {
            plan,
            places: places.map(|(_, (part, number))| (part.clone(), number, None)).collect(),
        }
    }

    /// Takes a sample if it belongs on the sheet.
    pub fn take(&mut self, made: &Made) {
        let wanted = self.places.iter_mut().find(|(_, number, _)| *number == made.sample.number);
        if let Some((.., pictures)) = wanted {
            let (width, height) = made.image.dimensions();
            let classes = GrayImage::from_raw(width, height, made.segmentation.clone());
            *pictures = Some(small([made.image.clone(), classes.expect("a byte per pixel")]));
        }
    }

    /// Draws the sheet. Samples that it has not seen are read from the folder or, where no format there can be read,
    /// made again.
    ///
    /// # Errors
    /// A file that cannot be read, a sample that cannot be made.
    pub fn draw(
        mut self,
        store: &Store<'_>,
        studio: &mut Studio<'_>,
    ) -> Result<RgbImage, DatasetError> {
        for place in 0..self.places.len() {
            let (part, number, pictures) = &self.places[place];
            if pictures.is_none() {
                match store.pictures(part, *number)? {
                    Some(read) => self.places[place].2 = Some(small(read)),
                    None => {
                        let made = studio.make(*number)?;
                        self.take(&made);
                    }
                }
            }
        }
        Ok(self.page(store))
    }

    fn page(&self, store: &Store<'_>) -> RgbImage {
        let plan = self.plan;
        let pictures = || self.places.iter().map(|(.., p)| p.as_ref().expect("all are there"));
        // Image and segmented image side by side.
        let pairs: Vec<GrayImage> = pictures().map(|[image, _]| twice(image)).collect();
        let captions = self.places.iter().map(|(_, number, _)| {
            let scene =
                plan.scenes.iter().find(|s| s.samples.contains(number)).expect("a scene's sample");
            format!("{} {} {}", store.name(*number), plan.splits[scene.split].name, scene.name)
        });
        let tiles = captions.zip(&pairs).map(|(caption, image)| Tile::Image { caption, image });
        let mut tiles: Vec<_> = tiles.collect();
        // Room for the colour before each name.
        let legend: Vec<_> = plan.classes.iter().map(|name| format!("   {name}")).collect();
        tiles.extend(legend.chunks(LINES).map(|lines| Tile::Text(lines.to_vec())));
        let sheet = Sheet { title: plan.title.clone(), columns: COLUMNS.min(tiles.len()), tiles };
        let drawn = sheet.draw();
        let colours = colours(plan);
        let mut page = RgbImage::from_fn(drawn.image.width(), drawn.image.height(), |x, y| {
            Rgb([drawn.image.get_pixel(x, y).0[0]; 3])
        });
        for (place, [image, classes]) in drawn.places.iter().zip(pictures()) {
            for (x, y, Luma([class])) in classes.enumerate_pixels() {
                let Some(colour) = colours.get(usize::from(*class)) else { continue };
                let at = page.get_pixel_mut(place[0] + image.width() + x, place[1] + y);
                let own = colour.map(f64::from);
                let mixed = |i: usize| (1.0 - SHARE) * f64::from(at.0[i]) + SHARE * own[i];
                *at = Rgb([0, 1, 2].map(|i| mixed(i).round() as u8));
            }
        }
        let edge = drawn.line * 2 / 3;
        for (entry, colour) in colours.iter().enumerate() {
            let [left, top] = drawn.places[self.places.len() + entry / LINES];
            let line = (entry % LINES) as u32;
            for (x, y) in (0..edge).flat_map(|x| (0..edge).map(move |y| (x, y))) {
                let at = (left + x, top + line * drawn.line + drawn.line / 6 + y);
                if let Some(pixel) = page.get_pixel_mut_checked(at.0, at.1) {
                    *pixel = Rgb(*colour);
                }
            }
        }
        page
    }
}

/// An image and its classes, no higher than a tile.
fn small([image, classes]: [GrayImage; 2]) -> [GrayImage; 2] {
    if image.height() <= HEIGHT {
        return [image, classes];
    }
    let width =
        (u64::from(image.width()) * u64::from(HEIGHT) / u64::from(image.height())).max(1) as u32;
    let resized = |of: &GrayImage, filter| imageops::resize(of, width, HEIGHT, filter);
    [
        resized(&image, imageops::FilterType::Triangle),
        resized(&classes, imageops::FilterType::Nearest),
    ]
}

fn twice(image: &GrayImage) -> GrayImage {
    let mut out = GrayImage::new(2 * image.width(), image.height());
    imageops::replace(&mut out, image, 0, 0);
    imageops::replace(&mut out, image, i64::from(image.width()), 0);
    out
}
