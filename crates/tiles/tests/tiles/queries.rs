//! Every query, bit for bit, for 1, 2, 7 and 64 tiles and a memory limit of a tenth.

use canted_obb::{Affine, PrimId};
use canted_tiles::{OpenOptions, TileWriter, TiledBvh, WriteOptions};
use canted_tlas::{Instance, Tlas};
use canted_trace::{Accept, Crossings, Hit, HitLists, Intersect, Ray};
use canted_wide::NearestPoint;

use crate::common::{cases, corners, open, points, rays, whole, write};

/// All numbers of a hit as bits.
type Bits = (u32, u32, u32, u32, u32, bool);

fn bits(hit: &Hit) -> Bits {
    let Hit { t, u, v, primitive, instance, side } = *hit;
    (t.to_bits(), u.to_bits(), v.to_bits(), primitive.0, instance.0, side == canted_trace::Side::Front)
}

fn lists(lists: &HitLists) -> Vec<Vec<Bits>> {
    lists.of_rays().map(|hits| hits.iter().map(bits).collect()).collect()
}

/// Compares all queries of rays with those of one BVH.
fn compare_rays(what: &str, tiled: &TiledBvh, one: &dyn Intersect, rays: &[Ray]) -> usize {
    let (mut want, mut found) = (vec![None; rays.len()], vec![None; rays.len()]);
    one.closest_hits(rays, &mut want);
    tiled.try_closest_hits(rays, &mut found).unwrap();
    for ((ray, want), found) in rays.iter().zip(&want).zip(&found) {
        assert_eq!(found.as_ref().map(bits), want.as_ref().map(bits), "{what} {ray:?}");
    }
    let (mut want_any, mut found_any) = (vec![false; rays.len()], vec![false; rays.len()]);
    one.occluded_many(rays, &mut want_any);
    tiled.try_occluded(rays, &mut found_any).unwrap();
    assert_eq!(found_any, want_any, "{what}");
    let (mut want_all, mut found_all) = (HitLists::new(), HitLists::new());
    one.all_hits_listed(rays, &mut want_all);
    tiled.try_all_hits(rays, &mut found_all).unwrap();
    assert_eq!(lists(&found_all), lists(&want_all), "{what}");
    // One ray at a time, and with a filter.
    let is_odd = |hit: &Hit| hit.primitive.0 % 2 == 1 && hit.t.is_finite();
    for ray in rays.iter().step_by(5) {
        let mut all = [vec![], vec![]];
        assert_eq!(
            tiled.closest_hit(ray).as_ref().map(bits),
            one.closest_hit(ray).as_ref().map(bits),
            "{what} {ray:?}"
        );
        assert_eq!(tiled.occluded(ray), one.occluded(ray), "{what} {ray:?}");
        let accepted = [tiled as &dyn Intersect, one]
            .map(|bvh| (bvh.closest_hit_with(ray, &mut Accept(is_odd)), bvh.occluded_with(ray, &mut Accept(is_odd))));
        assert_eq!(accepted[0], accepted[1], "{what} {ray:?}");
        tiled.all_hits(ray, &mut all[0]);
        one.all_hits(ray, &mut all[1]);
        assert_eq!(all[0], all[1], "{what} {ray:?}");
    }
    want.iter().flatten().count()
}

#[test]
fn tiles_answer_as_one_bvh() {
    for case in cases() {
        let (one, rays, points) = (whole(&case.mesh), rays(&case.mesh, 300), points(&case.mesh));
        let mut n_hits = 0;
        for n_tiles in [1, 2, 7, 64] {
            let folder = tempfile::tempdir().unwrap();
            let store = folder.path().join("store");
            let written = write(&store, &case.mesh, n_tiles);
            assert!(written.tiles <= n_tiles, "{} {n_tiles}", case.name);
            for memory in [u64::MAX, written.bytes / 10] {
                let tiled = open(&store, memory);
                assert_eq!(tiled.n_primitives() as usize, case.mesh.triangles.len());
                assert_eq!(tiled.aabb(), one.aabb(), "{}", case.name);
                let what = format!("{} in {n_tiles} tiles, {memory} bytes", case.name);
                n_hits += compare_rays(&what, &tiled, &one, &rays);
                let (mut want, mut found) = (HitLists::new(), HitLists::new());
                one.crossings_listed(&rays, &mut want);
                tiled.try_crossings(&rays, &mut found).unwrap();
                assert_eq!(lists(&found), lists(&want), "{what}");
                compare_points(&what, &tiled, &one, &points);
                let counts = tiled.counts();
                assert!(counts.held <= 1 || counts.held_bytes <= memory, "{what}: {counts:?}");
            }
        }
        assert!(n_hits > 0 || case.mesh.triangles.is_empty(), "{}", case.name);
    }
}

