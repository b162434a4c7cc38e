//! Displacement fields: trilinear displacements over a grid.

use glam::{DMat3, DVec3};
use insonify::sim::layout::{FLOW_VECTORS, GENERATIONS, PART_PULSE};
use insonify::sim::push::Scatter;

/// One displacement field, in texture space, mm.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    origin: DVec3,
    /// Nodes per mm.
    scale: DVec3,
    size: [usize; 3],
    displacements: &'a [[f32; 3]],
    /// Factor on them.
    amount: f64,
}

/// One generation of scatterers of what flows.
#[derive(Clone, Copy, Debug)]
pub struct Flowed<'a> {
    /// Factor on their amplitudes.
    pub weight: f64,
    /// Its number.
    pub generation: u32,
    /// How far the flow has carried them.
    pub field: Field<'a>,
}

impl<'a> Flowed<'a> {
    /// What is heard of what begins at vector `at` of `fields`: both generations, each of which has a vector with weight, number
    /// and way, or of a pulse the one whose pace, number and way the third one says. Behind them stands the field of the flow's
    /// shape.
    pub fn all(fields: &'a [[f32; 3]], at: u32, heard: Scatter) -> Vec<Self> {
        let shape = Field::new(fields, at + FLOW_VECTORS);
        if heard.part & PART_PULSE != 0 {
            let [pace, number, way] = fields[(at + GENERATIONS) as usize];
            let amount = f64::from(way) + f64::from(pace) * f64::from(heard.time);
            let field = Field { amount, ..shape };
            return vec![Self { weight: 1.0, generation: number as u32, field }];
        }
        let of = |[weight, number, way]: [f32; 3]| Self {
            weight: weight.into(),
            generation: number as u32,
            field: Field { amount: way.into(), ..shape },
        };
        (at..at + GENERATIONS).map(|at| of(fields[at as usize])).collect()
    }
}

