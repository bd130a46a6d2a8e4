//! What a program's kernel learns of a hit: normals, sides, positions, where rays leave, masks and a function that accepts hits.

use canted_fixtures::{
    SplitMix64,
    device_tests::{Test, needs_device},
};
use canted_gpu::build::{BuildConfig, WideConfig};
use canted_gpu::{
    BufferScene, DeviceBvh, DeviceInstance, DeviceRay, Gpu, InstanceBuffer, InstancedScene, MeshBuffers, ModuleHit,
    Options, Source, TracedScene, block_on, wgpu,
};
use canted_obb::{Affine, PrimId};
use canted_tlas::Instance;
use canted_trace::{Hit, InstanceId, Side, SurfacePoint};

use crate::buffers::{buffer, opened};
use crate::kernels::{On, run};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(surfaces_are_those_of_the_cpu),
        needs_device(rays_beside_a_hit_do_not_hit_its_triangle_again),
        needs_device(masks_choose_instances),
        needs_device(a_function_of_the_program_accepts_hits),
    ]
}

type Corners = [[f32; 3]; 3];

/// Triangles around a point, compact ones and needles down to a millionth of their length.
fn soup(random: &mut SplitMix64, n: usize, center: [f32; 3]) -> Vec<Corners> {
    let mut vector = |size: f32| -> [f32; 3] { std::array::from_fn(|_| size * random.signed() as f32) };
    let one = |i: usize| {
        let height = [1.0, 1e-2, 1e-4, 1e-6][i % 4];
        let (from, along, off) = (vector(2.0), vector(1.0), vector(height));
        let at = |s: f32, h: f32| std::array::from_fn(|k| center[k] + from[k] + s * along[k] + h * off[k]);
        [at(0.0, 0.0), at(1.0, 0.0), at(0.4, 1.0)]
    };
    (0..n).map(one).collect()
}

/// Placements with condition numbers up to 128: turned, scaled, sheared, mirrored, far.
fn placements() -> [Affine; 6] {
    [
        Affine::IDENTITY,
        Affine { columns: [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0], [12.0, -3.0, 5.0]] },
        Affine { columns: [[0.0, 20.0, 15.0], [3.0, 0.1, 0.0], [0.3, -4.0, 3.0], [-90.0, 40.0, 8.0]] },
        Affine { columns: [[-0.01, 0.0, 0.002], [0.0, 0.02, 0.0], [0.003, 0.0, 0.01], [0.5, 9.0, 9.0]] },
        Affine { columns: [[1.0, 0.5, 0.0], [0.0, 1.0, 0.5], [0.5, 0.0, 1.0], [3e4, -2e3, 1e2]] },
        Affine { columns: [[2.6, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.3, 1.0], [-7.0, 1.0, 30.0]] },
    ]
}

