//! The elastic body: its forces, its motion, its neighbors, and rays at what carries it.

use std::time::Duration;

use canted_obb::PrimId;
use canted_renderer::{UpdateOptions, UpdatePolicy};
use canted_scene::Scene;
use canted_trace::{Hit, InstanceId, Intersect, Kernel, Ray, ScaledRay, Watertight};
use elastic::{
    Body, BodyError, Floor, Grid, Material, Simulation, Surface, TriangleMesh, lattice_inside, normals, torus,
};

/// Without losses.
const ELASTIC: Material = Material { viscosity_s: 0.0, ..Material::RUBBER };

/// Spacing of the phyxels, m.
const SPACING: f32 = 0.1;

/// Points of a cubic lattice with a notch, so that the body has no symmetry.
fn lattice(n: u8, offset: [f32; 3]) -> Vec<[f32; 3]> {
    let cells = (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| [x, y, z])));
    let is_in_notch = |[x, y, z]: [u8; 3]| x + 1 >= n && y + 2 >= n && z <= n / 2;
    cells
        .filter(|&cell| !is_in_notch(cell))
        .map(|cell| std::array::from_fn(|k| offset[k] + SPACING * f32::from(cell[k])))
        .collect()
}

/// A body of `n³` phyxels, less a notch.
fn body(n: u8, material: &Material) -> Body {
    Body::new(&lattice(n, [0.3, -0.2, 0.1]), f64::from(SPACING).powi(3), material).unwrap()
}

/// Pseudo-random numbers in `[-1, 1)`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let upper = (self.0 >> 32) as u32;
        f64::from(upper) / f64::from(1_u32 << 31) - 1.0
    }

    fn vector(&mut self, scale: f64) -> [f64; 3] {
        std::array::from_fn(|_| scale * self.next())
    }
}

/// Independent random displacements and velocities of the phyxels.
fn shake(body: &mut Body, seed: u64, displacement: f64, velocity: f64) {
    let random = std::cell::RefCell::new(Random(seed));
    body.set_state(|_| {
        let mut random = random.borrow_mut();
        [random.vector(displacement), random.vector(velocity)]
    });
}

/// The image of a point under a rotation about the z axis, then about the x axis.
fn rotated([x, y, z]: [f64; 3], about_z_rad: f64, about_x_rad: f64) -> [f64; 3] {
    let ((s, c), (t, d)) = (about_z_rad.sin_cos(), about_x_rad.sin_cos());
    let [x, y] = [c * x - s * y, s * x + c * y];
    [x, d * y - t * z, t * y + d * z]
}

/// Length of a vector.
fn length(v: [f64; 3]) -> f64 {
    v.map(|x| x * x).iter().sum::<f64>().sqrt()
}

/// The difference of two vectors.
fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Roundings of a force, relative to its stiffness and the displacements: a gradient sums at most 64 links of relative condition
/// at most 8, of which the strain takes products twice.
const ROUNDINGS: f64 = 2.0 * 8.0 * 64.0;

/// Greatest force that rounding leaves on a phyxel: the bound of the squared frequency times the mass is the greatest
/// sum of stiffness over the phyxels that act on one, and each displacement is rounded, as the difference of positions below 1 m.
fn rounding_force(body: &Body) -> f64 {
    let stiffness = body.frequency_bound_squared() * body.mass() / f64::from(u32::try_from(body.n_phyxels()).unwrap());
    let displacement = body.displacements().map(length).fold(1.0, f64::max);
    ROUNDINGS * 0.5 * f64::EPSILON * stiffness * displacement
}

fn greatest_force(body: &Body) -> f64 {
    body.forces().into_iter().map(length).fold(0.0, f64::max)
}

#[test]
fn at_rest_and_after_a_translation_no_force_is_left() {
    for offset in [[0.0; 3], [1e7, -1e7, 1e7].map(|x: f32| x)] {
        let spread: Vec<[f32; 3]> = lattice(5, [0.0; 3])
            .into_iter()
            .map(|point| std::array::from_fn(|k| offset[k] + 100.0 * point[k]))
            .collect();
        let mut body = Body::new(&spread, 1000.0, &Material::RUBBER).unwrap();
        for shift in [[0.0; 3], [1e-9, 3.0, -7e5], [0.1, -0.0, 1e7]] {
            body.set_state(|_| [shift, [2.0, 0.3, -1.0]]);
            assert_eq!(body.elastic_energy(), 0.0);
            assert_eq!(greatest_force(&body), 0.0, "translated by {shift:?}");
        }
    }
}

