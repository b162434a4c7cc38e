//! 3MF (3mf.io, core specification 1.3, with the references to other models of its production extension): the meshes of
//! all items of the build, placed, in the file's unit. Supports, colours, slices and lattices are not read.

use std::collections::HashMap;
use std::io::{Cursor, Read as _};
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use quick_xml::events::{BytesStart, Event};
use zip::ZipArchive;

use super::words::shown;
use super::xml::{self, attribute, number};
use super::{COPY_AGAIN, EXPORT_AGAIN, Fault, no_vertex};
use crate::issue::Issue;
use crate::scene::mesh::{MAX_ELEMENTS, MAX_FILE, Parts, Soup, Units};

/// Most files in the archive: each takes memory beside its content.
const MAX_FILES: usize = 10_000;
/// Most objects that components place, one in another.
const MAX_PLACED: u64 = 100_000;
/// Path of the model in the archive, unless the archive names another.
const MODEL: &str = "3D/3dmodel.model";

pub(in crate::scene) fn read(path: &Path, bytes: &[u8]) -> Result<Parts, Vec<Issue>> {
    let package = Package::of(bytes).and_then(Package::models);
    let placed = package.and_then(|models| models.placed().map(|parts| (models, parts)));
    let (models, parts) = placed.map_err(|fault| fault.issues(path))?;
    let message = format!("supports are ignored ({})", models.supports);
    let supports =
        (models.supports > 0).then(|| Issue::warning(path, models.supports, message, ""));
    let issues = supports.into_iter().collect();
    Ok(Parts { parts, issues, units: Some(Units(models.unit)), ..Parts::default() })
}

/// An object by the model that holds it and its number there.
type Key = (usize, u32);

/// One object inside another, or in the build.
struct Component {
    object: Key,
    placement: DAffine3,
}

#[derive(Default)]
struct Object {
    name: String,
    /// True for a support structure.
    support: bool,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    components: Vec<Component>,
}

/// The objects of all models of a package.
struct Models {
    /// Objects, each after those that it consists of.
    objects: Vec<Object>,
    /// Places among them.
    by_key: HashMap<Key, usize>,
    build: Vec<Component>,
    /// Millimetres per unit.
    unit: f64,
    supports: usize,
}

/// The archive, and which models have been named.
struct Package<'b> {
    archive: ZipArchive<Cursor<&'b [u8]>>,
    /// Paths of models in the archive, the first of which is the root; and the number of each.
    models: Vec<String>,
    numbers: HashMap<String, usize>,
    /// Bytes that may still be unpacked.
    budget: u64,
    /// Vertices and triangles so far.
    elements: usize,
    /// Objects, components and items so far.
    places: u64,
}

