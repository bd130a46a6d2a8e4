//! BVHs that a device built, read back: the hits of the CPU's own BVH, bit for bit, and its topology; damaged ones are refused.

use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::{
    Mesh,
    device_tests::{Test, needs_device},
    grid, icosphere, scaffold_of, soup, thin_box,
};
use canted_gpu::{
    DeviceBvh, DownloadedBvh, Gpu, Options, Source, TracedScene, block_on,
    build::{BuildConfig, Topology, WideConfig},
    wgpu,
};
use canted_lbvh::{Bits, Corners, Strategy};
use canted_obb::{Affine, Obb};
use canted_tests::rays;
use canted_tlas::Instance;
use canted_trace::{Hit, Intersect, Ray};
use canted_wide::{Config, TriangleBvh};

use super::{gpu, setup::build};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(downloaded_bvhs_have_the_hits_of_the_cpu),
        needs_device(a_downloaded_radix_tree_is_that_of_the_cpu),
        needs_device(bvhs_of_the_cpu_and_meshes_of_two_levels_come_back),
        needs_device(damaged_bvhs_are_refused),
        needs_device(other_marks_of_leaves_are_refused),
    ]
}

fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.triangles.iter().map(|triangle| triangle.map(|i| mesh.positions[i as usize])).collect()
}

fn scene(gpu: &Gpu, mesh: &Mesh, bvh: DeviceBvh) -> TracedScene {
    block_on(TracedScene::new(gpu, Source::build([&corners(mesh)], bvh), Options::default())).unwrap()
}

fn binary(strategy: Strategy) -> DeviceBvh {
    BuildConfig { bits: Bits::B63, strategy }.into()
}

fn wide(strategy: Strategy, topology: Topology) -> DeviceBvh {
    WideConfig { bits: Bits::B63, topology, strategy }.into()
}

fn closest(bvh: &DownloadedBvh, ray: &Ray) -> Option<Hit> {
    match bvh {
        DownloadedBvh::Binary(bvh) => bvh.closest_hit(ray),
        DownloadedBvh::Wide(bvh) => bvh.closest_hit(ray),
    }
}

/// Every ray has the hit of `expected`, bit for bit; returns how many hit.
fn same_hits(bvh: &DownloadedBvh, mesh: &Mesh, expected: &dyn Intersect) -> usize {
    let rays = [rays::of_all_classes(mesh, 100, 20), rays::from_inside(mesh, 200, 30)].concat();
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(closest(bvh, ray), expected.closest_hit(ray), "ray {i}: {ray:?}");
    }
    rays.iter().filter(|ray| closest(bvh, ray).is_some()).count()
}

/// Binary and wide ones, aligned and oriented, of some thousand triangles and of few.
fn downloaded_bvhs_have_the_hits_of_the_cpu() {
    let gpu = gpu();
    // Far from the origin, boxes of the CPU are relative to another point.
    let far = icosphere(3).placed(|p| p.map(|x| 50.0 * x + 1e5));
    let meshes = [soup(1, 3000), scaffold_of(1, true, 4), far, thin_box(0.0), soup(2, 5), soup(3, 2), soup(4, 1)];
    for (number, mesh) in meshes.iter().enumerate() {
        let expected = build(mesh, &Config::default());
        for bvh in [
            binary(Strategy::Aabb),
            binary(Strategy::Combined),
            binary(Strategy::Dop),
            wide(Strategy::Aabb, Topology::Radix),
            wide(Strategy::Combined, Topology::Radix),
            wide(Strategy::Combined, Topology::Ploc),
        ] {
            let downloaded = block_on(scene(&gpu, mesh, bvh).download(&gpu)).unwrap();
            let is_wide = matches!(downloaded, DownloadedBvh::Wide(_));
            assert_eq!(is_wide, matches!(bvh, DeviceBvh::Wide(_)), "{bvh:?}");
            let n_hits = same_hits(&downloaded, mesh, &expected);
            assert!(n_hits > 50, "mesh {number}, {bvh:?}: {n_hits} hits");
            let n_oriented = match &downloaded {
                DownloadedBvh::Binary(bvh) => bvh.pairs().n_pairs().1,
                DownloadedBvh::Wide(bvh) => bvh.sizes().nodes[1],
            };
            let wants_oriented = !matches!(
                bvh,
                DeviceBvh::Binary(BuildConfig { strategy: Strategy::Aabb, .. })
                    | DeviceBvh::Wide(WideConfig { strategy: Strategy::Aabb, .. })
            );
            if number == 1 {
                assert_eq!(n_oriented > 50, wants_oriented, "{bvh:?}: {n_oriented} oriented nodes");
            }
        }
    }
    let none = block_on(scene(&gpu, &soup(5, 0), binary(Strategy::Aabb)).download(&gpu)).unwrap();
    assert!(closest(&none, &Ray::new([0.0; 3], [1.0, 0.0, 0.0])).is_none());
}

