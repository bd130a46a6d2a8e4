//! Motion: conserved quantities, the stable time step, the floor.

mod common;

use common::{ELASTIC, Random, body, length, rotated, shake, sub};
use elastic::{Body, BodyError, Floor, Material};

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
    let rest: Vec<[f64; 3]> = common::lattice(5, [0.3, -0.2, 0.1]).iter().map(|point| point.map(f64::from)).collect();
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
    assert_eq!(run(), run());
}
