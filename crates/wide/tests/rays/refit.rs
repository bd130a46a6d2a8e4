//! Refits: hits equal those of testing every moved triangle, whatever the motion.

use canted_fixtures::{self as fixtures, Hair, Mesh, SplitMix64, Strand};
use canted_lbvh::GeometryError;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Counts, Intersect, Kernel, MollerTrumbore, Ray, TriangleTest, Watertight};
use canted_wide::{Preset, RefitError, SimdPath, TriangleBvh};

use crate::common::{brute, build, build_for, grazing_rays};

fn moved(mesh: &Mesh, motion: impl FnMut([f64; 3]) -> [f64; 3]) -> Mesh {
    let place = mesh.positions.iter().map(|p| p.map(f64::from)).map(motion);
    let positions = place.map(|p| p.map(|x| x as f32)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

/// Small and extreme motions.
fn motions(mesh: &Mesh) -> Vec<(&'static str, Mesh)> {
    let mut rng = SplitMix64::new(9);
    let mut random = |size: f64| {
        moved(mesh, |p| [p[0] + size * rng.signed(), p[1] + size * rng.signed(), p[2] + size * rng.signed()])
    };
    let mut motions = vec![("shaken", random(0.02)), ("scattered", random(3.0))];
    motions.push(("collapsed to a point", moved(mesh, |_| [0.3, -0.7, 0.1])));
    motions.push(("collapsed to a line", moved(mesh, |[x, _, _]| [x, 0.5, 0.0])));
    motions.push(("flattened", moved(mesh, |[x, y, _]| [x, y, 0.0])));
    motions.push(("mirrored", moved(mesh, |[x, y, z]| [-x, y, z])));
    motions.push(("far away", moved(mesh, |p| p.map(|x| x + 1e7))));
    motions.push(("tiny", moved(mesh, |p| p.map(|x| 1e-6 * x))));
    motions.push(("rotated", mesh.off_axis()));
    motions.push((
        "twisted",
        moved(mesh, |[x, y, z]| {
            let (sin, cos) = fixtures::sin_cos(2.0 * z);
            [cos * x - sin * y, sin * x + cos * y, z]
        }),
    ));
    motions.push(("original", mesh.clone()));
    motions
}

fn meshes() -> Vec<(&'static str, Mesh)> {
    let hair = Hair { n_strands: 30, n_segments: 8, width: 0.004, strand: Strand::Ribbon };
    vec![
        ("nothing", Mesh::default()),
        ("one", fixtures::soup(1, 1)),
        ("soup", fixtures::soup(2, 600)),
        ("slivers", fixtures::slivers(3, 200)),
        ("identical", fixtures::identical(60)),
        ("hair", fixtures::hair(3, &hair)),
        ("scaffold", fixtures::scaffold_of(1, true, 3)),
        ("quads", fixtures::coplanar_quads(200).off_axis()),
    ]
}

/// Number of rays with other results than the loop over all triangles, and of rays that hit.
fn disagree<K: Kernel<Record = [[f32; 3]; 3]>>(wide: &TriangleBvh, mesh: &Mesh) -> (usize, usize) {
    let answers = grazing_rays(mesh, 30, 5).into_iter().map(|ray| {
        let hit = brute::<K>(mesh, &ray).first().copied();
        (wide.closest_hit(&ray) == hit && wide.occluded(&ray) == hit.is_some(), hit.is_some())
    });
    answers.fold((0, 0), |(wrong, hits), (right, hit)| (wrong + usize::from(!right), hits + usize::from(hit)))
}

fn hits_survive_motion<K: Kernel<Record = [[f32; 3]; 3]>>(test: TriangleTest) {
    for (name, mesh) in meshes() {
        // One BVH for all motions, so that each refit starts from the boxes of the last one.
        let mut wide = build_for(test, &mesh, Preset::default());
        let mut n_hits = 0;
        for (motion, moved) in motions(&mesh) {
            wide.refit(&moved.positions, &moved.triangles).unwrap();
            let (wrong, hits) = disagree::<K>(&wide, &moved);
            assert_eq!(wrong, 0, "{name} {motion}");
            n_hits += hits;
            let used = moved.triangles.iter().flatten().map(|&i| moved.positions[i as usize]);
            assert_eq!(wide.aabb(), Aabb::from_points(used), "{name} {motion}");
        }
        assert!(n_hits > 100 || mesh.triangles.len() < 2, "{name}: {n_hits} hits are too few");
    }
}

#[test]
fn watertight_hits_survive_any_motion() {
    hits_survive_motion::<Watertight>(TriangleTest::Watertight);
}

#[test]
fn moller_trumbore_hits_survive_any_motion() {
    hits_survive_motion::<MollerTrumbore>(TriangleTest::MollerTrumbore);
}

#[test]
fn a_bvh_that_is_not_refitted_is_detected() {
    let mesh = fixtures::scaffold_of(1, true, 3);
    let wide = build(&mesh, Preset::default());
    let (wrong, _) = disagree::<Watertight>(&wide, &motions(&mesh)[0].1);
    assert!(wrong > 50, "{wrong}");
}

/// Nodes and blocks, between the header and the checksum.
fn records(wide: &TriangleBvh) -> Vec<u8> {
    let bytes = wide.to_bytes();
    bytes[160..bytes.len() - 8].to_vec()
}

#[test]
fn the_same_vertices_give_the_same_bvh() {
    for (name, mesh) in meshes() {
        let mut wide = build(&mesh, Preset::default());
        let built = records(&wide);
        let refit = wide.refit(&mesh.positions, &mesh.triangles).unwrap();
        assert!(records(&wide) == built, "{name}");
        assert_eq!((refit.drift, refit.cost_before), (1.0, refit.cost_built), "{name}");
        // Away and back: frames have turned twice, and are those of the build but for roundings.
        let (_, away) = &motions(&mesh)[1];
        let there = wide.refit(&away.positions, &away.triangles).unwrap();
        let back = wide.refit(&mesh.positions, &mesh.triangles).unwrap();
        assert_eq!(back.cost_before, there.cost_now, "{name}");
        assert!((back.cost_now - refit.cost_built).abs() <= 1e-3 * refit.cost_built, "{name}: {back:?}");
    }
}

#[test]
fn rejected_vertices_change_nothing() {
    let mesh = fixtures::soup(2, 100);
    let mut wide = build(&mesh, Preset::default());
    let before = wide.to_bytes();
    let mut bad = mesh.clone();
    bad.positions[mesh.triangles[41][1] as usize][2] = f32::INFINITY;
    let rejected = wide.refit(&bad.positions, &bad.triangles);
    let vertex = mesh.triangles[41][1];
    let position = bad.positions[vertex as usize].into();
    let error = GeometryError::NotFinite { triangle: PrimId(41), vertex, position };
    assert_eq!(rejected, Err(RefitError::Geometry(error)));
    let n_vertices = mesh.positions.len();
    let rejected = wide.refit(&mesh.positions[..n_vertices - 1], &mesh.triangles);
    assert!(matches!(rejected, Err(RefitError::Geometry(GeometryError::IndexOutOfRange { .. }))), "{rejected:?}");
    let rejected = wide.refit(&mesh.positions, &mesh.triangles[1..]).unwrap_err();
    assert_eq!(rejected, RefitError::Count { n_primitives: 100, n_given: 99 });
    assert_eq!(rejected.to_string(), "the BVH has 100 primitives, but 99 are given");
    assert_eq!(wide.to_bytes(), before);
}

#[test]
fn threads_change_nothing() {
    let mesh = fixtures::scaffold_of(1, true, 6);
    let (_, moved) = &motions(&mesh)[0];
    let wide = build(&mesh, Preset::default());
    let on = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let mut wide = wide.clone();
        let refit = pool.install(|| wide.refit(&moved.positions, &moved.triangles)).unwrap();
        (wide.to_bytes(), refit)
    };
    let one = on(1);
    assert!(on(2) == one && on(5) == one);
}

/// Leaves of all sizes, in batches that begin anywhere; the first refit also measures the state before it.
#[test]
fn paths_change_nothing() {
    for (name, mesh) in meshes() {
        for preset in [Preset::Dynamic, Preset::Quality] {
            for (motion, moved) in motions(&mesh).iter().step_by(3) {
                let refitted = |path: SimdPath| {
                    let mut wide = build(&mesh, preset).with_path(path);
                    let refit = wide.refit(&moved.positions, &moved.triangles).unwrap();
                    (wide.with_path(SimdPath::Scalar).to_bytes(), refit)
                };
                let scalar = refitted(SimdPath::Scalar);
                for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
                    assert!(refitted(path) == scalar, "{name}, {motion}, {preset:?}, {}", path.name());
                }
            }
        }
    }
}

