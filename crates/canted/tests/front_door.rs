//! What a user of `canted` alone relies on: names, vectors of other libraries, threads, examples.

use canted::{Intersect, Ray, TriangleBvh, WideBvh};

#[test]
fn vectors_of_glam_pass_as_points_and_directions() {
    let positions = [glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y];
    let bvh = TriangleBvh::build(&positions, &[[0_u16, 1, 2]]).unwrap();
    let ray = Ray::new(glam::Vec3::new(0.25, 0.5, 1.0), -glam::Vec3::Z);
    let hit = bvh.closest_hit(&ray).unwrap();
    assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.25, 0.5));
    assert_eq!(bvh.nearest_point(glam::Vec3A::new(0.0, 0.0, 2.0), f32::INFINITY).unwrap().distance, 2.0);
}

/// BVHs are sent to and shared by threads.
#[test]
fn structures_are_send_and_sync() {
    fn check<T: Send + Sync + Clone + std::fmt::Debug>() {}
    check::<TriangleBvh>();
    check::<WideBvh<canted::kernel::Sphere>>();
    check::<canted::Tlas<TriangleBvh>>();
    #[cfg(feature = "bvh2")]
    check::<canted::structure::Bvh2>();
}

/// Modules included; a name that few programs need belongs into a module.
#[test]
fn the_root_has_at_most_thirty_names() {
    // Lines of the root have no indentation, but for the lists of names.
    let source = include_str!("../src/lib.rs");
    let (mut n_names, mut in_module, mut in_list) = (0, false, false);
    for line in source.lines().map(|line| line.split("//").next().unwrap_or_default()) {
        in_module |= line.starts_with("pub mod ");
        n_names += usize::from(line.starts_with("pub mod "));
        in_list |= line.starts_with("pub use ") && !in_module;
        if in_list {
            let names = line.rsplit_once('{').map_or(line, |(_, names)| names);
            n_names += names.split([',', '}', ';']).filter(|name| !name.trim().is_empty()).count();
        }
        in_list &= !line.ends_with(';');
        in_module &= line != "}";
    }
    assert!((20..=30).contains(&n_names), "{n_names} names");
}

/// Cargo builds the examples beside the tests, except where it is asked for one test alone.
#[test]
fn every_example_runs() {
    let built = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().join("examples");
    let mut n_run = 0;
    for source in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/examples")).unwrap() {
        let program =
            built.join(source.unwrap().path().file_stem().unwrap()).with_extension(std::env::consts::EXE_EXTENSION);
        if program.is_file() {
            let output = std::process::Command::new(&program).output().unwrap();
            assert!(output.status.success() && !output.stdout.is_empty(), "{}: {output:?}", program.display());
            n_run += 1;
        }
    }
    assert!(n_run == 0 || n_run >= 9, "{n_run} examples");
}