#[test]
fn after_a_rotation_only_rounding_is_left() {
    for (about_z, about_x) in [(1e-6, 0.0), (0.3, 0.1), (1.25, -2.0), (3.0, 0.7)] {
        let place = |stretch: f64| {
            move |rest: [f64; 3]| {
                let image = rotated(rest, about_z, about_x).map(|x| stretch * x);
                [sub(image, rest), [0.0; 3]]
            }
        };
        let mut body = body(6, &ELASTIC);
        body.set_state(place(1.0));
        let (force, bound) = (greatest_force(&body), rounding_force(&body));
        assert!(force <= bound, "rotated by {about_z}, {about_x}: {force} N, bound {bound} N");
        // The same check must reject a small stretch.
        body.set_state(place(1.0 + 1e-9));
        assert!(greatest_force(&body) > 2.0 * rounding_force(&body), "a stretch of 1e-9 passes");
    }
}

/// For an affine displacement, the energy is the volume times that of the exact gradient.
#[test]
fn the_energy_of_an_affine_displacement_is_that_of_its_gradient() {
    let mut random = Random(5);
    let mut body = body(5, &ELASTIC);
    let volume = body.mass() / ELASTIC.density;
    for _ in 0..20 {
        let h: [[f64; 3]; 3] = std::array::from_fn(|_| random.vector(0.3));
        body.set_state(|rest| [std::array::from_fn(|k| (0..3).map(|l| h[k][l] * rest[l]).sum()), [0.0; 3]]);
        let f = |k: usize, l: usize| h[k][l] + if k == l { 1.0 } else { 0.0 };
        let green = |k: usize, l: usize| {
            0.5 * ((0..3).map(|m| f(m, k) * f(m, l)).sum::<f64>() - if k == l { 1.0 } else { 0.0 })
        };
        let trace: f64 = (0..3).map(|k| green(k, k)).sum();
        let square: f64 = (0..9).map(|i| green(i / 3, i % 3) * green(i / 3, i % 3)).sum();
        // In terms of Young's modulus and Poisson's ratio.
        let (young, poisson) = (ELASTIC.young, ELASTIC.poisson);
        let density = 0.5 * young / (1.0 + poisson) * (square + poisson / (1.0 - 2.0 * poisson) * trace * trace);
        let (energy, want) = (body.elastic_energy(), volume * density);
        assert!((energy - want).abs() <= ROUNDINGS * f64::EPSILON * want, "{energy} J, by the gradient {want} J");
    }
}

/// The slope of the energy along the displacement of one coordinate of one phyxel.
///
/// The energy is a polynomial of degree 4 in a displacement, for which this difference quotient is exact up to rounding.
fn slope(body: &Body, state: &[[f64; 3]], phyxel: usize, axis: usize, h: f64) -> f64 {
    let energy = |steps: f64| {
        let mut body = body.clone();
        let at = std::cell::Cell::new(0);
        body.set_state(|_| {
            let i = at.replace(at.get() + 1);
            let mut u = state[i];
            u[axis] += if i == phyxel { steps * h } else { 0.0 };
            [u, [0.0; 3]]
        });
        body.elastic_energy()
    };
    (energy(-2.0) - 8.0 * energy(-1.0) + 8.0 * energy(1.0) - energy(2.0)) / (12.0 * h)
}

#[test]
fn forces_are_the_negative_gradient_of_the_energy() {
    let mut body = body(4, &ELASTIC);
    let viscous = self::body(4, &Material { viscosity_s: 0.01, ..ELASTIC });
    for (seed, size) in [(1, 0.001), (2, 0.02), (3, 0.06)] {
        shake(&mut body, seed, size, 1.0);
        let state: Vec<[f64; 3]> = body.displacements().collect();
        let forces = body.forces();
        let mut viscous = viscous.clone();
        shake(&mut viscous, seed, size, 1.0);
        let viscous_forces = viscous.forces();
        let h = 0.5 * size;
        // Energies add a few thousand terms, are rounded once more in each operation, and are divided by h.
        let bound = 1e4 * f64::EPSILON * (body.elastic_energy() + 1e-3) / h;
        let mut n_wrong = 0;
        for phyxel in [0, 7, 21, body.n_phyxels() - 1] {
            for axis in 0..3 {
                let want = -slope(&body, &state, phyxel, axis, h);
                let error = (forces[phyxel][axis] - want).abs();
                assert!(error <= bound, "phyxel {phyxel}: {} N, slope {want} N, bound {bound}", forces[phyxel][axis]);
                // Friction is no gradient: the same check must reject it.
                n_wrong += usize::from((viscous_forces[phyxel][axis] - want).abs() > bound);
            }
        }
        assert_eq!(n_wrong, 12, "viscous forces pass as a gradient");
    }
}

