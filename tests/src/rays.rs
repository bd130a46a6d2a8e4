//! Difficult rays for BVHs and triangle tests.

use canted_fixtures::{Grazing, Mesh, RayData, SplitMix64, grazing};
use canted_obb::vector::{Vector, cross, length, sub};
use canted_trace::{HIT_ERROR, Ray};

/// An arbitrary ray for meshes without triangles.
fn aside() -> Ray {
    Ray::new([0.0; 3], [1.0, 0.0, 0.0])
}

/// The ray of a fixture, from its origin on.
#[must_use]
pub fn endless(ray: RayData) -> Ray {
    Ray { t_max: ray.t_max, ..Ray::new(ray.origin, ray.direction) }
}

/// `n` rays of each of `classes`. Every fifth is repeated with negative zeros and another direction length, and every seventh
/// from or to a position near the point that it grazes.
#[must_use]
pub fn of_classes(mesh: &Mesh, classes: &[Grazing], n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![aside()];
    }
    let mut rays: Vec<Ray> =
        classes.iter().zip(seed..).flat_map(|(&class, seed)| grazing(mesh, class, n, seed)).map(endless).collect();
    let signless = |ray: &Ray| {
        let direction = ray.direction.map(|d| if d == 0.0 { -0.0 } else { d * 2.0f32.powi(-40) });
        Ray { direction, ..*ray }
    };
    let bounded = |(i, ray): (usize, &Ray)| match i % 2 {
        0 => Ray { t_max: 1.0, ..*ray },
        _ => Ray { t_min: 1.0, ..*ray },
    };
    let variants: Vec<Ray> =
        rays.iter().step_by(5).map(signless).chain(rays.iter().step_by(7).enumerate().map(bounded)).collect();
    rays.extend(variants);
    rays
}

/// `n` rays of each class and their variants.
#[must_use]
pub fn of_all_classes(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    of_classes(mesh, &Grazing::ALL, n, seed)
}

/// `n` rays of each class, and three times `n` in the planes of triangles and along axes, with intervals, lengths and signs of zero of
/// every kind.
#[must_use]
pub fn of_any_length(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![aside()];
    }
    let mut rng = SplitMix64::new(seed);
    let mut rays: Vec<Ray> =
        Grazing::ALL.iter().flat_map(|&class| grazing(mesh, class, n, seed)).map(endless).collect();
    for _ in 0..n {
        // From a vertex to a vertex, along an axis through one, and nearly so.
        let mut vertex = || mesh.positions[mesh.triangles[rng.below(mesh.triangles.len())][rng.below(3)] as usize];
        let [a, b] = [vertex(), vertex()];
        let mut along = [0.0; 3];
        along[rng.below(3)] = if rng.signed() < 0.0 { -1.0 } else { 1.0 };
        let nearly = along.map(|d: f32| if d == 0.0 { 1e-30 } else { d });
        rays.extend([std::array::from_fn(|k| b[k] - a[k]), along, nearly].map(|direction| Ray::new(a, direction)));
    }
    for (i, ray) in rays.iter_mut().enumerate() {
        (ray.t_min, ray.t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, f32::INFINITY), (0.0, f32::MAX)][i % 4];
        let scale = [1.0, 2.0f32.powi(-40), -1.0, 1e18, 3.0][i % 5];
        ray.direction = ray.direction.map(|d| if d == 0.0 && i % 2 == 0 { -0.0 } else { d * scale });
    }
    rays
}

/// A point of a random triangle: in turn a vertex, a point on an edge, a point inside.
fn target(mesh: &Mesh, i: usize, rng: &mut SplitMix64) -> [f64; 3] {
    let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
    let [u, v] = match i % 3 {
        0 => [0.0, 0.0],
        1 => [rng.unit(), 0.0],
        _ => [0.5 * rng.unit(), 0.5 * rng.unit()],
    };
    std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]))
}

/// A ray from `origin`, rounded, to `target`.
fn aimed(origin: [f64; 3], target: [f64; 3]) -> Ray {
    let origin = origin.map(|x| x as f32);
    Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
}

/// `n` rays towards vertices, edges and triangles from `sizes` diagonals away.
#[must_use]
pub fn from_afar(mesh: &Mesh, sizes: f64, n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![aside()];
    }
    let mut rng = SplitMix64::new(seed);
    let away = sizes * mesh.diagonal();
    (0..n)
        .map(|i| {
            let target = target(mesh, i, &mut rng);
            let direction = rng.on_sphere();
            aimed(std::array::from_fn(|k| target[k] + away * direction[k]), target)
        })
        .collect()
}

/// `n` rays that start within the bounds (on a vertex, an edge, a triangle or anywhere) and end at or pass another such
/// point.
#[must_use]
pub fn from_inside(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![aside()];
    }
    let mut rng = SplitMix64::new(seed);
    let [min, max] = mesh.bounds().map(|p| p.map(f64::from));
    (0..n)
        .map(|i| {
            let anywhere = std::array::from_fn(|k| min[k] + rng.unit() * (max[k] - min[k]));
            let start = if i % 4 == 3 { anywhere } else { target(mesh, i / 4, &mut rng) };
            let ray = aimed(start, target(mesh, i, &mut rng));
            // A third end at their target.
            if i % 3 == 1 { Ray { t_max: 1.0, ..ray } } else { ray }
        })
        .collect()
}

