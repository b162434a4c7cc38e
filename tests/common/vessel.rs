//! Blood that flows through a vessel.

/// A vessel through the middle of an image of 40 mm, 60 degrees to the scanlines, in which blood flows away from the probe by
/// 30 cm/s in the middle: tables that stand behind those of a scene's probe.
pub const VESSEL: &str = r#"
[[mesh]]
name = "vessel"
shape = { cylinder = { radius = 5, length = 100, segments = 48 } }
tissue = "blood"
priority = 1
translate = [0, 0, 20]
rotate = { axis = [0, 1, 0], angle = "60 deg" }

[[flow]]
name = "vessel"
mesh = "vessel"
line = { from = [0, 0, -50], to = [0, 0, 50] }
speed = "30 cm/s"
"#;
