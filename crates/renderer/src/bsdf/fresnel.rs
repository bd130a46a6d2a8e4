//! Fresnel reflectance.

/// Fresnel reflectance of unpolarized light at a dielectric boundary; `None` for total internal reflection.
///
/// `cosine` in 0..=1 is on the side from which the light comes, `eta` the index of refraction of the far side over that
/// side's.
pub(super) fn dielectric(cosine: f32, eta: f32) -> Option<f32> {
    let refracted = refracted_cosine(cosine, eta)?;
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    Some(0.5 * (perpendicular * perpendicular + parallel * parallel))
}

/// Cosine of the refracted direction by Snell's law; `None` for total internal reflection.
pub(super) fn refracted_cosine(cosine: f32, eta: f32) -> Option<f32> {
    // eta² - sin²θ without cancellation: above 45 degrees eta may be near 1, below it may be small.
    let square = if cosine * cosine < 0.5 {
        (eta - 1.0) * (eta + 1.0) + cosine * cosine
    } else {
        eta * eta - (1.0 - cosine) * (1.0 + cosine)
    };
    (square > 0.0).then(|| square.sqrt() / eta)
}

/// Schlick's approximation (1994) for a conductor with reflectance `normal` at normal incidence.
pub(super) fn schlick(cosine: f32, normal: f32) -> f32 {
    let sine = 1.0 - cosine;
    let square = sine * sine;
    normal + (1.0 - normal) * square * square * sine
}

/// A lower bound of the cosine-weighted mean of [`dielectric`] over the hemisphere, within 0.012 for `eta` in 1..=4.
///
/// A lower bound keeps the sum of base and coat below 1 even though roughness raises the reflectance of the coat above
/// that of a flat one (measured: by at most 0.0007 for `eta` up to 4). Above 4 the increase is large at Brewster's
/// angle, and the bound stays at its value for 4.
pub(super) fn mean_below(eta: f32) -> f32 {
    let eta = eta.clamp(1.02, 4.0);
    (eta - 1.02) / (eta + 4.25)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the angles of both rays, in `f64`; not at normal incidence, where this divides by zero.
    fn by_angles(angle: f64, eta: f64) -> f64 {
        let sine = angle.sin() / eta;
        if sine >= 1.0 {
            return 1.0;
        }
        let refracted = sine.asin();
        let perpendicular = (angle - refracted).sin() / (angle + refracted).sin();
        let parallel = (angle - refracted).tan() / (angle + refracted).tan();
        (perpendicular.powi(2) + parallel.powi(2)) / 2.0
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is what is tested")]
    fn dielectric_matches_angle_formula() {
        for eta in [1.0001, 1.33, 1.5, 2.4, 1.0 / 1.5, 1.0 / 2.4] {
            for degree in 1..90 {
                let angle = f64::from(degree).to_radians();
                let got = dielectric(angle.cos() as f32, eta as f32).unwrap_or(1.0);
                // The reflectance is steepest near the horizon and the critical angle: at whole degrees it amplifies an
                // error of the cosine or of eta by at most 200.
                let want = by_angles(angle, f64::from(eta as f32));
                assert!(
                    (f64::from(got) - want).abs() < 200.0 * f64::from(f32::EPSILON),
                    "{eta} {degree}: {got} {want}"
                );
            }
        }
        assert_eq!(dielectric(0.7, 1.0), Some(0.0));
        assert_eq!((dielectric(0.0, 1.5), dielectric(0.1, 1.0 / 1.5)), (Some(1.0), None));
        assert_eq!((schlick(1.0, 0.25), schlick(0.0, 0.25)), (0.25, 1.0));
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is what is tested")]
    fn mean_is_a_tight_lower_bound() {
        const STEPS: u32 = 10_000;
        let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt() as f32;
        for eta in [1.0001, 1.001, 1.01, 1.02, 1.05, 1.1, 1.2, 1.33, 1.5, 2.0, 2.4, 3.0, 4.0] {
            let reflectance = |i| dielectric(at(i), eta).map_or(1.0, f64::from);
            let mean = (0..STEPS).map(reflectance).sum::<f64>() / f64::from(STEPS);
            let below = f64::from(mean_below(eta));
            assert!(below < mean && mean - below < 0.012, "{eta}: {below} for {mean}");
        }
    }
}
