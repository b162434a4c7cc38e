//! Settings of strain: how images are compared, and what its colours show.

use super::group;
use super::units::{DURATION, LENGTH};

group! {
    /// Strain.
    pub struct Strain in "strain" {
        /// Time from the first of the two images that are compared to the second, which is shown.
        interval: f64 = 0.02, Facts::quantity(&DURATION, 1e-4, 10.0).label("Interval").usual(0.005, 0.1);
        /// Length of the echoes that are compared.
        window: f64 = 3.0, Facts::quantity(&LENGTH, 0.2, 30.0).label("Window").usual(1.0, 8.0);
        /// Farthest way along the scanlines that tissue is looked for.
        reach: f64 = 2.0, Facts::quantity(&LENGTH, 0.05, 20.0).label("Reach").usual(0.2, 5.0);
        /// Length over which the way is fitted by a line, whose slope is the strain.
        length: f64 = 5.0, Facts::quantity(&LENGTH, 0.2, 50.0).label("Length of fit").usual(2.0, 15.0);
        /// Strain at both ends of the colours: compressed along the scanline in blue, stretched in red.
        range: f64 = 0.02, Facts::number(1e-4, 2.0).label("Range").usual(0.001, 0.3);
        /// How alike echoes have to be, 0 to 1, to be coloured.
        likeness: f64 = 0.7, Facts::number(0.0, 1.0).label("Likeness");
    }
}