impl<'b> Package<'b> {
    fn of(bytes: &'b [u8]) -> Result<Self, Fault> {
        // Every file of an archive has an entry that begins so; data have it by chance, once in 4 GB.
        let files = bytes.windows(4).filter(|word| *word == b"PK\x01\x02").count();
        if files > MAX_FILES {
            let cause = format!("holds {files} files, the limit is {MAX_FILES}");
            return Err(Fault::new(cause, EXPORT_AGAIN));
        }
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|e| Fault::new(format!("is no archive as 3MF files are: {e}"), COPY_AGAIN))?;
        Ok(Self {
            archive,
            models: Vec::new(),
            numbers: HashMap::new(),
            budget: MAX_FILE,
            elements: 0,
            places: 0,
        })
    }

    /// The content of a file; none where there is no such file.
    fn content(&mut self, name: &str) -> Result<Option<Vec<u8>>, Fault> {
        let names = self.archive.file_names().flatten();
        let known = { names }.find(|known| known.eq_ignore_ascii_case(name));
        let Some(known) = known.map(|known| known.into_owned()) else { return Ok(None) };
        let broken = |e: &dyn std::fmt::Display| {
            Fault::new(format!("`{name}` in it cannot be read: {e}"), COPY_AGAIN)
        };
        let file = self.archive.by_name(&known).map_err(|e| broken(&e))?;
        let mut out = Vec::new();
        file.take(self.budget + 1).read_to_end(&mut out).map_err(|e| broken(&e))?;
        let left = self.budget.checked_sub(out.len() as u64).ok_or_else(|| {
            let cause = format!("unpacks to more than {} MB", MAX_FILE >> 20);
            Fault::new(cause, "reduce the mesh or split the file")
        });
        self.budget = left?;
        Ok(Some(out))
    }

    /// The number of a model by its path.
    fn model(&mut self, path: &str) -> usize {
        let path = path.trim_start_matches('/');
        if let Some(number) = self.numbers.get(path) {
            return *number;
        }
        self.models.push(path.to_owned());
        self.numbers.insert(path.to_owned(), self.models.len() - 1);
        self.models.len() - 1
    }

    /// Path of the root model, by the relationships of the package.
    fn root(&mut self) -> Result<String, Fault> {
        let Some(relations) = self.content("_rels/.rels")? else { return Ok(MODEL.to_owned()) };
        let mut reader = xml::reader(&relations);
        loop {
            match reader.read_event().map_err(xml::malformed)? {
                Event::Eof => return Ok(MODEL.to_owned()),
                Event::Start(e) | Event::Empty(e) => {
                    let kind = attribute(&e, "Type")?.unwrap_or_default();
                    if kind.ends_with("/3dmodel") {
                        return Ok(attribute(&e, "Target")?.unwrap_or_default().into_owned());
                    }
                }
                _ => {}
            }
        }
    }

    /// Reads the root model and those that it names.
    fn models(mut self) -> Result<Models, Fault> {
        let root = self.root()?;
        self.model(&root);
        let mut of_models: Vec<Vec<(u32, Object)>> = Vec::new();
        let mut out = Models {
            objects: Vec::new(),
            by_key: HashMap::new(),
            build: Vec::new(),
            unit: 1.0,
            supports: 0,
        };
        while of_models.len() < self.models.len() {
            let number = of_models.len();
            let path = self.models[number].clone();
            let content = self
                .content(&path)?
                .ok_or_else(|| Fault::new(format!("lacks its model `{path}`"), COPY_AGAIN))?;
            let objects = self.objects(&content, number, &mut out)?;
            of_models.push(objects);
        }
        // The root names objects of others, and those none of another model.
        for (model, objects) in of_models.into_iter().enumerate().rev() {
            for (id, object) in objects {
                let earlier = |c: &Component| out.by_key.contains_key(&c.object);
                if let Some(wrong) = object.components.iter().find(|c| !earlier(c)) {
                    return Err(no_object(wrong.object.1));
                }
                out.by_key.insert((model, id), out.objects.len());
                out.objects.push(object);
            }
        }
        Ok(out)
    }

    /// The objects of a model with their numbers; the root also has unit and build.
    fn objects(
        &mut self,
        content: &[u8],
        model: usize,
        out: &mut Models,
    ) -> Result<Vec<(u32, Object)>, Fault> {
        let mut reader = xml::reader(content);
        let mut objects: Vec<(u32, Object)> = Vec::new();
        loop {
            let element = match reader.read_event().map_err(xml::malformed)? {
                Event::Eof => return Ok(objects),
                Event::Start(element) | Event::Empty(element) => element,
                _ => continue,
            };
            let last = objects.last_mut().map(|(_, object)| object);
            match (element.local_name().as_ref(), last) {
                (b"model", _) if model == 0 => out.unit = unit(&element)?,
                (b"object", _) => {
                    self.place()?;
                    let id = number(&element, "id")?;
                    let kind = attribute(&element, "type")?.unwrap_or_default();
                    let name = attribute(&element, "name")?.filter(|name| !name.is_empty());
                    let object = Object {
                        name: name.map_or_else(|| format!("object {id}"), |n| n.into_owned()),
                        support: kind.ends_with("support"),
                        ..Object::default()
                    };
                    out.supports += usize::from(object.support);
                    objects.push((id, object));
                }
                (b"vertex", Some(object)) => {
                    self.count()?;
                    let axis = |name| number::<f32>(&element, name);
                    object.positions.push([axis("x")?, axis("y")?, axis("z")?]);
                }
                (b"triangle", Some(object)) => {
                    self.count()?;
                    let corner = |name| number::<u32>(&element, name);
                    object.triangles.push([corner("v1")?, corner("v2")?, corner("v3")?]);
                }
                (b"component", Some(object)) => {
                    let component = self.component(&element, model)?;
                    object.components.push(component);
                }
                (b"item", _) if model == 0 => {
                    let item = self.component(&element, model)?;
                    out.build.push(item);
                }
                _ => {}
            }
        }
    }

    fn count(&mut self) -> Result<(), Fault> {
        self.elements += 1;
        match self.elements > 2 * MAX_ELEMENTS {
            true => Err(Fault::too_many("these", "vertices or triangles")),
            false => Ok(()),
        }
    }

    fn place(&mut self) -> Result<(), Fault> {
        self.places += 1;
        match self.places > MAX_PLACED {
            true => Err(too_many_places("more")),
            false => Ok(()),
        }
    }

    fn component(&mut self, element: &BytesStart<'_>, model: usize) -> Result<Component, Fault> {
        self.place()?;
        let id = number(element, "objectid")?;
        let model = match attribute(element, "path")? {
            None => model,
            Some(_) if model != 0 => {
                let cause = "a model beside the root names objects of another one";
                return Err(Fault::new(cause, EXPORT_AGAIN));
            }
            Some(path) => self.model(&path),
        };
        let placement = match attribute(element, "transform")? {
            Some(text) => transform(&text)?,
            None => DAffine3::IDENTITY,
        };
        Ok(Component { object: (model, id), placement })
    }
}