#[test]
fn a_refitted_bvh_can_be_saved_and_keeps_its_drift() {
    let mesh = fixtures::scaffold_of(1, true, 4);
    let motions = motions(&mesh);
    let mut wide = build(&mesh, Preset::default());
    let (_, shaken) = &motions[0];
    let refit = wide.refit(&shaken.positions, &shaken.triangles).unwrap();
    let bytes = wide.to_bytes();
    let mut back = TriangleBvh::from_bytes(&bytes).unwrap();
    assert_eq!(back.to_bytes(), bytes);
    let again = back.refit(&shaken.positions, &shaken.triangles).unwrap();
    assert_eq!((again.cost_built, again.cost_before, again.drift), (refit.cost_built, refit.cost_now, refit.drift));
}

/// Tests of camera rays: nodes, and four triangles as one more, since trees trade one for the other by the size of their leaves.
fn work(wide: &TriangleBvh, mesh: &Mesh) -> f64 {
    let mut counts = Counts::default();
    for ray in fixtures::object_views(mesh).iter().flat_map(|view| view.rays(48)) {
        wide.closest_hit_with(&Ray::new(ray.origin, ray.direction), &mut counts);
    }
    counts.boxes as f64 / 8.0 + counts.triangles as f64 / 4.0
}

/// About the vertical axis, by `turns` over the height of 1.
fn twisted(mesh: &Mesh, turns: f64) -> Mesh {
    moved(mesh, |[x, y, z]| {
        let (sin, cos) = fixtures::sin_cos(turns * std::f64::consts::TAU * z);
        [cos * x - sin * y, sin * x + cos * y, z]
    })
}

