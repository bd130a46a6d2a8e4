//! Ray tracing for each kind of scene and driver limit. The package of tests compares whole scenes with the CPU.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{
    Gpu, GpuError, Options, Outcome, Source, TracedScene, block_on,
    build::{BuildConfig, WideConfig},
};
use canted_obb::Affine;
use canted_tlas::Instance;
use canted_trace::Ray;
use canted_wide::TriangleBvh;

use crate::{gpu, lowered};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(iteration_limit_is_below_the_drivers),
        needs_device(a_single_level_scene_is_traced),
        needs_device(triangles_of_a_flattened_scene_belong_to_instances),
        needs_device(instances_may_be_mirrored_scaled_or_empty),
        needs_device(empty_scenes_have_no_hits),
        needs_device(incomplete_traversal_is_reported),
        needs_device(unsupported_instances_are_rejected),
        needs_device(instances_with_masks_are_traced_by_rays_of_all_bits),
        needs_device(too_large_coordinates_are_rejected),
        needs_device(a_scene_above_a_device_limit_is_rejected),
        needs_device(vertices_that_are_not_finite_are_rejected_by_number),
        needs_device(instances_that_vanish_are_rejected),
    ]
}

type Bvh = TriangleBvh;

/// A floor of `n` by `n` squares in the plane z = 0, from 0 to `n`.
fn floor(n: u32) -> Bvh {
    let positions: Vec<[f32; 3]> = (0..=n).flat_map(|y| (0..=n).map(move |x| [x as f32, y as f32, 0.0])).collect();
    let triangles: Vec<[u32; 3]> = (0..n)
        .flat_map(|y| (0..n).map(move |x| y * (n + 1) + x))
        .flat_map(|i| [[i, i + 1, i + n + 2], [i, i + n + 2, i + n + 1]])
        .collect();
    TriangleBvh::build(&positions, &triangles).unwrap()
}

fn nothing() -> Bvh {
    TriangleBvh::build::<[f32; 3], u32>(&[], &[]).unwrap()
}

fn down(x: f32, y: f32) -> Ray {
    Ray::new([x, y, 4.0], [0.0, 0.0, -2.0])
}

/// `t`, primitive and instance of each hit.
fn hits(gpu: &Gpu, scene: &TracedScene, rays: &[Ray]) -> Vec<Option<(f32, u32, u32)>> {
    let answers = block_on(scene.closest_hits(gpu, rays)).unwrap();
    let known = answers.into_iter().map(|answer| match answer {
        Outcome::Complete(hit) => hit.map(|hit| (hit.t, hit.primitive, hit.instance)),
        Outcome::Incomplete => panic!("no traversal here is long"),
    });
    known.collect()
}

fn a_single_level_scene_is_traced() {
    let gpu = gpu();
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&floor(20)), Options::default())).unwrap();
    let rays = [down(3.75, 0.25), down(-1.0, 3.0), down(0.25, 19.75), Ray::new([0.0; 3], [0.0; 3])];
    assert_eq!(hits(&gpu, &scene, &rays), [Some((2.0, 6, 0)), None, Some((2.0, 19 * 40 + 1, 0)), None]);
    let found: Vec<_> = block_on(scene.occluded(&gpu, &rays)).unwrap();
    assert_eq!(found, [true, false, true, false].map(Outcome::Complete));
}

fn triangles_of_a_flattened_scene_belong_to_instances() {
    let gpu = gpu();
    // The second instance has no triangles.
    let scene = block_on(TracedScene::new(
        &gpu,
        Source::wide(&floor(4)),
        Options { parts: &[0, 8, 8, 31], ..Options::default() },
    ))
    .unwrap();
    let rays = [down(0.75, 0.25), down(0.75, 1.25), down(3.25, 3.75)];
    assert_eq!(hits(&gpu, &scene, &rays), [Some((2.0, 0, 0)), Some((2.0, 0, 2)), Some((2.0, 0, 3))]);
}

