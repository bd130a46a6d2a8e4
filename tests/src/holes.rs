//! Scanned meshes with their holes closed, and a point inside.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use canted_fixtures::{Mesh, SplitMix64};

use crate::{
    closed::Closed,
    vector::{cross, dot},
};

/// Closes each hole with a fan around one of its vertices. `None` if an edge has more than two triangles, or no point is found
/// inside.
#[must_use]
pub fn closed_up(name: &'static str, mut mesh: Mesh) -> Option<Closed> {
    weld(&mut mesh);
    let mut next = BTreeMap::new();
    let all: BTreeSet<[u32; 2]> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    for &[a, b] in &all {
        if !all.contains(&[b, a]) && next.insert(b, a).is_some() {
            return None;
        }
    }
    while let Some((&first, _)) = next.iter().next() {
        let mut around = vec![first];
        let mut at = first;
        while let Some(after) = next.remove(&at) {
            around.push(after);
            at = after;
        }
        // Back at the first vertex.
        around.pop();
        let fan = around.windows(2).skip(1).map(|pair| [around[0], pair[0], pair[1]]);
        mesh.triangles.extend(fan.collect::<Vec<_>>());
    }
    if mesh.open_edge().is_some() {
        return None;
    }
    let inner_point = inside(&mesh)?;
    let clearance = [0.002 * mesh.diagonal(); 3];
    // The fans may intersect the rest of the surface.
    Some(Closed { name, mesh, inner_point, clearance, is_simple: false })
}

/// Merges vertices with equal coordinates and removes triangles that become degenerate.
fn weld(mesh: &mut Mesh) {
    let mut first_of = HashMap::new();
    let first: Vec<u32> = (0u32..)
        .zip(&mesh.positions)
        .map(|(i, position)| *first_of.entry(position.map(|x| (x + 0.0).to_bits())).or_insert(i))
        .collect();
    for triangle in &mut mesh.triangles {
        *triangle = triangle.map(|index| first[index as usize]);
    }
    mesh.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
}

/// A point with winding number one; so have points a two-hundredth of the diagonal away.
fn inside(mesh: &Mesh) -> Option<[f64; 3]> {
    let [min, max] = mesh.bounds().map(|p| p.map(f64::from));
    let mut rng = SplitMix64::new(5);
    let step = 0.005 * mesh.diagonal();
    (0..100).map(|_| std::array::from_fn(|k| min[k] + (0.3 + 0.4 * rng.unit()) * (max[k] - min[k]))).find(|p| {
        let around = (0..7).map(|i: usize| {
            let mut q: [f64; 3] = *p;
            if i < 6 {
                q[i / 2] += if i.is_multiple_of(2) { step } else { -step };
            }
            q
        });
        around.into_iter().all(|q| (winding(mesh, q) - 1.0).abs() < 1e-6)
    })
}

/// Winding number of the surface around a point: its solid angle over that of a sphere (Van Oosterom, Strackee 1983).
fn winding(mesh: &Mesh, p: [f64; 3]) -> f64 {
    let solid_angle = |i: usize| {
        let [a, b, c] = mesh.corners(i).map(|corner| std::array::from_fn(|k| corner[k] - p[k]));
        let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
        2.0 * dot(a, cross(b, c)).atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    };
    (0..mesh.triangles.len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use canted_fixtures::displaced_icosphere;

    use super::*;

    #[test]
    fn holes_are_closed_and_an_inner_point_is_found() {
        let mut mesh = displaced_icosphere(3, 2);
        // Two adjacent triangles, and one that shares at most a vertex with them.
        let n = mesh.triangles.len();
        mesh.triangles.remove(n - 1);
        mesh.triangles.remove(n - 2);
        mesh.triangles.remove(3);
        let closed = closed_up("sphere", mesh.clone()).expect("two simple holes");
        assert_eq!(closed.mesh.open_edge(), None);
        assert!((winding(&closed.mesh, closed.inner_point) - 1.0).abs() < 1e-9);
        assert!(winding(&closed.mesh, [9.0, 0.0, 0.0]).abs() < 1e-9);
        // An edge of three triangles is not manifold.
        mesh.triangles.push([0, 1, 2]);
        mesh.triangles.push([0, 1, 3]);
        assert!(closed_up("none", mesh).is_none());
    }
}
