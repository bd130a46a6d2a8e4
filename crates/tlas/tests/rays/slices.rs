//! Slices of rays, of which the top level prepares eight at once, compared with the loop over every triangle of every instance.

use canted_fixtures::{Mesh, SplitMix64, soup};
use canted_obb::Affine;
use canted_tlas::{Instance, Tlas};
use canted_trace::{Hit, Intersect, Ray};
use canted_wide::{SimdPath, TriangleBvh};

use crate::oracle::{affine, all_hits};

fn tlas(mesh: &Mesh, instances: &[Instance]) -> Tlas<TriangleBvh> {
    Tlas::new(vec![TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()], instances, Default::default())
        .unwrap()
}

/// Rotated, sheared and mirrored maps of `scale` around `center`.
fn map(rng: &mut SplitMix64, (scale, center): (f64, [f64; 3])) -> Affine {
    loop {
        let columns = [rng.signed3(), rng.signed3(), rng.signed3()];
        let [a, b, c] = columns;
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        if (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]).abs() > 0.1 {
            let [x, y, z] = columns.map(|column| column.map(|x| scale * x));
            let at = rng.signed3();
            return affine([x, y, z, [0, 1, 2].map(|k| center[k] + 2.0 * scale * at[k])]);
        }
    }
}

/// How the instances of a scene lie, and which of them are special.
#[derive(Clone, Copy, Debug)]
struct Form {
    scale: f64,
    center: [f64; 3],
    moves: bool,
    has_bad_condition: bool,
}

const FORMS: [Form; 5] = [
    Form { scale: 1.0, center: [0.0; 3], moves: false, has_bad_condition: false },
    Form { scale: 1e-6, center: [0.0; 3], moves: false, has_bad_condition: false },
    Form { scale: 1.0, center: [1e7, -2e7, 3e6], moves: false, has_bad_condition: false },
    Form { scale: 1e12, center: [0.0; 3], moves: true, has_bad_condition: false },
    Form { scale: 1.0, center: [30.0, 0.0, 0.0], moves: true, has_bad_condition: true },
];

fn instances(rng: &mut SplitMix64, form: Form) -> Vec<Instance> {
    let place = (form.scale, form.center);
    let one = |i: usize| {
        let instance = match i % 3 {
            0 if form.moves => Instance::moving(0, map(rng, place), map(rng, (0.01 * form.scale, form.center))),
            _ => Instance::new(0, map(rng, place)),
        };
        instance.with_mask(if i.is_multiple_of(5) { 2 } else { u32::MAX })
    };
    let mut all: Vec<Instance> = (0..24).map(one).collect();
    if form.has_bad_condition {
        // A class of its own: rays are then traced one by one.
        all.push(Instance::new(0, affine([[1.0, 0.0, 0.0], [1.0, 1e-4, 0.0], [0.0, 0.0, 1.0], form.center])));
    }
    // Moving ones that pass through a singular map are not placed.
    all.retain(|instance| Tlas::new(vec![bvh()], &[*instance], Default::default()).is_ok());
    all
}

fn bvh() -> TriangleBvh {
    let mesh = soup(30, 3);
    TriangleBvh::build(&mesh.positions, &mesh.triangles).unwrap()
}

/// Rays of any direction length through the instances, some with an end of the interval that over- or underflows when it is scaled, some of
/// which are no rays.
fn rays(rng: &mut SplitMix64, form: Form, n: usize) -> Vec<Ray> {
    let point = |rng: &mut SplitMix64, reach: f64| {
        let at = rng.signed3();
        [0, 1, 2].map(|k| (form.center[k] + reach * form.scale * at[k]) as f32)
    };
    (0..n)
        .map(|i| {
            let (from, to) = (point(rng, [3.0, 100.0][i % 2]), point(rng, 2.0));
            let length = [1.0, 1e-20, 3e10, 0.7][i / 2 % 4];
            let direction = [0, 1, 2].map(|k| (f64::from(to[k]) - f64::from(from[k])) * length);
            let t_max = [f32::INFINITY, f32::MAX, (2.0 / length) as f32, 1e-44][i / 8 % 4];
            let ray = Ray::new(from, direction.map(|x| x as f32)).between([0.0, 1e-45][i / 3 % 2], t_max);
            match i % 41 {
                0 => ray.with_mask(0),
                1 => Ray { direction: [0.0; 3], ..ray },
                2 => Ray { origin: [f32::NAN; 3], ..ray },
                3 => ray.between(1.0, 0.5),
                i => ray.with_mask([u32::MAX, 1, 2][i % 3]),
            }
        })
        .collect()
}

/// The first ray whose answer in a slice differs from that of the loop.
fn difference(tlas: &Tlas<TriangleBvh>, truth: &[Option<Hit>], rays: &[Ray]) -> Option<usize> {
    let (mut hits, mut occluded) = (vec![None; rays.len()], vec![false; rays.len()]);
    // Slices that end within eight rays too.
    for (rays, hits) in rays.chunks(13).zip(hits.chunks_mut(13)) {
        tlas.closest_hits(rays, hits);
    }
    for (rays, occluded) in rays.chunks(21).zip(occluded.chunks_mut(21)) {
        tlas.occluded_many(rays, occluded);
    }
    let same = |i: &usize| hits[*i] == truth[*i] && occluded[*i] == truth[*i].is_some();
    (0..rays.len()).find(|i| !same(i))
}

#[test]
fn slices_have_the_hits_of_the_loop() {
    let mut rng = SplitMix64::new(45);
    let mesh = soup(30, 3);
    let mut n_hits = 0;
    for (number, form) in FORMS.into_iter().enumerate() {
        let instances = instances(&mut rng, form);
        assert!(instances.len() >= 16, "{form:?}: {} instances", instances.len());
        let rays = rays(&mut rng, form, 400);
        let truth: Vec<Option<Hit>> = rays
            .iter()
            .map(|ray| {
                let seen = |hit: &Hit| instances[hit.instance.index()].mask & ray.mask != 0;
                let is_ray = ray.direction != [0.0; 3] && !ray.origin[0].is_nan() && ray.t_min <= ray.t_max;
                if !is_ray {
                    return None;
                }
                all_hits(std::slice::from_ref(&mesh), &instances, ray, 0.0).into_iter().map(|(_, hit)| hit).find(seen)
            })
            .collect();
        n_hits += truth.iter().flatten().count();
        for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
            let tlas = tlas(&mesh, &instances).with_path(path);
            assert_eq!(difference(&tlas, &truth, &rays), None, "form {number} on {path:?}");
            for (ray, hit) in rays.iter().zip(&truth) {
                assert_eq!((tlas.closest_hit(ray), tlas.occluded(ray)), (*hit, hit.is_some()), "{ray:?}");
            }
        }
        // The check notices an instance that is not there.
        let hit = truth.iter().flatten().next().unwrap_or_else(|| panic!("form {number} has hits"));
        let mut without = instances.clone();
        without[hit.instance.index()] = Instance::REMOVED;
        assert!(difference(&tlas(&mesh, &without), &truth, &rays).is_some(), "form {number}");
    }
    assert!(n_hits > FORMS.len(), "{n_hits} hits");
}
