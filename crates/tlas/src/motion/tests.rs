use super::*;

fn rotated(angle: f64, scale: [f64; 3], shift: [f32; 3]) -> Affine {
    #[expect(clippy::cast_possible_truncation, reason = "test data")]
    let column = |c: [f64; 3], s: f64| c.map(|x| (x * s) as f32);
    let (sine, cosine) = angle.sin_cos();
    let columns = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
    let [x, y, z] = std::array::from_fn(|i| column(columns[i], scale[i]));
    Affine { columns: [x, y, z, shift] }
}

/// The norm at a hundred thousand times never exceeds the bound, and reaches three quarters of it.
#[test]
fn inverses_are_bounded_at_all_times() {
    for angle in [0.0, 0.3, 1.0, 1.57, 2.5] {
        for scale in [[1.0; 3], [1.0, 2.0, 0.1], [-1.0, 1.0, 1e3], [1e-3, 1e-3, 1e-3], [1.0, 1.0, 1e-5]] {
            // Between a mirror image and a rotation the map is singular at some time, so both ends have the same determinant sign.
            let open = rotated(0.2, scale.map(f64::signum), [0.0; 3]);
            let motion = Motion::new(&open, &rotated(0.2 + angle, scale, [1e7; 3]));
            let bound = motion.norm_of_inverse(1e12).unwrap();
            let times = (0..=100_000).map(|i| f64::from(i) / 100_000.0);
            let greatest = times.map(|time| row_sum_norm(&motion.inverse(time))).fold(0.0, f64::max);
            assert!(greatest <= bound && bound <= 1.34 * greatest, "{angle} {scale:?}: {greatest} {bound}");
        }
    }
}

#[test]
fn times_outside_the_shutter_are_clamped() {
    let (open, close) = (rotated(0.2, [1.0; 3], [0.0; 3]), rotated(1.2, [3.0, 1.0, 0.5], [1e3; 3]));
    let motion = Motion::new(&open, &close);
    let columns = |map: &Affine| map.columns.map(|column| column.map(f64::from));
    for time in [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(motion.world_from_object(time), columns(&open), "{time}");
    }
    for time in [1.0, 2.0, f32::INFINITY] {
        let off = zip(motion.world_from_object(time), columns(&close), |a, b| (a - b).abs());
        assert!(off.as_flattened().iter().all(|&off| off <= 1e3 * f64::EPSILON), "{time}: {off:?}");
    }
    let [half, full] = [0.5, 1.0].map(|time| motion.world_from_object(time)[3][0]);
    assert_eq!(half, 0.5 * full);
    assert_eq!(motion.object_from_world(0.5), invert(&motion.world_from_object(0.5)));
}

#[test]
fn half_a_turn_is_singular_at_half_time() {
    let motion = Motion::new(&Affine::IDENTITY, &rotated(std::f64::consts::PI, [1.0; 3], [0.0; 3]));
    let (time, norm) = motion.norm_of_inverse(1e6).unwrap_err();
    assert!(time == 0.5 && norm > 1e6, "{time} {norm}");
}

/// Halving of intervals finds a singular map at any time, not only at simple fractions.
#[test]
fn a_singular_map_at_any_time_is_found() {
    // The norm is one over the scale, which falls at a rate of at least 1; the closing transform is rounded once.
    const LIMIT: f64 = 1e6;
    let bound = 1.0 / LIMIT + 0.5 * f64::from(f32::EPSILON);
    for singular_at in [0.1, 1.0 / 3.0, 0.77, 0.999] {
        #[expect(clippy::cast_possible_truncation, reason = "test data")]
        let close = ((singular_at - 1.0) / singular_at) as f32;
        let close = Affine { columns: [[close, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
        let (time, norm) = Motion::new(&Affine::IDENTITY, &close).norm_of_inverse(LIMIT).unwrap_err();
        assert!((time - singular_at).abs() <= bound && norm > LIMIT, "{time} for {singular_at}: {norm}");
    }
}
