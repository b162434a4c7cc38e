//! Places of the vertices of an animated glTF file at a time: appendix C and sections 3.7.2 and 3.7.3 of the
//! specification of glTF 2.0, written for the tests in double precision, without the program.

use serde_json::Value;

use crate::keyframes::document::{Document, index_of};

/// Rows of an affine matrix.
pub type Matrix = [[f64; 4]; 3];

const IDENTITY: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A mistake that an evaluation could make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planted {
    /// Keyframes are shown a hundredth of a second late.
    Late,
    /// Rotations are interpolated component by component, and not brought to length one.
    Lerp,
    /// The first morph target with a weight is left out.
    Target,
    /// Joints move vertices without their inverse bind matrices.
    Unbound,
    /// The node with a skinned mesh moves it, too.
    Carried,
    /// The translation of nodes is left out.
    Unmoved,
}

pub struct Pose<'d> {
    pub document: &'d Document,
    pub animation: usize,
    pub planted: Option<Planted>,
}

/// Keyframes of a property.
struct Keys<'d> {
    sampler: &'d Value,
    times: Vec<f64>,
    /// Values, one after the other.
    values: Vec<f64>,
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

impl Pose<'_> {
    fn planted(&self, planted: Planted) -> bool {
        self.planted == Some(planted)
    }

    /// Key times and values of a node's property.
    fn sampler(&self, node: usize, path: &str) -> Option<Keys<'_>> {
        let animation = &self.document.json["animations"][self.animation];
        let channel = animation["channels"].as_array()?.iter().find(|c| {
            c["target"]["node"].as_u64() == Some(node as u64) && c["target"]["path"] == *path
        })?;
        let sampler = &animation["samplers"][index_of(&channel["sampler"])];
        let times = self.document.accessor(&sampler["input"]);
        let values = self.document.accessor(&sampler["output"]);
        Some(Keys {
            sampler,
            times: times.into_iter().flatten().collect(),
            values: values.into_iter().flatten().collect(),
        })
    }

    /// Key times of a property; none where it does not move.
    pub fn times(&self, node: usize, path: &str) -> Vec<f64> {
        self.sampler(node, path).map_or(Vec::new(), |keys| keys.times)
    }

    fn sample(&self, node: usize, path: &str, time: f64) -> Option<Vec<f64>> {
        let Keys { sampler, times, values: flat } = self.sampler(node, path)?;
        let time = time - f64::from(u8::from(self.planted(Planted::Late))) * 0.01;
        let spline = sampler["interpolation"] == "CUBICSPLINE";
        let width = flat.len() / times.len() / if spline { 3 } else { 1 };
        // Part 0 is the in-tangent, 1 the value, 2 the out-tangent of a spline.
        let key = |k: usize, part: usize| {
            let at = if spline { 3 * k + part } else { k };
            flat[at * width..(at + 1) * width].to_vec()
        };
        let last = times.len() - 1;
        if time <= times[0] {
            return Some(key(0, 1));
        }
        if time >= times[last] {
            return Some(key(last, 1));
        }
        let k = (0..last).rev().find(|&k| times[k] <= time).expect("after the first");
        let step = times[k + 1] - times[k];
        let t = (time - times[k]) / step;
        let (a, b) = (key(k, 1), key(k + 1, 1));
        let lerp = |a: &[f64], b: &[f64]| -> Vec<f64> {
            a.iter().zip(b).map(|(a, b)| (1.0 - t) * a + t * b).collect()
        };
        Some(match sampler["interpolation"].as_str().unwrap_or("LINEAR") {
            "STEP" => a,
            "CUBICSPLINE" => {
                let (out, into) = (key(k, 2), key(k + 1, 0));
                let (t2, t3) = (t * t, t * t * t);
                let at = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                        + step * (t3 - 2.0 * t2 + t) * out[i]
                        + (-2.0 * t3 + 3.0 * t2) * b[i]
                        + step * (t3 - t2) * into[i]
                };
                (0..width).map(at).collect()
            }
            _ if path == "rotation" && !self.planted(Planted::Lerp) => slerp(&a, &b, t),
            _ => lerp(&a, &b),
        })
    }

    fn local(&self, node: usize, time: f64) -> Matrix {
        let json = &self.document.json["nodes"][node];
        if let Some(m) = numbers(&json["matrix"]) {
            return std::array::from_fn(|r| std::array::from_fn(|c| m[4 * c + r]));
        }
        let property = |path: &str, rest: &[f64]| {
            let stored = numbers(&json[path]).unwrap_or(rest.to_vec());
            self.sample(node, path, time).unwrap_or(stored)
        };
        let mut t = property("translation", &[0.0; 3]);
        if self.planted(Planted::Unmoved) {
            t = vec![0.0; 3];
        }
        let s = property("scale", &[1.0; 3]);
        let mut q = property("rotation", &[0.0, 0.0, 0.0, 1.0]);
        if !self.planted(Planted::Lerp) {
            q = unit(&q);
        }
        let (x, y, z, w) = (q[0], q[1], q[2], q[3]);
        let turn = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        std::array::from_fn(|r| [turn[r][0] * s[0], turn[r][1] * s[1], turn[r][2] * s[2], t[r]])
    }

    fn parent(&self, node: usize) -> Option<usize> {
        let nodes = self.document.json["nodes"].as_array()?;
        nodes.iter().position(|n| {
            let children = n["children"].as_array();
            children.is_some_and(|c| c.iter().any(|i| i.as_u64() == Some(node as u64)))
        })
    }

    /// The node and its ancestors.
    pub fn chain(&self, node: usize) -> Vec<usize> {
        std::iter::successors(Some(node), |&n| self.parent(n)).collect()
    }

    /// Scene from node space.
    pub fn global(&self, node: usize, time: f64) -> Matrix {
        let up = self.chain(node);
        up.iter().rev().fold(IDENTITY, |m, &n| product(&m, &self.local(n, time)))
    }

    /// Joints of a node's skin.
    pub fn joints(&self, node: usize) -> Option<Vec<usize>> {
        let skin = self.document.json["nodes"][node].get("skin")?;
        let joints = self.document.json["skins"][index_of(skin)]["joints"].as_array()?;
        Some(joints.iter().map(index_of).collect())
    }

    /// Vertices of a node's mesh, primitive after primitive: in the node's space, or in that of the scene
    /// if the mesh is skinned.
    pub fn vertices(&self, node: usize, time: f64) -> Vec<[f64; 3]> {
        let json = &self.document.json;
        let mesh = &json["meshes"][index_of(&json["nodes"][node]["mesh"])];
        let resting = numbers(&json["nodes"][node]["weights"]).or(numbers(&mesh["weights"]));
        let weights = self.sample(node, "weights", time).or(resting);
        let mut weights = weights.unwrap_or_default();
        if self.planted(Planted::Target)
            && let Some(w) = weights.iter_mut().find(|w| **w != 0.0)
        {
            *w = 0.0;
        }
        let matrices = self.joint_matrices(node, time);
        let mut out = Vec::new();
        for primitive in mesh["primitives"].as_array().expect("primitives") {
            let mut points = self.document.accessor(&primitive["attributes"]["POSITION"]);
            let none = Vec::new();
            let targets = primitive["targets"].as_array().unwrap_or(&none);
            for (target, weight) in targets.iter().zip(&weights) {
                let Some(position) = target.get("POSITION") else {
                    continue;
                };
                for (p, d) in points.iter_mut().zip(self.document.accessor(position)) {
                    (0..3).for_each(|axis| p[axis] += weight * d[axis]);
                }
            }
            if let Some(matrices) = &matrices {
                points = self.skinned(&points, primitive, matrices);
            }
            out.extend(points.iter().map(|p| [p[0], p[1], p[2]]));
        }
        out
    }

    fn joint_matrices(&self, node: usize, time: f64) -> Option<Vec<Matrix>> {
        let joints = self.joints(node)?;
        let json = &self.document.json;
        let skin = &json["skins"][index_of(&json["nodes"][node]["skin"])];
        let bind = skin.get("inverseBindMatrices").map(|i| self.document.accessor(i));
        let matrix = |(j, joint): (usize, &usize)| {
            let global = self.global(*joint, time);
            let bound = match &bind {
                Some(bind) if !self.planted(Planted::Unbound) => {
                    let stored = &bind[j];
                    let inverse: Matrix =
                        std::array::from_fn(|r| std::array::from_fn(|c| stored[4 * c + r]));
                    product(&global, &inverse)
                }
                _ => global,
            };
            match self.planted(Planted::Carried) {
                true => product(&self.global(node, time), &bound),
                false => bound,
            }
        };
        Some(joints.iter().enumerate().map(matrix).collect())
    }

    fn skinned(
        &self,
        points: &[Vec<f64>],
        primitive: &Value,
        matrices: &[Matrix],
    ) -> Vec<Vec<f64>> {
        let attributes = &primitive["attributes"];
        let sets: Vec<_> = (0..)
            .map_while(|set| {
                let joints = attributes.get(format!("JOINTS_{set}"))?;
                let weights = attributes.get(format!("WEIGHTS_{set}"))?;
                Some((self.document.accessor(joints), self.document.accessor(weights)))
            })
            .collect();
        let place = |(v, p): (usize, &Vec<f64>)| {
            let (mut sum, mut whole) = (vec![0.0; 3], 0.0);
            for (joints, weights) in &sets {
                for (joint, weight) in joints[v].iter().zip(&weights[v]) {
                    let moved = apply(&matrices[*joint as usize], &[p[0], p[1], p[2]]);
                    (0..3).for_each(|axis| sum[axis] += weight * moved[axis]);
                    whole += weight;
                }
            }
            sum.iter().map(|v| v / whole).collect()
        };
        points.iter().enumerate().map(place).collect()
    }

    /// Corners of a node's mesh as stored, for lists of triangles only.
    pub fn triangles(&self, node: usize) -> Vec<[usize; 3]> {
        let json = &self.document.json;
        let mesh = &json["meshes"][index_of(&json["nodes"][node]["mesh"])];
        let (mut out, mut first) = (Vec::new(), 0);
        for primitive in mesh["primitives"].as_array().expect("primitives") {
            assert_eq!(primitive["mode"].as_u64().unwrap_or(4), 4);
            let count = self.document.accessor(&primitive["attributes"]["POSITION"]).len();
            let corners: Vec<usize> = match primitive.get("indices") {
                Some(i) => self.document.accessor(i).iter().map(|v| v[0] as usize).collect(),
                None => (0..count).collect(),
            };
            out.extend(corners.chunks(3).map(|t| [t[0] + first, t[1] + first, t[2] + first]));
            first += count;
        }
        out
    }
}

fn unit(q: &[f64]) -> Vec<f64> {
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.iter().map(|v| v / length).collect()
}

/// Interpolation by appendix C.4: the shorter way, at constant speed. Its quaternions are unit ones; some files
/// store three digits of them.
fn slerp(a: &[f64], b: &[f64], t: f64) -> Vec<f64> {
    let (a, b) = (unit(a), unit(b));
    let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    let angle = dot.abs().min(1.0).acos();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    // Below this angle the great circle is a line in double precision.
    let (wa, wb) = match angle < 1e-8 {
        true => (1.0 - t, t),
        false => (((1.0 - t) * angle).sin() / angle.sin(), (t * angle).sin() / angle.sin()),
    };
    a.iter().zip(&b).map(|(a, b)| wa * a + sign * wb * b).collect()
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let shift = if c == 3 { a[r][3] } else { 0.0 };
            (0..3).map(|k| a[r][k] * b[k][c]).sum::<f64>() + shift
        })
    })
}

pub fn apply(m: &Matrix, p: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|r| (0..3).map(|k| m[r][k] * p[k]).sum::<f64>() + m[r][3])
}
