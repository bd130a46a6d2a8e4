//! Rays that the driver traces by its ray queries. No bound of their hits is known, so they are compared with the CPU's where a ray is far
//! from all edges, not nearly parallel to a triangle that it comes close to, and its hits are apart.

use canted_fixtures::SplitMix64;
use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{
    AdapterInfo, Choice, DeviceHit, DeviceRay, Gpu, ModuleHit, ModuleOptions, Options, Outcome, Source, TracedScene,
    adapters, block_on, wgpu,
};
use canted_lbvh::Corners;
use canted_obb::Affine;
use canted_obb::vector::{cross, dot};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Hit, Intersect, Ray, ScaledRay};
use canted_wide::TriangleBvh;

pub(crate) fn tests() -> Vec<Test> {
    let first = block_on(adapters()).unwrap_or_default().into_iter().next();
    let lacks = match &first {
        Some(AdapterInfo { has_ray_queries: false, name, .. }) => Some(format!("adapter '{name}' has no ray queries")),
        _ => None,
    };
    let has = if lacks.is_none() { Some("the adapter has ray queries".to_owned()) } else { None };
    vec![
        needs_device(hits_of_one_level_are_those_of_the_cpu_away_from_edges).unless(lacks.clone()),
        needs_device(hits_of_instances_are_those_of_the_cpu_away_from_edges).unless(lacks.clone()),
        needs_device(a_kernel_of_the_program_traces_rays_of_the_driver).unless(lacks.clone()),
        needs_device(what_the_driver_does_not_trace_is_refused).unless(lacks),
        needs_device(ray_queries_that_the_driver_lacks_are_refused).unless(has),
    ]
}

/// Distance from an edge in weights, sine between ray and triangle, and distance of hits, below which rays are not compared.
const EDGE: f64 = 1e-3;
const SINE: f64 = 0.02;
const APART: f64 = 1e-3;

/// Differences of `t` and of weights that single precision explains for such rays: some 30 roundings of coordinates up to 10 over [`SINE`],
/// and over the size of a triangle, which is at least 0.1.
const OFF_T: f64 = 30.0 * 10.0 * 6e-8 / SINE;
const OFF_WEIGHT: f64 = OFF_T / 0.1;

/// Triangles of about half a unit around the origin.
fn soup(n: usize) -> Vec<Corners> {
    let mut random = SplitMix64::new(3);
    let mut vector = |size: f64| -> [f64; 3] { std::array::from_fn(|_| size * random.signed()) };
    let mut triangles = vec![];
    while triangles.len() < n {
        let (at, u, v) = (vector(2.0), vector(0.5), vector(0.5));
        let normal = cross(u, v);
        if dot(normal, normal) > 0.01 {
            let corner = |a: f64, b: f64| std::array::from_fn(|k| (at[k] + a * u[k] + b * v[k]) as f32);
            triangles.push([corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)]);
        }
    }
    triangles
}

/// Placements: turned, scaled, sheared, mirrored.
fn instances() -> [Instance; 5] {
    let columns = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]],
        [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0], [3.0, -1.0, 2.0]],
        [[0.0, 1.5, 0.5], [1.0, 0.1, 0.0], [0.3, -0.5, 1.0], [-4.0, 2.0, 1.0]],
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.2], [0.0, 0.0, 1.0], [1.0, 4.0, -2.0]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, 0.2, 0.1]],
    ];
    let masks = [0b0100001, u32::MAX, 0b110, 0b1000000, 0];
    let mut number = 0;
    columns.map(|columns| {
        number += 1;
        // The second mesh, which has no triangles, is in none.
        Instance::new(if number == 2 { 2 } else { 0 }, Affine { columns }).with_mask(masks[number - 1])
    })
}

/// Rays through the middle from all around.
fn rays(n: u32) -> Vec<Ray> {
    let mut random = SplitMix64::new(7);
    let one = |i| {
        let (from, to) = (random.on_sphere(), random.on_sphere());
        let origin: [f32; 3] = std::array::from_fn(|k| (6.0 * from[k]) as f32);
        let direction = std::array::from_fn(|k| (2.0 * to[k] - 6.0 * from[k]) as f32);
        let end = if i % 5 == 0 { 1.0 } else { f32::INFINITY };
        Ray { t_max: end, ..Ray::new(origin, direction) }
    };
    (0..n).map(one).collect()
}