fn instances_may_be_mirrored_scaled_or_empty() {
    let gpu = gpu();
    let place = |x: f32, z: f32, at: [f32; 3]| Affine { columns: [[x, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, z], at] };
    let instances = [
        Instance::new(1, Affine::IDENTITY),
        Instance::new(0, place(-2.0, 1.0, [0.0; 3])),
        Instance::new(0, place(0.5, -3.0, [10.0, 0.0, -2.0])),
    ];
    let scene = block_on(TracedScene::new(&gpu, Source::tlas([&floor(4), &nothing()], &instances), Options::default()))
        .unwrap();
    let rays = [down(-1.5, 0.25), down(10.375, 0.25), down(1.0, 1.0)];
    assert_eq!(hits(&gpu, &scene, &rays), [Some((2.0, 0, 1)), Some((3.0, 0, 2)), None]);
}

fn empty_scenes_have_no_hits() {
    let gpu = gpu();
    let rays = [down(0.0, 0.0)];
    let empty = nothing();
    for scene in [
        TracedScene::new(&gpu, Source::wide(&empty), Options { parts: &[], ..Options::default() }),
        TracedScene::new(&gpu, Source::tlas::<&TriangleBvh>([], &[]), Options::default()),
        TracedScene::new(&gpu, Source::tlas([&empty], &[Instance::new(0, Affine::IDENTITY)]), Options::default()),
    ] {
        let scene = block_on(scene).unwrap();
        assert_eq!(hits(&gpu, &scene, &rays), [None]);
        assert!(block_on(scene.closest_hits(&gpu, &[])).unwrap().is_empty());
    }
}

fn incomplete_traversal_is_reported() {
    let gpu = gpu();
    let scene =
        block_on(TracedScene::new(&gpu, Source::wide(&floor(20)), Options::default())).unwrap().with_max_iterations(2);
    let rays = [down(3.75, 0.25), down(-100.0, 3.0)];
    let answers = block_on(scene.closest_hits(&gpu, &rays)).unwrap();
    assert_eq!(answers, [Outcome::Incomplete, Outcome::Complete(None)]);
    assert_eq!(block_on(scene.occluded(&gpu, &rays)).unwrap(), [Outcome::Incomplete, Outcome::Complete(false)]);
}

fn unsupported_instances_are_rejected() {
    let gpu = gpu();
    let floor = floor(1);
    let refused = |instance: Instance| match block_on(TracedScene::new(
        &gpu,
        Source::tlas([&floor], &[instance]),
        Options::default(),
    )) {
        Ok(_) => panic!("{instance:?} is traced"),
        Err(error) => error.to_string(),
    };
    let about_z = |[sine, cosine]: [f32; 2]| Affine {
        columns: [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0], [0.0; 3]],
    };
    // Rotated by 135 degrees.
    let turning = Instance::moving(0, Affine::IDENTITY, about_z([0.7, -0.7]));
    assert_eq!(
        refused(turning),
        "not supported on the GPU: instance 0, whose motion has condition number inf (maximum 1.024e3)"
    );
    let flat = Affine { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1e-4], [0.0; 3]] };
    assert!(refused(Instance::new(0, flat)).contains("condition"));
    assert!(refused(Instance::new(3, Affine::IDENTITY)).contains("bottom-level BVH 3"));
}

fn instances_with_masks_are_traced_by_rays_of_all_bits() {
    let gpu = gpu();
    let floor = floor(1);
    let at = |mask| Instance::new(0, Affine::IDENTITY).with_mask(mask);
    // No ray hits an instance with mask 0.
    for (masks, expected) in [([0, 4], Some(1)), ([2, 4], Some(0)), ([0, 0], None)] {
        let scene =
            block_on(TracedScene::new(&gpu, Source::tlas([&floor], &masks.map(at)), Options::default())).unwrap();
        let found = block_on(scene.closest_hits(&gpu, &[down(0.4, 0.2)])).unwrap();
        let [Outcome::Complete(hit)] = found[..] else { panic!("{found:?}") };
        assert_eq!(hit.map(|hit| hit.instance), expected);
        let error =
            block_on(scene.closest_hits(&gpu, &[down(0.4, 0.2).with_mask(4)])).err().map(|error| error.to_string());
        let expected = "not supported on the GPU: batches of rays with masks through instances with masks; use closest_hit_masked in a kernel";
        assert_eq!(error.as_deref(), (masks != [0, 0]).then_some(expected));
    }
}

