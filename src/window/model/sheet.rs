//! The marks on the image, measurements and texts: the pointer makes, moves and removes them.

mod mark;

use glam::DVec2;

use super::calipers::{Caliper, CaliperKind};
pub use mark::{Mark, Marks, Moment, Note, What};

/// The pointer's tool on the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// Makes a measurement.
    Measure(CaliperKind),
    /// Places a text.
    Note,
}

/// The tool whose points are as many as the user likes.
const TRACE: Tool = Tool::Measure(CaliperKind::Trace);
/// Most points of an outline.
const MOST: usize = 4096;

/// A point of a mark: both indices.
pub type Handle = (usize, usize);

/// An unfinished mark.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// The tool that makes it.
    pub tool: Tool,
    /// Points so far, mm.
    pub points: Vec<DVec2>,
    of: Moment,
}

/// All marks, and the state of the pointer.
#[derive(Default)]
pub struct Sheet {
    all: Marks,
    tool: Option<Tool>,
    draft: Option<Draft>,
    /// Last position of the pointer, mm.
    pointer: DVec2,
    selected: Option<Handle>,
    /// Vector from the pointer to the selected point that follows it, mm.
    held: Option<DVec2>,
    /// Least distance between points of an outline that is drawn with the button held, mm.
    tracing: Option<f64>,
    /// True once such a point was added.
    drawn: bool,
    editing: Option<usize>,
}

impl Sheet {
    /// The marks on the image, in the order of their making.
    pub fn marks(&self) -> &[Mark] {
        &self.all.shown
    }

    /// The marks on the image, and what the worksheet has of earlier ones.
    pub fn all(&self) -> &Marks {
        &self.all
    }

    /// Puts other marks in the place of these, which are returned; the tool stays.
    pub fn put(&mut self, all: Marks) -> Marks {
        let tool = self.tool;
        std::mem::replace(self, Self { tool, all, ..Self::default() }).all
    }

    /// Takes all marks off the image, as scanners do when the image goes live. Measurements with a name stay for the
    /// worksheet: the report has those of several images.
    pub fn retire(&mut self) {
        self.stop_editing();
        let Marks { shown, mut kept } = std::mem::take(&mut self.all);
        kept.extend(shown.into_iter().filter(Mark::is_named));
        self.put(Marks { shown: Vec::new(), kept });
    }

    /// Removes a mark by its place in [`Marks::iter`], on the image or not.
    pub fn strike(&mut self, place: usize) {
        match place.checked_sub(self.all.kept.len()) {
            Some(shown) => self.remove(shown),
            None => drop(self.all.kept.remove(place)),
        }
    }

    /// Removes all named measurements, on the image and off it.
    pub fn strike_all(&mut self) {
        let Marks { mut shown, .. } = std::mem::take(&mut self.all);
        shown.retain(|mark| !mark.is_named());
        self.put(Marks { shown, kept: Vec::new() });
    }

    /// Returns whether a mark is being dragged or its text typed.
    pub fn is_busy(&self) -> bool {
        self.held.is_some() || self.editing.is_some()
    }

    /// The pointer's tool.
    pub fn tool(&self) -> Option<Tool> {
        self.tool
    }

    /// Takes a tool, or none. An unfinished mark is dropped.
    pub fn take(&mut self, tool: Option<Tool>) {
        self.tool = tool;
        self.draft = None;
        (self.tracing, self.drawn) = (None, false);
        self.stop_editing();
    }

    /// Takes a tool, or puts it away where it is the present one.
    pub fn toggle(&mut self, tool: Tool) {
        self.take((self.tool != Some(tool)).then_some(tool));
    }

    /// The unfinished mark, as if finished at the pointer's position.
    pub fn draft(&self) -> Option<Draft> {
        let mut draft = self.draft.clone()?;
        draft.points.push(self.pointer);
        Some(draft)
    }

    /// Returns whether a mark is unfinished.
    pub fn is_drawing(&self) -> bool {
        self.draft.is_some()
    }

    /// The point that keys move.
    pub fn selected(&self) -> Option<Handle> {
        self.selected
    }

    /// The note whose text is being typed.
    pub fn editing(&self) -> Option<usize> {
        self.editing
    }

    /// Selects a mark by its last point.
    pub fn select(&mut self, mark: usize) {
        if let Some(found) = self.all.shown.get(mark) {
            self.selected = Some((mark, found.points().len() - 1));
        }
    }

    /// Selects nothing.
    pub fn deselect(&mut self) {
        (self.selected, self.held) = (None, None);
    }

    /// Takes a point with the pointer at a place, mm: both move together from then on.
    pub fn hold(&mut self, handle: Handle, at: DVec2) {
        let (mark, point) = handle;
        self.stop_editing();
        self.selected = Some(handle);
        self.held = Some(self.all.shown[mark].points()[point] - at);
    }

    /// Handles the button going down at a place, mm; a point within `reach` mm of it is meant.
    pub fn press(&mut self, at: DVec2, reach: f64, of: Moment) {
        self.stop_editing();
        self.pointer = at;
        if let Some(draft) = &self.draft {
            if draft.tool == TRACE {
                // Back at its beginning, or twice at one place: the outline is closed.
                let ends = [draft.points[0], draft.points[draft.points.len() - 1]];
                if ends.iter().any(|end| end.distance(at) <= reach) {
                    return self.close();
                }
                self.tracing = Some(reach / 2.0);
            }
            return self.add(at);
        }
        self.deselect();
        if let Some(handle) = self.near(at, reach) {
            self.hold(handle, at);
        } else if let Some(tool) = self.tool {
            let points = vec![at];
            self.draft = Some(Draft { tool, points, of });
            self.tracing = (tool == TRACE).then_some(reach / 2.0);
        }
    }