fn compare_points(what: &str, tiled: &TiledBvh, one: &canted_wide::TriangleBvh, points: &[[f32; 3]]) {
    let mut inside = vec![false; points.len()];
    tiled.try_contains(points, &mut inside).unwrap();
    let mut signed = vec![0.0; points.len()];
    tiled.try_signed_distances(points, &mut signed).unwrap();
    for (k, max_distance) in [(1, f32::INFINITY), (5, f32::INFINITY), (3, 0.5), (0, 1.0), (1, -1.0), (1, f32::NAN)] {
        let mut nearest: Vec<Vec<NearestPoint>> = vec![vec![]; points.len()];
        tiled.try_nearest_points(points, k, max_distance, &mut nearest).unwrap();
        for (&point, found) in points.iter().zip(&nearest) {
            let mut want = vec![];
            one.nearest_points(point, k, max_distance, &mut want);
            assert_eq!(*found, want, "{what} {point:?} {k} {max_distance}");
        }
    }
    for ((&point, inside), signed) in points.iter().zip(inside).zip(signed) {
        assert_eq!(inside, one.contains(point), "{what} {point:?}");
        assert_eq!(signed.to_bits(), one.signed_distance(point).to_bits(), "{what} {point:?}");
    }
}

/// The hits of parts of a store combine to those of the whole: by the least `t`, then the lowest number.
#[test]
fn parts_of_a_store_combine_to_the_whole() {
    let mesh = canted_fixtures::soup(1, 300);
    let (folder, one, rays) = (tempfile::tempdir().unwrap(), whole(&mesh), rays(&mesh, 2_000));
    let store = folder.path().join("store");
    let n = write(&store, &mesh, 16).tiles as u32;
    let (mut want, mut best) = (vec![None; rays.len()], vec![None::<Hit>; rays.len()]);
    one.closest_hits(&rays, &mut want);
    for part in [[0, 5], [5, 1], [6, u32::MAX]] {
        let options = OpenOptions { part: Some(part), ..OpenOptions::default() };
        let (tiled, mut found) = (TiledBvh::open(&store, options).unwrap(), vec![None; rays.len()]);
        assert_eq!(tiled.aabb(), one.aabb());
        tiled.try_closest_hits(&rays, &mut found).unwrap();
        assert!(tiled.counts().reads <= u64::from(part[1].min(n - part[0])));
        for (best, found) in best.iter_mut().zip(found) {
            let is_closer = found.is_some_and(|found: Hit| best.is_none_or(|best| found.before(&best)));
            *best = if is_closer { found } else { *best };
        }
    }
    assert_eq!(best, want);
}

/// Meshes in several places: the hits of a TLAS, ties between instances included.
#[test]
fn placements_answer_as_a_tlas() {
    let meshes = [canted_fixtures::soup(5, 120), canted_fixtures::icosphere(2)];
    let placements = [
        (0, Affine::IDENTITY),
        (1, Affine::rotation([1.0, 2.0, 3.0], 0.7).then(&Affine::translation([0.5, 0.25, -1.0]))),
        (1, Affine::scale([1.0, -2.0, 0.5])),
        (0, Affine::IDENTITY),
        (1, Affine::translation([1e4, 0.0, 0.0])),
    ];
    let instances = placements.map(|(mesh, affine)| Instance::new(mesh, affine));
    let tlas = Tlas::new(meshes.iter().map(whole).collect(), &instances, Default::default()).unwrap();
    let mut rays = rays(&meshes[0], 400);
    rays.extend(
        rays.clone().iter().map(|ray| Ray::new([ray.origin[0] + 1e4, ray.origin[1], ray.origin[2]], ray.direction)),
    );
    for n_tiles in [1, 3, 7] {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        let n = meshes.iter().map(|mesh| mesh.triangles.len()).max().unwrap();
        let options = WriteOptions { tile_triangles: n.div_ceil(n_tiles), ..WriteOptions::default() };
        let mut writer = TileWriter::create(&store, options).unwrap();
        for mesh in &meshes {
            writer.push(&corners(mesh)).unwrap();
            writer.end_mesh().unwrap();
        }
        // Numbers as a scene may give them: each instance on from 1,000 times its own.
        for (i, &(mesh, affine)) in placements.iter().enumerate() {
            writer.place(mesh, affine, &[[0, 1000 * i as u64]]).unwrap();
        }
        writer.finish(&mut |_| ()).unwrap();
        for memory in [u64::MAX, 1] {
            let tiled = TiledBvh::open(&store, OpenOptions { memory, ..OpenOptions::default() }).unwrap();
            assert!(compare_rays(&format!("{n_tiles} tiles"), &tiled, &tlas, &rays) > 100);
            let hit = rays.iter().find_map(|ray| tiled.closest_hit(ray).filter(|hit| hit.instance.0 == 2)).unwrap();
            assert_eq!(tiled.in_whole(hit.instance, hit.primitive), (2000 + u64::from(hit.primitive.0), 2));
            let error = tiled.try_contains(&[[0.0; 3]], &mut [false]).unwrap_err().to_string();
            assert!(error.ends_with("require a store of one mesh; this one has 5 placements"), "{error}");
            let (mut want, mut found) = (HitLists::new(), HitLists::new());
            tlas.crossings_listed(&rays, &mut want);
            tiled.try_crossings(&rays, &mut found).unwrap();
            assert_eq!(lists(&found), lists(&want));
            compare_placed_points(&tiled, &tlas, &rays);
        }
    }
}