#[test]
fn forces_neither_push_nor_rotate_the_body() {
    let mut body = body(5, &Material { viscosity_s: 0.003, ..Material::RUBBER });
    let rest: Vec<[f64; 3]> = lattice(5, [0.3, -0.2, 0.1]).iter().map(|point| point.map(f64::from)).collect();
    for seed in 0..10 {
        shake(&mut body, seed, 0.05, 3.0);
        let (mut push, mut torque, mut all) = ([0.0; 3], [0.0; 3], 0.0);
        for ((rest, u), f) in rest.iter().zip(body.displacements()).zip(body.forces()) {
            let x: [f64; 3] = std::array::from_fn(|k| rest[k] + u[k]);
            for k in 0..3 {
                let (a, b) = ((k + 1) % 3, (k + 2) % 3);
                push[k] += f[k];
                torque[k] += x[a] * f[b] - x[b] * f[a];
            }
            all += length(f);
        }
        // Each of some 60 shares of a force is rounded; arms are shorter than 1 m.
        let bound = ROUNDINGS * f64::EPSILON * all;
        assert!(length(push) <= bound && length(torque) <= bound, "{push:?} N, {torque:?} N m of {all} N");
        assert!(bound < 1e-9 * all);
    }
}

#[test]
fn surfels_follow_affine_motion_exactly() {
    let mut body = body(5, &ELASTIC);
    let surfels = [[0.3, -0.2, 0.1], [0.26, -0.24, 0.05], [0.55, 0.01, 0.33], [0.75, 0.24, 0.54]];
    let surface = Surface::new(&body, &surfels).unwrap();
    assert_eq!(surface.positions(&body), surfels, "at rest");
    let image = |point: [f64; 3]| rotated(point, 0.4, -1.0).map(|x| 1.25 * x + 0.5);
    body.set_state(|rest| [sub(image(rest), rest), [0.0; 3]]);
    for (surfel, moved) in surfels.into_iter().zip(surface.positions(&body)) {
        let want = image(surfel.map(f64::from));
        // One rounding to f32 of coordinates below 2.
        let error = length(sub(moved.map(f64::from), want));
        assert!(error <= 2.0 * f64::from(f32::EPSILON), "{moved:?} instead of {want:?}");
    }
}

#[test]
fn unusable_bodies_are_errors() {
    let cube = lattice(3, [0.0; 3]);
    let error = |points: &[[f32; 3]], volume, material: &Material| {
        Body::new(points, volume, material).map(|body| body.n_phyxels()).unwrap_err()
    };
    let mut lost = cube.clone();
    lost[4][1] = f32::NAN;
    assert!(error(&lost, 1e-3, &ELASTIC).to_string().starts_with("phyxel 4 is not finite: [0.0, NaN, 0.1]"));
    let plane: Vec<[f32; 3]> = cube.iter().map(|&[x, y, _]| [x, y, 5.0]).collect();
    let needle: Vec<[f32; 3]> = cube.iter().map(|&[x, y, z]| [x, y, 1e-4 * z]).collect();
    let same = vec![[1.0, 2.0, 3.0]; 40];
    for points in [plane, needle, same, vec![[0.0; 3]], vec![[0.0; 3], [f32::MAX, 0.0, 0.0]]] {
        assert!(matches!(error(&points, 1e-3, &ELASTIC), BodyError::Flat { phyxel: 0, .. }), "{points:?}");
    }
    for volume in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(error(&cube, volume, &ELASTIC).to_string().starts_with("volume of a phyxel is out of range: "));
    }
    for (material, message) in [
        (Material { density: 0.0, ..ELASTIC }, "density is out of range: 0"),
        (Material { young: f64::NAN, ..ELASTIC }, "Young's modulus is out of range: NaN"),
        (Material { poisson: 0.5, ..ELASTIC }, "Poisson's ratio is out of range: 0.5"),
        (Material { viscosity_s: f64::INFINITY, ..ELASTIC }, "viscosity is out of range: inf"),
    ] {
        assert_eq!(error(&cube, 1e-3, &material).to_string(), message);
    }
    let body = Body::new(&cube, 1e-3, &ELASTIC).unwrap();
    for far in [[9.0, 0.0, 0.0], [f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0]] {
        let detached = Surface::new(&body, &[[0.0; 3], far]).map(|_| ()).unwrap_err();
        assert!(matches!(detached, BodyError::Detached { surfel: 1, .. }), "{detached}");
    }
    let nothing = Body::new(&[], 1.0, &ELASTIC).unwrap();
    assert_eq!((nothing.n_phyxels(), nothing.elastic_energy()), (0, 0.0));
}

