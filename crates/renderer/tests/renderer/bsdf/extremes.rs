//! All inputs in range give finite results.

use canted_renderer::{Bsdf, BsdfSample, Lobes, Pattern, Sampler};

use crate::common::{dot, narrow, unit};

const LAST: f32 = 1.0 - f32::EPSILON / 2.0;
const SHARES: [f32; 6] = [0.0, 1e-30, 1e-4, 0.5, LAST, 1.0];
const ROUGHNESS: [f32; 8] = [0.0, 1e-4, 0.031_249, 0.031_25, 0.04, 0.3, LAST, 1.0];
const IORS: [f32; 9] = [1.0, 1.0 + f32::EPSILON, 1.0001, 1.0078, 1.0079, 1.5, 2.4, 100.0, 1000.0];
const COSINES: [f32; 9] = [1.0, LAST, 0.745_356, 0.5, 1e-3, 1e-7, 1e-20, f32::MIN_POSITIVE, 1e-45];

struct Dice {
    sampler: Sampler,
    n: u32,
}

impl Dice {
    fn number(&mut self) -> f32 {
        self.n += 1;
        self.sampler.pair(self.n, 0, 0)[0]
    }

    /// A number from a list, or sometimes `any` of a random number.
    fn pick(&mut self, list: &[f32], any: impl Fn(f32) -> f32) -> f32 {
        let (which, number) = (self.number(), self.number());
        let at = (which * (list.len() + 2) as f32) as usize;
        list.get(at).copied().unwrap_or_else(|| any(number))
    }

    fn share(&mut self) -> f32 {
        self.pick(&SHARES, |x| x)
    }

    fn bsdf(&mut self) -> Bsdf {
        Bsdf {
            base_color: std::array::from_fn(|_| self.share()),
            metallic: self.share(),
            roughness: self.pick(&ROUGHNESS, |x| x),
            specular: self.share(),
            transmission: self.share(),
            ior: self.pick(&IORS, |x| 1.0 + 3.0 * x),
            thin_walled: self.number() < 0.3,
            is_inside: self.number() < 0.5,
            is_compensated: self.number() < 0.5,
            lobes: (self.number() < 0.5).then(|| self.lobes()),
        }
    }

    fn lobes(&mut self) -> Lobes {
        let angle = 7.0 * self.number();
        Lobes {
            specular_color: std::array::from_fn(|_| 3.0 * self.share()),
            clearcoat: self.share(),
            clearcoat_roughness: self.pick(&ROUGHNESS, |x| x),
            sheen_color: std::array::from_fn(|_| self.share()),
            sheen_roughness: self.share(),
            anisotropy: self.share(),
            direction: [angle.cos(), angle.sin()],
            iridescence: self.share(),
            iridescence_ior: self.pick(&IORS, |x| 1.0 + 3.0 * x),
            iridescence_thickness: 1000.0 * self.share(),
            absorption: [0.0; 3],
        }
    }

    /// A unit vector above the horizon, possibly grazing.
    fn direction(&mut self) -> [f32; 3] {
        let cosine = self.pick(&COSINES, |x| x);
        let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
        let (s, c) = (std::f32::consts::TAU * self.pick(&[0.0, 0.25, 0.5], |x| x)).sin_cos();
        [sine * c, sine * s, cosine]
    }
}

fn is_valid(scattered: &BsdfSample) -> bool {
    let BsdfSample { incident, weight, density, is_delta, is_transmitted } = *scattered;
    let length = dot(incident.map(f64::from), incident.map(f64::from)).sqrt();
    weight.iter().all(|w| w.is_finite() && *w >= 0.0)
        && density.is_finite()
        && (density > 0.0) != is_delta
        && is_transmitted == (incident[2] < 0.0)
        && incident[2] != 0.0
        // Unit vectors combined by a facet normal: a dozen roundings.
        && (length - 1.0).abs() < 12.0 * f64::from(f32::EPSILON)
}