fn no_object(id: u32) -> Fault {
    let cause = format!("names object {id}, which does not stand before it");
    Fault::new(cause, EXPORT_AGAIN)
}

fn too_many_places(count: impl std::fmt::Display) -> Fault {
    let cause = format!("places {count} objects, the limit is {MAX_PLACED}");
    Fault::new(cause, super::REDUCE)
}

/// Millimetres per unit of the model.
fn unit(model: &BytesStart<'_>) -> Result<f64, Fault> {
    Ok(match &*attribute(model, "unit")?.unwrap_or_default() {
        "micron" => 1e-3,
        "" | "millimeter" => 1.0,
        "centimeter" => 10.0,
        "inch" => 25.4,
        "foot" => 304.8,
        "meter" => 1000.0,
        other => {
            return Err(Fault::new(format!("`{}` is no unit of 3MF", shown(other)), EXPORT_AGAIN));
        }
    })
}

/// Twelve numbers, row by row of a matrix that rows of coordinates are multiplied with.
fn transform(text: &str) -> Result<DAffine3, Fault> {
    let values: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let values = values.ok().filter(|v| v.iter().all(|v| v.is_finite()));
    let rows: Option<[f64; 12]> = values.and_then(|v| v.try_into().ok());
    let m = rows.ok_or_else(|| {
        Fault::new(format!("`{}` is no transform of 12 numbers", shown(text)), EXPORT_AGAIN)
    })?;
    let row = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    let matrix = DMat3::from_cols(row(0), row(3), row(6));
    Ok(DAffine3::from_mat3_translation(matrix, row(9)))
}

impl Models {
    fn object(&self, key: Key) -> Result<usize, Fault> {
        self.by_key.get(&key).copied().ok_or_else(|| no_object(key.1))
    }

    /// Fails where components place too much; each object may be in several others.
    fn check(&self) -> Result<(), Fault> {
        // Placed objects and triangles, by object; what an object consists of comes before it.
        let mut sums: Vec<[u64; 2]> = Vec::with_capacity(self.objects.len());
        let sum = |own: [u64; 2], components: &[Component], sums: &[[u64; 2]]| {
            components.iter().try_fold(own, |[objects, triangles], component| {
                let [more, inside] = sums[self.object(component.object)?];
                Ok([objects.saturating_add(more), triangles.saturating_add(inside)])
            })
        };
        for object in &self.objects {
            let own = [1, object.positions.len().max(object.triangles.len()) as u64];
            let all = sum(own, &object.components, &sums)?;
            sums.push(all);
        }
        let [objects, triangles] = sum([0, 0], &self.build, &sums)?;
        if triangles > MAX_ELEMENTS as u64 {
            return Err(Fault::too_many(triangles, "placed vertices or triangles"));
        }
        if objects > MAX_PLACED {
            return Err(too_many_places(objects));
        }
        Ok(())
    }

    /// Every mesh of the build where it is placed.
    fn placed(&self) -> Result<Vec<Soup>, Fault> {
        self.check()?;
        let mut out = Vec::new();
        let mut todo = Vec::new();
        for item in &self.build {
            todo.push((self.object(item.object)?, item.placement));
            while let Some((number, placement)) = todo.pop() {
                let object = &self.objects[number];
                if object.support {
                    continue;
                }
                for component in object.components.iter().rev() {
                    todo.push((self.object(component.object)?, placement * component.placement));
                }
                if !object.triangles.is_empty() {
                    out.push(object.soup(placement)?);
                }
            }
        }
        Ok(out)
    }
}

impl Object {
    fn soup(&self, placement: DAffine3) -> Result<Soup, Fault> {
        let vertices = self.positions.len();
        if let Some(v) = self.triangles.iter().flatten().find(|&&v| v as usize >= vertices) {
            return Err(no_vertex(v, vertices));
        }
        let place = |p: &[f32; 3]| {
            let world = placement.transform_point3(DVec3::from(p.map(f64::from)));
            world.as_vec3().to_array()
        };
        let mirrors = placement.matrix3.determinant() < 0.0;
        let turn = |&[a, b, c]: &[u32; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
        Ok(Soup {
            name: self.name.clone(),
            positions: self.positions.iter().map(place).collect(),
            triangles: self.triangles.iter().map(turn).collect(),
        })
    }
}

#[cfg(test)]
mod tests;
