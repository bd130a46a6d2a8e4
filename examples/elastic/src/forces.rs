//! Elastic energy, and the forces that are its exact negative gradient.
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

use glam::{DMat3, DVec3};

use crate::body::Body;
use crate::neighbors::{Link, outer};

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
        let mut forces = vec![DVec3::ZERO; self.n_phyxels()];
        for (i, links) in self.links.iter().enumerate() {
            let gradient = self.gradient(i, &self.displacements);
            let deformation = DMat3::IDENTITY + gradient;
            let mut strain = strain(gradient);
            let rate = if retardation > 0.0 { self.gradient(i, velocities) } else { DMat3::ZERO };
            if retardation > 0.0 {
                let product = deformation.transpose() * rate;
                strain += 0.5 * retardation * (product + product.transpose());
            }
            let pull = self.volume * (deformation * self.stress(strain));
            for link in links {
                let to = link.to as usize;
                let mut residual = self.residual(i, link, gradient, &self.displacements);
                if retardation > 0.0 {
                    let line = link.offset + (self.displacements[to] - self.displacements[i]);
                    residual += retardation
                        * (velocities[to] - velocities[i]).project_onto_normalized(line.normalize_or_zero());
                }
                let force = pull * link.gradient + self.stiffness(link) * residual;
                forces[to] -= force;
                forces[i] += force;
            }
        }
        forces
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