/// The same boxes on the same levels, in the same order.
fn a_downloaded_radix_tree_is_that_of_the_cpu() {
    let gpu = gpu();
    let boxes = |bvh: &Bvh2| {
        let mut all: Vec<(Obb, u32, bool)> = vec![];
        bvh.pairs().each_box(|obb, level, is_leaf| all.push((obb, level, is_leaf)));
        all
    };
    for mesh in [soup(6, 2000), grid(7, [30, 40])] {
        let config = Bvh2Config { bits: Bits::B63, ..Bvh2Config::default() };
        let expected = Bvh2::build(&mesh.positions, &mesh.triangles, &config).unwrap();
        let DownloadedBvh::Binary(found) = block_on(scene(&gpu, &mesh, binary(Strategy::Aabb)).download(&gpu)).unwrap()
        else {
            panic!("a binary BVH was built");
        };
        assert!(boxes(&found) == boxes(&expected) && boxes(&found).len() > 1000);
    }
}

fn bvhs_of_the_cpu_and_meshes_of_two_levels_come_back() {
    let gpu = gpu();
    let meshes = [scaffold_of(1, true, 3), soup(8, 700)];
    let of_cpu = meshes.each_ref().map(|mesh| build(mesh, &Config::default()));
    let of_mesh: Vec<Vec<Corners>> = meshes.iter().map(corners).collect();
    let instances = [0, 1, 1].map(|mesh| Instance::new(mesh, Affine::IDENTITY));
    for input in [
        Source::tlas(&of_cpu, &instances),
        Source::build(&of_mesh, binary(Strategy::Combined)).with_instances(&instances),
        Source::build(&of_mesh, wide(Strategy::Combined, Topology::Radix)).with_instances(&instances),
    ] {
        let scene = block_on(TracedScene::new(&gpu, input, Options::default())).unwrap();
        for (number, mesh) in meshes.iter().enumerate() {
            let n_hits = same_hits(&block_on(scene.download_mesh(&gpu, number)).unwrap(), mesh, &of_cpu[number]);
            assert!(n_hits > 50, "{n_hits}");
        }
        assert!(block_on(scene.download(&gpu)).unwrap_err().to_string().contains("two levels"));
        assert_eq!(
            block_on(scene.download_mesh(&gpu, 2)).unwrap_err().to_string(),
            "there is no mesh 2 in a scene of 2 meshes"
        );
    }
    let uploaded = block_on(TracedScene::new(&gpu, Source::wide(&of_cpu[0]), Options::default())).unwrap();
    let DownloadedBvh::Wide(found) = block_on(uploaded.download(&gpu)).unwrap() else {
        panic!("a wide BVH was uploaded")
    };
    let kinds = |bvh: &TriangleBvh| bvh.sizes().nodes;
    assert_eq!(kinds(&found), kinds(&of_cpu[0]));
}

fn damaged_bvhs_are_refused() {
    let gpu = gpu();
    let mesh = soup(9, 300);
    // The word of the first child of the root, and a coordinate of its box; which is a corner of a triangle, a plane, or where all boxes start.
    for (bvh, word, plane) in [
        (binary(Strategy::Aabb), 3, 0),
        (binary(Strategy::PcaBounded), 15, 3),
        (wide(Strategy::Aabb, Topology::Radix), 0, 8),
    ] {
        for (at, value, expected) in [
            (plane, f32::NAN.to_bits(), "outside of a box|box 0 of the node"),
            (plane, 1e6_f32.to_bits(), "outside of a box|box 0 of the node"),
            (word, 0, "two parents|two records"),
            (word, 0x0fff_fff0, "names nothing|names no node|a record takes line"),
            (
                word,
                0x8000_0001,
                "is in two leaves|belongs to two records|does not exist|out of range|not below the root|is in no leaf|marks other",
            ),
        ] {
            let scene = scene(&gpu, &mesh, bvh);
            block_on(scene.download(&gpu)).unwrap();
            overwrite(&gpu, &scene, at, value);
            // A half-extent that is too great holds all; the axis-aligned ones are planes.
            if let Ok(downloaded) = block_on(scene.download(&gpu)) {
                assert!(
                    matches!(bvh, DeviceBvh::Binary(BuildConfig { strategy: Strategy::PcaBounded, .. }))
                        && value == 1e6_f32.to_bits()
                );
                same_hits(&downloaded, &mesh, &build(&mesh, &Config::default()));
                continue;
            }
            let message = block_on(scene.download(&gpu)).unwrap_err().to_string();
            assert!(message.starts_with("the BVH on the device is damaged: "), "{message}");
            assert!(expected.split('|').any(|part| message.contains(part)), "{bvh:?}, {at}, {value:x}: {message}");
        }
    }
}

/// An aligned node says again which of its children are leaves; so does what is read back.
fn other_marks_of_leaves_are_refused() {
    let gpu = gpu();
    let scene = scene(&gpu, &soup(9, 300), wide(Strategy::Aabb, Topology::Radix));
    let is_refused = |marks: &u32| {
        // With steps of 1.
        overwrite(&gpu, &scene, 11, 0x7f_7f7f | marks << 24);
        let found = block_on(scene.download(&gpu));
        found.is_err_and(|error| error.to_string().contains("marks other children as leaves"))
    };
    // All but those of the root.
    assert_eq!((0..256).filter(is_refused).count(), 255);
}

/// Replaces a word of the nodes.
fn overwrite(gpu: &Gpu, scene: &TracedScene, word: u64, value: u32) {
    let nodes: &wgpu::Buffer = scene.buffer("nodes").unwrap().buffer;
    gpu.queue().write_buffer(nodes, 4 * word, &value.to_le_bytes());
}
