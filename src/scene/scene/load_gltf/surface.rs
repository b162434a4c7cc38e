//! Triangles of primitives, as stored.

use gltf::mesh::Mode;

use super::File;
use super::accessor::Reader;
use crate::issue::Issue;
use crate::scene::mesh::MAX_ELEMENTS;

/// Triangles of a primitive as stored, metres.
pub(super) struct Surface {
    pub positions: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

/// A reader of primitives that counts its elements.
pub(super) struct Surfaces<'a> {
    pub reader: Reader<'a>,
    pub issues: Vec<Issue>,
    elements: usize,
}

impl<'a> Surfaces<'a> {
    pub fn new(file: &'a File<'_>) -> Self {
        Self {
            reader: Reader { path: file.path, buffers: &file.buffers },
            issues: Vec::new(),
            elements: 0,
        }
    }

    pub fn warn(&mut self, count: usize, message: &str) {
        let message = format!("{message} ({count})");
        self.issues.push(Issue::warning(self.reader.path, count, message, ""));
    }

    /// Triangles of a primitive; none for points and lines.
    pub fn primitive(
        &mut self,
        name: &str,
        primitive: &gltf::Primitive<'_>,
    ) -> Result<Option<Surface>, Issue> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.warn(1, "points or lines are ignored");
            return Ok(None);
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.expect("primitives without positions were left out");
        self.elements = self.elements.saturating_add(positions.count());
        let corners = primitive.indices().map_or(0, |a| a.count() / 3);
        self.elements = self.elements.saturating_add(corners);
        if self.elements > MAX_ELEMENTS {
            return Err(Issue::error(
                self.reader.path,
                self.elements,
                format!("has more than {MAX_ELEMENTS} vertices or triangles, which are too many"),
                "reduce the mesh",
            ));
        }
        let positions = self.reader.positions(&positions).map_err(|e| e.of(name))?;
        let corners = match primitive.indices() {
            Some(indices) => self.reader.indices(&indices).map_err(|e| e.of(name))?,
            None => (0..positions.len() as u32).collect(),
        };
        self.in_range(name, &corners, positions.len())?;
        let (triangles, left_over) = assemble(mode, &corners);
        if left_over > 0 {
            self.warn(left_over, "indices that complete no triangle are ignored");
        }
        Ok(Some(Surface { positions, triangles }))
    }

    fn in_range(&self, name: &str, corners: &[u32], vertices: usize) -> Result<(), Issue> {
        let outside = corners.iter().filter(|&&i| i as usize >= vertices).count();
        if outside == 0 {
            return Ok(());
        }
        Err(Issue::error(
            self.reader.path,
            outside,
            format!("{outside} indices are out of range: there are {vertices} vertices"),
            "export it again",
        )
        .of(name))
    }
}

/// Triangles of a list, strip or fan, and the indices left over (glTF 2.0, 3.7.2.1).
pub(super) fn assemble(mode: Mode, corners: &[u32]) -> (Vec<[u32; 3]>, usize) {
    match mode {
        Mode::TriangleStrip => {
            let strip = corners.windows(3).enumerate();
            let turned = strip
                .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] });
            (turned.collect(), if corners.len() < 3 { corners.len() } else { 0 })
        }
        Mode::TriangleFan => {
            let rim = corners.get(1..).unwrap_or_default().windows(2);
            let fan = rim.map(|w| [w[0], w[1], corners[0]]);
            (fan.collect(), if corners.len() < 3 { corners.len() } else { 0 })
        }
        _ => {
            let (whole, rest) = corners.as_chunks();
            (whole.to_vec(), rest.len())
        }
    }
}
