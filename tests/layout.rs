//! Checks that `sim::layout` mirrors `glsl/shared.glsl`: names, offsets and strides by reflection of SPIR-V, the
//! constants by their text there.

use std::mem::size_of;

use insonify::sim::layout::{
    Aperture, CONSTANTS, Counters, Frame, Fusion, Instance, Interaction, Label, Row, Scanline,
    Segment, Surface, Tissue, View3d,
};
use insonify::sim::push;
use insonify::sim::shaders::{Library, words_of};
use spirq::ReflectConfig;
use spirq::ty::{StructType, Type};
use spirq::var::Variable;

/// Name, size and fields of a structure of `sim::layout`.
struct Mirror {
    name: &'static str,
    size: usize,
    offsets: &'static [(&'static str, usize)],
}

macro_rules! mirrors {
    ($($ty:ident),*) => {
        [$(Mirror { name: stringify!($ty), size: size_of::<$ty>(), offsets: $ty::OFFSETS }),*]
    };
}

fn mirrors() -> [Mirror; 13] {
    mirrors!(
        Frame,
        Tissue,
        Surface,
        Instance,
        Row,
        Segment,
        Counters,
        Fusion,
        View3d,
        Interaction,
        Scanline,
        Label,
        Aperture
    )
}

/// Types of all storage buffers of a module.
fn buffers(words: &[u32]) -> Vec<Type> {
    let entries = ReflectConfig::new().spv(words.to_vec()).ref_all_rscs(true).reflect().unwrap();
    let variables = entries.into_iter().flat_map(|e| e.vars);
    variables.filter(|v| matches!(v, Variable::Descriptor { .. })).map(|v| v.ty().clone()).collect()
}

/// Structures that are elements (with the array's stride) or members of storage blocks.
fn structures(ty: &Type, stride: Option<usize>, found: &mut Vec<(StructType, Option<usize>)>) {
    match ty {
        Type::Array(array) => structures(&array.element_ty, array.stride, found),
        Type::Struct(structure) => found.push((structure.clone(), stride)),
        _ => {}
    }
}

fn elements(words: &[u32]) -> Vec<(StructType, Option<usize>)> {
    let mut found = Vec::new();
    for block in buffers(words) {
        if let Type::Struct(block) = block {
            for member in block.members {
                structures(&member.ty, None, &mut found);
            }
        }
    }
    found
}

fn offsets(structure: &StructType) -> Vec<usize> {
    structure.members.iter().map(|m| m.offset.unwrap()).collect()
}

/// The difference of `structure` of the shader, an array's element, from its mirror.
fn difference(structure: &StructType, stride: Option<usize>, mirror: &Mirror) -> Option<String> {
    let shader: Vec<_> = structure
        .members
        .iter()
        .map(|m| (m.name.clone().unwrap_or_default(), m.offset.unwrap()))
        .collect();
    let here: Vec<_> = mirror.offsets.iter().map(|(n, o)| ((*n).to_owned(), *o)).collect();
    let pairs = shader.iter().zip(&here).find(|(s, h)| s != h);
    if let Some((shader, here)) = pairs {
        return Some(format!("{}: {here:?} here, {shader:?} in the shader", mirror.name));
    }
    if shader.len() != here.len() {
        return Some(format!(
            "{}: {} fields here, {} in the shader",
            mirror.name,
            here.len(),
            shader.len()
        ));
    }
    (stride != Some(mirror.size)).then(|| {
        format!("{}: {} bytes here, stride {stride:?} in the shader", mirror.name, mirror.size)
    })
}

fn named() -> Vec<(StructType, Option<usize>)> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv/layout.spv");
    elements(&words_of(&std::fs::read(path).unwrap()))
}

#[test]
fn every_structure_has_the_names_offsets_and_size_of_its_mirror() {
    let shader = named();
    assert_eq!(shader.len(), mirrors().len(), "layout.comp mentions every structure");
    for mirror in &mirrors() {
        let (structure, stride) = shader
            .iter()
            .find(|(s, _)| s.name() == Some(mirror.name))
            .unwrap_or_else(|| panic!("{} is not in layout.comp", mirror.name));
        assert_eq!(difference(structure, *stride, mirror), None);
    }
}

/// Names and values of the constants in `glsl/shared.glsl`: numbers, and sums with another one's name.
fn shader_constants() -> Vec<(String, f64)> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/glsl/shared.glsl");
    let mut found: Vec<(String, f64)> = Vec::new();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let Some(declaration) = line.strip_prefix("const ") else { continue };
        let (name, value) = declaration.split_once(';').unwrap().0.split_once(" = ").unwrap();
        let name = name.split_once(' ').unwrap().1;
        let term = |term: &str| {
            let number = term.trim_end_matches('u');
            let hexadecimal = number.strip_prefix("0x").map(|digits| {
                f64::from(u32::from_str_radix(digits, 16).expect("a hexadecimal number"))
            });
            let known = found.iter().find(|(known, _)| known == number).map(|(_, value)| *value);
            hexadecimal.or(known).unwrap_or_else(|| {
                number.parse().unwrap_or_else(|_| panic!("{name}: {number} is no number"))
            })
        };
        let value = value.split(" + ").map(term).sum();
        found.push((name.to_owned(), value));
    }
    found
}