/// The soup in buffers of a program, and a mesh of it.
fn with_buffers<T>(device: &wgpu::Device, soup: &[Corners], then: impl FnOnce(MeshBuffers<'_>) -> T) -> T {
    let vertices = buffer(device, bytemuck::cast_slice(soup));
    let n_triangles = u32::try_from(soup.len()).unwrap();
    let (n_vertices, stride) = (3 * n_triangles, 12);
    then(MeshBuffers { vertices: &vertices, first_byte: 0, stride, n_vertices, indices: None, n_triangles })
}

/// Rays from around the images of triangles to points of them, in world space.
fn rays_to(random: &mut SplitMix64, soup: &[Corners], maps: &[Affine], n: usize) -> Vec<DeviceRay> {
    let one = |i: usize| {
        let map = &maps[i % maps.len()];
        let [a, b, c] = soup[(i * 7) % soup.len()].map(|vertex| map.point_f64(vertex.map(f64::from)));
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let target: [f64; 3] = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let far = [0.1, 3.0, 200.0, 1e4][i % 4] * map.row_sum_norm();
        let origin: [f32; 3] = std::array::from_fn(|k| (target[k] + far * random.signed()) as f32);
        let direction = std::array::from_fn(|k| 0.7 * (target[k] - f64::from(origin[k])) as f32);
        DeviceRay { origin, t_min: 0.0, direction, t_max: 3e38 }
    };
    (0..n).map(one).collect()
}

/// Calls `then` with scenes over soups around several points, the soup, their instances' placements and a name. All structures are over one of the soups, because
/// the driver compiles a kernel for each.
fn scenes(
    (gpu, device): (&Gpu, &wgpu::Device),
    random: &mut SplitMix64,
    mut then: impl FnMut(&mut SplitMix64, &TracedScene, &[Corners], &[Affine], &str),
) {
    let maps = placements();
    let placed: Vec<DeviceInstance> = maps.iter().map(|map| DeviceInstance::new(0, map)).collect();
    let condition = |map: &Affine| {
        let inverse = Instance::new(0, *map).object_from_world(0).unwrap();
        map.row_sum_norm() * canted_tlas::row_sum_norm(&inverse)
    };
    let most = maps.iter().map(condition).fold(0.0, f64::max);
    assert!(most > 100.0 && most <= 128.0, "condition numbers up to {most}");
    let transforms = buffer(device, bytemuck::cast_slice(&placed));
    let n_instances = u32::try_from(placed.len()).unwrap();
    let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances, has_masks: false };
    let bvhs: [(&str, DeviceBvh); 2] =
        [("wide", WideConfig::default().into()), ("binary", BuildConfig::default().into())];
    for (i, center) in [[3.0, -2.0, 5.0], [0.0; 3], [1000.0, 0.3, -40.0]].into_iter().enumerate() {
        let soup = soup(random, 200, center);
        for (name, bvh) in &bvhs[..if i == 0 { 2 } else { 1 }] {
            with_buffers(device, &soup, |mesh| {
                let scene = block_on(BufferScene::new(gpu, &[mesh], *bvh)).unwrap();
                then(random, scene.traced(), &soup, &maps[..1], &format!("{name} at {center:?}"));
                let scene = block_on(InstancedScene::new(gpu, &[mesh], &instances, *bvh)).unwrap();
                then(random, scene.traced(), &soup, &maps, &format!("{name} in two levels at {center:?}"));
            });
        }
        if i == 0 {
            // An instance that moves is in its first place at the time of the module's rays.
            let mut moving = maps.map(|map| Instance::new(0, map));
            let columns = [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.1], [9.0; 3]];
            moving[1] = Instance::moving(0, maps[1], Affine { columns });
            let input = Source::build([&soup], WideConfig::default()).with_instances(&moving);
            then(random, &block_on(TracedScene::new(gpu, input, Options::default())).unwrap(), &soup, &maps, "moving");
        }
    }
}

/// A kernel that writes what it learns of each hit.
const LEARNS: &str = "
struct Learned { hit: Hit, error: f32, normal: vec3f, is_front: u32, position: vec3f, is_incomplete: u32 }
@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> learned: array<Learned>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&rays) {
        let hit = closest_hit(rays[id.x]);
        if hit.instance == NONE {
            learned[id.x].hit = hit;
        } else {
            let surface = surface_of(hit, rays[id.x]);
            let is_same = all(surface.normal == normal_of(hit));
            learned[id.x] = Learned(hit, surface.error, surface.normal, u32(surface.is_front), surface.position, u32(is_incomplete || !is_same));
        }
    }
}
";

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Learned {
    hit: ModuleHit,
    error: f32,
    padding: u32,
    normal: [f32; 3],
    is_front: u32,
    position: [f32; 3],
    is_incomplete: u32,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Checks a hit of a ray against the CPU's normal, side and plane.
fn check(learned: &Learned, ray: &DeviceRay, soup: &[Corners], map: &Affine, name: &str) -> bool {
    let Learned { hit, error, normal, is_front, position, .. } = *learned;
    let (primitive, instance) = (PrimId(hit.primitive), InstanceId(hit.instance));
    let of_cpu = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: Side::Front };
    let corners = soup[hit.primitive as usize];
    let expected = SurfacePoint::in_instance(&of_cpu, corners, 1.0, map);
    let inverse = Instance::new(0, *map).object_from_world(0).unwrap();
    let condition = map.row_sum_norm() * canted_tlas::row_sum_norm(&inverse);
    let (normal, position) = (normal.map(f64::from), position.map(f64::from));
    let off = (0..3).map(|k| (normal[k] - expected.normal[k]).abs()).fold(0.0, f64::max);
    // As `TracedScene::module` states.
    assert!(off <= condition / f64::from(1 << 20), "{name}: normal {normal:?}, not {:?}", expected.normal);
    let direction = ray.direction.map(f64::from);
    let cosine = dot(expected.normal, direction) / dot(direction, direction).sqrt();
    if cosine.abs() > condition / f64::from(1 << 20) {
        assert_eq!(is_front == 1, cosine < 0.0, "{name}: cosine {cosine}");
    }
    let vertex = map.point_f64(corners[0].map(f64::from));
    let from_vertex: [f64; 3] = std::array::from_fn(|k| position[k] - vertex[k]);
    let size: f64 = expected.normal.iter().map(|x| x.abs()).sum();
    let distance = dot(expected.normal, from_vertex).abs();
    assert!(distance <= size * f64::from(error), "{name}: {distance} off the plane, error {error}");
    distance > 0.0
}

