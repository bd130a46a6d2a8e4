//! How much work a ray does, and how much memory a BIH takes.

use std::time::{Duration, Instant};

use canted_bih::{BihConfig, BoxBih};
use canted_fixtures::{Mesh, equal_centroids, identical, outlier, soup, torus};
use canted_trace::{Counts, Intersect, Ray, Watertight};

use crate::common::{build, config, loop_over_all, rays};

fn counted(mesh: &Mesh, config: &BihConfig, rays: &[Ray]) -> Counts {
    let bih = build::<Watertight>(mesh, config);
    let mut counts = Counts::default();
    for ray in rays {
        bih.closest_hit_with(ray, &mut counts);
    }
    counts
}

#[test]
fn queries_count_their_tests() {
    let mesh = torus(10, 6);
    let bih = build::<Watertight>(&mesh, &BihConfig::default());
    let ray = rays(&mesh, 50).into_iter().find(|ray| bih.occluded(ray)).unwrap();
    let mut counts = Counts::default();
    assert_eq!(bih.closest_hit_with(&ray, &mut counts), bih.closest_hit(&ray));
    assert!(counts.boxes > 0 && (1..120).contains(&counts.triangles), "{counts:?}");
    let printed = format!("{bih:?}");
    assert!(printed.starts_with("Bih { n_triangles: 120, "), "{printed}");
}

#[test]
fn a_ray_that_misses_the_root_visits_no_node() {
    let mesh = torus(10, 6);
    let counts = counted(&mesh, &BihConfig::default(), &[Ray::new([9.0, 9.0, 9.0], [1.0, 0.0, 0.0])]);
    assert_eq!(counts, Counts { boxes: 1, triangles: 0 });
}

/// Two clusters: a ray in the gap visits the node that owns it, and nothing else.
#[test]
fn a_ray_in_the_gap_visits_only_the_node_that_owns_it() {
    let small = soup(2, 100);
    let mesh = small.joined(&small.placed(|[x, y, z]| [x + 100.0, y, z]));
    let counts = counted(&mesh, &config(1, 1.3), &[Ray::new([50.0, 0.5, -1.0], [0.0, 0.0, 1.0])]);
    assert_eq!(counts, Counts { boxes: 3, triangles: 0 });
}

#[test]
fn subtrees_behind_the_hit_are_skipped() {
    let wall =
        |x: f32| Mesh { positions: vec![[x, -9.0, -9.0], [x, 9.0, -9.0], [x, 0.0, 9.0]], triangles: vec![[0, 1, 2]] };
    let mut mesh = Mesh::default();
    for x in 0..64u8 {
        mesh = mesh.joined(&wall(x.into()));
    }
    let counts = |ray| counted(&mesh, &config(1, 1.3), &[ray]);
    for direction in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]] {
        let nearest = counts(Ray::new([31.5, 0.0, 0.0], direction));
        assert_eq!(nearest.triangles, 1, "{nearest:?}");
        // A ray that ends before the first wall.
        let none = counts(Ray { t_max: 0.25, ..Ray::new([31.5, 0.0, 0.0], direction) });
        assert_eq!(none.triangles, 0, "{none:?}");
    }
}

/// Groups of triangles in thin plates: without clip nodes their margins are visited.
#[test]
fn the_tight_box_rule_saves_visits() {
    let plate = soup(4, 40).placed(|[x, y, z]| [x * 0.05, y * 30.0, z * 30.0]);
    let mut mesh = Mesh::default();
    for i in 0..12u8 {
        mesh = mesh.joined(&plate.placed(|[x, y, z]| [x + 10.0 * f32::from(i), y, z]));
    }
    let rays = rays(&mesh, 100);
    let [with, without] = [1.3, f32::INFINITY].map(|factor| counted(&mesh, &config(2, factor), &rays));
    assert!(with.boxes + with.triangles < without.boxes + without.triangles, "{with:?}, {without:?} without");
    for ray in &rays {
        let want = loop_over_all::<Watertight>(&mesh, ray).first().copied();
        assert_eq!(build::<Watertight>(&mesh, &config(2, 1.3)).closest_hit(ray), want);
    }
}

/// Planes carry pads by their own content, so that a floor of 1e6 does not slow rays among small triangles.
#[test]
fn a_large_triangle_does_not_loosen_other_planes() {
    let small = soup(6, 3_000);
    let far: Vec<[f32; 3]> = [[-1e6, -1e6, -9.0], [1e6, -1e6, -9.0], [0.0, 1e6, -9.0]].to_vec();
    let mesh = small.joined(&Mesh { positions: far, triangles: vec![[0, 1, 2]] });
    let rays: Vec<Ray> = rays(&small, 40).into_iter().filter(|ray| ray.origin.iter().all(|x| x.abs() < 5.0)).collect();
    let [alone, with] = [&small, &mesh].map(|mesh| counted(mesh, &config(1, 1.3), &rays));
    assert!(with.boxes + with.triangles < 2 * (alone.boxes + alone.triangles), "{alone:?}, with the floor {with:?}");
}

#[test]
fn larger_leaves_take_less_memory() {
    let mesh = soup(3, 2_000);
    let nodes = [1, 5, 10, 20, 30].map(|n| build::<Watertight>(&mesh, &config(n, 1.3)).memory().nodes);
    assert!(nodes.is_sorted_by(|a, b| a > b), "{nodes:?}");
    let bih = build::<Watertight>(&mesh, &config(1, f32::INFINITY));
    let memory = bih.memory();
    assert_eq!((memory.nodes, memory.references, memory.triangles), (16 * (2 * 2_000 - 1), 4 * 2_000, 36 * 2_000));
    assert_eq!(bih.n_bytes(), memory.total());
}

/// A mesh of `n` triangles by name.
type Degenerate = (&'static str, fn(u32) -> Mesh);

const DEGENERATE: [Degenerate; 3] =
    [("identical", identical), ("outlier", outlier), ("equal centroids", equal_centroids)];

/// Greatest time ratio for ten times the triangles: linear time gives 10, more levels and caches add some, quadratic time gives
/// 100.
const LINEAR: u32 = 30;

#[test]
fn degenerate_scenes_build_in_linear_time() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, mesh) in DEGENERATE {
        let meshes = [mesh(10_000), mesh(100_000)];
        let mut least = [Duration::MAX; 2];
        // Other load only adds time.
        for _ in 0..50 {
            for (mesh, least) in meshes.iter().zip(&mut least) {
                let start = Instant::now();
                let bih = pool.install(|| build::<Watertight>(mesh, &BihConfig::default()));
                *least = start.elapsed().min(*least);
                assert!(bih.boxes().depth() <= BoxBih::MAX_DEPTH, "{name}: {bih:?}");
            }
            if least[1] < LINEAR * least[0] {
                break;
            }
        }
        assert!(least[1] < LINEAR * least[0], "{name}: {least:?}");
    }
}