/// Phyxels at one place are legal where others are around: they are pulled apart no more than together.
#[test]
fn duplicate_phyxels_stay_together() {
    let mut points = lattice(4, [0.0; 3]);
    points.push(points[21]);
    let mut body = Body::new(&points, f64::from(SPACING).powi(3), &ELASTIC).unwrap();
    body.set_state(|[x, y, z]| [[0.1 * x, 0.2 * y * y, -0.1 * x * z], [0.0; 3]]);
    let forces = body.forces();
    assert!(forces.iter().all(|f| length(*f).is_finite()));
    assert!(length(forces[21]) > 0.0);
}

const NO_GRAVITY: [f64; 3] = [0.0; 3];

/// A stretch and a spin, without noise: what a body does in a picture.
fn spin_and_stretch(body: &mut Body) {
    body.set_state(|[x, y, z]| [[0.12 * x, -0.05 * y, 0.03 * x], [-2.0 * y, 2.0 * x + 0.5 * z, 1.0]]);
}

fn energy(body: &Body) -> f64 {
    body.elastic_energy() + body.kinetic_energy()
}

#[test]
fn rest_stays_at_rest() {
    let mut body = body(5, &Material::RUBBER);
    let step = body.stable_step();
    for _ in 0..1000 {
        body.step(step, NO_GRAVITY, None).unwrap();
    }
    assert!(body.displacements().all(|u| u == [0.0; 3]));
    assert_eq!((body.kinetic_energy(), body.elastic_energy()), (0.0, 0.0));
}

/// Leapfrog conserves `½v² + ½ω²x² (1 - (ω dt)²/4)` of a vibration, so its energy varies by at most a fraction `(ω dt)²/4`,
/// which at a tenth of the stable step, `2/ω`, is 1 %.
const ENERGY_BOUND: f64 = 0.01;

/// Greatest relative change of the energy in 1,000 steps.
fn energy_drift(body: &mut Body, step: f64) -> f64 {
    let start = energy(body);
    let drift = (0..1000)
        .map(|_| body.step(step, NO_GRAVITY, None).map_or(f64::INFINITY, |()| (energy(body) / start - 1.0).abs()));
    drift.fold(0.0, f64::max)
}

#[test]
fn energy_drifts_less_than_one_percent_in_1000_steps() {
    for noise in [0.0, 0.005] {
        let mut body = body(5, &ELASTIC);
        if noise > 0.0 {
            shake(&mut body, 4, noise, 0.5)
        } else {
            spin_and_stretch(&mut body)
        }
        let step = 0.1 * body.stable_step();
        let mut coarse = body.clone();
        let drift = energy_drift(&mut body, step);
        assert!(drift < ENERGY_BOUND, "energy drifts by {drift}");
        assert!(drift > 0.0);
        // The same check must reject steps that are too long.
        assert!(energy_drift(&mut coarse, 100.0 * step) > ENERGY_BOUND, "long steps pass");
    }
}

#[test]
fn momentum_is_conserved_to_rounding() {
    for material in [ELASTIC, Material::RUBBER] {
        let mut body = body(5, &material);
        spin_and_stretch(&mut body);
        let [linear, angular] = [body.momentum(), body.angular_momentum()];
        let step = 0.5 * body.stable_step();
        for _ in 0..1000 {
            body.step(step, NO_GRAVITY, None).unwrap();
        }
        // Each step rounds each velocity and position a few times; forces add up to zero within 64 roundings of their size, and change
        // a velocity by less than the greatest one. The errors add up at worst.
        let bound = 1000.0 * 128.0 * f64::EPSILON * length(angular).max(length(linear));
        let drift = [sub(body.momentum(), linear), sub(body.angular_momentum(), angular)].map(length);
        assert!(drift[0] <= bound && drift[1] <= bound, "momentum drifts by {drift:?}, bound {bound}");
        // The same check must reject an outer force of a millionth of the weight.
        body.step(step, [9.81e-6, 0.0, 0.0], None).unwrap();
        assert!(length(sub(body.momentum(), linear)) > bound, "a push passes");
    }
}

#[test]
fn viscosity_takes_energy_but_not_from_rotation() {
    let mut body = body(5, &Material { viscosity_s: 5e-3, ..ELASTIC });
    spin_and_stretch(&mut body);
    let (start, angular) = (energy(&body), body.angular_momentum());
    let step = 0.5 * body.stable_step();
    let mut last = start;
    for _ in 0..10 {
        for _ in 0..200 {
            body.step(step, NO_GRAVITY, None).unwrap();
        }
        assert!(energy(&body) <= last * (1.0 + 1e-3), "energy rises from {last} to {}", energy(&body));
        last = energy(&body);
    }
    assert!(last < 0.9 * start && last > 0.0, "{last} of {start}");
    assert!(length(sub(body.angular_momentum(), angular)) < 1e-9 * length(angular));
}

