//! Instances that move while the shutter is open: at each ray's time the device agrees with the CPU.

use canted_fixtures::{
    Mesh, SplitMix64,
    device_tests::{Test, needs_device},
};
use canted_gpu::{
    DeviceHit, DeviceRay, Gpu, HIT_ERROR, MotionPolynomials, Options, Outcome, Source, TracedScene, Variant, block_on,
    choice, wgsl,
};
use canted_obb::Affine;
use canted_tests::{
    closed::placements,
    rays,
    scenes::{self, baked},
};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Intersect, Ray, ScaledRay};
use canted_wide::TriangleBvh;

use super::{
    gpu,
    reference::{Tally, World, error_of_instance},
    setup::{build, few_variants},
};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(rays_of_any_time_lose_no_hit), needs_device(the_comparison_detects_another_time)]
}

/// The end transform of an instance that rotates about z, grows and is shifted while the shutter is open.
fn moved(open: &Affine, angle: f64, growth: [f64; 3], shift: f32) -> Affine {
    let (sine, cosine) = angle.sin_cos();
    let mut close = *open;
    for (column, growth) in close.columns[..3].iter_mut().zip(growth) {
        let [x, y, z] = column.map(|x| growth * f64::from(x));
        *column = [cosine * x - sine * y, sine * x + cosine * y, z].map(|x| x as f32);
    }
    let [x, y, z] = close.columns[3];
    close.columns[3] = [x + shift, y - 2.0 * shift, z + 0.5 * shift];
    close
}

/// Each placement of closed meshes with four motions, the last of which is none.
fn crowd() -> Vec<Instance> {
    let motions = [(0.0, [1.0; 3]), (1.5, [1.0; 3]), (-0.7, [2.0, 0.5, 1.0]), (0.0, [1.0; 3])];
    let all = placements().into_iter().zip([0.5, 1e-6, 3e5, 2e3, 1.0]).flat_map(|(placement, shift)| {
        let open = placement.world_from_object;
        (0..).zip(motions).map(move |(i, (angle, growth))| Instance {
            world_from_object_close: (i < 3).then(|| moved(&open, angle, growth, shift)),
            ..Instance::new(i % 2, open)
        })
    });
    all.collect()
}

/// The exact corners of an instance's triangle.
fn corners_at(instance: &Instance, mesh: &Mesh, primitive: u32, time: f32) -> [[f64; 3]; 3] {
    let open = &instance.world_from_object;
    let close = instance.world_from_object_close.unwrap_or(*open);
    mesh.corners(primitive as usize).map(|p| {
        let [from, to] = [open, &close].map(|end| end.point_f64(p));
        std::array::from_fn(|k| from[k] + f64::from(time) * (to[k] - from[k]))
    })
}

/// `B` of an instance at any time.
fn error(ray: &Ray, instance: &Instance, reach: f64) -> f64 {
    let Some(motion) = MotionPolynomials::of(instance) else {
        return error_of_instance(ray, &instance.world_from_object, reach);
    };
    let ends = [instance.world_from_object, instance.world_from_object_close.unwrap()];
    let row_sum = |m: &Affine, k: usize| m.columns[..3].iter().map(|column| f64::from(column[k].abs())).sum::<f64>();
    let forward = ends.iter().flat_map(|m| (0..3).map(|k| row_sum(m, k))).fold(0.0, f64::max);
    let at = ends.iter().flat_map(|m| m.columns[3]).chain(ray.origin).map(|x| f64::from(x.abs())).fold(0.0, f64::max);
    5.0 * f64::from(HIT_ERROR) * forward * motion.norm_of_inverse() * (2.0 * at + forward * reach)
}

