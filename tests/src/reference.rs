//! All hits of a ray compared with exact arithmetic, triangle by triangle.

use canted_fixtures::{Mesh, SplitMix64, displaced_icosphere, fan, slivers, soup, thin_box};
use canted_obb::PrimId;
use canted_trace::{HIT_ERROR, Hit, Ray};

use crate::exact::{Margin, Verdict, near_plane, verdict};

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f32 = 0.5 * f32::EPSILON;

/// Displacement of a vertex across the ray in the watertight test, relative to its greatest distance from the origin.
///
/// The subtraction, and the sheared coordinate's quotient, product and difference: four roundings. The sheared z has one more,
/// which moves nothing across the ray. Two axes give a factor of √2; a fifth unit covers second-order terms.
const ACROSS: f32 = 5.0 * std::f32::consts::SQRT_2 * U;

/// What underflow adds to the distance of a reported point, as documented for `HIT_ERROR`: 2^-127.
const UNDERFLOW: f32 = 0.5 * f32::MIN_POSITIVE;

/// Displacement of a vertex across the ray by underflow: half of 2^-149 in the shearing product, on two axes, and as much in
/// the rounded margin.
const UNDERFLOW_ACROSS: f32 = f32::from_bits(2);

fn greatest(numbers: impl IntoIterator<Item = f32>) -> f32 {
    numbers.into_iter().fold(0.0, |all, x| all.max(x.abs()))
}

/// Vertices of a triangle.
#[must_use]
pub fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [[f32; 3]; 3] {
    triangle.map(|index| mesh.positions[index as usize])
}

/// The margin of a triangle: the bound of the kernel's proof, rounded up by a thousandth.
#[must_use]
pub fn margin(ray: &Ray, corners: &[[f32; 3]; 3]) -> Margin {
    let origin = greatest(ray.origin);
    let away = greatest(corners.iter().flat_map(|corner| (0..3).map(|k| corner[k] - ray.origin[k])));
    let reach = greatest(corners.iter().flatten().copied());
    // Along each of three axes, so √3 along a normal.
    let along = 3.0f32.sqrt() * HIT_ERROR * (origin + reach);
    Margin { across: 1.001 * ACROSS * away + UNDERFLOW_ACROSS, along: 1.001 * along + UNDERFLOW }
}

/// Number of ray-triangle pairs by verdict.
#[derive(Default, Debug)]
pub struct Tally {
    /// Certain hits.
    pub n_pierced: usize,
    /// Certain misses.
    pub n_missed: usize,
    /// Pairs within the margin.
    pub n_open: usize,
}

/// Compares `hits` with the verdicts on `mesh`.
///
/// # Errors
/// The first certain hit that is not found, certain miss that is hit, or hit off its plane.
pub fn compare(mesh: &Mesh, ray: &Ray, hits: &[Hit], tally: &mut Tally) -> Result<(), String> {
    for (id, triangle) in (0..).map(PrimId).zip(&mesh.triangles) {
        let corners = corners(mesh, triangle);
        let margin = margin(ray, &corners);
        let hit = hits.iter().find(|hit| hit.primitive == id);
        match (verdict(ray, corners, &margin), hit) {
            (Verdict::Pierced, None) => return Err(format!("{ray:?} pierces {id} and does not hit it")),
            (Verdict::Missed, Some(hit)) => return Err(format!("{ray:?} misses {id} and hits it: {hit:?}")),
            (Verdict::Pierced, _) => tally.n_pierced += 1,
            (Verdict::Missed, _) => tally.n_missed += 1,
            (Verdict::Open, _) => tally.n_open += 1,
        }
        if let Some(hit) = hit.filter(|hit| !near_plane(ray, hit.t, corners, margin.along)) {
            return Err(format!("{ray:?} hits {id} off its plane: {hit:?}"));
        }
    }
    Ok(())
}

/// Rays towards points near edges and vertices, at distances from a few roundings to an edge length, inward and outward.
#[must_use]
pub fn rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let diagonal = mesh.diagonal();
    let mut ray = || {
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let along = [0.0, 0.5, rng.unit()][rng.below(3)];
        let offset = 0.5f64.powi(i32::try_from(rng.below(22)).unwrap()) * [1.0, -1.0][rng.below(2)];
        let direction = rng.on_sphere();
        let distance = diagonal * rng.unit();
        let target: [f64; 3] = std::array::from_fn(|k| {
            let edge = a[k] + along * (b[k] - a[k]);
            edge + 0.3 * offset * (c[k] - edge)
        });
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] - distance * direction[k]) as f32);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(|_| ray()).filter(|ray| greatest(ray.direction) > 0.0).collect()
}

/// Small meshes of every kind, size and position.
#[must_use]
pub fn meshes() -> Vec<(&'static str, Mesh)> {
    let soup = soup(21, 60);
    let placed = |scale: f32, shift: f32| {
        let positions = soup.positions.iter().map(|p| p.map(|x| x * scale + shift)).collect();
        Mesh { positions, triangles: soup.triangles.clone() }
    };
    vec![
        ("displaced icosphere", displaced_icosphere(3, 1)),
        ("fan", fan(40)),
        ("slivers", slivers(8, 60)),
        ("thin box", thin_box(1e-3)),
        ("soup at 1e7", placed(5e3, 1e7)),
        ("soup at 1e-20", placed(1e-20, 0.0)),
        ("soup at 1e15", placed(1e15, 0.0)),
        ("soup", soup.clone()),
    ]
}
