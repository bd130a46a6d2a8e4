//! Degenerate scenes: a hundred thousand identical triangles, a far outlier, equal centroids, very few triangles.
//!
//! Build time grows no faster than the scene, depth is bounded, and so is the number of tests in a traversal. Coincident
//! triangles all tie, so every one must be tested to find the lowest index; the bound is then the scene size. Not covered here:
//! quality of ordinary trees (the program's `stats`), invalid geometry.

use std::time::{Duration, Instant};

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::{Grazing, Mesh, equal_centroids, grazing, identical, outlier, soup};
use canted_lbvh::{self as lbvh, Bits, Domain, Strategy, VolumeConfig};
use canted_tests::brute;
use canted_trace::{Counts, InstanceId, Ray, Watertight};

fn config(strategy: Strategy, bits: Bits) -> BuildConfig {
    BuildConfig { bits, volumes: VolumeConfig { strategy, fallback: true } }
}

fn build(mesh: &Mesh, config: &BuildConfig) -> Bvh2<Watertight> {
    Bvh2::build(&mesh.positions, &mesh.triangles, config).unwrap()
}

/// A scene of `n` triangles by name.
type Kind = (&'static str, fn(u32) -> Mesh);

const KINDS: [Kind; 3] = [("identical", identical), ("outlier", outlier), ("equal centroids", equal_centroids)];

fn build_time(mesh: &Mesh, config: &BuildConfig) -> Duration {
    let start = Instant::now();
    build(mesh, config);
    start.elapsed()
}

/// Greatest time ratio for ten times the triangles: linear time gives 10, sorting passes and caches add some, quadratic time
/// gives 100.
const LINEAR: u32 = 30;

/// Greatest number of repeated builds.
const N_BUILDS: u32 = 50;

/// The least build times of both meshes on one thread, alternating, because other load only adds time. Stops as soon as the
/// times are in proportion.
fn least_times(meshes: [&Mesh; 2], config: &BuildConfig) -> [Duration; 2] {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut least = [Duration::MAX; 2];
    for _ in 0..N_BUILDS {
        least = pool.install(|| [0, 1].map(|i| least[i].min(build_time(meshes[i], config))));
        if least[1] < LINEAR * least[0] {
            break;
        }
    }
    least
}

#[test]
fn build_time_is_nearly_linear() {
    for (name, mesh) in KINDS {
        let (small, large) = (mesh(10_000), mesh(100_000));
        for strategy in Strategy::ALL {
            let [small, large] = least_times([&small, &large], &config(strategy, Bits::B63));
            assert!(large < LINEAR * small, "{name}, {strategy:?}: {small:?}, then {large:?}");
        }
    }
}

#[test]
fn depth_stays_within_its_bound() {
    for (name, mesh) in KINDS.into_iter().chain([("soup", (|n| soup(4, n)) as fn(u32) -> Mesh)]) {
        for n in [1, 2, 3, 7, 1000, 4097, 100_000] {
            for (bits, n_bits) in [(Bits::B30, 30), (Bits::B63, 63)] {
                let mesh = mesh(n);
                let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
                let codes = lbvh::morton_codes(&Domain::new(&bounds, 3, bits), &corners);
                let tree = lbvh::radix(lbvh::sort_by_code(&codes, bits));
                // Each step down separates codes by a bit, then positions; the leaf counts too.
                let n_position_bits = n.next_power_of_two().trailing_zeros();
                assert!(tree.depth <= n_bits + n_position_bits + 1, "{name}, {n}, {bits:?}: {}", tree.depth);
                assert!(tree.depth > n_position_bits, "{name}, {n}, {bits:?}: {}", tree.depth);
            }
        }
    }
}

#[test]
fn equal_codes_make_a_balanced_tree() {
    for (name, mesh) in [KINDS[0], KINDS[2]] {
        let mesh = mesh(100_000);
        let blas = build(&mesh, &config(Strategy::Aabb, Bits::B63));
        // 2^17 is the next power of two; the leaf adds one level.
        assert_eq!(blas.pairs().depth(), 18, "{name}");
    }
}

/// Mean number of box and triangle tests per ray.
fn tests_per_ray(blas: &Bvh2<Watertight>, rays: &[Ray]) -> f64 {
    let mut counts = Counts::default();
    for ray in rays {
        blas.closest_hit_with(ray, InstanceId(0), &mut counts);
    }
    (counts.boxes + counts.triangles) as f64 / rays.len() as f64
}

fn rays_at(mesh: &Mesh, n: usize) -> Vec<Ray> {
    let ray = |ray: canted_fixtures::RayData| Ray::new(ray.origin, ray.direction);
    [Grazing::Vertices, Grazing::Far].into_iter().flat_map(|class| grazing(mesh, class, n, 5)).map(ray).collect()
}

/// `n` triangles in the unit cube and one at `distance`.
fn cluster(n: u32, distance: f32) -> Mesh {
    let mut mesh = soup(9, n);
    let first = u32::try_from(mesh.positions.len()).unwrap();
    mesh.positions.extend([[distance; 3], [distance + 1.0, distance, distance], [distance, distance + 1.0, distance]]);
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh
}

#[test]
fn an_outlier_costs_only_its_share_of_the_grid() {
    let alone = soup(9, 20_000);
    let rays = rays_at(&alone, 300);
    let tests = |mesh: &Mesh, bits| tests_per_ray(&build(mesh, &config(Strategy::Aabb, bits)), &rays);
    let without = tests(&alone, Bits::B63);
    // 2^21 cells over 1e3 leave 2,000 for the unit cube, where 20,000 triangles need 27.
    let with = tests(&cluster(20_000, 1e3), Bits::B63);
    assert!(with < 1.5 * without, "{without} tests a ray, {with} with an outlier at 1e3");
    // 2^10 cells over 1e3 leave one cell, as do 2^21 over 1e7: the order is then that of the input, and a ray may test every
    // box. This is the limit of codes on a grid; an SAH build does not have it.
    for (distance, bits) in [(1e3, Bits::B30), (1e7, Bits::B63)] {
        let coarse = tests(&cluster(20_000, distance), bits);
        assert!(coarse > 10.0 * without && coarse <= 60_002.0, "{coarse} tests a ray, {bits:?}, {distance:e}");
    }
}

#[test]
fn coincident_triangles_are_tested_once_each_and_missed_early() {
    let n = 100_000;
    let mesh = identical(n);
    for strategy in Strategy::ALL {
        let blas = build(&mesh, &config(strategy, Bits::B63));
        let trace = |ray: &Ray| {
            let mut counts = Counts::default();
            (blas.closest_hit_with(ray, InstanceId(0), &mut counts).map(|hit| hit.primitive.0), counts)
        };
        let (hit, counts) = trace(&Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]));
        assert_eq!((hit, counts.triangles), (Some(0), u64::from(n)), "{strategy:?}");
        assert!(counts.boxes < 2 * u64::from(n), "{strategy:?}: {counts:?}");
        let (hit, counts) = trace(&Ray::new([-2.0, 0.25, -1.0], [0.0, 0.0, 1.0]));
        assert_eq!((hit, counts.triangles), (None, 0), "{strategy:?}");
        assert!(counts.boxes <= 3, "{strategy:?}: {counts:?}");
        let mut any = Counts::default();
        assert!(blas.occluded_with(&Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]), InstanceId(0), &mut any));
        assert_eq!(any.triangles, 1, "{strategy:?}");
        assert!(any.boxes < 40, "{strategy:?}: {any:?}");
    }
}