/// The device's answers to rays at a time.
fn hits(gpu: &Gpu, scene: &TracedScene, rays: &[Ray], time: f32) -> Vec<Outcome<Option<DeviceHit>>> {
    let chosen = Variant::none().with(choice::Mask::None).with(choice::Count::None);
    let kernel = gpu.kernel(wgsl::check::MOVING, &scene.specialize(chosen)).unwrap();
    let scaled: Vec<ScaledRay> = rays.iter().map(|ray| ScaledRay::new(ray).unwrap()).collect();
    let rays_there = gpu.buffer("rays", &scaled.iter().map(DeviceRay::scaled).collect::<Vec<_>>()).unwrap();
    let times = gpu.buffer("times", &vec![time; rays.len()]).unwrap();
    let answers = gpu.zeroed::<DeviceHit>("hits", rays.len()).unwrap();
    let mut bound = scene.bindings();
    bound.push(("rays", &rays_there));
    bound.push(("times", &times));
    bound.push(("hits", &answers));
    let mut commands = gpu.commands();
    commands.dispatch(&kernel, &bound, kernel.groups(u32::try_from(rays.len()).unwrap())).unwrap();
    block_on(commands.run()).unwrap();
    let found = block_on(gpu.read(&answers)).unwrap();
    let answer = |(ray, hit): (&ScaledRay, DeviceHit)| match u32::MAX - hit.instance {
        0 => Outcome::Complete(None),
        1 => Outcome::Incomplete,
        _ => Outcome::Complete(Some(DeviceHit { t: ray.caller_t(hit.t), ..hit })),
    };
    scaled.iter().zip(found).map(answer).collect()
}

/// Compares the device at `time + late` with the CPU at several times.
fn compared(gpu: &Gpu, late: f32) -> Result<Tally, String> {
    let meshes = [scenes::needles().remove(0).mesh, scenes::room(3, 12).off_axis()];
    let reach =
        meshes.each_ref().map(|m| m.positions.iter().flatten().fold(0.0, |all: f64, &x| all.max(f64::from(x).abs())));
    let crowd = crowd();
    let (_, config) = few_variants().remove(0);
    let bottom: Vec<TriangleBvh> = meshes.iter().map(|mesh| build(mesh, &config)).collect();
    let scene = block_on(TracedScene::new(gpu, Source::tlas(&bottom, &crowd), Options::default())).unwrap();
    let tlas = Tlas::new(bottom, &crowd, TopConfig::default()).unwrap();
    let mut tally = Tally::default();
    let mut rng = SplitMix64::new(11);
    let times = [0.0, 0.5, rng.unit() as f32, rng.unit() as f32, 1.0 - f32::EPSILON];
    for (seed, time) in (0..).zip(times) {
        let placed = |index: usize| {
            let instance = &crowd[index];
            let at = |close: &Affine| Affine {
                columns: std::array::from_fn(|j| {
                    std::array::from_fn(|k| {
                        let from = instance.world_from_object.columns[j][k];
                        from + time * (close.columns[j][k] - from)
                    })
                }),
            };
            instance.world_from_object_close.as_ref().map_or(instance.world_from_object, at)
        };
        let rays: Vec<Ray> = (0..crowd.len())
            .flat_map(|index| {
                let mesh = baked(&meshes[crowd[index].blas as usize], &placed(index));
                [rays::of_all_classes(&mesh, 20, seed), rays::from_inside(&mesh, 40, seed + 40)].concat()
            })
            .filter(|ray| ScaledRay::new(ray).is_some())
            .collect();
        let of = |instance: u32| (&crowd[instance as usize], crowd[instance as usize].blas as usize);
        let world = World {
            corners: &|instance, primitive| {
                let (instance, mesh) = of(instance);
                corners_at(instance, &meshes[mesh], primitive, time)
            },
            error: &|ray, instance| {
                let (instance, mesh) = of(instance);
                error(ray, instance, reach[mesh])
            },
        };
        for (ray, hit) in rays.iter().zip(hits(gpu, &scene, &rays, time + late)) {
            world.check(ray, tlas.closest_hit(&ray.at_time(time)), hit, &mut tally)?;
        }
    }
    Ok(tally)
}

fn rays_of_any_time_lose_no_hit() {
    let gpu = gpu();
    compared(&gpu, 0.0).unwrap_or_else(|error| panic!("{error}")).report("moving instances");
}

fn the_comparison_detects_another_time() {
    let gpu = gpu();
    let wrong = compared(&gpu, -1.0 / 256.0).unwrap_err();
    assert!(wrong.contains("lost") || wrong.contains("off its triangle"), "{wrong}");
}
