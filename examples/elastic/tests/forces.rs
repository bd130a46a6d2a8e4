//! Forces: none without deformation, the gradient of the energy, and none on the body as a whole.

mod common;

use common::{ELASTIC, Random, SPACING, body, lattice, length, rotated, shake, sub};
use elastic::{Body, BodyError, Material, Surface};

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
