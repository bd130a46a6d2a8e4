//! Only required resources: buffers and bytes of a bare scene compared with those of a full one.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_renderer::Levels;
use canted_scene::Scene;

use super::scenes::{bare, full};
use super::{gpu, small, with_picture};

pub(crate) fn tests() -> Vec<Test> {
    vec![needs_device(a_bare_scene_binds_few_buffers_and_few_bytes)]
}

fn a_bare_scene_binds_few_buffers_and_few_bytes() {
    let gpu = gpu();
    let needs = |scene: &Scene, levels| -> Vec<(String, u64)> {
        let buffers = with_picture(&gpu, scene, levels, &small(), |picture| {
            picture.buffers().iter().map(|(name, n_bytes)| ((*name).to_owned(), *n_bytes)).collect()
        });
        let mut buffers: Vec<(String, u64)> = buffers.unwrap();
        buffers.sort();
        buffers
    };
    let bytes_of = |all: &[(String, u64)], name: &str| all.iter().find(|(other, _)| other == name).map(|(_, n)| *n);
    let sum = |all: &[(String, u64)]| all.iter().map(|(_, n)| n).sum::<u64>();
    let bare = needs(&bare(), Levels::Auto);
    let full = needs(&full(), Levels::Two);
    let names = |all: &[(String, u64)]| all.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(
        names(&bare),
        ["bvhs", "lights", "materials", "nodes", "picture", "triangle_blocks", "triangles", "vertices"]
    );
    let only_full: Vec<String> = names(&full).into_iter().filter(|name| bytes_of(&bare, name).is_none()).collect();
    assert_eq!(only_full, ["images", "instance_order", "instances", "placements", "slots", "texels_0"]);
    assert!(names(&bare).iter().all(|name| bytes_of(&full, name) >= bytes_of(&bare, name)));
    // Four vertices of three words; the full scene adds eleven for normal, tangent and color, and two for the texture.
    assert_eq!((bytes_of(&bare, "vertices"), bytes_of(&full, "vertices")), (Some(4 * 12), Some(4 * (12 + 44 + 8))));
    assert_eq!((bytes_of(&bare, "triangles"), bytes_of(&bare, "lights")), (Some(2 * 32), Some(48)));
    assert!(2 * sum(&bare) < sum(&full), "{bare:?}, {full:?}");
}