    /// Handles the pointer moving to a place, mm.
    pub fn motion(&mut self, at: DVec2) {
        self.pointer = at;
        if let (Some(apart), Some((mark, point))) = (self.held, self.selected) {
            self.all.shown[mark].drag(point, at + apart);
        }
        if let (Some(step), Some(draft)) = (self.tracing, &mut self.draft)
            && draft.points[draft.points.len() - 1].distance(at) > step
            && draft.points.len() < MOST
        {
            draft.points.push(at);
            self.drawn = true;
        }
    }

    /// Handles the button going up: a point where it went down and another one here, if the pointer moved
    /// farther than `reach` mm.
    pub fn release(&mut self, at: DVec2, reach: f64) {
        self.motion(at);
        self.held = None;
        self.tracing = None;
        let Some(draft) = &self.draft else { return };
        if draft.tool == TRACE {
            // A stroke is an outline; a click is one point of it.
            if std::mem::take(&mut self.drawn) {
                self.close();
            }
            return;
        }
        let last = *draft.points.last().expect("the first point made it");
        if draft.tool == Tool::Note || last.distance(at) > reach {
            self.add(at);
        }
    }

    fn add(&mut self, at: DVec2) {
        let Some(draft) = &mut self.draft else { return };
        draft.points.push(at);
        let what = match draft.tool {
            Tool::Measure(kind) if kind.points().is_none_or(|all| draft.points.len() < all) => {
                return;
            }
            Tool::Measure(kind) => What::Caliper(Caliper::new(kind, draft.points.clone())),
            Tool::Note => {
                let tip = draft.points[0];
                self.editing = Some(self.all.shown.len());
                // A click places the text itself, a drag moves the text away from its arrow's tip.
                let arrow = (tip != at).then_some(tip);
                let text = String::new();
                What::Note(Note { text, at, arrow })
            }
        };
        self.finish(what);
    }

    /// Closes the outline that is being traced; drops one that encloses nothing.
    pub fn close(&mut self) {
        let traced = self.draft.as_ref().filter(|draft| draft.tool == TRACE);
        let Some(points) = traced.map(|draft| draft.points.clone()) else {
            return;
        };
        match points.len() < 3 {
            true => self.draft = None,
            false => self.finish(What::Caliper(Caliper::new(CaliperKind::Trace, points))),
        }
    }

    /// Puts what was drafted among the marks.
    fn finish(&mut self, what: What) {
        let Some(draft) = self.draft.take() else { return };
        let letter = self.letter();
        self.all.shown.push(Mark { letter, what, of: draft.of });
        self.select(self.all.shown.len() - 1);
    }

    /// The first letter that no mark has.
    fn letter(&self) -> char {
        let mut letters = 'A'..='Z';
        let free = letters.find(|letter| self.all.shown.iter().all(|m| m.letter != *letter));
        free.unwrap_or('Z')
    }

    /// The point nearest to a place, within `reach` mm.
    pub fn near(&self, at: DVec2, reach: f64) -> Option<Handle> {
        let points = self.all.shown.iter().enumerate().flat_map(|(index, mark)| {
            let points = mark.points().into_iter().enumerate();
            points.map(move |(point, place)| ((index, point), place.distance(at)))
        });
        let within = points.filter(|(_, distance)| *distance <= reach);
        let nearest = within.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(handle, _)| handle)
    }

    /// Moves the selected point; returns whether there is one.
    pub fn nudge(&mut self, by: DVec2) -> bool {
        let Some((mark, point)) = self.selected else {
            return false;
        };
        let to = self.all.shown[mark].points()[point] + by;
        self.all.shown[mark].drag(point, to);
        true
    }

    /// Drops the unfinished mark, else the selection, else the tool; returns whether there was one.
    pub fn cancel(&mut self) -> bool {
        if self.editing.is_some() {
            self.stop_editing();
        } else if self.draft.is_some() {
            self.draft = None;
        } else if self.selected.is_some() {
            self.selected = None;
        } else {
            return self.tool.take().is_some();
        }
        true
    }

    /// Removes the mark whose point is selected; returns whether there is one.
    pub fn delete(&mut self) -> bool {
        let Some((mark, _)) = self.selected.take() else {
            return false;
        };
        self.remove(mark);
        true
    }

    /// Removes a mark.
    pub fn remove(&mut self, mark: usize) {
        (self.selected, self.editing, self.held) = (None, None, None);
        self.all.shown.remove(mark);
    }

    /// Removes all marks on the image.
    pub fn clear(&mut self) {
        let kept = std::mem::take(&mut self.all.kept);
        self.put(Marks { shown: Vec::new(), kept });
    }

    /// Names a measurement, or sets the text of a note.
    pub fn set_text(&mut self, mark: usize, text: String) {
        match &mut self.all.shown[mark].what {
            What::Caliper(caliper) => caliper.label = text,
            What::Note(note) => note.text = text,
        }
    }

    /// Starts editing the text of a note.
    pub fn edit(&mut self, mark: usize) {
        self.stop_editing();
        self.select(mark);
        self.editing = Some(mark);
    }

    /// Ends editing and keeps the text; removes a note without one.
    pub fn stop_editing(&mut self) {
        let Some(mark) = self.editing.take() else {
            return;
        };
        if let What::Note(note) = &self.all.shown[mark].what
            && note.text.trim().is_empty()
        {
            self.remove(mark);
        }
    }
}

#[cfg(test)]
mod tests;
