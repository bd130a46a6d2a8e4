//! Time steps, and how long they may be.

use glam::{DMat3, DVec3};

use crate::body::{Body, BodyError};
use crate::forces::strain;

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
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating by definition")]
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