/// The greatest frequency of small vibrations about rest, squared, by power iteration with the forces themselves.
fn measured_frequency_squared(body: &Body) -> f64 {
    const SMALL: f64 = 1e-7;
    let mut body = body.clone();
    shake(&mut body, 9, SMALL, 0.0);
    let phyxel_mass = body.mass() / f64::from(u32::try_from(body.n_phyxels()).unwrap());
    let mut rate = 0.0;
    for _ in 0..300 {
        let forces = body.forces();
        let size = |vectors: &mut dyn Iterator<Item = [f64; 3]>| vectors.map(|v| length(v).powi(2)).sum::<f64>().sqrt();
        let greatest = forces.iter().map(|&f| length(f)).fold(0.0, f64::max);
        rate = size(&mut forces.iter().copied()) / size(&mut body.displacements()) / phyxel_mass;
        let at = std::cell::Cell::new(0);
        body.set_state(|_| [forces[at.replace(at.get() + 1)].map(|x| SMALL * x / greatest), [0.0; 3]]);
    }
    rate
}

#[test]
fn the_stable_step_is_short_enough_and_not_too_short() {
    let body = body(5, &ELASTIC);
    let (bound, measured) = (body.frequency_bound_squared(), measured_frequency_squared(&body));
    assert!(measured <= bound, "frequency² {measured}, bound {bound}");
    assert!(measured >= bound / 16.0, "the step is more than 4 times too short: {measured}, bound {bound}");

    // Small noise stays small at the stable step, and grows without limit beyond the measured limit.
    let limit = 2.0 / measured.sqrt();
    let mut random = Random(3);
    for (step, grows) in [(body.stable_step(), false), (0.98 * limit, false), (1.02 * limit, true)] {
        let mut body = body.clone();
        let seed = random.0;
        random.next();
        shake(&mut body, seed, 1e-9, 0.0);
        let start = energy(&body);
        let greatest = (0..400)
            .map(|_| body.step(step, NO_GRAVITY, None).map_or(f64::INFINITY, |()| energy(&body) / start))
            .fold(0.0, f64::max);
        assert_eq!(greatest > 1e4, grows, "step {step} of {limit}: energy grows {greatest} times");
    }
}

#[test]
fn viscous_bodies_are_stable_at_their_step() {
    for viscosity_s in [1e-4, 1e-2, 1.0] {
        let mut body = body(4, &Material { viscosity_s, ..ELASTIC });
        assert!(body.stable_step() < self::body(4, &ELASTIC).stable_step());
        shake(&mut body, 6, 1e-6, 1e-3);
        let start = energy(&body);
        for _ in 0..300 {
            body.step(body.stable_step(), NO_GRAVITY, None).unwrap();
        }
        assert!(energy(&body) <= start, "viscosity {viscosity_s} s: {} of {start}", energy(&body));
    }
}

#[test]
fn steps_that_are_too_long_are_an_error() {
    let mut body = body(4, &ELASTIC);
    spin_and_stretch(&mut body);
    let step = 100.0 * body.stable_step();
    let error = (0..1000).find_map(|_| body.step(step, NO_GRAVITY, None).err()).expect("it diverges");
    assert!(matches!(error, BodyError::Diverged { .. }), "{error}");
    assert!(error.to_string().ends_with("use a shorter time step"));
}

#[test]
fn a_body_falls_onto_the_floor_and_loses_energy_there() {
    let mut body = body(5, &Material::RUBBER);
    // Off a corner, so that it tumbles.
    body.set_state(|rest| [sub(rotated(rest, 0.6, 0.5), [rest[0], rest[1] - 0.6, rest[2]]), [0.5, 0.0, 0.0]]);
    let floor = Floor { height: 0.0, friction: 0.4 };
    let rest: Vec<[f64; 3]> = lattice(5, [0.3, -0.2, 0.1]).iter().map(|point| point.map(f64::from)).collect();
    let heights = |body: &Body| body.displacements().zip(&rest).map(|(u, rest)| rest[1] + u[1]).collect::<Vec<_>>();
    let phyxel_mass = body.mass() / f64::from(u32::try_from(rest.len()).unwrap());
    let total = |body: &Body| energy(body) + 9.81 * phyxel_mass * heights(body).iter().sum::<f64>();
    let start = total(&body);
    let mut was_deformed = false;
    for frame in 0..72 {
        let n_steps = body.advance(1.0 / 24.0, [0.0, -9.81, 0.0], Some(floor)).unwrap();
        assert!((1..500).contains(&n_steps));
        assert!(heights(&body).iter().all(|&height| height >= floor.height), "frame {frame}: below the floor");
        // Falling, leapfrog is exact; on the floor, each contact loses energy or lifts a phyxel by less than a step's fall.
        assert!(total(&body) <= start * (1.0 + ENERGY_BOUND), "frame {frame}: {} of {start}", total(&body));
        was_deformed |= body.elastic_energy() > 0.01 * start;
    }
    assert!(was_deformed, "it never hit the floor");
    assert!(body.kinetic_energy() < 0.1 * start, "it still moves: {} J of {start}", body.kinetic_energy());
    let lowest = heights(&body).into_iter().fold(f64::INFINITY, f64::min);
    assert!(lowest < 0.05, "it lies on the floor: {lowest}");
}

