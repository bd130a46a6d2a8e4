//! What the device places, compared with the CPU.

use canted_fixtures::{
    SplitMix64,
    device_tests::{Test, needs_device},
};
use canted_gpu::{
    BufferConfig, DeviceBvh, DeviceInstance, Gpu, InstanceBuffer, InstancedScene, MeshBuffers, NOT_PLACED, Outcome,
    block_on, wgpu,
};
use canted_obb::{Aabb, Affine};
use canted_tlas::Instance;

use crate::{gpu, words};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(instances_have_the_bits_of_the_cpu_and_boxes_contain_them),
        needs_device(faults_of_instances_are_reported_with_their_number),
    ]
}

/// Two triangles far from their origin, and a single one; no triangle.
fn soups() -> [Vec<[f32; 9]>; 3] {
    let far =
        vec![[10.0, -3.0, 0.25, 12.5, -3.0, 0.5, 11.0, 2.0, 0.125], [10.5, 0.0, -2.0, 12.0, 1.0, 0.0, 11.0, -1.0, 7.0]];
    [far, vec![[-1.0, 0.0, 0.0, 1.0, 0.0, 0.1, 0.0, 1.0, 0.3]], vec![]]
}

fn bounds(soup: &[[f32; 9]]) -> Aabb {
    Aabb::from_points(soup.iter().flat_map(|t| [[t[0], t[1], t[2]], [t[3], t[4], t[5]], [t[6], t[7], t[8]]]))
}

/// Transforms of all sizes, most of them sheared, some mirrored, some of the greatest condition that devices accept.
fn transforms() -> Vec<Affine> {
    let mut random = SplitMix64::new(28);
    let mut unit = move || random.signed() as f32;
    let mut all = vec![Affine::IDENTITY];
    for i in 0..3000_i32 {
        let scale = 2.0_f32.powi(i % 81 - 40) * (1.0 + unit() * 0.5);
        let flat = [1.0, 1e-1, 3e-3][usize::try_from(i % 3).unwrap()];
        let mut columns = [[0.0; 3]; 4];
        for (k, column) in columns[..3].iter_mut().enumerate() {
            *column = std::array::from_fn(|j| scale * if j == k { 1.0 } else { 0.4 * unit() });
        }
        columns[2] = columns[2].map(|x| x * flat);
        let shift = 10.0_f32.powi(i % 17 - 8);
        columns[3] = std::array::from_fn(|_| shift * unit());
        if i % 5 == 0 {
            // Numbers with few bits, whose products need no rounding.
            columns = columns.map(|column| column.map(|x| f32::from_bits(x.to_bits() & 0xfff8_0000)));
        }
        all.push(Affine { columns });
    }
    all
}

fn storage(gpu: &Gpu, contents: &[u8]) -> wgpu::Buffer {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(contents);
    gpu.buffer("a program's buffer", &words).unwrap().wgpu().clone()
}

fn scene_of(gpu: &Gpu, instances: &[DeviceInstance]) -> InstancedScene {
    let vertices = soups().map(|soup| storage(gpu, bytemuck::cast_slice(&soup)));
    let meshes: Vec<MeshBuffers<'_>> = vertices
        .iter()
        .zip(soups())
        .map(|(vertices, soup)| MeshBuffers {
            vertices,
            first_byte: 0,
            stride: 12,
            n_vertices: u32::try_from(3 * soup.len()).unwrap(),
            indices: None,
            n_triangles: u32::try_from(soup.len()).unwrap(),
        })
        .collect();
    let buffer = storage(gpu, bytemuck::cast_slice(instances));
    let n_instances = u32::try_from(instances.len()).unwrap();
    let instances = InstanceBuffer { buffer: &buffer, first_byte: 0, stride: 64, n_instances, has_masks: false };
    block_on(InstancedScene::new(
        gpu,
        &meshes,
        &instances,
        BufferConfig { is_checked: false, ..DeviceBvh::default().into() },
    ))
    .unwrap()
}

/// Whether the words of an instance are those of its inverse and its mesh, apart from the signs of zeros.
fn is_placed(words: &[u32], inverse: &[[f64; 4]; 3], map: &Affine, mesh: u32) -> bool {
    (0..3).all(|k| {
        let row = std::array::from_fn(|j| f32::from_bits(words[4 * k + j]));
        let exact = |j: usize| {
            let at = 16 + 8 * k + 2 * j;
            f64::from_bits(u64::from(words[at + 1]) << 32 | u64::from(words[at]))
        };
        let [x, y, z, _] = inverse[k].map(|x| x as f32);
        row == [x, y, z, map.columns[3][k]] && inverse[k] == std::array::from_fn(exact)
    }) && words[12..16] == [mesh + 1, 0, u32::MAX, 0]
}

/// The boxes of all instances, from the leaves of the top level's nodes.
fn boxes(gpu: &Gpu, scene: &InstancedScene, n: usize) -> Vec<Aabb> {
    const LEAF: u32 = 1 << 31;
    let n_triangles: usize = soups().iter().map(Vec::len).sum();
    let nodes = words(gpu, scene.traced(), "nodes").unwrap();
    let mut boxes = vec![Aabb::EMPTY; n];
    // Sixteen words a node: two children of lower ends, word, upper ends.
    for child in nodes[16 * n_triangles..].chunks_exact(8).filter(|child| child[3] & LEAF != 0) {
        let [min, max] = [0, 4].map(|at| std::array::from_fn(|k| f32::from_bits(child[at + k])));
        boxes[(child[3] & !LEAF) as usize] = Aabb { min, max };
    }
    boxes
}

