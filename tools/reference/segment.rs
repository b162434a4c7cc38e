//! A straight part of a path, in f64.

use glam::DVec3;

use insonify::sim::layout::{self, REFLECTED};

/// See [`layout::Segment`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start, world mm.
    pub origin: DVec3,
    /// Length, mm.
    pub length: f64,
    /// Unit direction.
    pub direction: DVec3,
    /// One-way time at the start, us.
    pub time: f64,
    /// Unit lateral axis carried along the path.
    pub lateral: DVec3,
    /// One-way intensity weight at the start.
    pub weight: f64,
    /// Lateral variance a + 2 b x + c x^2 after rough reflections: a mm^2, b mm, c.
    pub spread: [f64; 3],
    /// Lateral offset a + b x + c x^2, mm, of what comes one deviation beside the beam's axis, by surfaces that bend its
    /// wavefront.
    pub lens: [f64; 3],
    /// Distance of the neighbouring scanline's path, mm, and its growth per mm.
    pub strip: [f64; 2],
    /// True if it was reflected on the way to its start.
    pub reflected: bool,
    /// Share of the path among those that replace it.
    pub share: f64,
    /// Index of the tissue.
    pub tissue: u32,
    /// Index of the instance, or NONE in the background.
    pub instance: u32,
    /// Line e * scanlines + l.
    pub line: u32,
    /// Elevation axis = handedness * cross(direction, lateral).
    pub handedness: f64,
}

impl From<&layout::Segment> for Segment {
    fn from(s: &layout::Segment) -> Self {
        let xyz = |v: [f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
        Self {
            origin: xyz(s.origin_length),
            length: s.origin_length[3].into(),
            direction: xyz(s.direction_time),
            time: s.direction_time[3].into(),
            lateral: xyz(s.lateral_weight),
            weight: s.lateral_weight[3].into(),
            spread: [s.spread[0].into(), s.spread[1].into(), s.spread[2].into()],
            lens: [s.lens[0].into(), s.lens[1].into(), s.lens[2].into()],
            strip: [s.strip.abs().into(), s.lens[3].into()],
            reflected: s.line & REFLECTED != 0,
            share: s.spread[3].into(),
            tissue: s.tissue,
            instance: s.instance,
            line: s.line & !REFLECTED,
            handedness: f64::from(s.strip).signum(),
        }
    }
}

impl From<&Segment> for layout::Segment {
    fn from(s: &Segment) -> Self {
        let pack = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
        Self {
            origin_length: pack(s.origin, s.length),
            direction_time: pack(s.direction, s.time),
            lateral_weight: pack(s.lateral, s.weight),
            spread: pack(DVec3::from(s.spread), s.share),
            lens: pack(DVec3::from(s.lens), s.strip[1]),
            tissue: s.tissue,
            instance: s.instance,
            line: s.line | if s.reflected { REFLECTED } else { 0 },
            strip: (s.handedness * s.strip[0]) as f32,
        }
    }
}