fn surfaces_are_those_of_the_cpu() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let on = (&device, &queue, &gpu);
    scenes((&gpu, &device), &mut SplitMix64::new(5), |random, scene, soup, maps, name| {
        let rays = rays_to(random, soup, maps, 1500);
        let rays_there = gpu.buffer("rays", &rays).unwrap();
        let found = gpu.zeroed::<Learned>("learned", rays.len()).unwrap();
        run(on, (scene, None), LEARNS, &[[rays_there.wgpu(), found.wgpu()]], 24);
        let found = block_on(gpu.read(&found)).unwrap();
        let mut n = [0; 3];
        for (learned, ray) in found.iter().zip(&rays).filter(|(learned, _)| learned.hit.instance != u32::MAX) {
            assert_eq!(learned.is_incomplete, 0);
            let is_off = check(learned, ray, soup, &maps[learned.hit.instance as usize], name);
            n[learned.is_front as usize] += 1;
            n[2] += usize::from(is_off);
        }
        assert!(n.iter().all(|&n| n > 100), "{name}: {n:?}");
    });
}

/// Of rays that leave the hits of rays, counts those that hit the same triangle again.
const AGAIN: &str = "
@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>, 4>;
var<private> only: vec2u;
var<private> is_only: bool;
fn is_of_interest(hit: Hit) -> bool {
    return !is_only || all(only == vec2u(hit.primitive, hit.instance));
}
fn random(seed: ptr<function, u32>) -> f32 {
    *seed = *seed * 747796405u + 2891336453u;
    let word = ((*seed >> ((*seed >> 28u) + 4u)) ^ *seed) * 277803737u;
    return f32(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}
fn within(seed: ptr<function, u32>) -> vec3f {
    return 2.0 * vec3f(random(seed), random(seed), random(seed)) - 1.0;
}
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&rays) {
        return;
    }
    let first = rays[id.x];
    var next = first;
    var hit: Hit;
    var surface: Surface;
    var seed = id.x * 9781u + 1u;
    // One call, because drivers compile a traversal for each.
    for (var i = 0u; i < 13u; i++) {
        let found = closest_hit(next);
        if i == 0u {
            hit = found;
            if hit.instance == NONE {
                return;
            }
            surface = surface_of(hit, first);
            is_only = true;
            only = vec2u(hit.primitive, hit.instance);
        } else {
            atomicAdd(&counts[0], 1u);
            atomicAdd(&counts[1], u32(found.instance != NONE));
        }
        atomicAdd(&counts[2], u32(is_incomplete));
        // In any direction, nearly along the plane, and as nearly as f32 can tell.
        var direction = within(&seed);
        if i % 3u != 0u {
            direction -= dot(direction, surface.normal) * surface.normal;
        }
        if i % 3u == 1u {
            direction += 1e-5 * within(&seed);
        }
        next = ray(surface.position, direction, 3e38);
        if atomicLoad(&counts[3]) == 1u {
            next.origin = origin_beside(hit, first, direction);
        }
    }
}
";

fn rays_beside_a_hit_do_not_hit_its_triangle_again() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    let on: On<'_> = (&device, &queue, &gpu);
    scenes((&gpu, &device), &mut SplitMix64::new(6), |random, scene, soup, maps, name| {
        let rays = rays_to(random, soup, maps, 1500);
        let rays_there = gpu.buffer("rays", &rays).unwrap();
        let counts = [1, 0].map(|is_beside| gpu.buffer("counts", &[0_u32, 0, 0, is_beside]).unwrap());
        let sets = counts.each_ref().map(|counts| [rays_there.wgpu(), counts.wgpu()]);
        run(on, (scene, Some("is_of_interest")), AGAIN, &sets, 24);
        let [beside, at_hits] = counts.map(|counts| block_on(gpu.read(&counts)).unwrap());
        assert!(beside[0] > 8_000 && beside[2] == 0, "{name}: {beside:?}");
        assert_eq!(beside[1], 0, "{name}: rays of {} hit their triangle again", beside[0]);
        assert!(at_hits[1] > 0, "{name}: rays may start at hits");
    });
}

/// Floors above each other, as instances with masks.
const HEIGHTS: [f32; 4] = [3.0, 2.0, 1.0, 0.0];
const MASKS: [u32; 4] = [0b001, 0b110, 0, 0b100];

