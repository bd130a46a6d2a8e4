//! Builds: the same bytes for any number of threads, and bounded time on degenerate scenes.

use std::time::{Duration, Instant};

use canted_fixtures::{Mesh, equal_centroids, identical, outlier, scaffold_of, slivers, soup};
use canted_tests::{rays, scenes};
use canted_trace::{Counts, InstanceId, Ray, Watertight};
use canted_wide::{Config, Preset};

use super::setup::{agrees, build, every_variant, few_variants};

fn bytes(n_threads: usize, mesh: &Mesh, config: &Config) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    pool.install(|| build::<Watertight>(mesh, config).to_bytes())
}

#[test]
fn threads_change_no_byte() {
    // More triangles than one task has.
    let meshes = [soup(3, 12_000), scaffold_of(1, true, 6), scenes::room(3, 800).off_axis(), identical(9_000)];
    for mesh in meshes {
        for (variant, config) in few_variants() {
            let want = bytes(1, &mesh, &config);
            for n_threads in [2, 3] {
                assert!(bytes(n_threads, &mesh, &config) == want, "{variant}, {n_threads} threads");
            }
        }
    }
}

/// The bytes distinguish BVHs.
#[test]
fn bytes_differ_between_scenes_and_presets() {
    let of = |seed, preset| bytes(2, &soup(seed, 500), &Config::preset(preset));
    assert_eq!(of(1, Preset::Fast), of(1, Preset::Fast));
    assert_ne!(of(1, Preset::Fast), of(2, Preset::Fast));
    assert_ne!(of(1, Preset::Fast), of(1, Preset::Quality));
}

/// A scene of `n` triangles by name.
type Kind = (&'static str, fn(u32) -> Mesh);

const KINDS: [Kind; 4] = [
    ("identical", identical),
    ("outlier", outlier),
    ("equal centroids", equal_centroids),
    ("slivers", |n| slivers(5, n)),
];

/// Greatest time ratio for ten times the triangles: linear time gives 10, levels, sorts and caches add some, quadratic time
/// gives 100.
const LINEAR: u32 = 40;

/// The bound if all nodes are reinserted and one triangle lies 10⁷ away: relative to its areas those of the cluster round to
/// zero, the search cannot prune, and time grows as the square.
const QUADRATIC: u32 = 150;

/// Greatest number of repeated builds.
const N_BUILDS: u32 = 20;

#[test]
fn build_time_is_nearly_linear() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, mesh) in KINDS {
        let meshes = [mesh(2_000), mesh(20_000)];
        for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
            let config = Config::preset(preset);
            let bound = if name == "outlier" && preset == Preset::Quality { QUADRATIC } else { LINEAR };
            let mut least = [Duration::MAX; 2];
            for _ in 0..N_BUILDS {
                for (least, mesh) in least.iter_mut().zip(&meshes) {
                    let start = Instant::now();
                    pool.install(|| build::<Watertight>(mesh, &config));
                    *least = start.elapsed().min(*least);
                }
                if least[1] < bound * least[0] {
                    break;
                }
            }
            assert!(least[1] < bound * least[0], "{name}, {preset:?}: {least:?}");
        }
    }
}

/// Triangles stretched along an axis become nearly parallel needles without a best frame, so the search must give up. Without
/// a bound this took two hundred times as long.
#[test]
fn nearly_parallel_needles_take_no_longer_to_build() {
    for scenes::Case { name, mesh } in scenes::needles() {
        let stretched = mesh.positions.iter().map(|p| [p[0] * 20.0 + 1e7, p[1] * 1e-3, p[2] * 1e-3]).collect();
        let meshes = [Mesh { positions: stretched, triangles: mesh.triangles.clone() }, mesh];
        let mut least = [Duration::MAX; 2];
        for _ in 0..N_BUILDS {
            for (least, mesh) in least.iter_mut().zip(&meshes) {
                let start = Instant::now();
                build::<Watertight>(mesh, &Config::default());
                *least = start.elapsed().min(*least);
            }
            if least[0] < 10 * least[1] {
                break;
            }
        }
        assert!(least[0] < 10 * least[1], "{name}: {least:?}");
    }
}

#[test]
fn a_hundred_thousand_equal_triangles_are_tested_once_each_and_missed_early() {
    let n = 100_000;
    let mesh = identical(n);
    for (variant, config) in few_variants() {
        let tree = build::<Watertight>(&mesh, &config);
        // Eight children per node and 17 levels of halving; one child too few at each level adds one.
        assert!(tree.sizes().depth <= 17, "{variant}: {:?}", tree.sizes());
        let trace = |ray: &Ray| {
            let mut counts = Counts::default();
            (tree.closest_hit_with(ray, InstanceId(0), &mut counts).map(|hit| hit.primitive.0), counts)
        };
        let (hit, counts) = trace(&Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]));
        // All tie, so each triangle must be tested and every box entered.
        assert_eq!((hit, counts.triangles), (Some(0), u64::from(n)), "{variant}");
        assert!(counts.boxes < 2 * u64::from(n), "{variant}: {counts:?}");
        let (hit, counts) = trace(&Ray::new([-2.0, 0.25, -1.0], [0.0, 0.0, 1.0]));
        assert_eq!((hit, counts.triangles), (None, 0), "{variant}");
        assert!(counts.boxes <= 8, "{variant}: {counts:?}");
        let mut any = Counts::default();
        assert!(tree.occluded_with(&Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]), InstanceId(0), &mut any));
        assert!(any.triangles <= 32 && any.boxes <= 8 * 17, "{variant}: {any:?}");
    }
}

#[test]
fn degenerate_scenes_match_the_loop() {
    for (name, mesh) in KINDS {
        for n in [0, 1, 2, 3, 8, 9, 500] {
            let mesh = mesh(n);
            let rays = [rays::of_all_classes(&mesh, 12, 190), rays::from_inside(&mesh, 40, 191)].concat();
            agrees::<Watertight>(&format!("{name}, {n}"), &mesh, &every_variant(), &rays);
        }
    }
}
