//! Invalid instances are reported with their index.

use canted_bvh2::Bvh2;
use canted_fixtures::Rotation;
use canted_lbvh::Strategy;
use canted_obb::Affine;
use canted_tlas::{Instance, InstanceError, MAX_CONDITION, Tlas, TopConfig};
use canted_trace::Watertight;

use super::setup::{affine, build, meshes};

fn add(blas: u32, third: Affine) -> Result<(), InstanceError> {
    let [soup, torus] = meshes();
    let bottom: Vec<Bvh2<Watertight>> = vec![build(&soup, Strategy::Aabb), build(&torus, Strategy::Aabb)];
    let sound = Instance::new(0, Affine::IDENTITY);
    let instances = [sound, sound, Instance::new(blas, third)];
    Tlas::new(bottom, &instances, TopConfig::default()).map(|_| ())
}

#[test]
fn a_missing_blas_is_reported() {
    assert_eq!(add(2, Affine::IDENTITY), Err(InstanceError::NoSuchBlas { instance: 2, blas: 2 }));
    assert_eq!(add(1, Affine::IDENTITY), Ok(()));
}

#[test]
fn transforms_that_are_not_finite_are_rejected() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for place_of_bad in 0..12 {
            let mut affine = Affine::IDENTITY;
            affine.columns[place_of_bad / 3][place_of_bad % 3] = bad;
            assert_eq!(add(0, affine), Err(InstanceError::NotFinite { instance: 2 }));
        }
    }
}

#[test]
fn singular_transforms_are_rejected_at_any_scale() {
    let flat = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    for scale in [1e-30, 1e-6, 1.0, 1e6, 1e30] {
        let scaled = |columns: [[f32; 3]; 3]| {
            let [x, y, z] = columns.map(|column| column.map(|c| c * scale));
            Affine { columns: [x, y, z, [0.0; 3]] }
        };
        for columns in [[[0.0; 3]; 3], flat, [flat[0], flat[0], flat[1]], [flat[0], flat[1], [0.0; 3]]] {
            let error = add(0, scaled(columns)).unwrap_err();
            assert!(matches!(error, InstanceError::IllConditioned { instance: 2, .. }), "{scale:e}: {error}");
        }
    }
}

#[test]
fn the_condition_number_decides_not_the_determinant() {
    for scale in [1e-6f64, 1e-3, 1.0, 1e3, 1e6] {
        assert_eq!(add(0, affine(&Rotation::off_axis(), [scale, scale, -scale], [1e7, 0.0, 0.0])), Ok(()), "{scale:e}");
    }
    let stretched = |ratio: f64| add(1, affine(&Rotation::IDENTITY, [1.0, 1.0, ratio], [0.0; 3]));
    assert_eq!(stretched(MAX_CONDITION), Ok(()));
    assert_eq!(stretched(1.0 / MAX_CONDITION), Ok(()));
    let condition = 2.0 * MAX_CONDITION;
    for ratio in [condition, 1.0 / condition] {
        assert_eq!(stretched(ratio), Err(InstanceError::IllConditioned { instance: 2, condition }));
    }
}

#[test]
fn error_messages_name_instance_and_limit() {
    let sentence = |result: Result<(), InstanceError>| result.unwrap_err().to_string();
    assert_eq!(sentence(add(7, Affine::IDENTITY)), "instance 2 refers to bottom-level BVH 7, which does not exist");
    let mut affine = Affine::IDENTITY;
    affine.columns[3][1] = f32::NAN;
    assert_eq!(sentence(add(0, affine)), "the transform of instance 2 is not finite");
    affine.columns = [[0.0; 3]; 4];
    assert_eq!(
        sentence(add(0, affine)),
        "the transform of instance 2 is too close to singular: its condition number is inf, at most 1.048576e6 is supported"
    );
}

#[test]
fn bounds_out_of_range_are_rejected() {
    let mut affine = Affine::IDENTITY;
    affine.columns[0][0] = 1e38;
    affine.columns[1][1] = 1e38;
    affine.columns[2][2] = 1e38;
    affine.columns[3] = [3e38; 3];
    assert_eq!(add(0, affine), Err(InstanceError::OutOfRange { instance: 2 }));
}
