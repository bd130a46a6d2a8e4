//! Invalid and empty input.

use canted_bih::{Bih, BihConfig, BoxBih, BoxBihError};
use canted_fixtures::Mesh;
use canted_lbvh::GeometryError;
use canted_obb::{Aabb, PrimId};
use canted_trace::{Intersect, Ray, Watertight};

use crate::common::{build, config};

#[test]
fn an_empty_bih_is_never_hit() {
    let bih = build::<Watertight>(&Mesh::default(), &BihConfig::default());
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    let mut hits = vec![];
    bih.all_hits(&ray, &mut hits);
    assert_eq!((bih.closest_hit(&ray), bih.occluded(&ray), hits.len(), bih.n_triangles()), (None, false, 0, 0));
    assert_eq!((bih.n_bytes(), bih.bounds().half_extents), (0, [0.0; 3]));
}

#[test]
fn invalid_rays_never_hit() {
    let bih = build::<Watertight>(&canted_fixtures::identical(9), &config(1, 1.3));
    let valid = Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]);
    assert!(bih.occluded(&valid));
    for ray in [
        Ray { direction: [0.0; 3], ..valid },
        Ray { direction: [0.0, f32::NAN, 1.0], ..valid },
        Ray { direction: [0.0, 0.0, f32::INFINITY], ..valid },
        Ray { origin: [f32::NAN, 0.25, -1.0], ..valid },
        Ray { origin: [0.25, 0.25, f32::NEG_INFINITY], ..valid },
        Ray { t_min: f32::NAN, ..valid },
        Ray { t_min: -1.0, ..valid },
        Ray { t_min: 2.0, t_max: 1.0, ..valid },
    ] {
        assert_eq!((bih.closest_hit(&ray), bih.occluded(&ray)), (None, false), "{ray:?}");
    }
}

#[test]
fn invalid_geometry_is_an_error_with_its_index() {
    let mut positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, f32::NAN, 0.0]];
    let error = |positions: &[[f32; 3]], triangles: &[[u32; 3]]| {
        Bih::build(positions, triangles, &BihConfig::default()).unwrap_err()
    };
    let bad = GeometryError::NotFinite { triangle: PrimId(1), vertex: 3, position: positions[3].into() };
    assert_eq!(error(&positions, &[[0, 1, 2], [0, 1, 3]]), bad);
    positions.pop();
    let missing = GeometryError::IndexOutOfRange { triangle: PrimId(0), index: 3, n_vertices: 3 };
    assert_eq!(error(&positions, &[[0, 1, 3]]), missing);
}

#[test]
fn invalid_boxes_are_an_error_with_their_index() {
    let valid = Aabb { min: [0.0; 3], max: [1.0; 3] };
    for invalid in [
        Aabb::EMPTY,
        Aabb { min: [0.0, 2.0, 0.0], ..valid },
        Aabb { max: [1.0, f32::INFINITY, 1.0], ..valid },
        Aabb { min: [0.0, 0.0, f32::NAN], ..valid },
    ] {
        let error = BoxBih::build(&[valid, valid, invalid], &BihConfig::default()).unwrap_err();
        assert_eq!(error, BoxBihError::Invalid { index: 2 }, "{invalid:?}");
        assert_eq!(error.to_string(), "box 2 is empty or not finite");
    }
    let error = BoxBihError::TooMany { n_boxes: 1 << 31 };
    assert_eq!(error.to_string(), "2147483648 boxes exceed the maximum of 1073741824");
}

/// Beyond 2^62 hits may be missed, but nothing panics, loops or overflows.
#[test]
fn coordinates_near_the_limit_of_f32_build_and_trace() {
    let mut rng = canted_fixtures::SplitMix64::new(1);
    let corners: Vec<f32> =
        vec![f32::MAX, f32::MIN, 3e38, -3e38, 1e38, 0.0, -0.0, 1e-45, -1e-45, f32::MIN_POSITIVE, 1.0];
    for _ in 0..50 {
        let mut mesh = Mesh::default();
        for i in 0..60 {
            mesh.positions
                .extend([(); 3].map(|()| std::array::from_fn::<f32, 3, _>(|_| corners[rng.below(corners.len())])));
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        for factor in [1.0, 1.3, f32::INFINITY] {
            let bih = build::<Watertight>(&mesh, &config(1, factor));
            for _ in 0..20 {
                let [origin, direction] = [(); 2].map(|()| std::array::from_fn(|_| corners[rng.below(corners.len())]));
                let ray = Ray::new(origin, direction);
                assert_eq!(bih.occluded(&ray), bih.closest_hit(&ray).is_some(), "{ray:?}");
            }
        }
    }
}
