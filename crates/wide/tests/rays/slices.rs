//! Slices equal single rays, on any number of threads, with and without a filter.

use canted_fixtures::Mesh;
use canted_trace::{Accept, Crossings, Hit, HitLists, Intersect, Ray, Side, TriangleTest, Watertight};
use canted_wide::Preset;

use crate::common::{brute, build, build_for, paths, rays};

/// Rays of more than three jobs, the last one part of a job.
fn scene() -> (Mesh, Vec<Ray>) {
    let mesh = canted_fixtures::soup(4, 400);
    let rays = rays(&mesh, 700, 5);
    assert!(rays.len() > 3 * 1024 && !rays.len().is_multiple_of(1024));
    (mesh, rays)
}

/// A filter that depends on all its arguments.
fn odd(index: usize, ray: &Ray, hit: &Hit) -> bool {
    let bits = hit.t.to_bits() ^ ray.origin[0].to_bits() ^ hit.primitive.0;
    !(index + bits as usize).is_multiple_of(3)
}

fn on_threads(n: usize, work: impl FnOnce() + Send) {
    rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool").install(work);
}

#[test]
fn slices_equal_single_rays() {
    let (mesh, rays) = scene();
    for test in TriangleTest::ALL {
        for path in paths() {
            let (bvh, rays) = (build_for(test, &mesh, Preset::Balanced).with_path(path), &rays[..]);
            let want: Vec<_> = rays.iter().map(|ray| bvh.closest_hit(ray)).collect();
            let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
            bvh.closest_hits(rays, &mut hits);
            bvh.occluded_many(rays, &mut occluded);
            assert_eq!(hits, want, "{}", path.name());
            assert!(occluded.iter().zip(&want).all(|(occluded, hit)| *occluded == hit.is_some()), "{}", path.name());
        }
    }
}

#[test]
fn threads_change_nothing() {
    let (mesh, rays) = scene();
    let bvh = build(&mesh, Preset::Balanced);
    let n = rays.len();
    let (mut hits, mut occluded, mut all) = (vec![None; n], vec![false; n], vec![vec![]; n]);
    let (mut hits_with, mut occluded_with) = (vec![None; n], vec![false; n]);
    bvh.closest_hits(&rays, &mut hits);
    bvh.occluded_many(&rays, &mut occluded);
    bvh.all_hits_many(&rays, &mut all);
    bvh.closest_hits_with(&rays, &mut hits_with, &odd);
    bvh.occluded_many_with(&rays, &mut occluded_with, &odd);
    for threads in [1, 2, 7] {
        on_threads(threads, || {
            // Old answers must be overwritten.
            let stale = hits.iter().flatten().next().copied();
            let (mut par_hits, mut par_occluded, mut par_all) = (vec![stale; n], vec![true; n], vec![vec![]; n]);
            par_all[0].extend(stale);
            bvh.par_closest_hits(&rays, &mut par_hits);
            bvh.par_occluded_many(&rays, &mut par_occluded);
            bvh.par_all_hits_many(&rays, &mut par_all);
            assert_eq!((&par_hits, &par_occluded, &par_all), (&hits, &occluded, &all), "{threads} threads");
            bvh.par_closest_hits_with(&rays, &mut par_hits, &odd);
            bvh.par_occluded_many_with(&rays, &mut par_occluded, &odd);
            assert_eq!((&par_hits, &par_occluded), (&hits_with, &occluded_with), "{threads} threads");
        });
    }
}

#[test]
fn lists_equal_single_rays() {
    let (mesh, mut rays) = scene();
    rays.push(Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, 1.0]));
    // Through corners, where crossings and hits differ.
    rays.extend(mesh.triangles.iter().map(|t| {
        let target = mesh.positions[t[0] as usize];
        Ray::new([target[0], target[1], target[2] - 4.0], [0.0, 0.0, 1.0])
    }));
    for path in paths() {
        let bvh = build(&mesh, Preset::Balanced).with_path(path);
        let (mut lists, mut hits, mut n_all) = (HitLists::new(), vec![], 0);
        // Old answers must be overwritten.
        bvh.all_hits_listed(&rays[..9], &mut lists);
        bvh.all_hits_listed(&rays, &mut lists);
        assert_eq!(lists.of_rays().count(), rays.len());
        for (ray, own) in rays.iter().zip(lists.of_rays()) {
            bvh.all_hits(ray, &mut hits);
            assert_eq!(own, hits, "{ray:?} {}", path.name());
            n_all += hits.len();
        }
        assert_eq!((n_all, lists.hits().len()), (lists.hits().len(), n_all));
        bvh.crossings_listed(&rays, &mut lists);
        for (ray, own) in rays.iter().zip(lists.of_rays()) {
            bvh.crossings(ray, &mut hits);
            assert_eq!(own, hits, "{ray:?} {}", path.name());
        }
        assert!(lists.hits().len() < n_all && lists.of_rays().count() == rays.len());
    }
    let mut lists = HitLists::new();
    build_for(TriangleTest::MollerTrumbore, &mesh, Preset::Fast).all_hits_listed(&[], &mut lists);
    assert_eq!(lists, HitLists::default());
}

#[test]
fn filters_choose_among_all_hits() {
    let (mesh, rays) = scene();
    let bvh = build(&mesh, Preset::Quality);
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    bvh.closest_hits_with(&rays, &mut hits, &odd);
    bvh.occluded_many_with(&rays, &mut occluded, &odd);
    let (mut rejected, mut passed) = (0, 0);
    for (i, ray) in rays.iter().enumerate() {
        let all = brute::<Watertight>(&mesh, ray);
        let want = all.iter().copied().find(|hit| odd(i, ray, hit));
        assert_eq!((hits[i], occluded[i]), (want, want.is_some()), "ray {i}");
        rejected += usize::from(want.is_none() && !all.is_empty());
        passed += usize::from(want.is_some() && want != all.first().copied());
        let back = |hit: &Hit| hit.side == Side::Back;
        let want = all.iter().copied().find(back);
        assert_eq!(bvh.closest_hit_with(ray, &mut Accept(back)), want);
        assert_eq!(bvh.occluded_with(ray, &mut Accept(back)), want.is_some());
    }
    assert!(rejected > 10 && passed > 50, "{rejected} rays lost all hits, {passed} passed through some");
}

#[test]
#[should_panic(expected = "one answer for each ray")]
fn slices_of_different_length_panic() {
    let bvh = build(&canted_fixtures::fan(3), Preset::Fast);
    bvh.par_closest_hits(&[Ray::new([0.0; 3], [1.0; 3])], &mut []);
}