fn too_large_coordinates_are_rejected() {
    let gpu = gpu();
    let reaching = |far: f32| {
        let positions = [[0.0; 3], [far, 0.0, 0.0], [0.0, 1.0, 0.0]];
        Bvh::build(&positions, &[[0, 1, 2]]).unwrap()
    };
    let there = |shift: f32| {
        let mut map = Affine::IDENTITY;
        map.columns[3][1] = shift;
        Instance::new(0, map)
    };
    assert!(block_on(TracedScene::new(&gpu, Source::wide(&reaching(1e18)), Options::default())).is_ok());
    assert!(block_on(TracedScene::new(&gpu, Source::tlas([&floor(1)], &[there(-9e17)]), Options::default())).is_ok());
    for (name, scene) in [
        ("the scene", TracedScene::new(&gpu, Source::wide(&reaching(1.1e18)), Options::default())),
        ("mesh 0", TracedScene::new(&gpu, Source::tlas([&reaching(f32::MAX)], &[]), Options::default())),
        (
            "instance 1",
            TracedScene::new(&gpu, Source::tlas([&floor(1)], &[there(0.0), there(-2e18)]), Options::default()),
        ),
    ] {
        let Err(error) = block_on(scene) else { panic!("{name} is traced") };
        assert!(error.to_string().contains(&format!("{name}, which has coordinates above 1e18")), "{error}");
    }
}

fn a_scene_above_a_device_limit_is_rejected() {
    let gpu = lowered(1 << 16);
    match block_on(TracedScene::new(&gpu, Source::wide(&floor(60)), Options::default())) {
        Err(GpuError::Limit { need, most, .. }) => assert!(need > most && most == 1 << 16),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("a large scene fits"),
    }
}

fn vertices_that_are_not_finite_are_rejected_by_number() {
    let gpu = gpu();
    let good = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for wrong in [f32::NAN, f32::INFINITY] {
        let mut bad = good;
        bad[1][2] = wrong;
        let (first, second) = ([good; 2], [good, good, good, bad]);
        let instances = [Instance::new(0, Affine::IDENTITY), Instance::new(1, Affine::IDENTITY)];
        let refused = |built: Result<TracedScene, GpuError>| built.map(drop).unwrap_err().to_string();
        let (binary, wide) = (BuildConfig::default(), WideConfig::default());
        for (mesh, error) in [
            (0, refused(block_on(TracedScene::new(&gpu, Source::build([&second], binary), Options::default())))),
            (0, refused(block_on(TracedScene::new(&gpu, Source::build([&second], wide), Options::default())))),
            (
                1,
                refused(block_on(TracedScene::new(
                    &gpu,
                    Source::build([&first[..], &second], binary).with_instances(&instances),
                    Options::default(),
                ))),
            ),
            (
                1,
                refused(block_on(TracedScene::new(
                    &gpu,
                    Source::build([&first[..], &second], wide).with_instances(&instances),
                    Options::default(),
                ))),
            ),
        ] {
            assert_eq!(error, format!("mesh {mesh}: triangle 3 has a vertex that is not finite"));
        }
    }
}

/// The inverse of such an instance has no `f32` rows.
fn instances_that_vanish_are_rejected() {
    let gpu = gpu();
    let scaled = |scale: f32| {
        let map = Affine { columns: [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale], [0.0; 3]] };
        block_on(TracedScene::new(&gpu, Source::tlas([&floor(2)], &[Instance::new(0, map)]), Options::default()))
            .map(drop)
            .map_err(|e| e.to_string())
    };
    assert_eq!(scaled(1e-30), Ok(()));
    let error = scaled(1e-31).unwrap_err();
    assert_eq!(error, "not supported on the GPU: instance 0, which scales by less than 2^-100");
}

/// On every driver the iteration limit ends traversal before the driver would.
fn iteration_limit_is_below_the_drivers() {
    let gpu = gpu();
    let scene = block_on(TracedScene::new(&gpu, Source::wide(&nothing()), Options::default())).unwrap();
    let module = scene.module(0).unwrap();
    let (_, limit) = module.split_once("MAX_ITERATIONS: u32 = ").unwrap();
    let limit: u32 = limit.split_once('u').unwrap().0.parse().unwrap();
    let counted = block_on(canted_gpu::loop_iterations(&gpu, 100_000)).unwrap();
    // Eight invocations of a vector share the count of iterations where a driver ends loops.
    assert!(limit > 0 && (counted == 100_000 || 8 * limit <= counted), "limit {limit}, where a loop takes {counted}");
}
