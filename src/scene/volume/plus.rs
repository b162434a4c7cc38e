//! Elements of configurations of PLUS (`PlusDeviceSet_*.xml`), with places for what is wrong in them.

use std::path::Path;
use std::str::FromStr;

use glam::DAffine3;
use roxmltree::{Document, Node};

use super::{Transforms, transform};
use crate::issue::{self, FileError};

/// Longest configuration, bytes.
const MAX_CONFIG: u64 = 4 << 20;

/// An element and its file.
#[derive(Clone, Copy)]
pub struct Element<'d> {
    /// The element.
    pub node: Node<'d, 'd>,
    path: &'d Path,
}

/// Text of a configuration, for [`Element::root`].
///
/// # Errors
/// The fault of the file.
pub fn text(path: &Path) -> Result<String, FileError> {
    let bytes = issue::read(path, MAX_CONFIG, "give a configuration of PLUS")?;
    let declared = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
    String::from_utf8(bytes).or_else(|fault| {
        let (good, bytes) = (fault.utf8_error().valid_up_to(), fault.into_bytes());
        // Latin-1 has the first 256 characters of Unicode.
        let latin = ["\"iso-8859-1\"", "'iso-8859-1'", "\"latin1\"", "'latin1'"];
        if latin.iter().any(|name| declared.contains(&format!("encoding={name}"))) {
            return Ok(bytes.into_iter().map(char::from).collect());
        }
        let line = 1 + bytes[..good].iter().filter(|&&byte| byte == b'\n').count();
        let message = "has a character that is no UTF-8, and does not say that it is in ISO-8859-1";
        Err(FileError::line(path, line, message, "save it as UTF-8"))
    })
}

/// The XML of a configuration.
///
/// # Errors
/// It is none.
pub fn parse<'t>(path: &Path, text: &'t str) -> Result<Document<'t>, FileError> {
    Document::parse(text).map_err(|e| {
        let line = e.pos().row as usize;
        FileError::line(path, line, format!("is no XML: {e}"), "correct it")
    })
}

impl<'d> Element<'d> {
    /// The outermost element of the file at `path`.
    pub fn root(path: &'d Path, document: &'d Document<'d>) -> Self {
        Self { node: document.root_element(), path }
    }

    /// The elements of a name inside this one, at any depth.
    pub fn named(&self, name: &'static str) -> impl Iterator<Item = Self> + use<'d> {
        let path = self.path;
        let nodes = self.node.descendants().filter(move |n| n.has_tag_name(name));
        nodes.map(move |node| Self { node, path })
    }

    /// The transforms of the `CoordinateDefinitions` inside it.
    ///
    /// # Errors
    /// A matrix that is none or singular, or one that leads from or to nothing.
    pub fn transforms(&self) -> Result<Transforms, FileError> {
        let mut out = Transforms::default();
        for element in self.named("Transform") {
            // Transforms in other parts of a configuration have no matrix.
            if let Some(matrix) = element.matrix("Matrix")? {
                out.add(element.need("From")?, element.need("To")?, matrix);
            }
        }
        Ok(out)
    }

    /// An error on its line.
    pub fn error(&self, message: impl Into<String>, remedy: &str) -> FileError {
        let line = self.node.document().text_pos_at(self.node.range().start).row as usize;
        let message = format!("`{}`: {}", self.node.tag_name().name(), message.into());
        FileError::line(self.path, line, message, remedy)
    }

    /// An error in an attribute.
    pub fn wrong(&self, name: &str, cause: &str, remedy: &str) -> FileError {
        let value: String =
            self.node.attribute(name).unwrap_or_default().chars().take(60).collect();
        self.error(format!("`{name}` is `{value}`: {cause}"), remedy)
    }

    /// An attribute that has to be there.
    ///
    /// # Errors
    /// It is missing.
    pub fn need(&self, name: &str) -> Result<&'d str, FileError> {
        self.node.attribute(name).ok_or_else(|| self.error(format!("lacks `{name}`"), "add it"))
    }

    /// A transform of 16 numbers, where the attribute is there.
    ///
    /// # Errors
    /// It is none, or singular.
    pub fn matrix(&self, name: &str) -> Result<Option<DAffine3>, FileError> {
        let Some(text) = self.node.attribute(name) else { return Ok(None) };
        let matrix = transform(text)
            .map_err(|cause| self.wrong(name, cause, "write 16 numbers, row by row"))?;
        match matrix.matrix3.determinant().abs() < 1e-12 {
            true => Err(self.wrong(name, "is singular", "correct it")),
            false => Ok(Some(matrix)),
        }
    }

    /// N numbers, where the attribute is there.
    ///
    /// # Errors
    /// Others, or another number of them.
    pub fn numbers<T: FromStr, const N: usize>(
        &self,
        name: &str,
    ) -> Result<Option<[T; N]>, FileError> {
        let Some(text) = self.node.attribute(name) else { return Ok(None) };
        let values: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
        let values = values.and_then(|v| <[T; N]>::try_from(v).ok());
        let wrong = || self.wrong(name, "does not fit", &format!("write {N} numbers"));
        values.ok_or_else(wrong).map(Some)
    }

    /// The value of a word, where the attribute is there.
    ///
    /// # Errors
    /// A word that is not known.
    pub fn choice<T: Copy>(&self, name: &str, known: &[(&str, T)]) -> Result<Option<T>, FileError> {
        let Some(word) = self.node.attribute(name) else { return Ok(None) };
        let found = known.iter().find(|(w, _)| w.eq_ignore_ascii_case(word));
        let words: Vec<_> = known.iter().map(|(w, _)| *w).collect();
        let remedy = format!("write one of {}", words.join(", "));
        let value = found.ok_or_else(|| self.wrong(name, "cannot be done", &remedy))?;
        Ok(Some(value.1))
    }
}