/// Whether the answer for a ray does not depend on the arithmetic, for triangles in world space.
fn is_clear(ray: &Ray, world: &[[[f64; 3]; 3]]) -> bool {
    let (origin, direction) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let length = dot(direction, direction).sqrt();
    let mut hits = vec![0.0, f64::from(ray.t_max) * length];
    for [a, b, c] in world {
        let of = |p: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|k| p[k] - a[k]) };
        let (u, v, from) = (of(b), of(c), of(&origin));
        let normal = cross(u, v);
        let size = dot(normal, normal).sqrt();
        let sine = dot(normal, direction) / (size * length);
        // The plane of the triangle, at the ray, or the nearest point where both are nearly parallel.
        let t = -dot(normal, from) / (size * sine.abs().max(1e-9).copysign(sine));
        let p: [f64; 3] = std::array::from_fn(|k| from[k] + t * direction[k] / length);
        let weights = [dot(cross(p, v), normal) / (size * size), dot(cross(u, p), normal) / (size * size)];
        let least = weights[0].min(weights[1]).min(1.0 - weights[0] - weights[1]);
        if sine.abs() < SINE && least > -0.5 || least.abs() < EDGE {
            return false;
        }
        if least > 0.0 {
            hits.push(t);
        }
    }
    hits.retain(|t| t.is_finite() && *t >= -APART);
    hits.sort_by(f64::total_cmp);
    hits.windows(2).all(|pair| pair[1] - pair[0] > APART)
}

/// The triangles of instances in world space.
fn placed(meshes: &[&[Corners]], instances: &[Instance]) -> Vec<[[f64; 3]; 3]> {
    let of = |instance: &Instance| {
        let map = instance.world_from_object;
        meshes[instance.blas as usize].iter().map(move |corners| corners.map(|p| map.point_f64(p.map(f64::from))))
    };
    instances.iter().flat_map(of).collect()
}

/// Of rays that are clear, the number of hits, of misses, and of answers that differ.
fn compared(rays: &[Ray], world: &[[[f64; 3]; 3]], cpu: &[Option<Hit>], driver: &[Option<DeviceHit>]) -> [usize; 3] {
    let mut n = [0; 3];
    for ((ray, cpu), driver) in rays.iter().zip(cpu).zip(driver).filter(|((ray, _), _)| is_clear(ray, world)) {
        let is_same = match (cpu, driver) {
            (None, None) => true,
            (Some(cpu), Some(driver)) => {
                let length = f64::from(dot(ray.direction, ray.direction)).sqrt();
                let off = |a: f32, b: f32| (f64::from(a) - f64::from(b)).abs();
                (cpu.instance.0, cpu.primitive.0) == (driver.instance, driver.primitive)
                    && off(cpu.t, driver.t) * length <= OFF_T
                    && off(cpu.u, driver.u).max(off(cpu.v, driver.v)) <= OFF_WEIGHT
            }
            _ => false,
        };
        n[usize::from(cpu.is_none())] += 1;
        n[2] += usize::from(!is_same);
    }
    n
}

fn gpu() -> Gpu {
    block_on(Gpu::with_ray_queries(&Choice::Best)).unwrap()
}

fn scene(gpu: &Gpu, source: Source<'_>) -> Result<TracedScene, String> {
    block_on(TracedScene::new(gpu, source, Options::default())).map_err(|error| error.to_string())
}

/// The driver's answers, which agree with its occlusion.
fn traced(gpu: &Gpu, scene: &TracedScene, rays: &[Ray]) -> Vec<Option<DeviceHit>> {
    let complete = |outcome| if let Outcome::Complete(found) = outcome { found } else { panic!("a ray has no answer") };
    let hits: Vec<_> = block_on(scene.closest_hits(gpu, rays)).unwrap().into_iter().map(complete).collect();
    let occluded = block_on(scene.occluded(gpu, rays)).unwrap();
    let expected: Vec<_> = hits.iter().map(|hit| Outcome::Complete(hit.is_some())).collect();
    assert_eq!(occluded, expected);
    assert_eq!(scene.n_exact_rays(), 0);
    hits
}

fn hits_of_one_level_are_those_of_the_cpu_away_from_edges() {
    let (gpu, soup, rays) = (gpu(), soup(300), rays(4000));
    let world = placed(&[&soup], &[Instance::new(0, Affine::IDENTITY)]);
    let bvh = TriangleBvh::build_flat(&soup).unwrap();
    let cpu: Vec<_> = rays.iter().map(|ray| bvh.closest_hit(ray)).collect();
    let of = |soup: &Vec<Corners>| {
        let scene = scene(&gpu, Source::driver_ray_queries([soup])).unwrap();
        compared(&rays, &world, &cpu, &traced(&gpu, &scene, &rays))
    };
    let [n_hits, n_misses, n_differing] = of(&soup);
    assert!(n_hits > 1500 && n_misses > 300 && n_differing == 0, "{n_hits}, {n_misses}, {n_differing}");
    // Nothing to hit, in one level and in two.
    let nothing: [&[Corners]; 1] = [&[]];
    for source in [Source::driver_ray_queries(nothing), Source::driver_ray_queries([&soup]).with_instances(&[])] {
        assert!(traced(&gpu, &scene(&gpu, source).unwrap(), &rays).iter().all(Option::is_none));
    }
    // Other triangles, other numbers, and a mesh that is moved by a thousandth of its size are noticed.
    let mut others = soup.clone();
    others.pop();
    assert!(of(&others)[2] > 0);
    others = soup.clone();
    others.swap(0, 1);
    assert!(of(&others)[2] > 0);
    others = soup.iter().map(|corners| corners.map(|[x, y, z]| [x + 4e-3, y, z])).collect();
    assert!(of(&others)[2] > n_hits / 10);
}