#[test]
fn degenerate_scenes_match_the_loop() {
    for (name, mesh) in KINDS {
        for n in [0, 1, 2, 3, 500] {
            let mesh = mesh(n);
            let records = brute::records::<Watertight>(&mesh.positions, &mesh.triangles);
            let rays = if n == 0 { vec![Ray::new([0.0; 3], [1.0, 0.0, 0.0])] } else { rays_at(&mesh, 40) };
            for strategy in Strategy::ALL {
                for bits in [Bits::B30, Bits::B63] {
                    let blas = build(&mesh, &config(strategy, bits));
                    for ray in &rays {
                        let want = brute::closest_hit::<Watertight>(&records, ray);
                        assert_eq!(blas.closest_hit(ray), want, "{name}, {n}, {strategy:?}, {ray:?}");
                        assert_eq!(blas.occluded(ray), want.is_some());
                    }
                }
            }
        }
    }
}

/// The bounds above can fail: a chain is deep and slow.
#[test]
fn a_chain_exceeds_the_bounds() {
    let n = 2_000u32;
    let mesh = soup(9, n);
    let (corners, bounds) = lbvh::triangle_corners(&mesh.positions, &mesh.triangles).unwrap();
    let chain: Vec<_> = (0..n - 1)
        .map(|i| {
            let rest = if i + 2 < n { lbvh::Child::inner(lbvh::NodeId(i + 1)) } else { lbvh::Child::leaf(n - 1) };
            [lbvh::Child::leaf(i), rest]
        })
        .collect();
    let tree = lbvh::Tree::from_children(&chain).unwrap();
    assert_eq!(tree.depth, n);
    let config = config(Strategy::Aabb, Bits::B63);
    let rays = rays_at(&mesh, 100);
    let chained = tests_per_ray(&Bvh2::over(tree, &corners, &bounds, &config), &rays);
    assert!(chained > 10.0 * tests_per_ray(&build(&mesh, &config), &rays), "{chained} tests a ray");
}
