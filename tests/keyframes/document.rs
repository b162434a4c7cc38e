//! A glTF file as numbers, read for the tests only: JSON and bytes, without the program.

use std::path::Path;

use serde_json::Value;

pub struct Document {
    pub json: Value,
    buffers: Vec<Vec<u8>>,
}

impl Document {
    pub fn open(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("readable");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
        let (text, binary) = match bytes.starts_with(b"glTF") {
            true => {
                let json = word(12) as usize;
                let binary = bytes.get(20 + json + 8..).unwrap_or_default();
                (&bytes[20..20 + json], binary)
            }
            false => (&bytes[..], &[][..]),
        };
        let json: Value = serde_json::from_slice(text).expect("JSON");
        let none = Vec::new();
        let buffers = json["buffers"].as_array().unwrap_or(&none);
        let load = |buffer: &Value| match buffer["uri"].as_str() {
            None => binary.to_vec(),
            Some(uri) => match uri.split_once("base64,") {
                Some((_, data)) => from_base64(data),
                None => std::fs::read(path.parent().expect("a folder").join(uri)).expect("buffer"),
            },
        };
        let buffers = buffers.iter().map(load).collect();
        Self { json, buffers }
    }

    /// Elements of an accessor, component by component.
    pub fn accessor(&self, index: &Value) -> Vec<Vec<f64>> {
        let accessor = &self.json["accessors"][index_of(index)];
        let width = match accessor["type"].as_str().expect("type") {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            other => panic!("{other}"),
        };
        let kind = accessor["componentType"].as_u64().expect("kind");
        let normalized = accessor["normalized"].as_bool() == Some(true);
        let offset = accessor["byteOffset"].as_u64().unwrap_or(0);
        let count = index_of(&accessor["count"]);
        let read = |place: &Value, offset: u64, kind: u64, width: usize, count: usize| {
            let view = &self.json["bufferViews"][index_of(&place["bufferView"])];
            let (size, _) = component(kind);
            let stride = view["byteStride"].as_u64().unwrap_or((size * width) as u64) as usize;
            let begin = (view["byteOffset"].as_u64().unwrap_or(0) + offset) as usize;
            let bytes = &self.buffers[index_of(&view["buffer"])];
            let one = |i: usize, c: usize| value(&bytes[begin + i * stride + c * size..], kind);
            (0..count).map(|i| (0..width).map(|c| one(i, c)).collect()).collect::<Vec<Vec<f64>>>()
        };
        let mut out = match accessor.get("bufferView") {
            Some(_) => read(accessor, offset, kind, width, count),
            None => vec![vec![0.0; width]; count],
        };
        if let Some(sparse) = accessor.get("sparse") {
            let count = index_of(&sparse["count"]);
            let start = |part: &Value| part["byteOffset"].as_u64().unwrap_or(0);
            let (places, values) = (&sparse["indices"], &sparse["values"]);
            let index_kind = places["componentType"].as_u64().expect("kind");
            let at = read(places, start(places), index_kind, 1, count);
            let new = read(values, start(values), kind, width, count);
            for (at, new) in at.iter().zip(new) {
                out[at[0] as usize] = new;
            }
        }
        if normalized {
            let most = component(kind).1;
            for v in out.iter_mut().flatten() {
                *v = (*v / most).max(-1.0);
            }
        }
        out
    }
}

/// Index of a thing in its list.
pub fn index_of(value: &Value) -> usize {
    value.as_u64().expect("an index") as usize
}

/// Bytes of a component, and the value that stands for one when normalised.
fn component(kind: u64) -> (usize, f64) {
    match kind {
        5120 => (1, 127.0),
        5121 => (1, 255.0),
        5122 => (2, 32767.0),
        5123 => (2, 65535.0),
        5125 | 5126 => (4, f64::NAN),
        other => panic!("{other}"),
    }
}

fn value(bytes: &[u8], kind: u64) -> f64 {
    match kind {
        5120 => f64::from(bytes[0] as i8),
        5121 => f64::from(bytes[0]),
        5122 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
        5123 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        5125 => f64::from(u32::from_le_bytes(bytes[..4].try_into().expect("4 bytes"))),
        _ => f64::from(f32::from_le_bytes(bytes[..4].try_into().expect("4 bytes"))),
    }
}

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn from_base64(text: &str) -> Vec<u8> {
    let (mut out, mut word, mut bits) = (Vec::new(), 0u32, 0);
    for letter in text.bytes().filter(|&b| b != b'=') {
        let six = ALPHABET.iter().position(|&a| a == letter).expect("base64");
        word = word << 6 | six as u32;
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            out.push((word >> bits) as u8);
        }
    }
    out
}

/// Bytes as text, for files that are made here.
pub fn to_base64(bytes: &[u8]) -> String {
    let mut out = String::new();
    for three in bytes.chunks(3) {
        let word = (0..3).fold(0u32, |w, i| w << 8 | u32::from(*three.get(i).unwrap_or(&0)));
        for i in 0..4 {
            match i <= three.len() {
                true => out.push(char::from(ALPHABET[(word >> (18 - 6 * i)) as usize & 63])),
                false => out.push('='),
            }
        }
    }
    out
}