fn hits_of_instances_are_those_of_the_cpu_away_from_edges() {
    let (gpu, soup, rays, instances) = (gpu(), soup(60), rays(4000), instances().map(|i| i.with_mask(u32::MAX)));
    let meshes: [&[Corners]; 3] = [&soup, &[], &soup[10..30]];
    let world = placed(&meshes, &instances);
    let bvhs: Vec<_> = meshes.iter().map(|mesh| TriangleBvh::build_flat(mesh).unwrap()).collect();
    let tlas = Tlas::new(bvhs, &instances, TopConfig::default()).unwrap();
    let cpu: Vec<_> = rays.iter().map(|ray| tlas.closest_hit(ray)).collect();
    let source = |instances| Source::driver_ray_queries(meshes).with_instances(instances);
    let hits = traced(&gpu, &scene(&gpu, source(&instances)).unwrap(), &rays);
    let [n_hits, n_misses, n_differing] = compared(&rays, &world, &cpu, &hits);
    assert!(n_hits > 1000 && n_misses > 300 && n_differing == 0, "{n_hits}, {n_misses}, {n_differing}");
    let mut others = instances;
    others.swap(1, 2);
    let hits = traced(&gpu, &scene(&gpu, source(&others)).unwrap(), &rays);
    assert!(compared(&rays, &world, &cpu, &hits)[2] > 0);
}

/// Each ray with the mask of its number.
const KERNEL: &str = "
struct Answer { hit: rt_Hit, masked: rt_Hit, is_occluded: u32, is_masked_occluded: u32 }
@group(0) @binding(0) var<storage, read> rays: array<rt_Ray>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = id.x;
    if i < arrayLength(&rays) {
        let again = rt_ray(rays[i].origin, rays[i].direction, rays[i].t_max);
        let mask = i % 256u;
        answers[i] = Answer(rt_closest_hit(rays[i]), rt_closest_hit_masked(again, mask), u32(rt_occluded(rays[i]) && !rt_is_incomplete), u32(rt_occluded_masked(again, mask)));
        if answers[i].hit.instance == rt_NONE && answers[i].is_occluded != 0u {
            answers[i].is_occluded = 2u;
        }
    }
}
";

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Answer {
    hit: ModuleHit,
    masked: ModuleHit,
    is_occluded: u32,
    is_masked_occluded: u32,
}

fn a_kernel_of_the_program_traces_rays_of_the_driver() {
    let (gpu, soup, rays, instances) = (gpu(), soup(60), rays(4096), instances());
    let meshes: [&[Corners]; 3] = [&soup, &[], &soup[10..30]];
    let world = placed(&meshes, &instances);
    let scene = scene(&gpu, Source::driver_ray_queries(meshes).with_instances(&instances)).unwrap();
    let device = gpu.device();
    let text = scene.module(ModuleOptions { group: 1, prefix: "rt_", accepts: None }).unwrap() + KERNEL;
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let own_entry = |binding, read_only| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let layout_of =
        |entries: &[_]| device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries });
    let own_layout = layout_of(&[own_entry(0, true), own_entry(1, false)]);
    let layout = layout_of(&TracedScene::driver_layout_entries(wgpu::ShaderStages::COMPUTE));
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: Some(&device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&own_layout), Some(&layout)],
            immediate_size: 0,
        })),
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let device_rays: Vec<_> = rays.iter().map(|ray| DeviceRay::scaled(&ScaledRay::new(ray).unwrap())).collect();
    let there = gpu.buffer("rays", &device_rays).unwrap();
    let answers = gpu.zeroed::<Answer>("answers", rays.len()).unwrap();
    let own = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &own_layout,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: there.wgpu().as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: answers.wgpu().as_entire_binding() },
        ],
    });
    let theirs = scene.bind_group(&gpu, &layout).unwrap();
    let mut encoder = gpu.encoder();
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &own, &[]);
    pass.set_bind_group(1, &theirs, &[]);
    pass.dispatch_workgroups(64, 1, 1);
    drop(pass);
    gpu.submit(encoder).unwrap();
    let answers = block_on(gpu.read(&answers)).unwrap();
    let hit = |ray: usize, ModuleHit { t, u, v, primitive, instance, .. }: ModuleHit| {
        let t = ScaledRay::new(&rays[ray]).unwrap().caller_t(t);
        (instance != DeviceHit::NONE).then_some(DeviceHit { t, u, v, primitive, instance })
    };
    let found: Vec<_> = answers.iter().enumerate().map(|(i, answer)| hit(i, answer.hit)).collect();
    assert_eq!(found, traced(&gpu, &scene, &rays));
    let occluded: Vec<_> = answers.iter().map(|answer| answer.is_occluded == 1).collect();
    assert_eq!(occluded, found.iter().map(Option::is_some).collect::<Vec<_>>());
    let bvhs: Vec<_> = meshes.iter().map(|mesh| TriangleBvh::build_flat(mesh).unwrap()).collect();
    let tlas = Tlas::new(bvhs, &instances, TopConfig::default()).unwrap();
    let masked: Vec<_> = answers.iter().enumerate().map(|(i, answer)| hit(i, answer.masked)).collect();
    let with_mask = |(i, ray): (usize, &Ray)| tlas.closest_hit(&Ray { mask: i as u32 % 256, ..*ray });
    let cpu: Vec<_> = rays.iter().enumerate().map(with_mask).collect();
    let [n_hits, n_misses, n_differing] = compared(&rays, &world, &cpu, &masked);
    assert!(n_hits > 500 && n_misses > 300 && n_differing == 0, "{n_hits}, {n_misses}, {n_differing}");
    assert!(compared(&rays, &world, &cpu, &found)[2] > 100, "masks are of no effect");
    assert!(answers.iter().zip(&masked).all(|(answer, hit)| (answer.is_masked_occluded == 1) == hit.is_some()));
}