/// The differences of the shaders' constants from ours, with values in single precision.
fn differing(shader: &[(String, f64)], ours: &[(&str, f64)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (name, value) in shader {
        match ours.iter().find(|(ours, _)| ours == name) {
            Some((_, ours)) if *ours as f32 == *value as f32 => {}
            Some((_, ours)) => wrong.push(format!("{name}: {ours} here, {value} in the shader")),
            None => wrong.push(format!("{name}: not in sim::layout")),
        }
    }
    for (name, _) in ours.iter().filter(|(ours, _)| shader.iter().all(|(name, _)| name != ours)) {
        wrong.push(format!("{name}: not in shared.glsl"));
    }
    wrong
}

#[test]
fn every_constant_has_the_value_of_its_mirror() {
    let shader = shader_constants();
    assert!(shader.len() > 50, "{shader:?}");
    assert_eq!(differing(&shader, CONSTANTS), Vec::<String>::new());
    // Every changed value, and one that either side lacks, is noticed.
    for at in 0..shader.len() {
        let mut planted = shader.clone();
        planted[at].1 = 1.37 * planted[at].1 + 1.0;
        assert_eq!(differing(&planted, CONSTANTS).len(), 1);
    }
    assert_eq!(differing(&shader[1..], CONSTANTS).len(), 1);
    assert_eq!(differing(&shader, &CONSTANTS[1..]).len(), 1);
}

#[test]
fn a_planted_mismatch_is_noticed() {
    let shader = named();
    let (structure, stride) = shader.iter().find(|(s, _)| s.name() == Some("Surface")).unwrap();
    let size = size_of::<Surface>();
    let planted =
        |offsets, size| difference(structure, *stride, &Mirror { name: "Surface", size, offsets });
    let mut fields = Surface::OFFSETS.to_vec();
    fields.swap(1, 2);
    assert!(planted(fields.leak(), size).is_some(), "two fields swapped");
    let mut fields = Surface::OFFSETS.to_vec();
    fields[3].1 += 4;
    assert!(planted(fields.leak(), size).is_some(), "a field moved");
    assert!(planted(&Surface::OFFSETS[..8], size).is_some(), "a field missing");
    assert!(planted(Surface::OFFSETS, size + 16).is_some(), "another size");
    assert!(planted(Surface::OFFSETS, size).is_none());
}

/// Optimisation strips the names, but a kernel that lays out a shared structure differently (`std140`, `scalar`,
/// an edited copy) has offsets or a stride that no mirror has. Kernels may have structures of their own if
/// they are made of vec4 and scalars without a hole.
#[test]
fn the_kernels_use_the_same_layout() {
    let library = Library::embedded();
    for stem in library.stems() {
        for (structure, stride) in elements(library.words(stem)) {
            let found = offsets(&structure);
            let known = mirrors().iter().any(|m| {
                m.offsets.iter().map(|f| f.1).eq(found.iter().copied())
                    && stride.is_none_or(|s| s == m.size)
            });
            let mut end = 0;
            let packed = structure.members.iter().all(|m| {
                let start = m.offset.unwrap();
                let whole = start == end;
                end = start + m.ty.nbyte().unwrap_or(0);
                whole
            }) && stride.is_none_or(|s| s == end);
            assert!(
                known || packed,
                "{stem}: a structure with offsets {found:?}, stride {stride:?}"
            );
        }
    }
}

/// Names, offsets and sizes of the push constants that a kernel's source declares, by the rules of std430.
fn declared(kernel: &str, source: &str) -> Vec<(String, usize, usize)> {
    let (_, rest) = source.split_once("layout(push_constant) uniform Push {").expect(kernel);
    let code = rest.split_once('}').expect("its end").0.lines();
    let code: String = code.map(|line| line.split("//").next().unwrap()).collect();
    let mut end = 0;
    let declaration = |text: &str| {
        let (ty, name) = text.trim().split_once(' ')?;
        let size = match ty {
            "uint" | "float" => 4,
            "uvec4" | "vec4" => 16,
            _ => panic!("{kernel}: {ty}"),
        };
        let offset = usize::next_multiple_of(end, size);
        end = offset + size;
        Some((name.trim().to_owned(), offset, size))
    };
    code.split(';').filter_map(declaration).collect()
}

#[test]
fn push_constants_are_those_of_the_sources() {
    let glsl = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/glsl"));
    let mut kernels = Vec::new();
    for entry in std::fs::read_dir(glsl).unwrap() {
        let path = entry.unwrap().path();
        let source = std::fs::read_to_string(&path).unwrap();
        if !source.contains("layout(push_constant)") {
            continue;
        }
        let kernel = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let (_, ours) = push::ALL
            .iter()
            .find(|(name, _)| *name == kernel)
            .unwrap_or_else(|| panic!("{kernel}"));
        let ours: Vec<_> = ours.iter().map(|(n, o, s)| ((*n).to_owned(), *o, *s)).collect();
        assert_eq!(declared(&kernel, &source), ours, "{kernel}");
        kernels.push(kernel);
    }
    assert_eq!(kernels.len(), push::ALL.len(), "{kernels:?}");
    let planted = "layout(push_constant) uniform Push { uint b; uint a;  // first\n uvec4 c; };";
    let found = [("b", 0, 4), ("a", 4, 4), ("c", 16, 16)].map(|(n, o, s)| (n.to_owned(), o, s));
    assert_eq!(declared("planted", planted), found);
}
