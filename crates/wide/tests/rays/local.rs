//! Box tests depend on the ray and on what is in a box, not on what is elsewhere in the mesh.
//!
//! Counted, so the results are the same on every machine. Not covered: scenes where the far part is hit.

use canted_fixtures::{Mesh, SplitMix64};
use canted_trace::{Counts, Intersect, MollerTrumbore, Ray, TriangleTest, Watertight};
use canted_wide::{Preset, TriangleBvh};

use crate::common::{brute, build, build_for};

/// By how much a far part may raise the number of box tests.
const MOST: f64 = 1.5;

fn to_f32(v: [f64; 3]) -> [f32; 3] {
    v.map(|x| x as f32)
}

/// `n` triangles of about `size` in a cube from `-half` to `half` around `center`.
fn detail(n: usize, half: f64, size: f64, center: [f64; 3], seed: u64) -> Mesh {
    let mut rng = SplitMix64::new(seed);
    let mut mesh = Mesh { positions: vec![], triangles: vec![] };
    for i in 0..u32::try_from(n).unwrap() {
        let at = rng.signed3();
        for _ in 0..3 {
            let corner = rng.signed3();
            mesh.positions.push(to_f32([0, 1, 2].map(|k| center[k] + half * at[k] + 0.5 * size * corner[k])));
        }
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// Two triangles of this half-width at `z`.
fn floor(half: f32, z: f32) -> Mesh {
    let positions = vec![[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
    Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] }
}

/// Rays from a cube of this half-width around `center`, in all directions.
fn rays(n: usize, half: f64, center: [f64; 3], seed: u64) -> Vec<Ray> {
    let mut rng = SplitMix64::new(seed);
    let mut ray = || {
        let at = rng.signed3();
        Ray::new(to_f32([0, 1, 2].map(|k| center[k] + half * at[k])), to_f32(rng.on_sphere()))
    };
    (0..n).map(|_| ray()).collect()
}

/// Box tests a ray, by preset, after comparing a part of the hits with the loop.
fn n_boxes(mesh: &Mesh, rays: &[Ray], n_checked: usize) -> Vec<(Preset, f64)> {
    let expected: Vec<_> =
        rays[..n_checked].iter().map(|ray| brute::<Watertight>(mesh, ray).first().copied()).collect();
    let count = |preset: Preset| {
        let bvh = build(mesh, preset);
        let mut counts = Counts::default();
        for (i, ray) in rays.iter().enumerate() {
            let hit = bvh.closest_hit_with(ray, &mut counts);
            assert!(i >= n_checked || hit == expected[i], "{preset:?}: {ray:?}: {hit:?}, {:?}", expected[i]);
        }
        (preset, counts.boxes as f64 / rays.len() as f64)
    };
    [Preset::Fast, Preset::Balanced].map(count).into()
}

/// Compares box tests of `mesh` with and without `far`.
fn assert_local(what: &str, mesh: &Mesh, far: &Mesh, rays: &[Ray]) {
    let alone = n_boxes(mesh, rays, 0);
    let together = n_boxes(&mesh.joined(far), rays, 60);
    for ((name, alone), (_, together)) in alone.iter().zip(&together) {
        assert!(*together <= MOST * alone, "{what}, {name:?}: {together} box tests a ray instead of {alone}");
    }
}

#[test]
fn a_floor_of_any_size_does_not_slow_small_detail() {
    let mesh = detail(50_000, 1.0, 0.01, [0.0; 3], 1);
    let rays = rays(2_000, 1.0, [0.0; 3], 2);
    for half in [1e4, 1e5, 1e6] {
        assert_local(&format!("a floor of {half}"), &mesh, &floor(half, -1.1), &rays);
    }
}

#[test]
fn a_sky_does_not_slow_small_detail() {
    let mesh = detail(50_000, 1.0, 0.01, [0.3, -0.2, 0.7], 3);
    let sky = canted_fixtures::icosphere(2).placed(|p| p.map(|x| 1e6 * x));
    assert_local("a sky", &mesh, &sky, &rays(2_000, 1.0, [0.3, -0.2, 0.7], 4));
}

/// Rays in the small cluster at the origin of the space, next to one of a million; and the other way round.
#[test]
fn clusters_of_very_different_scale_do_not_slow_each_other() {
    let small = detail(10_000, 1e-6, 1e-8, [0.0; 3], 5);
    let large = detail(10_000, 1e6, 1e4, [3e6, 0.0, 0.0], 6);
    assert_local("a large cluster", &small, &large, &rays(2_000, 1e-6, [0.0; 3], 7));
    assert_local("a small cluster", &large, &small, &rays(2_000, 1e6, [3e6, 0.0, 0.0], 8));
}

/// A mesh far from the origin needs as many box tests as the same mesh at the origin, as far as `f32` can hold it: a distance of 1e7 is
/// 600 times the resolution of its coordinates away from losing it.
#[test]
fn a_distant_mesh_is_as_fast_as_one_at_the_origin() {
    for (size, distances) in [(0.02, &[1e4, 1e5][..]), (20.0, &[1e6, 1e7])] {
        let half = 50.0 * size;
        let mesh = detail(20_000, half, size, [0.0; 3], 20);
        let alone = n_boxes(&mesh, &rays(1_000, half, [0.0; 3], 21), 0);
        for &distance in distances {
            for direction in [[1.0, 0.0, 0.0], [-0.7, 0.3, 1.0]] {
                let center = direction.map(|x| distance * x);
                let away = n_boxes(&detail(20_000, half, size, center, 20), &rays(1_000, half, center, 21), 60);
                for ((name, alone), (_, away)) in alone.iter().zip(&away) {
                    let what = format!("{size} at {distance}, {name:?}");
                    assert!(*away <= MOST * alone, "{what}: {away} box tests a ray instead of {alone}");
                }
            }
        }
    }
}

/// A distant mesh with a floor that reaches the origin, and one that a refit moves there and back.
#[test]
fn a_distant_mesh_may_have_distant_parts_and_move() {
    let (near, far) = ([0.0; 3], [3e5, -2e5, 1e4]);
    let [mesh, away] = [near, far].map(|center| detail(20_000, 1.0, 0.05, center, 22));
    let [rays_near, rays_far] = [near, far].map(|center| rays(1_000, 1.0, center, 23));
    assert_local("a floor from afar to the origin", &away, &floor(1e6, 1e4 - 1.1), &rays_far);

    let mut bvh = build(&mesh, Preset::Fast);
    let count = |bvh: &TriangleBvh, mesh: &Mesh, rays: &[Ray]| {
        let mut counts = Counts::default();
        for (i, ray) in rays.iter().enumerate() {
            let hit = bvh.closest_hit_with(ray, &mut counts);
            assert!(i > 30 || hit == brute::<Watertight>(mesh, ray).first().copied(), "{ray:?}");
        }
        counts.boxes
    };
    let before = count(&bvh, &mesh, &rays_near);
    for (mesh, rays) in [(&away, &rays_far), (&mesh, &rays_near)] {
        bvh.refit(&mesh.positions, &mesh.triangles).unwrap();
        let after = count(&bvh, mesh, rays);
        assert!(2 * after <= 3 * before, "{after} box tests instead of {before}");
        let loaded = TriangleBvh::from_bytes(&bvh.to_bytes()).unwrap();
        assert_eq!(count(&loaded, mesh, rays), after);
    }
}

/// Boxes that a refit writes are as local as those of a build, and so are those read from a file of another triangle test.
#[test]
fn refitted_and_loaded_boxes_are_local() {
    let mesh = detail(20_000, 1.0, 0.015, [0.0; 3], 9).joined(&floor(1e6, -1.1));
    let shrunk = mesh.placed(|p| p.map(|x| 0.5 * x));
    let rays = rays(500, 0.5, [0.0; 3], 10);
    let mut bvh = build(&mesh, Preset::Fast);
    bvh.refit(&shrunk.positions, &shrunk.triangles).unwrap();
    let other = build_for(TriangleTest::MollerTrumbore, &shrunk, Preset::Fast).to_bytes();
    let [mut built, mut refitted, mut loaded] = [Counts::default(); 3];
    let of_build = build(&shrunk, Preset::Fast);
    let of_other = TriangleBvh::from_bytes_with(&other, TriangleTest::Watertight).unwrap();
    for ray in &rays {
        let hit = of_build.closest_hit_with(ray, &mut built);
        assert_eq!(bvh.closest_hit_with(ray, &mut refitted), hit, "{ray:?}");
        assert_eq!(of_other.closest_hit_with(ray, &mut loaded), hit, "{ray:?}");
    }
    // A power of two changes no decision of the build, so that the boxes are the same bit for bit.
    assert_eq!((refitted, loaded), (built, built));
    assert_eq!(of_other.to_bytes(), of_build.to_bytes());
    assert_eq!(
        TriangleBvh::from_bytes_with(&of_build.to_bytes(), TriangleTest::MollerTrumbore).unwrap().to_bytes(),
        other
    );
}

/// Rays at corners and edges of triangles, hence of boxes, with origins from close by to 1e7, in a mesh of mixed scales.
#[test]
fn grazing_rays_in_mixed_scales_hit_what_the_loop_hits() {
    let near = detail(400, 1.0, 0.3, [0.0; 3], 12);
    let tiny = detail(200, 1e-4, 5e-5, [0.7, -0.4, 0.2], 13);
    let away = detail(200, 10.0, 3.0, [4e4, -3e4, 9e3], 14);
    let mesh = near.joined(&tiny).joined(&away).joined(&floor(1e6, -1.0));
    let mut rng = SplitMix64::new(15);
    let mut ray = |i: usize| {
        let triangle = mesh.triangles[rng.below(mesh.triangles.len())];
        let [a, b] = [0, 1].map(|j| mesh.positions[triangle[j] as usize].map(f64::from));
        // At a vertex, or on an edge.
        let s = if i.is_multiple_of(2) { 0.0 } else { rng.unit() };
        let target = [0, 1, 2].map(|k| a[k] + s * (b[k] - a[k]));
        let (mut direction, distance) = (rng.on_sphere(), 10.0_f64.powf(9.0 * rng.unit() - 2.0));
        if i.is_multiple_of(5) {
            // In the plane of two faces of a box.
            direction[i % 3] = 0.0;
        }
        let origin = to_f32([0, 1, 2].map(|k| target[k] - distance * direction[k]));
        Ray::new(origin, to_f32([0, 1, 2].map(|k| target[k] - f64::from(origin[k]))))
    };
    let rays: Vec<Ray> = (0..6_000).map(&mut ray).collect();
    let mut n_hits = 0;
    for preset in [Preset::Dynamic, Preset::Fast, Preset::Balanced, Preset::Quality] {
        let (watertight, weights) = (build(&mesh, preset), build_for(TriangleTest::MollerTrumbore, &mesh, preset));
        for ray in &rays {
            let hit = brute::<Watertight>(&mesh, ray).first().copied();
            n_hits += u32::from(hit.is_some());
            assert_eq!(watertight.closest_hit(ray), hit, "{preset:?}: {ray:?}");
            assert_eq!(watertight.occluded(ray), hit.is_some(), "{preset:?}: {ray:?}");
            let hit = brute::<MollerTrumbore>(&mesh, ray).first().copied();
            assert_eq!(weights.closest_hit(ray), hit, "{preset:?}: {ray:?}");
        }
    }
    assert!(n_hits > 5_000, "{n_hits}");
}

/// The counter counts: a ray that misses all tests the root alone.
#[test]
fn a_miss_tests_one_node() {
    let bvh = build(&detail(1_000, 1.0, 0.01, [0.0; 3], 11), Preset::Fast);
    let mut counts = Counts::default();
    assert_eq!(bvh.closest_hit_with(&Ray::new([5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), &mut counts), None);
    assert_eq!(counts.boxes, 8);
}