fn what_the_driver_does_not_trace_is_refused() {
    let (gpu, soup) = (gpu(), soup(3));
    let by_driver = || Source::driver_ray_queries([&soup]);
    let refused = |instance: Instance| scene(&gpu, by_driver().with_instances(&[instance])).err().unwrap();
    let [still, other, ..] = instances();
    let what = "not supported on the GPU: instance 0, which ";
    assert_eq!(
        refused(Instance::moving(0, still.world_from_object, other.world_from_object)),
        what.to_owned() + "moves, by ray queries of the driver"
    );
    assert_eq!(
        refused(still.with_mask(0x80)),
        what.to_owned() + "has a mask of more than seven bits, but not all, by ray queries of the driver"
    );
    assert!(refused(Instance::new(1, Affine::IDENTITY)).contains("instance 0"));
    let with = |options| block_on(TracedScene::new(&gpu, by_driver(), options)).err().unwrap().to_string();
    let masked = [vec![true; 3]];
    assert_eq!(
        with(Options { masked: &masked, ..Options::default() }),
        "not supported on the GPU: masked triangles by ray queries of the driver"
    );
    assert_eq!(
        with(Options { parts: &[0, 1], ..Options::default() }),
        "not supported on the GPU: parts of meshes by ray queries of the driver"
    );
    let scaled = |scale: f32| Affine { columns: [[scale, 0.0, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale], [0.0; 3]] };
    assert!(refused(Instance::new(0, scaled(1e-31))).contains("instance 0, which scales by less than 2^-100"));
    assert!(refused(Instance::new(0, scaled(1e25))).contains("instance 0"));
    let scene = scene(&gpu, by_driver()).unwrap();
    assert_eq!(
        scene.stream_queries(&gpu, 8, None).err().unwrap().to_string(),
        "not supported on the GPU: streams of rays by ray queries of the driver"
    );
    assert!(block_on(scene.download_mesh(&gpu, 3)).err().unwrap().to_string().contains("structures of the driver"));
    let accepting = ModuleOptions { accepts: Some("accepts"), ..ModuleOptions::from(1) };
    assert_eq!(
        scene.module(accepting).unwrap_err().to_string(),
        "not supported on the GPU: a function that accepts hits of the driver"
    );
    assert_eq!(
        block_on(scene.download(&gpu)).err().unwrap().to_string(),
        "not supported on the GPU: a download of structures of the driver"
    );
    // A device that was opened without them has none.
    let plain = super::gpu();
    assert!(!plain.has_ray_queries() && plain.info().has_ray_queries);
    assert!(self::scene(&plain, by_driver()).err().unwrap().contains("open it by Gpu::with_ray_queries"));
}

fn ray_queries_that_the_driver_lacks_are_refused() {
    let name = super::gpu().info().name.clone();
    let error = block_on(Gpu::with_ray_queries(&Choice::Best)).err().unwrap().to_string();
    assert_eq!(error, format!("not supported on the GPU: ray queries of the driver by adapter '{name}'"));
}
