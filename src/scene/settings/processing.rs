//! Settings of the display chain: what is done with the log-compressed scanlines before they are shown.

use super::group;

group! {
    /// The display chain. Without it scanlines are shown as they were detected.
    pub struct Processing in "processing" {
        /// Share of the speckle that is smoothed away, by the filter of Lee (1980): where greys vary as much as speckle
        /// alone does, the mean of the neighbourhood is shown; where they vary more, as at borders, they stay.
        speckle_reduction: f64 = 0.0,
            Facts::number(0.0, 1.0).label("Speckle reduction");
        /// Factor, less 1, on what a sample differs from the mean of its neighbourhood by: unsharp masking. Borders become
        /// sharper, and speckle stands out more.
        edge_enhancement: f64 = 0.0,
            Facts::number(0.0, 4.0).label("Edge enhancement").usual(0.0, 2.0);
        /// Size of the neighbourhood that both look at: its standard deviation over that of the point-spread function,
        /// along and across the scanlines.
        neighbourhood: f64 = 1.0,
            Facts::number(0.25, 4.0).label("Neighbourhood").usual(0.5, 2.0);
    }
}

impl Processing {
    /// True if it changes anything.
    pub fn is_on(&self) -> bool {
        self.speckle_reduction > 0.0 || self.edge_enhancement > 0.0
    }
}