/// With the frames as built, struts twisted by 60 degrees would make 3.0 of the cost and 2.1 times the work.
#[test]
fn frames_of_struts_turn_with_them() {
    let mesh = fixtures::scaffold_of(1, false, 8);
    let bounds = build(&mesh, Preset::Dynamic).aabb();
    let height = f64::from(bounds.max[2] - bounds.min[2]);
    let mut wide = build(&mesh, Preset::default());
    let mut moved = mesh.clone();
    for step in 1..=6 {
        moved = twisted(&mesh, f64::from(step) / 36.0 / height);
        let refit = wide.refit(&moved.positions, &moved.triangles).unwrap();
        assert!(refit.drift < 2.2, "{step}: {refit:?}");
    }
    let (old, new) = (work(&wide, &moved), work(&build(&moved, Preset::default()), &moved));
    assert!(old / new < 1.5, "{old} {new}");
    // And back: no step has lost anything.
    for step in (0..6).rev() {
        moved = twisted(&mesh, f64::from(step) / 36.0 / height);
        wide.refit(&moved.positions, &moved.triangles).unwrap();
    }
    assert!((wide.drift() - 1.0).abs() < 0.02, "{}", wide.drift());
}

#[test]
fn a_rebuild_is_advised_where_it_gains() {
    let hair = Hair { n_strands: 600, n_segments: 12, width: 0.004, strand: Strand::Ribbon };
    let mesh = fixtures::hair(3, &hair);
    let mut wide = build(&mesh, Preset::default());
    let mut last = 0.0;
    for turns in [0.02, 0.06, 1.0, 3.0] {
        let moved = twisted(&mesh, turns);
        let refit = wide.refit(&moved.positions, &moved.triangles).unwrap();
        assert!(refit.drift > last, "{turns}: {}", refit.drift);
        last = refit.drift;
        let (old, new) = (work(&wide, &moved), work(&build(&moved, Preset::default()), &moved));
        let gain = old / new;
        if refit.rebuild_advised() {
            assert!(gain > 1.2, "{turns}: drift {}, gain {gain}", refit.drift);
        } else {
            assert!(gain < 1.3, "{turns}: drift {}, gain {gain}", refit.drift);
        }
        assert_eq!(refit.rebuild_advised(), turns >= 1.0, "{turns}: drift {}", refit.drift);
    }
    // Motions of the mesh as one cause no drift.
    for moved in [moved(&mesh, |p| p.map(|x| 7.0 * x)), moved(&mesh, |[x, y, z]| [x + 4.0, y, z])] {
        let mut wide = build(&mesh, Preset::default());
        let refit = wide.refit(&moved.positions, &moved.triangles).unwrap();
        assert!((refit.drift - 1.0).abs() < 0.01, "{}", refit.drift);
    }
}