/// `n` rays at inner points of triangles, nearly along their normals, from as close as the error of hits allows. If any ray
/// hits a triangle with certainty, these do. Degenerate triangles give no ray.
#[must_use]
pub fn at_insides(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let mut ray = |i: usize| {
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let normal = cross(sub(b, a), sub(c, a));
        let (double_area, stray) = (length(normal), rng.on_sphere());
        let [u, v] = [0.2 + 0.25 * rng.unit(), 0.2 + 0.25 * rng.unit()];
        let target: Vector = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let longest = [sub(b, a), sub(c, b), sub(a, c)].map(length).into_iter().fold(0.0, f64::max);
        let reach = [a, b, c].iter().flatten().fold(0.0f64, |all, x| all.max(x.abs()));
        // The origin is as far out as the triangle and the error includes both; underflow adds half the least normal number.
        let error = 3.0f64.sqrt() * f64::from(HIT_ERROR) * 2.0 * reach + 0.5 * f64::from(f32::MIN_POSITIVE);
        let away = [1.2, 2.0, 8.0][i % 3] * (error + double_area / longest) * [1.0, -1.0][i % 2];
        let origin = std::array::from_fn(|k| target[k] + away * (normal[k] / double_area + 0.1 * stray[k]));
        (double_area > 0.0).then(|| aimed(origin, target))
    };
    let is_ray = |ray: &Ray| ray.direction.iter().any(|&d| d != 0.0);
    (0..n).filter_map(&mut ray).filter(is_ray).collect()
}

/// Greatest coordinate of [`on_lattice`] in steps.
const LATTICE: f32 = 4096.0;

/// The mesh with coordinates rounded to multiples of a power of two, at most 2^12 steps from zero.
#[must_use]
pub fn on_lattice(mesh: &Mesh) -> Mesh {
    let reach = mesh.positions.iter().flatten().fold(f32::MIN_POSITIVE, |all, x| all.max(x.abs()));
    // The least power of two that is not below the reach.
    let step = f32::from_bits((reach.to_bits() + 0x007f_ffff) & 0x7f80_0000) / LATTICE;
    let positions = mesh.positions.iter().map(|p| p.map(|x| (x / step).round() * step)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

/// `n` rays that lie exactly in the plane of a triangle, a third of them along an edge.
///
/// `mesh` must come from [`on_lattice`]: origin and direction are sums of few multiples of edges, so each coordinate is an
/// integer number of steps below 2^24. Triangles with fewer than two distinct vertices give no ray.
#[must_use]
pub fn in_planes(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    if mesh.triangles.is_empty() {
        return vec![aside()];
    }
    let mut rng = SplitMix64::new(seed);
    let mut ray = |i: usize| {
        let corners = mesh.triangles[rng.below(mesh.triangles.len())].map(|index| mesh.positions[index as usize]);
        let first = rng.below(3);
        let [a, b, c] = [0, 1, 2].map(|k| corners[(first + k) % 3]);
        let mut times = || [-3.0f32, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0][rng.below(7)];
        let (mut from, mut along) = ([times(), times()], [times(), times()]);
        if i.is_multiple_of(3) {
            (from[1], along[1]) = (0.0, 0.0);
        }
        let sum = |[u, v]: [f32; 2]| std::array::from_fn(|k| u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let offset: [f32; 3] = sum(from);
        Ray::new(std::array::from_fn(|k| a[k] + offset[k]), sum(along))
    };
    (0..n).map(&mut ray).filter(|ray| ray.direction != [0.0; 3]).collect()
}

#[cfg(test)]
mod tests {
    use canted_fixtures::soup;

    use super::*;
    use crate::exact::near_plane;

    #[test]
    fn rays_in_planes_lie_in_planes() {
        let mesh = on_lattice(&soup(3, 1).off_axis());
        let corners = mesh.triangles[0].map(|index| mesh.positions[index as usize]);
        let rays = in_planes(&mesh, 100, 1);
        assert!(rays.len() > 80);
        for ray in rays {
            assert!([0.0, 1.0].iter().all(|&t| near_plane(&ray, t, corners, 0.0)), "{ray:?}");
        }
        let off = Ray::new([corners[0][0].next_up(), corners[0][1], corners[0][2]], [1.0, 0.0, 0.0]);
        assert!(!near_plane(&off, 0.0, corners, 0.0));
    }

    #[test]
    fn rays_from_afar_start_far_away() {
        let mesh = soup(3, 10);
        for ray in from_afar(&mesh, 1e4, 30, 2) {
            let distance = ray.origin.iter().map(|x| x * x).sum::<f32>().sqrt();
            assert!(distance > 1.2e4 && distance < 3e4, "{distance}");
        }
    }
}
