//! Shares of light that a flat boundary reflects.

/// Reflectance of unpolarised light at a boundary of dielectrics, by Fresnel's equations; `None` where the reflection
/// is total, for no refracted direction exists.
///
/// `cosine` in 0..=1 is that of the angle to the normal on the side the light comes from, `eta` the index of the other
/// side over this side's.
pub(super) fn dielectric(cosine: f32, eta: f32) -> Option<f32> {
    let refracted = refracted_cosine(cosine, eta)?;
    let perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
    let parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
    Some(0.5 * (perpendicular * perpendicular + parallel * parallel))
}

/// Cosine on the far side by Snell's law; `None` where the reflection is total.
pub(super) fn refracted_cosine(cosine: f32, eta: f32) -> Option<f32> {
    // eta² - sin²θ, in the form that does not cancel: above half a right angle eta may be near 1, below it small.
    let square = if cosine * cosine < 0.5 {
        (eta - 1.0) * (eta + 1.0) + cosine * cosine
    } else {
        eta * eta - (1.0 - cosine) * (1.0 + cosine)
    };
    (square > 0.0).then(|| square.sqrt() / eta)
}

/// Schlick's approximation (1994) for a conductor of reflectance `normal` at normal incidence, 1 at the horizon.
pub(super) fn schlick(cosine: f32, normal: f32) -> f32 {
    let sine = 1.0 - cosine;
    let square = sine * sine;
    normal + (1.0 - normal) * square * square * sine
}

/// The cosine-weighted mean of [`dielectric`] over the hemisphere, or less: by at most 0.012 for `eta` in 1..=4.
///
/// Being less is what keeps the sum of base and layer below 1 where roughness lifts the layer's reflectance above that
/// of a flat one: by 0.0007 at most, measured, for an `eta` up to 4. Above 4 it lifts it much at Brewster's angle; there
/// the mean serves no more and this stays at its value for 4.
pub(super) fn mean_below(eta: f32) -> f32 {
    let eta = eta.clamp(1.02, 4.0);
    (eta - 1.02) / (eta + 4.25)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the angles of the two rays, in `f64`; away from the normal, where it divides by zero.
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
    fn fresnel_agrees_with_the_angles() {
        for eta in [1.0001, 1.33, 1.5, 2.4, 1.0 / 1.5, 1.0 / 2.4] {
            for degree in 1..90 {
                let angle = f64::from(degree).to_radians();
                let got = dielectric(angle.cos() as f32, eta as f32).unwrap_or(1.0);
                // The reflectance is steepest near the horizon and the critical angle: an error of the cosine or of
                // eta counts at most 200 times at whole degrees.
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
    fn the_mean_is_bounded_from_below() {
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
