/// An isotropic elastic material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Mass per volume, kg/m³; above zero.
    pub density: f64,
    /// Young's modulus, Pa; above zero.
    pub young: f64,
    /// Poisson's ratio, from 0 to below 0.5.
    pub poisson: f64,
    /// Retardation time (Kelvin-Voigt), s: the stress is that of the strain plus this time its rate; 0 for no losses. A vibration of angular frequency `ω` is damped by
    /// `viscosity_s·ω/2` of critical.
    pub viscosity_s: f64,
}

impl Material {
    /// Soft rubber foam.
    pub const RUBBER: Self = Self { density: 1000.0, young: 1.5e5, poisson: 0.35, viscosity_s: 1e-3 };

    /// Lamé's first parameter `λ`, Pa: stress per change of volume.
    pub(crate) fn lambda(&self) -> f64 {
        self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }

    /// Lamé's second parameter `μ`, the shear modulus, Pa.
    pub(crate) fn mu(&self) -> f64 {
        self.young / (2.0 * (1.0 + self.poisson))
    }

    /// `λ + 2μ`, Pa: the modulus of compression without lateral strain, the stiffest response to a gradient of rank 1.
    pub(crate) fn p_wave_modulus(&self) -> f64 {
        self.lambda() + 2.0 * self.mu()
    }

    /// The name and the value of the first property that is out of range.
    pub(crate) fn out_of_range(&self) -> Option<(&'static str, f64)> {
        let Self { density, young, poisson, viscosity_s } = *self;
        [
            ("density", density, density > 0.0),
            ("Young's modulus", young, young > 0.0),
            ("Poisson's ratio", poisson, (0.0..0.5).contains(&poisson)),
            ("viscosity", viscosity_s, viscosity_s >= 0.0),
        ]
        .into_iter()
        .find_map(|(name, value, is_in_range)| (!is_in_range || !value.is_finite()).then_some((name, value)))
    }
}