fn floors() -> [Affine; 4] {
    HEIGHTS.map(|z| Affine { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, z]] })
}

/// Two triangles, of which a ray at (0.7, 0.3) hits the first and one at (0.3, 0.7) the second.
const FLOOR: [Corners; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];

/// The floors, whose instances the program's buffer or the CPU places.
fn masked(gpu: &Gpu, device: &wgpu::Device, masks: [u32; 4], then: impl Fn(&TracedScene, &str)) {
    let one = |(map, mask)| DeviceInstance { mask, ..DeviceInstance::new(0, map) };
    let placed: Vec<_> = floors().iter().zip(masks).map(one).collect();
    let transforms = buffer(device, bytemuck::cast_slice(&placed));
    let instances = InstanceBuffer { buffer: &transforms, first_byte: 0, stride: 64, n_instances: 4, has_masks: true };
    with_buffers(device, &FLOOR, |mesh| {
        for (name, bvh) in [("binary", DeviceBvh::from(BuildConfig::default())), ("wide", WideConfig::default().into())]
        {
            then(block_on(InstancedScene::new(gpu, &[mesh], &instances, bvh)).unwrap().traced(), name);
        }
    });
    let placed: Vec<_> = floors().iter().zip(masks).map(|(map, mask)| Instance::new(0, *map).with_mask(mask)).collect();
    let input = Source::build([&FLOOR], WideConfig::default()).with_instances(&placed);
    then(&block_on(TracedScene::new(gpu, input, Options::default())).unwrap(), "placed by the CPU");
}

/// For each mask up to 7 the instance that a ray with it hits, and whether it hits any.
const MASKED: &str = "
@group(0) @binding(0) var<storage, read_write> found: array<vec2u>;
@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let down = ray(vec3f(0.7, 0.3, 9.0), vec3f(0.0, 0.0, -1.0), 3e38);
    let unmasked = closest_hit(down);
    let hit = closest_hit_masked(down, id.x);
    found[id.x] = vec2u(hit.instance, u32(occluded_masked(down, id.x)));
    if unmasked.instance != 0u || !occluded(down) || is_incomplete {
        found[id.x] = vec2u(77u);
    }
}
";

fn masks_choose_instances() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    masked(&gpu, &device, MASKS, |scene, name| {
        let found = gpu.zeroed::<[u32; 2]>("found", 8).unwrap();
        run((&device, &queue, &gpu), (scene, None), MASKED, &[[found.wgpu()]], 1);
        let first = |mask: u32| (0..4).find(|&i| MASKS[i as usize] & mask != 0);
        let expected: Vec<_> = (0..8).map(|mask| first(mask).map_or([u32::MAX, 0], |i| [i, 1])).collect();
        assert_eq!(block_on(gpu.read(&found)).unwrap(), expected, "{name}");
    });
}

/// Rays to both triangles: the first floor whose number and triangle have an even sum.
const ACCEPTED: &str = "
@group(0) @binding(0) var<storage, read_write> found: array<vec4u>;
fn accepts(hit: Hit) -> bool {
    // The floors are seen from above.
    return (hit.primitive + hit.instance) % 2u == REST && normal_of(hit).z > 0.5 && hit.u + hit.v < 1.0;
}
@compute @workgroup_size(2)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let x = select(0.3, 0.7, id.x == 0u);
    let down = ray(vec3f(x, 1.0 - x, 9.0), vec3f(0.0, 0.0, -1.0), 3e38);
    let hit = closest_hit(down);
    found[id.x] = vec4u(hit.primitive, hit.instance, u32(occluded(down)), u32(is_incomplete));
}
";

fn a_function_of_the_program_accepts_hits() {
    let (device, queue) = opened();
    let gpu = Gpu::from_wgpu(device.clone(), queue.clone());
    masked(&gpu, &device, [u32::MAX; 4], |scene, name| {
        for rest in 0..3 {
            let found = gpu.zeroed::<[u32; 4]>("found", 2).unwrap();
            let kernel = format!("const REST = {rest}u; {ACCEPTED}");
            run((&device, &queue, &gpu), (scene, Some("accepts")), &kernel, &[[found.wgpu()]], 1);
            let expected = match rest {
                2 => [[u32::MAX, u32::MAX, 0, 0]; 2],
                _ => [0, 1].map(|primitive| [primitive, (primitive + rest) % 2, 1, 0]),
            };
            assert_eq!(block_on(gpu.read(&found)).unwrap(), expected, "{name}, {rest}");
        }
    });
}