#[test]
fn a_run_repeats_bit_for_bit() {
    let run = || {
        let mut body = body(4, &Material::RUBBER);
        shake(&mut body, 8, 0.01, 1.0);
        for _ in 0..5 {
            body.advance(0.01, [0.0, -9.81, 0.0], Some(Floor { height: -0.3, friction: 0.2 })).unwrap();
        }
        body.displacements().map(|u| u.map(f64::to_bits)).collect::<Vec<_>>()
    };
    let on = |n_threads| rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap().install(run);
    for n_threads in [2, 3, 7] {
        assert_eq!(on(1), on(n_threads), "{n_threads} threads");
    }
}

/// Stretched and at rest, a viscous body returns to its shape, wherever it is then.
#[test]
fn a_stretched_body_recovers_its_shape() {
    let mut body = body(5, &Material { viscosity_s: 1e-2, ..Material::RUBBER });
    let points = lattice(5, [0.3, -0.2, 0.1]).iter().map(|point| point.map(f64::from)).collect::<Vec<_>>();
    // By a fifth along x, half of it against y, sheared along z.
    body.set_state(|[x, y, _]| [[0.2 * x, -0.1 * y, 0.3 * x], [0.0; 3]]);
    // The greatest change of a distance between two phyxels, relative to it.
    let strain = |body: &Body| {
        let now: Vec<[f64; 3]> =
            body.displacements().zip(&points).map(|(u, p)| [0, 1, 2].map(|k| u[k] + p[k])).collect();
        let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |j| [i, j]));
        let change = |[i, j]: [usize; 2]| {
            let rest = length(sub(points[i], points[j]));
            (length(sub(now[i], now[j])) - rest).abs() / rest
        };
        pairs.map(change).fold(0.0, f64::max)
    };
    assert!(strain(&body) > 0.15, "it is deformed: {}", strain(&body));
    body.advance(2.0, NO_GRAVITY, None).unwrap();
    assert!(strain(&body) < 1e-3, "it has its shape again: {}", strain(&body));
    assert!(energy(&body) < 1e-6 * body.mass(), "it is at rest: {} J", energy(&body));
}

/// A sphere that its phyxels shear and stretch has the normals of the ellipsoid: those of the sphere times the inverse transposed map.
#[test]
fn normals_of_a_deformed_sphere_are_those_of_the_ellipsoid() {
    let mesh = sphere(96);
    let mut body = Body::new(&lattice_inside(&mesh, 0.15).unwrap(), 0.15_f64.powi(3), &ELASTIC).unwrap();
    let surface = Surface::new(&body, &mesh.positions).unwrap();
    // x' = 1.4 x + 0.3 y, y' = 0.8 y, z' = 0.7 z.
    body.set_state(|[x, y, z]| [[0.4 * x + 0.3 * y, -0.2 * y, -0.3 * z], [0.0; 3]]);
    let normals = normals(&surface.positions(&body), &mesh.triangles);
    let mut greatest = 0.0_f64;
    for (&[x, y, z], normal) in mesh.positions.iter().zip(normals) {
        let [x, y, z] = [x, y, z].map(f64::from);
        // The inverse transposed: x'' = x / 1.4, y'' = (y - 0.3 x'') / 0.8, z'' = z / 0.7.
        let along = x / 1.4;
        let want = [along, (y - 0.3 * along) / 0.8, z / 0.7];
        let cosine = (0..3).map(|k| want[k] * f64::from(normal[k])).sum::<f64>() / length(want);
        greatest = greatest.max(cosine.min(1.0).acos().to_degrees());
    }
    assert!(greatest < 1.0, "{greatest} degrees");
    // The normals of the sphere would be seen.
    let unit = [0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0];
    assert!((unit[0] / 1.4 * unit[0] + unit[1] * (unit[1] - 0.3 * unit[0] / 1.4) / 0.8).acos().to_degrees() > 5.0);
}

