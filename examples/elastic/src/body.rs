//! The body: phyxels of an elastic material.

use std::{error::Error, fmt};

use glam::DVec3;

use crate::neighbors::{Link, links, radii_of_action, vector};

/// A point-based elastic body.
///
/// Its state is a displacement from the rest position and a velocity for each phyxel. At rest both are zero, and so is every
/// force, exactly.
#[derive(Clone, Debug)]
pub struct Body {
    pub(crate) material: Material,
    /// Volume and mass of each phyxel.
    pub(crate) volume: f64,
    pub(crate) phyxel_mass: f64,
    pub(crate) rest: Vec<DVec3>,
    pub(crate) radii: Vec<f64>,
    pub(crate) links: Vec<Vec<Link>>,
    pub(crate) displacements: Vec<DVec3>,
    pub(crate) velocities: Vec<DVec3>,
    /// Elastic and viscous forces, once a step has computed them.
    pub(crate) forces: Option<Vec<DVec3>>,
    /// Time since rest.
    pub(crate) seconds: f64,
}

/// Why a body cannot be made or moved.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyError {
    /// A property of the material, or the volume of a phyxel, is out of range.
    OutOfRange {
        /// Which one.
        property: &'static str,
        /// Its value.
        value: f64,
    },
    /// A phyxel has a coordinate that is not finite.
    NotFinite {
        /// Index of the phyxel.
        phyxel: usize,
        /// Its rest position.
        position: [f32; 3],
    },
    /// The phyxels in the radius of action of one lie in a plane, or nearly so: they define no displacement gradient.
    Flat {
        /// Index of the phyxel.
        phyxel: usize,
        /// Number of phyxels in its radius of action.
        n_neighbors: usize,
        /// The radius of action, m.
        radius: f64,
    },
    /// The simulation diverged, because the time step was too long.
    Diverged {
        /// Index of a phyxel that is no longer at a finite place.
        phyxel: usize,
        /// When, s.
        seconds: f64,
    },
    /// A surfel is in the radius of action of no phyxel.
    Detached {
        /// Index of the surfel.
        surfel: usize,
        /// Its rest position.
        position: [f32; 3],
    },
}

impl fmt::Display for BodyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { property, value } => write!(f, "{property} is out of range: {value}"),
            Self::NotFinite { phyxel, position } => write!(f, "phyxel {phyxel} is not finite: {position:?}"),
            Self::Flat { phyxel, n_neighbors, radius } => write!(
                f,
                "phyxel {phyxel}: the {n_neighbors} phyxels within {radius} m do not span space; use a smaller spacing"
            ),
            Self::Diverged { phyxel, seconds } => {
                write!(f, "phyxel {phyxel} diverged at {seconds} s; use a shorter time step")
            }
            Self::Detached { surfel, position } => {
                write!(
                    f,
                    "surfel {surfel} at {position:?} is in the radius of action of no phyxel; use a smaller spacing"
                )
            }
        }
    }
}

impl Error for BodyError {}

impl Body {
    /// A body at rest. Each phyxel has the given volume in m³: the cell of the lattice that it stands for.
    ///
    /// Müller et al. estimate volumes by density; for phyxels of a regular lattice the cell is exact, also at the surface.
    ///
    /// # Errors
    /// A volume or a property of the material out of range, a phyxel that is not finite, or one whose neighbors do not span space.
    pub fn new(rest: &[[f32; 3]], volume: f64, material: &Material) -> Result<Self, BodyError> {
        let of_volume = (!(volume > 0.0 && volume.is_finite())).then_some(("volume of a phyxel", volume));
        if let Some((property, value)) = material.out_of_range().or(of_volume) {
            return Err(BodyError::OutOfRange { property, value });
        }
        if let Some(phyxel) = rest.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
            return Err(BodyError::NotFinite { phyxel, position: rest[phyxel] });
        }
        let radii = radii_of_action(rest);
        let links = links(rest, &radii).map_err(|(phyxel, n_neighbors)| BodyError::Flat {
            phyxel,
            n_neighbors,
            radius: radii[phyxel],
        })?;
        Ok(Self {
            material: *material,
            volume,
            phyxel_mass: volume * material.density,
            rest: rest.iter().copied().map(vector).collect(),
            radii,
            links,
            displacements: vec![DVec3::ZERO; rest.len()],
            velocities: vec![DVec3::ZERO; rest.len()],
            forces: None,
            seconds: 0.0,
        })
    }

    /// Number of phyxels.
    #[must_use]
    pub fn n_phyxels(&self) -> usize {
        self.rest.len()
    }

    /// Mass of the body, kg.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 phyxels")]
    pub fn mass(&self) -> f64 {
        self.phyxel_mass * self.n_phyxels() as f64
    }

    /// Places each phyxel, given by its rest position, at a displacement in m with a velocity in m/s.
    pub fn set_state(&mut self, state: impl Fn([f64; 3]) -> [[f64; 3]; 2]) {
        for (i, rest) in self.rest.iter().enumerate() {
            [self.displacements[i], self.velocities[i]] = state(rest.to_array()).map(DVec3::from);
        }
        self.forces = None;
    }

    /// Displacements from the rest positions, m.
    pub fn displacements(&self) -> impl ExactSizeIterator<Item = [f64; 3]> {
        self.displacements.iter().map(DVec3::to_array)
    }

    /// Linear momentum, kg·m/s.
    #[must_use]
    pub fn momentum(&self) -> [f64; 3] {
        (self.phyxel_mass * self.velocities.iter().sum::<DVec3>()).to_array()
    }

    /// Angular momentum about the origin, kg·m²/s.
    #[must_use]
    pub fn angular_momentum(&self) -> [f64; 3] {
        let arms = self.rest.iter().zip(&self.displacements).map(|(&rest, &u)| rest + u);
        let sum: DVec3 = arms.zip(&self.velocities).map(|(arm, &velocity)| arm.cross(velocity)).sum();
        (self.phyxel_mass * sum).to_array()
    }

    /// Kinetic energy, J.
    #[must_use]
    pub fn kinetic_energy(&self) -> f64 {
        0.5 * self.phyxel_mass * self.velocities.iter().map(|v| v.length_squared()).sum::<f64>()
    }
}

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
