use super::*;

fn rotated(angle: f64, scale: [f64; 3], shift: [f32; 3]) -> Affine {
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
        let close = ((singular_at - 1.0) / singular_at) as f32;
        let close = Affine { columns: [[close, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] };
        let (time, norm) = Motion::new(&Affine::IDENTITY, &close).norm_of_inverse(LIMIT).unwrap_err();
        assert!((time - singular_at).abs() <= bound && norm > LIMIT, "{time} for {singular_at}: {norm}");
    }
}

fn shear(by: f32) -> Affine {
    Affine { columns: [[1.0, 0.0, 0.0], [by, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]] }
}

/// A shear of condition 2^19 took half a million intervals of the bound by `‖M⁻¹·change‖`; each takes about 0.2 µs.
#[test]
fn few_intervals_bound_any_motion() {
    let long = 724.0;
    let flat = rotated(0.0, [1.0, 1.0, 2e-6], [0.0; 3]);
    let thin = rotated(0.3, [1.0, 2e-6, 2e-6], [1e7, 0.0, 0.0]);
    let motions = [
        (shear(long), shear(-long)),
        (shear(long), shear(1.5)),
        (Affine::IDENTITY, flat),
        (flat, rotated(0.9, [1.0, 2e-6, 1.0], [0.0; 3])),
        (thin, rotated(0.5, [1.0, 2e-6, 2e-6], [0.0; 3])),
        (thin, rotated(3.0, [2e-6, 1.0, 2e-6], [0.0; 3])),
        (Affine::IDENTITY, rotated(std::f64::consts::PI - 4e-6, [1.0; 3], [0.0; 3])),
        (rotated(0.0, [1e-15, 1e-15, 2e-21], [0.0; 3]), rotated(0.4, [1e-15; 3], [0.0; 3])),
    ];
    for (open, close) in motions {
        let motion = Motion::new(&open, &close);
        let mut n_intervals = 0;
        let result = motion.norm_of_inverse_in(f64::MAX, &mut n_intervals);
        assert!(n_intervals <= 300, "{n_intervals} intervals: {open:?} {close:?}");
        if let Ok(bound) = result {
            let times = (0..=10_000).map(|i| f64::from(i) / 10_000.0);
            let greatest = times.map(|time| row_sum_norm(&motion.inverse(time))).fold(0.0, f64::max);
            assert!(greatest <= bound, "{greatest} {bound}: {open:?} {close:?}");
        }
    }
}

/// The residual of computed inverses is within the bound; where columns are almost parallel it is far above 2^-29.
#[test]
fn inverses_are_as_good_as_stated() {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(state >> 32).expect("32 bits")) / f64::from(u32::MAX) - 0.5
    };
    let mut greatest = 0.0_f64;
    for thin in [1e-1, 1e-3, 1e-5, 1e-5, 1e-5, 1e-5] {
        // Columns along one direction but for `thin`.
        let mut map = || {
            let direction = [(); 3].map(|()| next());
            let column =
                |length: f64, next: &mut dyn FnMut() -> f64| direction.map(|d| (length * d + thin * next()) as f32);
            Affine { columns: [column(1.0, &mut next), column(-0.7, &mut next), column(0.4, &mut next), [0.0; 3]] }
        };
        let motion = Motion::new(&map(), &map());
        for step in 0..=1000 {
            let time = f64::from(step) / 1000.0;
            let (columns, inverse) = (motion.at(time), motion.inverse(time));
            let by_rows = std::array::from_fn(|k| [columns[0][k], columns[1][k], columns[2][k], 0.0]);
            let condition = row_sum_norm(&by_rows) * row_sum_norm(&inverse);
            let residual: [[f64; 4]; 3] = std::array::from_fn(|k| {
                std::array::from_fn(|j| {
                    let product: f64 = (0..3).map(|l| columns[l][k] * inverse[l][j]).sum();
                    if j < 3 { product - f64::from(u8::from(j == k)) } else { 0.0 }
                })
            });
            let residual = row_sum_norm(&residual);
            // Computing the residual adds a few roundings relative to the condition.
            assert!(residual <= Motion::residual(condition) + 8.0 * U64 * condition, "{thin} {time}: {residual:e}");
            greatest = greatest.max(if condition <= 1_048_576.0 { residual } else { 0.0 });
        }
    }
    assert!(greatest > 2.0_f64.powi(-29), "{greatest:e}: worse inverses occur");
}