/// Corners of a box in world space. The error of `f64` is far below the pads.
fn image(map: &Affine, aabb: &Aabb) -> [[f64; 3]; 8] {
    std::array::from_fn(|corner| {
        let point = std::array::from_fn(|k| f64::from(if corner >> k & 1 == 0 { aabb.min[k] } else { aabb.max[k] }));
        map.point_f64(point)
    })
}

fn holds(aabb: &Aabb, point: [f64; 3]) -> bool {
    (0..3).all(|k| f64::from(aabb.min[k]) <= point[k] && point[k] <= f64::from(aabb.max[k]))
}

fn instances_have_the_bits_of_the_cpu_and_boxes_contain_them() {
    let gpu = gpu();
    let transforms = transforms();
    let placed: Vec<DeviceInstance> = (0..).zip(&transforms).map(|(i, map)| DeviceInstance::new(i % 2, map)).collect();
    let scene = scene_of(&gpu, &placed);
    let found = words(&gpu, scene.traced(), "instances").unwrap();
    let found: Vec<&[u32]> = found.chunks_exact(40).collect();
    let boxes = boxes(&gpu, &scene, placed.len());
    let (mut n_compared, mut n_escaped) = (0, 0);
    for (i, map) in transforms.iter().enumerate() {
        let instance = Instance::new(placed[i].mesh, *map);
        let inverse = instance.object_from_world(i).unwrap();
        let backward = canted_tlas::row_sum_norm(&inverse);
        if map.row_sum_norm() * backward > 1023.0 {
            continue;
        }
        n_compared += 1;
        assert!(is_placed(found[i], &inverse, map, instance.blas), "instance {i}: {:?}", found[i]);
        let aabb = bounds(&soups()[i % 2]);
        for point in image(map, &aabb) {
            assert!(holds(&boxes[i], point), "instance {i}: {:?} lacks {point:?}", boxes[i]);
        }
        // Without pads some boxes would be too small, and no box is much larger than the pads.
        let reach = map.reach(aabb.reach());
        let [pad, most] = [8.0, 48.0].map(|n| n * f64::from(f32::EPSILON) * reach);
        let moved = |by: f64| Aabb {
            min: boxes[i].min.map(|x| (f64::from(x) + by) as f32),
            max: boxes[i].max.map(|x| (f64::from(x) - by) as f32),
        };
        n_escaped += usize::from(image(map, &aabb).iter().any(|&point| !holds(&moved(pad), point)));
        assert!(
            (0..3).all(|k| image(map, &aabb).iter().any(|p| p[k] <= f64::from(boxes[i].min[k]) + most)),
            "instance {i}: {:?} is loose",
            boxes[i]
        );
    }
    assert!(n_compared > 2000 && n_escaped > 100, "{n_compared} compared, {n_escaped} need their pads");
}

fn faults_of_instances_are_reported_with_their_number() {
    let gpu = gpu();
    let good = DeviceInstance::new(0, &Affine::IDENTITY);
    let with = |change: fn(&mut DeviceInstance)| {
        let mut bad = good;
        change(&mut bad);
        let scene = scene_of(&gpu, &[good, good, bad, good]);
        // Whatever the contents, rays come to an end and meet the others.
        let ray = canted_trace::Ray::new([11.0, -1.0, 100.0], [0.0, 0.0, -1.0]);
        let hits = block_on(scene.traced().closest_hits(&gpu, &[ray])).unwrap();
        assert!(matches!(hits[..], [Outcome::Complete(Some(hit))] if hit.instance == 0), "{hits:?}");
        block_on(scene.check(&gpu)).map_err(|error| error.to_string())
    };
    assert_eq!(with(|_| {}), Ok(()));
    assert_eq!(with(|bad| bad.mesh = NOT_PLACED), Ok(()));
    // A mesh without triangles.
    assert_eq!(with(|bad| bad.mesh = 2), Ok(()));
    let of = |change| with(change).unwrap_err();
    assert!(of(|bad| bad.mesh = 3).contains("instance 2 refers to a mesh beyond the 3"));
    for change in [
        (|bad| bad.rows[1][1] = f32::NAN) as fn(&mut DeviceInstance),
        |bad| bad.rows[0][3] = f32::INFINITY,
        |bad| bad.rows[2][3] = -2e18,
        |bad| bad.rows = [[9e17, 0.0, 0.0, 0.0], [0.0, 9e17, 0.0, 0.0], [0.0, 0.0, 9e17, 0.0]],
    ] {
        let found = of(change);
        assert!(found.contains("instance 2 has a transform that is not finite or has coordinates"), "{found}");
    }
    for change in [
        (|bad| bad.rows[1] = [0.0; 4]) as fn(&mut DeviceInstance),
        |bad| bad.rows[1] = bad.rows[0],
        |bad| bad.rows[2][2] = 1e-4,
        |bad| bad.rows = bad.rows.map(|row| row.map(|x| x * 1e-36)),
        |bad| bad.rows[0][1] = 1e6,
    ] {
        let found = of(change);
        assert!(found.contains("instance 2 has a transform that is singular, has a condition"), "{found}");
    }
}