/// Points in world space: where rays start, where they hit, and between.
fn compare_placed_points(tiled: &TiledBvh, tlas: &Tlas<canted_wide::TriangleBvh>, rays: &[Ray]) {
    let at = |ray: &Ray, t: f32| [0, 1, 2].map(|k| f64::from(ray.origin[k]) + f64::from(t * ray.direction[k]));
    let mut points: Vec<[f64; 3]> = vec![[f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], [1e300, 0.0, 0.0]];
    for ray in rays.iter().step_by(3) {
        let t = tlas.closest_hit(ray).map_or(1.0, |hit| hit.t);
        points.extend([0.0, 0.5, 1.0, 1.25].map(|part| at(ray, part * t)));
    }
    let (mut inside, mut signed) = (vec![false; points.len()], vec![0.0; points.len()]);
    tiled.try_contains_placed(&points, &mut inside).unwrap();
    tiled.try_signed_distances_placed(&points, &mut signed).unwrap();
    assert!(inside.iter().any(|x| *x) && signed.iter().any(|x| *x < 0.0));
    for ((&point, inside), signed) in points.iter().zip(inside).zip(signed) {
        assert_eq!(inside, tlas.contains(point), "{point:?}");
        assert_eq!(signed.to_bits(), tlas.signed_distance(point).to_bits(), "{point:?}");
    }
    for (k, max_distance) in [(1, f64::INFINITY), (6, f64::INFINITY), (3, 0.5), (0, 1.0), (1, -1.0), (1, f64::NAN)] {
        let mut nearest = vec![vec![]; points.len()];
        tiled.try_nearest_surfaces(&points, k, max_distance, &mut nearest).unwrap();
        for (&point, found) in points.iter().zip(&nearest) {
            let mut want = vec![];
            tlas.nearest_points(point, k, max_distance, &mut want);
            assert_eq!(*found, want, "{point:?} {k} {max_distance}");
        }
    }
}

/// A batch reads each tile few times, and coherent rays only those that they reach.
#[test]
fn a_batch_reads_a_tile_few_times() {
    let mesh = canted_fixtures::grid(1, [64, 64]);
    let (folder, one) = (tempfile::tempdir().unwrap(), whole(&mesh));
    let store = folder.path().join("store");
    let written = write(&store, &mesh, 64);
    assert_eq!((written.tiles, written.resumed), (64, 0));
    let rays = rays(&mesh, 20_000);
    let tiled = open(&store, written.bytes / 10);
    let mut hits = vec![None; rays.len()];
    tiled.try_closest_hits(&rays, &mut hits).unwrap();
    let counts = tiled.counts();
    assert!(counts.reads <= 4 * 64, "{counts:?}");
    let mut want = vec![None; rays.len()];
    one.closest_hits(&rays, &mut want);
    assert_eq!(hits, want);
    // The vertices of a hit are those of its number.
    let hit = want.iter().flatten().next().unwrap();
    let vertices = tiled.try_triangles(&[hit.primitive.0, u32::MAX]).unwrap();
    assert_eq!(vertices, [Some(one.triangle(PrimId(hit.primitive.0))), None]);
}
