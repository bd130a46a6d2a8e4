//! Normals of morphed vertices whose targets store none: the file's own hold for the unmorphed shape only.
//!
//! The change of a vertex normal is that of the mean normal of the triangles around the vertex, weighted by area, between the
//! unmorphed positions and those with the targets that store no normals. It is added to the file's normal, as the offsets of a
//! target are: a small weight changes normals little, and what the file says about the unmorphed shape stays. Vertices with
//! equal position and normal count as one, so that seams of texture coordinates do not become creases; creases stay creases.

use std::collections::HashMap;

use gltf::json::Index;
use gltf::json::accessor::Type;
use gltf::json::mesh::{MorphTarget, Primitive};

use super::accessor::{Accessor, REALS};
use super::pose::MorphedAttribute;
use super::primitive::PrimitiveReader;
use crate::read::ReadError;

/// The changes of the normals of `vertices`, which are numbers in the file; `triangles` are indices of that list. `None` where all
/// targets of nonzero weight store normals.
pub(super) fn changes(
    reader: &PrimitiveReader<'_, '_>,
    primitive: &Primitive,
    positions: usize,
    normals: &Accessor<'_>,
    triangles: &[[u32; 3]],
    vertices: &[usize],
) -> Result<Option<Vec<[f64; 3]>>, ReadError> {
    let lacks_normals = |target: &MorphTarget| -> Option<Index<gltf::json::Accessor>> {
        target.positions.filter(|_| target.normals.is_none())
    };
    let mut active = primitive.targets.iter().flatten().zip(reader.pose.weights);
    if !active.any(|(target, &weight)| weight != 0.0 && lacks_normals(target).is_some()) {
        return Ok(None);
    }
    let location = format!("{} POSITION", reader.location);
    let base = Accessor::open(reader.document, positions, &location, Type::Vec3, REALS)?;
    let morphed = MorphedAttribute::open(reader, primitive, base, lacks_normals, &location)?;
    let (before, after): (Vec<[f64; 3]>, Vec<[f64; 3]>) =
        vertices.iter().map(|&vertex| (morphed.base.reals(vertex).map(f64::from), morphed.at(vertex))).unzip();
    let mut numbers = HashMap::new();
    let groups: Vec<usize> = (vertices.iter().zip(&before))
        .map(|(&vertex, position)| {
            let normal: [f32; 3] = normals.reals(vertex);
            // Adding zero makes -0.0 positive.
            let key = (position.map(|x| (x + 0.0).to_bits()), normal.map(|x| (x + 0.0).to_bits()));
            let next = numbers.len();
            *numbers.entry(key).or_insert(next)
        })
        .collect();
    let means = |positions: &[[f64; 3]]| mean_normals(positions, triangles, &groups, numbers.len());
    let of_groups: Vec<[f64; 3]> = means(&before).into_iter().zip(means(&after)).map(change).collect();
    Ok(Some(groups.into_iter().map(|group| of_groups[group]).collect()))
}

/// The difference of two unit normals; zero where one has no direction.
fn change((before, after): ([f64; 3], [f64; 3])) -> [f64; 3] {
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (a, b) = (length(before), length(after));
    if !(a > 0.0 && b > 0.0 && a.is_finite() && b.is_finite()) {
        return [0.0; 3];
    }
    std::array::from_fn(|k| after[k] / b - before[k] / a)
}

/// Sums of the normals of the triangles around each group of vertices, as long as twice the area.
fn mean_normals(positions: &[[f64; 3]], triangles: &[[u32; 3]], groups: &[usize], n_groups: usize) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; n_groups];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let [u, v]: [[f64; 3]; 2] = [b, c].map(|end| std::array::from_fn(|k| end[k] - a[k]));
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            u[i] * v[j] - u[j] * v[i]
        });
        for &corner in triangle {
            let sum = &mut sums[groups[corner as usize]];
            *sum = std::array::from_fn(|k| sum[k] + normal[k]);
        }
    }
    sums
}