#[test]
fn results_are_always_finite() {
    let mut dice = Dice { sampler: Sampler::new(Pattern::Random, 1, 1), n: 0 };
    let (mut n_delta, mut n_through, mut n_lost) = (0, 0, 0);
    for _ in 0..300_000 {
        let (bsdf, outgoing) = (dice.bsdf(), dice.direction());
        let square = [dice.pick(&[0.0, LAST, 0.5], |x| x), dice.pick(&[0.0, LAST, 0.5], |x| x)];
        let choice = dice.pick(&[0.0, LAST], |x| x);
        match bsdf.sample(outgoing, square, choice) {
            Some(scattered) => {
                assert!(is_valid(&scattered), "{bsdf:?} {outgoing:?} {square:?} {choice}: {scattered:?}");
                n_delta += u32::from(scattered.is_delta);
                n_through += u32::from(scattered.is_transmitted);
            }
            None => n_lost += 1,
        }
        let [x, y, z] = dice.direction();
        // Lobes are highest in the mirrored direction.
        let [a, b, c] = outgoing;
        for incident in [[x, y, z], [x, y, -z], [-a, -b, c], [-a, -b, -c]] {
            let evaluation = bsdf.evaluate(outgoing, incident);
            let numbers = [evaluation.value[0], evaluation.value[1], evaluation.value[2], evaluation.density];
            let sound = numbers.iter().all(|x| x.is_finite() && *x >= 0.0);
            assert!(sound, "{bsdf:?} {outgoing:?} {incident:?}: {evaluation:?}");
        }
        assert!(bsdf.albedo().iter().all(|a| (0.0..=1.0).contains(a)), "{bsdf:?}: {:?}", bsdf.albedo());
    }
    assert!(n_delta > 30_000 && n_through > 10_000 && n_lost > 10_000, "{n_delta} {n_through} {n_lost}");
}

#[test]
fn directions_below_the_horizon_give_zero() {
    let bsdf = Bsdf { specular: 1.0, transmission: 0.5, ..Bsdf::lambert([0.5; 3]) };
    for outgoing in [[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [1.0, 0.0, -0.0]] {
        assert_eq!(bsdf.sample(outgoing, [0.5; 2], 0.5), None);
        assert_eq!(bsdf.evaluate(outgoing, [0.0, 0.0, 1.0]).density, 0.0);
    }
    assert_eq!(bsdf.evaluate([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]).value, [0.0; 3]);
}

/// `is_delta_only` holds exactly for materials that evaluate to zero everywhere.
#[test]
fn delta_only_materials_evaluate_to_zero() {
    let mut dice = Dice { sampler: Sampler::new(Pattern::Random, 1, 2), n: 0 };
    let mirror = Bsdf { metallic: 1.0, roughness: 0.0, ..Bsdf::lambert([0.9; 3]) };
    let glass = Bsdf { transmission: 1.0, roughness: 0.0, specular: 1.0, ..Bsdf::lambert([1.0; 3]) };
    for bsdf in [mirror, glass, Bsdf { thin_walled: true, ..glass }] {
        assert!(bsdf.is_delta_only());
        for _ in 0..1000 {
            let evaluation = bsdf.evaluate(dice.direction(), dice.direction());
            assert_eq!((evaluation.value, evaluation.density), ([0.0; 3], 0.0));
        }
    }
    assert_eq!((mirror.albedo(), glass.albedo()), ([0.9; 3], [1.0; 3]));
    let up = narrow(unit([0.1, 0.2, 1.0]));
    for bsdf in
        [Bsdf { metallic: 0.9, ..mirror }, Bsdf { transmission: 0.9, ..glass }, Bsdf { roughness: 0.1, ..glass }]
    {
        assert!(!bsdf.is_delta_only() && bsdf.evaluate(up, [-up[0], -up[1], up[2]]).value[0] > 0.0);
    }
}