/// A sphere of radius 1, of `n` rings of twice as many vertices.
fn sphere(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh { positions: vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], triangles: vec![] };
    let around = 2 * n;
    for ring in 0..n {
        let (sin, cos) = (std::f64::consts::PI * f64::from(ring + 1) / f64::from(n + 1)).sin_cos();
        for k in 0..around {
            let (y, x) = (std::f64::consts::TAU * f64::from(k) / f64::from(around)).sin_cos();
            mesh.positions.push([sin * x, cos, sin * y].map(|x| x as f32));
        }
    }
    let index = |ring: u32, k: u32| 2 + ring * around + k % around;
    for k in 0..around {
        mesh.triangles.push([0, index(0, k + 1), index(0, k)]);
        mesh.triangles.push([1, index(n - 1, k), index(n - 1, k + 1)]);
        for ring in 1..n {
            let [a, b, c, d] = [index(ring - 1, k), index(ring - 1, k + 1), index(ring, k), index(ring, k + 1)];
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh
}

/// The oracle: every point, in `f64`.
fn loop_over_points(points: &[[f32; 3]], center: [f32; 3], radius: f64) -> Vec<u32> {
    let near = |point: &[f32; 3]| {
        let squares = (0..3).map(|k| f64::from(point[k]) - f64::from(center[k])).map(|x| x * x);
        squares.sum::<f64>() <= radius * radius
    };
    (0..).zip(points).filter(|(_, point)| near(point)).map(|(i, _)| i).collect()
}

/// Random points at a scale about an offset, with duplicates, a plane, a line, and one far outlier.
fn points(random: &mut Random, scale: f64, offset: f64, with_outlier: bool) -> Vec<[f32; 3]> {
    let mut points: Vec<[f32; 3]> = (0..150).map(|_| random.vector(scale).map(|x| (x + offset) as f32)).collect();
    points.extend_from_within(0..20);
    points.extend((0..20).map(|_| [(random.next() * scale) as f32, offset as f32, -0.0]));
    points.extend((0..20).map(|i| [(f64::from(i) * 0.1 * scale + offset) as f32, offset as f32, offset as f32]));
    if with_outlier {
        points.push([(3e4 * scale + offset) as f32, offset as f32, 0.0]);
    }
    points
}

#[test]
fn a_query_equals_a_loop() {
    let mut random = Random(1);
    let mut n_found = 0;
    for scale in [1e-6, 1.0, 1e6] {
        for offset in [0.0, -scale, 1e7] {
            for with_outlier in [false, true] {
                let points = points(&mut random, scale, offset, with_outlier);
                for part in [0.0, 0.003, 0.1, 0.5, 10.0] {
                    let radius = part * scale;
                    let grid = Grid::new(&points, radius);
                    let elsewhere = (0..20).map(|_| random.vector(3.0 * scale).map(|x| (x + offset) as f32));
                    for center in points.iter().copied().chain(elsewhere.collect::<Vec<_>>()) {
                        let want = loop_over_points(&points, center, radius);
                        n_found += want.len();
                        assert_eq!(grid.within(center, radius), want, "within {radius} of {center:?}");
                    }
                }
            }
        }
    }
    assert!(n_found > 100_000, "most queries find something: {n_found}");
}

/// Points on the borders of cells: multiples of the radius.
#[test]
fn points_exactly_a_radius_apart_are_found() {
    let points: Vec<[f32; 3]> = (0..1000_u16).map(|i| [0.1 * f32::from(i), 7.0, -0.0]).collect();
    let grid = Grid::new(&points, f64::from(0.1_f32));
    for &center in &points {
        for radius in [0.05, 0.1, f64::from(0.1_f32)] {
            assert_eq!(grid.within(center, radius), loop_over_points(&points, center, radius));
        }
    }
}

#[test]
fn extreme_coordinates_are_found() {
    let points = [[0.0; 3], [-0.0; 3], [f32::MAX; 3], [f32::MIN; 3], [1e-45; 3], [f32::MIN_POSITIVE; 3]];
    for radius in [0.0, 1e-44, 1.0, 1e38, 1e39] {
        let grid = Grid::new(&points, radius);
        for center in points {
            assert_eq!(grid.within(center, radius), loop_over_points(&points, center, radius), "{radius} {center:?}");
        }
    }
    assert!(Grid::new(&[], 1.0).within([0.0; 3], 1.0).is_empty());
}

#[test]
#[should_panic(expected = "cannot search 2")]
fn a_larger_radius_than_that_of_the_grid_is_rejected() {
    let _ = Grid::new(&[[0.0; 3]], 1.0).within([0.0; 3], 2.0);
}

/// The oracle: the kernel on every triangle of every mesh, each of which is placed once where it is.
fn loop_over(scene: &Scene, ray: &Ray) -> Option<Hit> {
    let ray = ScaledRay::new(ray)?;
    let prepared = Watertight::prepare(&ray);
    let mut best: Option<Hit> = None;
    for (instance, mesh) in (0..).map(InstanceId).zip(&scene.meshes) {
        for (primitive, triangle) in (0..).map(PrimId).zip(&mesh.triangles) {
            let record = Watertight::record(triangle.map(|i| mesh.positions[i as usize]));
            if let Some(hit) = Watertight::intersect(&prepared, &ray, &record, ray.t_max) {
                let hit = Hit { t: hit.t, u: hit.u, v: hit.v, primitive, instance, side: hit.side };
                if best.is_none_or(|best| hit.before(&best)) {
                    best = Some(hit);
                }
            }
        }
    }
    best.map(|hit| Hit { t: ray.caller_t(hit.t), ..hit })
}

/// Rays of any length from all around towards the body, and onto edges and vertices of it.
fn rays(random: &mut Random, scene: &Scene) -> Vec<Ray> {
    let mesh = &scene.meshes[0];
    let mut rays = Vec::new();
    for i in 0..60 {
        let origin = random.vector(3.0).map(|x| x as f32);
        let vertex = mesh.positions[(0.5 * (random.next() + 1.0) * mesh.positions.len() as f64) as usize];
        let blur = if i % 3 == 0 { 0.0 } else { 0.2 };
        let length = 10_f64.powf(6.0 * random.next());
        let target = std::array::from_fn::<f64, 3, _>(|k| f64::from(vertex[k]) + blur * random.next());
        let direction = std::array::from_fn(|k| (length * (target[k] - f64::from(origin[k]))) as f32);
        rays.push(Ray::new(origin, direction));
        rays.push(Ray::new(vertex, [0.0, if i % 2 == 0 { -1.0 } else { 1.0 }, -0.0]));
    }
    rays
}

/// The numbers of rays that hit, and of those whose answers differ from the loop's.
fn compare(simulation: &Simulation, rays: &[Ray]) -> (usize, usize) {
    let structure = &simulation.prepared;
    let (mut n_hits, mut n_differences) = (0, 0);
    for ray in rays {
        let want = loop_over(&simulation.scene, ray);
        let is_equal = structure.closest_hit(ray) == want && structure.occluded(ray) == want.is_some();
        n_hits += usize::from(want.is_some());
        n_differences += usize::from(!is_equal);
    }
    (n_hits, n_differences)
}

#[test]
fn hits_of_every_frame_equal_a_loop() {
    // It hits the floor at the seventh frame.
    const N_FRAMES: [(UpdatePolicy, usize); 3] =
        [(UpdatePolicy::Auto, 60), (UpdatePolicy::Refit, 14), (UpdatePolicy::Rebuild, 14)];
    let mesh = torus([0.45, 0.2], [24, 12], 1.0, 0.5);
    for (policy, n_frames) in N_FRAMES {
        let mut random = Random(11);
        let mut simulation = Simulation::new(&mesh, 0.1, &Material::RUBBER).unwrap();
        let (mut refits, mut rebuilds) = (0, 0);
        for frame in 0..n_frames {
            let options = UpdateOptions { policy, trace_time: Duration::from_millis(100) };
            let (n_steps, updates) = simulation.advance(1.0 / 24.0, &options).unwrap();
            assert!(n_steps > 0);
            (refits, rebuilds) = (refits + updates.refits, rebuilds + updates.rebuilds);
            let rays = rays(&mut random, &simulation.scene);
            let (n_hits, n_differences) = compare(&simulation, &rays);
            assert!(n_hits > rays.len() / 3, "only {n_hits} of {} rays hit", rays.len());
            assert_eq!(n_differences, 0, "frame {frame}, {policy:?}");
        }
        let expected = match policy {
            UpdatePolicy::Auto => refits + rebuilds == n_frames,
            UpdatePolicy::Refit => (refits, rebuilds) == (n_frames, 0),
            UpdatePolicy::Rebuild => (refits, rebuilds) == (0, n_frames),
        };
        assert!(expected, "{policy:?}: {refits} refits, {rebuilds} rebuilds");
        // The same check must reject a BVH of the last frame.
        let old = simulation.scene.meshes[0].positions.clone();
        simulation.scene.meshes[0].positions = old.into_iter().map(|[x, y, z]| [x, y + 0.05, z]).collect();
        assert!(compare(&simulation, &rays(&mut random, &simulation.scene)).1 > 0, "an old BVH passes");
    }
}

#[test]
fn simulations_that_cannot_be_made_are_errors() {
    let error = |spacing: f64| {
        let mesh = torus([0.45, 0.2], [24, 12], 1.0, 0.5);
        Simulation::new(&mesh, spacing, &Material::RUBBER).map(|_| ()).unwrap_err().to_string()
    };
    for spacing in [0.0, -1.0, f64::NAN, 1e-6] {
        assert_eq!(error(spacing), format!("spacing {spacing} m of phyxels: use a larger one"));
    }
    assert!(error(2.0).contains("use a smaller spacing"), "{}", error(2.0));
}