fn widen(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

impl<'a> Field<'a> {
    /// The field that begins at vector `at` of `fields` with its header: origin, nodes per mm, nodes.
    pub fn new(fields: &'a [[f32; 3]], at: u32) -> Self {
        let [origin, scale, size, displacements @ ..] = &fields[at as usize..] else {
            panic!("a field begins with a header")
        };
        let size = size.map(|n| n as usize);
        Self {
            origin: widen(*origin),
            scale: widen(*scale),
            size,
            displacements: &displacements[..size.iter().product()],
            amount: 1.0,
        }
    }

    /// Displacement v of the tissue point `p` of the reference shape; outside the grid that of the
    /// nearest point on it.
    pub fn displacement(&self, p: DVec3) -> DVec3 {
        self.with_gradient(p).0
    }

    /// Displacement, and its derivatives by x, y, z as columns.
    fn with_gradient(&self, p: DVec3) -> (DVec3, DMat3) {
        let last = DVec3::from(self.size.map(|n| (n - 1) as f64));
        let at = (p - self.origin) * self.scale;
        let on = at.clamp(DVec3::ZERO, last);
        let cell = on.floor().min(last - 1.0);
        let t = on - cell;
        let [i, j, k] = cell.to_array().map(|v| v as usize);
        let (mut v, mut gradient) = (DVec3::ZERO, DMat3::ZERO);
        for n in 0..8 {
            let far = [n & 1, n >> 1 & 1, n >> 2];
            let [nx, ny, _] = self.size;
            let node = i + far[0] + nx * (j + far[1] + ny * (k + far[2]));
            let d = self.amount * widen(self.displacements[node]);
            let side = |a: usize| if far[a] == 1 { t[a] } else { 1.0 - t[a] };
            let sign = |a: usize| if far[a] == 1 { 1.0 } else { -1.0 };
            v += side(0) * side(1) * side(2) * d;
            gradient.x_axis += sign(0) * side(1) * side(2) * d;
            gradient.y_axis += side(0) * sign(1) * side(2) * d;
            gradient.z_axis += side(0) * side(1) * sign(2) * d;
        }
        let slope = |a: usize| if at[a] == on[a] { self.scale[a] } else { 0.0 };
        gradient.x_axis *= slope(0);
        gradient.y_axis *= slope(1);
        gradient.z_axis *= slope(2);
        (v, gradient)
    }

    /// The point of the reference shape whose tissue is at `p` now: Newton's iteration on
    /// P + v(P) = p, and P <- p - v(P) where the field folds.
    pub fn reference(&self, p: DVec3) -> DVec3 {
        let mut found = p;
        for _ in 0..50 {
            let (v, gradient) = self.with_gradient(found);
            let miss = p - found - v;
            let jacobian = DMat3::IDENTITY + gradient;
            found += if jacobian.determinant() > 0.05 { jacobian.inverse() * miss } else { miss };
            if miss.length() < 1e-12 {
                break;
            }
        }
        found
    }

    /// The derivative of the present place by the reference point, at `p`; its determinant is present volume over volume at rest.
    pub fn jacobian(&self, p: DVec3) -> DMat3 {
        DMat3::IDENTITY + self.with_gradient(p).1
    }

    /// Distance of nodes along x, mm.
    pub fn spacing(&self) -> f64 {
        self.scale.x.recip()
    }

    /// Bound on the displacements, mm: a trilinear one lies between those of its cell's nodes.
    pub fn reach(&self) -> f64 {
        let longest = |reach: f64, &d: &[f32; 3]| reach.max(widen(d).length());
        self.amount.abs() * self.displacements.iter().fold(0.0, longest)
    }

    /// Bound on the gradient: the largest change of displacement per mm between two points. Along an
    /// axis the derivative lies between those along the edges of a cell.
    pub fn steepness(&self) -> f64 {
        let [nx, ny, _] = self.size;
        let largest = |step: usize, at: &dyn Fn(usize) -> bool| {
            let edges = (step..self.displacements.len()).filter(|&i| at(i));
            let slope = |i: usize| {
                (widen(self.displacements[i]) - widen(self.displacements[i - step])).length()
            };
            edges.map(slope).fold(0.0, f64::max)
        };
        let slopes = DVec3::new(
            largest(1, &|i| i % nx > 0),
            largest(nx, &|i| i / nx % ny > 0),
            largest(nx * ny, &|_| true),
        );
        self.amount.abs() * (slopes * self.scale).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 x 2 x 2 nodes, 2 mm apart, from (-2, 0, 0); squeezed in x behind the middle.
    fn squeezed() -> Vec<[f32; 3]> {
        let mut fields = vec![[-2.0, 0.0, 0.0], [0.5; 3], [3.0, 2.0, 2.0]];
        fields.extend((0..12).map(|i| if i % 3 == 2 { [-1.0, 0.0, 0.5] } else { [0.0; 3] }));
        fields
    }

    #[test]
    fn displacements_are_linear_between_nodes_and_constant_outside() {
        let fields = squeezed();
        let field = Field::new(&fields, 0);
        for (x, expected) in [(-9.0, 0.0), (-1.0, 0.0), (0.5, -0.25), (2.0, -1.0), (7.0, -1.0)] {
            let v = field.displacement(DVec3::new(x, 1.0, -3.0));
            assert_eq!(v, DVec3::new(expected, 0.0, -0.5 * expected), "{x}");
        }
        assert_eq!(field.reach(), 1.25_f64.sqrt());
        assert_eq!(field.spacing(), 2.0);
        assert_eq!(field.steepness(), 1.25_f64.sqrt() / 2.0);
    }

    #[test]
    fn the_reference_point_comes_back_to_where_the_tissue_is() {
        let fields = squeezed();
        let field = Field::new(&fields, 0);
        for i in 0..60 {
            let p = DVec3::new(-3.0 + 0.1 * f64::from(i), 0.3, 1.7);
            let reference = field.reference(p);
            assert!((reference + field.displacement(reference) - p).length() < 1e-12);
        }
        // Twice as far behind the middle.
        let reference = field.reference(DVec3::new(0.4, 0.0, 0.0));
        assert!((reference.x - 0.8).abs() < 1e-12);
    }
}
