//! The body: phyxels of an elastic material. Elastic energy, and the forces that are its exact negative gradient.
//!
//! Phyxel `i` has the displacement gradient `H = Σ (u_j - u_i) d_ij^T`, the deformation gradient `F = I + H`, the strain of Green
//! and Lagrange `E = (F^T F - I)/2 = (H + H^T + H^T H)/2`, and the stress of St. Venant and Kirchhoff `S = λ tr(E) I + 2μ E`. Its
//! energy is `v (S : E)/2`, whose derivative by `u_j` is `v F S d_ij`; `u_i` gets the opposite. `E` does not change with rotations,
//! so linear and angular momentum are conserved.
//!
//! A gradient cannot see how neighbors move against each other, so Müller's forces leave such motion without resistance. A second
//! energy opposes it, after Ganzenmüller 2015: `½ Σ k_ij |r_ij|²` with the residual of the fit, `r_ij = (u_j - u_i) - H X_ij`. It is zero
//! for every affine motion. Because `k_ij` is proportional to the weights of the least-squares fit, `Σ k_ij r_ij X_ij^T = 0`, and
//! the derivative by `u_j` is just `k_ij r_ij`.
//!
//! Time steps, and how long they may be.

use std::{error::Error, fmt};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::neighbors::{Link, links, outer, radii_of_action, vector};

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
    /// The links that end at each phyxel, as phyxel and position in its list, in ascending order.
    incoming: Vec<Vec<[u32; 2]>>,
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
        let mut incoming = vec![Vec::new(); rest.len()];
        for (from, links) in (0..).zip(&links) {
            (0..).zip(links).for_each(|(position, link)| incoming[link.to as usize].push([from, position]));
        }
        Ok(Self {
            material: *material,
            volume,
            phyxel_mass: volume * material.density,
            rest: rest.iter().copied().map(vector).collect(),
            radii,
            links,
            incoming,
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

/// Phyxels of a task: fewer take less time than its start.
const MIN_PHYXELS: usize = 32;

/// Stiffness against motion that is not affine, relative to that of the material.
const NON_AFFINE: f64 = 0.2;

impl Body {
    /// Elastic energy, J.
    #[must_use]
    pub fn elastic_energy(&self) -> f64 {
        let of_phyxel = |i: usize| {
            let gradient = self.gradient(i, &self.displacements);
            let strain = strain(gradient);
            let stress = self.stress(strain);
            let elastic = 0.5 * self.volume * (0..3).map(|k| stress.col(k).dot(strain.col(k))).sum::<f64>();
            let residual = |link: &Link| self.residual(i, link, gradient, &self.displacements);
            let non_affine = |link: &Link| 0.5 * self.stiffness(link) * residual(link).length_squared();
            elastic + self.links[i].iter().map(non_affine).sum::<f64>()
        };
        (0..self.n_phyxels()).map(of_phyxel).sum()
    }

    /// Elastic and viscous force on each phyxel, N.
    #[must_use]
    pub fn forces(&self) -> Vec<[f64; 3]> {
        self.forces_at(&self.velocities).iter().map(DVec3::to_array).collect()
    }

    /// Forces at the displacements, for the given velocities.
    ///
    /// Viscosity adds the rate of the strain, times the retardation time, to the strain. Against motion that is not affine it puts a
    /// dashpot into each link, along the line between the phyxels: damping the rate of the residual itself would exert a
    /// torque on the body. Both are skipped where the material has no viscosity.
    pub(crate) fn forces_at(&self, velocities: &[DVec3]) -> Vec<DVec3> {
        let retardation = self.material.viscosity_s;
        let of_links = |(i, links): (usize, &Vec<Link>)| -> Vec<DVec3> {
            let gradient = self.gradient(i, &self.displacements);
            let deformation = DMat3::IDENTITY + gradient;
            let mut strain = strain(gradient);
            let rate = if retardation > 0.0 { self.gradient(i, velocities) } else { DMat3::ZERO };
            if retardation > 0.0 {
                let product = deformation.transpose() * rate;
                strain += 0.5 * retardation * (product + product.transpose());
            }
            let pull = self.volume * (deformation * self.stress(strain));
            let of_link = |link: &Link| {
                let to = link.to as usize;
                let mut residual = self.residual(i, link, gradient, &self.displacements);
                if retardation > 0.0 {
                    let line = link.offset + (self.displacements[to] - self.displacements[i]);
                    residual += retardation
                        * (velocities[to] - velocities[i]).project_onto_normalized(line.normalize_or_zero());
                }
                pull * link.gradient + self.stiffness(link) * residual
            };
            links.iter().map(of_link).collect()
        };
        let of_links: Vec<Vec<DVec3>> =
            self.links.par_iter().enumerate().with_min_len(MIN_PHYXELS).map(of_links).collect();
        // Each phyxel gathers, in the order of the phyxels at the other ends, so that the bits do not depend on threads.
        let gathered = |(i, incoming): (usize, &Vec<[u32; 2]>)| {
            let (before, after) = incoming.split_at(incoming.partition_point(|[from, _]| (*from as usize) < i));
            let pulled = |force, [from, position]: &[u32; 2]| force - of_links[*from as usize][*position as usize];
            let own = of_links[i].iter().fold(before.iter().fold(DVec3::ZERO, pulled), |force, own| force + own);
            after.iter().fold(own, pulled)
        };
        self.incoming.par_iter().enumerate().with_min_len(MIN_PHYXELS).map(gathered).collect()
    }

    /// Gradient at phyxel `i`, by rest position, of a field given at all phyxels.
    pub(crate) fn gradient(&self, i: usize, field: &[DVec3]) -> DMat3 {
        self.links[i].iter().map(|link| outer(field[link.to as usize] - field[i], link.gradient)).sum()
    }

    /// What a gradient does not explain of the field at a link.
    fn residual(&self, i: usize, link: &Link, gradient: DMat3, field: &[DVec3]) -> DVec3 {
        (field[link.to as usize] - field[i]) - gradient * link.offset
    }

    /// Stiffness `k_ij` against the residual at a link, N/m.
    pub(crate) fn stiffness(&self, link: &Link) -> f64 {
        NON_AFFINE * self.material.p_wave_modulus() * self.volume * link.weight
    }

    /// Stress for a strain, Pa.
    pub(crate) fn stress(&self, strain: DMat3) -> DMat3 {
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        DMat3::from_diagonal(DVec3::splat(self.material.lambda() * trace)) + 2.0 * self.material.mu() * strain
    }
}

/// Strain of Green and Lagrange for a displacement gradient.
pub(crate) fn strain(gradient: DMat3) -> DMat3 {
    0.5 * (gradient + gradient.transpose() + gradient.transpose() * gradient)
}

/// A horizontal floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Least height of a phyxel, m.
    pub height: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

impl Body {
    /// A step of the leapfrog method (kick, drift, kick), under an acceleration in m/s², over an optional floor.
    ///
    /// Elastic forces come from the new positions and, for viscosity, from the velocities in the middle of the step. A phyxel below the
    /// floor is put onto it, loses its downward velocity, and friction takes at most its coefficient times that from the sideways
    /// velocity (Coulomb).
    ///
    /// # Errors
    /// [`BodyError::Diverged`] where a phyxel is no longer at a finite place.
    pub fn step(&mut self, seconds: f64, acceleration: [f64; 3], floor: Option<Floor>) -> Result<(), BodyError> {
        let acceleration = DVec3::from(acceleration);
        let before = self.forces.take().unwrap_or_else(|| self.forces_at(&self.velocities));
        self.kick(0.5 * seconds, &before, acceleration);
        for (u, velocity) in self.displacements.iter_mut().zip(&self.velocities) {
            *u += seconds * *velocity;
        }
        if let Some(floor) = floor {
            self.collide(floor);
        }
        let after = self.forces_at(&self.velocities);
        self.kick(0.5 * seconds, &after, acceleration);
        self.forces = Some(after);
        self.seconds += seconds;
        let lost = self.displacements.iter().zip(&self.velocities).position(|(u, v)| !(u.is_finite() && v.is_finite()));
        match lost {
            Some(phyxel) => Err(BodyError::Diverged { phyxel, seconds: self.seconds }),
            None => Ok(()),
        }
    }

    /// Steps through a time, in equal steps of at most half the stable one. Returns their number.
    ///
    /// Half, because the stable step is computed for the deformation at the start.
    ///
    /// # Errors
    /// As [`Body::step`].
    pub fn advance(&mut self, seconds: f64, acceleration: [f64; 3], floor: Option<Floor>) -> Result<u32, BodyError> {
        const SAFETY: f64 = 0.5;
        let n = (seconds / (SAFETY * self.stable_step())).ceil().max(1.0) as u32;
        for _ in 0..n {
            self.step(seconds / f64::from(n), acceleration, floor)?;
        }
        Ok(n)
    }

    fn kick(&mut self, seconds: f64, forces: &[DVec3], acceleration: DVec3) {
        for (velocity, force) in self.velocities.iter_mut().zip(forces) {
            *velocity += seconds * (*force / self.phyxel_mass + acceleration);
        }
    }

    fn collide(&mut self, floor: Floor) {
        for (i, rest) in self.rest.iter().enumerate() {
            let (u, velocity) = (&mut self.displacements[i], &mut self.velocities[i]);
            if rest.y + u.y >= floor.height {
                continue;
            }
            u.y = floor.height - rest.y;
            let stopped = (-velocity.y).max(0.0);
            let sideways = DVec3::new(velocity.x, 0.0, velocity.z);
            let speed = sideways.length();
            let kept = if speed > 0.0 { (1.0 - floor.friction * stopped / speed).max(0.0) } else { 0.0 };
            *velocity = kept * sideways + DVec3::Y * velocity.y.max(0.0);
        }
    }

    /// An upper bound of the squared angular frequency of every small vibration about the present deformation, 1/s².
    ///
    /// The frequencies are eigenvalues of the stiffness divided by the mass, at most the greatest sum over a row of the norms of its
    /// blocks. Phyxel `i` adds to the block of `k` and `l` at most `v (|F|² (λ + 2μ) + |S|) |d_k| |d_l|`, where `d_i` is minus the
    /// sum of the others. The energy of its residuals is the least over all gradients, so at most that of springs `k_ij`, whose rows
    /// sum to `2 k_ij` at both ends.
    #[must_use]
    pub fn frequency_bound_squared(&self) -> f64 {
        let mut rows = vec![0.0; self.n_phyxels()];
        for (i, links) in self.links.iter().enumerate() {
            let gradient = self.gradient(i, &self.displacements);
            let deformation = DMat3::IDENTITY + gradient;
            let stretch = norm_bound(deformation.transpose() * deformation);
            let stress = norm_bound(self.stress(strain(gradient)));
            let modulus = self.volume * (stretch * self.material.p_wave_modulus() + stress);
            let own = links.iter().map(|link| link.gradient).sum::<DVec3>().length();
            let sum = own + links.iter().map(|link| link.gradient.length()).sum::<f64>();
            rows[i] += modulus * own * sum;
            for link in links {
                let spring = 2.0 * self.stiffness(link);
                rows[i] += spring;
                rows[link.to as usize] += spring + modulus * link.gradient.length() * sum;
            }
        }
        rows.into_iter().fold(0.0, f64::max) / self.phyxel_mass
    }

    /// The longest stable time step about the present deformation, s; infinite for a body without phyxels.
    ///
    /// Leapfrog is stable up to `2 (√(1 + ξ²) - ξ)/ω`, where `ξ = ω viscosity/2` is the damping of the fastest vibration `ω` relative
    /// to critical damping, if viscous forces are at most those of the bound times the retardation time, as dashpots are those of the
    /// springs (Belytschko, Liu and Moran, "Nonlinear finite elements for continua and structures", 2000). The bound of `ω`
    /// makes the step shorter than necessary, never longer.
    #[must_use]
    pub fn stable_step(&self) -> f64 {
        let frequency = self.frequency_bound_squared().sqrt();
        let damping = 0.5 * self.material.viscosity_s * frequency;
        2.0 * ((1.0 + damping * damping).sqrt() - damping) / frequency
    }
}

/// An upper bound of the spectral norm of a symmetric matrix: the greatest sum of absolute values in a row.
fn norm_bound(matrix: DMat3) -> f64 {
    (0..3).map(|k| matrix.col(k).abs().element_sum()).fold(0.0, f64::max)
}
