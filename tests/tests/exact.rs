//! Grazing rays judged without rounding: what certainly pierces is hit, what certainly misses is not.
//!
//! Each ray collects every triangle that the tree offers it; integers say, for each triangle, whether the ray pierces
//! or misses it wherever rounding may have put its vertices. Every strategy, offsets of 1e7, scales 1e-20 and 1e15.
//! Not covered here: rays within the margin, of which only `watertight.rs` asks something; instances, for which
//! `instances.rs` has bounds.

use canted_fixtures::{Mesh, SplitMix64, displaced_icosphere, fan, slivers, soup, thin_box};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::PrimId;
use canted_tests::exact::{Margin, Verdict, near_plane, verdict};
use canted_tlas::{Blas, BuildConfig, MeshBlas};
use canted_trace::{HIT_ERROR, Hit, InstanceId, Query, Ray, Watertight};

/// Half of `f32::EPSILON`: the relative error of one rounding.
const U: f32 = 0.5 * f32::EPSILON;

/// Displacement of a vertex across the ray in the watertight test, relative to its greatest distance from the origin.
///
/// The subtraction, and the sheared coordinate's quotient, product and difference: four roundings. The sheared z is off
/// by one more, which moves nothing across. The picture has two axes, √2 together; a fifth unit covers second-order
/// terms.
const ACROSS: f32 = 5.0 * std::f32::consts::SQRT_2 * U;

/// Refuses every hit, and so is shown all of them.
#[derive(Default)]
struct Collect(Vec<Hit>);

impl Query for Collect {
    fn accepts(&mut self, hit: &Hit) -> bool {
        self.0.push(*hit);
        false
    }
}

fn greatest(numbers: impl IntoIterator<Item = f32>) -> f32 {
    numbers.into_iter().fold(0.0, |all, x| all.max(x.abs()))
}

fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [[f32; 3]; 3] {
    triangle.map(|index| mesh.positions[index as usize])
}

/// The margin of a triangle: what the kernel's proof allows, rounded up by a thousandth.
fn margin(ray: &Ray, corners: &[[f32; 3]; 3]) -> Margin {
    let origin = greatest(ray.origin);
    let away = greatest(corners.iter().flat_map(|corner| (0..3).map(|k| corner[k] - ray.origin[k])));
    let reach = greatest(corners.iter().flatten().copied());
    // Along each of three axes, so √3 in the direction of a normal.
    let along = 3.0f32.sqrt() * HIT_ERROR * (origin + reach);
    Margin { across: 1.001 * ACROSS * away, along: 1.001 * along }
}

#[derive(Default, Debug)]
struct Tally {
    n_pierced: usize,
    n_missed: usize,
    n_open: usize,
}

/// Compares all hits that `hits` holds with the verdicts on `mesh`.
fn compare(mesh: &Mesh, ray: &Ray, hits: &[Hit], tally: &mut Tally) -> Result<(), String> {
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

/// Rays at points beside edges and vertices, by distances from a few roundings to a whole edge, inward and outward.
#[expect(clippy::cast_possible_truncation, reason = "rays are rounded like everything")]
fn rays(mesh: &Mesh, n: usize, seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let diagonal = mesh.diagonal();
    let mut ray = || {
        let [a, b, c] = mesh.corners(rng.below(mesh.triangles.len()));
        let along = [0.0, 0.5, rng.unit()][rng.below(3)];
        let beside = 0.5f64.powi(i32::try_from(rng.below(22)).unwrap()) * [1.0, -1.0][rng.below(2)];
        let direction = rng.on_sphere();
        let distance = diagonal * rng.unit();
        let target: [f64; 3] = std::array::from_fn(|k| {
            let edge = a[k] + along * (b[k] - a[k]);
            edge + 0.3 * beside * (c[k] - edge)
        });
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] - distance * direction[k]) as f32);
        Ray::new(origin, std::array::from_fn(|k| (target[k] - f64::from(origin[k])) as f32))
    };
    (0..n).map(|_| ray()).filter(|ray| greatest(ray.direction) > 0.0).collect()
}

fn meshes() -> Vec<(&'static str, Mesh)> {
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

fn build(mesh: &Mesh, strategy: Strategy) -> MeshBlas<Watertight> {
    let volumes = VolumeConfig { strategy, fallback: true };
    MeshBlas::build(&mesh.positions, &mesh.triangles, &BuildConfig { volumes, ..BuildConfig::default() }).unwrap()
}

#[test]
fn trees_hit_what_is_pierced_and_nothing_that_is_missed() {
    for (name, mesh) in meshes() {
        let mut tally = Tally::default();
        for (strategy, seed) in Strategy::ALL.into_iter().zip(70..) {
            let blas = build(&mesh, strategy);
            for ray in rays(&mesh, 60, seed) {
                let mut all = Collect::default();
                assert_eq!(blas.closest_hit(&ray, InstanceId(0), &mut all), None);
                compare(&mesh, &ray, &all.0, &mut tally).unwrap_or_else(|e| panic!("{name}, {strategy:?}: {e}"));
            }
        }
        let Tally { n_pierced, n_missed, n_open } = tally;
        assert!(n_missed > 1000 && n_open < n_pierced + n_missed, "{name}: {tally:?}");
        // No sliver is so wide that rounding could not move a ray off it.
        assert_eq!(n_pierced > 100, name != "slivers", "{name}: {tally:?}");
    }
}

#[test]
fn the_closest_hit_is_the_least_of_all() {
    for (name, mesh) in meshes() {
        let blas = build(&mesh, Strategy::Dop);
        for ray in rays(&mesh, 60, 5) {
            let hit = blas.closest_hit(&ray, InstanceId(0), &mut ());
            let mut all = Collect::default();
            blas.closest_hit(&ray, InstanceId(0), &mut all);
            let least = all.0.into_iter().reduce(|a, b| if b.before(&a) { b } else { a });
            assert_eq!(hit, least, "{name}: {ray:?}");
        }
    }
}

#[test]
fn a_vertex_moved_by_a_hundred_margins_is_seen() {
    for (name, mesh) in meshes() {
        let mut n_seen = 0;
        for ray in rays(&mesh, 300, 6) {
            let blas = build(&mesh, Strategy::Aabb);
            let mut all = Collect::default();
            blas.closest_hit(&ray, InstanceId(0), &mut all);
            let mut moved = mesh.clone();
            let by = 100.0 * margin(&ray, &corners(&mesh, &mesh.triangles[0])).along;
            moved.positions.iter_mut().for_each(|p| *p = p.map(|x| x + by));
            n_seen += usize::from(compare(&moved, &ray, &all.0, &mut Tally::default()).is_err());
        }
        assert!(n_seen > 10, "{name}: {n_seen} moved meshes were seen");
    }
}
