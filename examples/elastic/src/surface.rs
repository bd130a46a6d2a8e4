use glam::{DMat3, DVec3};

use crate::body::{Body, BodyError};
use crate::grid::{Grid, distance_squared};
use crate::neighbors::{kernel, vector};

/// A phyxel that moves a surfel.
struct Anchor {
    phyxel: u32,
    /// The weights of a surfel sum to 1.
    weight: f64,
    /// From the phyxel to the surfel, at rest.
    offset: DVec3,
}

/// The surfels of a body: vertices of a mesh that follow the phyxels.
pub struct Surface {
    rest: Vec<DVec3>,
    anchors: Vec<Vec<Anchor>>,
}

impl Surface {
    /// Surfels at the given rest positions, each moved by all phyxels in whose radius of action it is.
    ///
    /// # Errors
    /// [`BodyError::Detached`] where a surfel, possibly one that is not finite, is in the radius of action of no phyxel.
    pub fn new(body: &Body, positions: &[[f32; 3]]) -> Result<Self, BodyError> {
        #[expect(clippy::cast_possible_truncation, reason = "the rest positions came from f32")]
        let phyxels: Vec<[f32; 3]> = body.rest.iter().map(|rest| rest.to_array().map(|x| x as f32)).collect();
        let radius = body.radii.iter().copied().fold(0.0, f64::max);
        let grid = Grid::new(&phyxels, radius);
        let anchors = positions.iter().enumerate().map(|(surfel, &position)| {
            let mut anchors: Vec<Anchor> = grid
                .within(position, radius)
                .into_iter()
                .map(|phyxel| {
                    let i = phyxel as usize;
                    let weight = kernel(distance_squared(phyxels[i], position), body.radii[i]);
                    Anchor { phyxel, weight, offset: vector(position) - body.rest[i] }
                })
                .filter(|anchor| anchor.weight > 0.0)
                .collect();
            let sum: f64 = anchors.iter().map(|anchor| anchor.weight).sum();
            anchors.iter_mut().for_each(|anchor| anchor.weight /= sum);
            if anchors.is_empty() { Err(BodyError::Detached { surfel, position }) } else { Ok(anchors) }
        });
        Ok(Self { anchors: anchors.collect::<Result<_, _>>()?, rest: positions.iter().copied().map(vector).collect() })
    }

    /// Positions of the surfels as the body is deformed, m, rounded to `f32`.
    ///
    /// Each phyxel moves a surfel by its own displacement and gradient, as in Müller et al.; a surfel takes the weighted mean. An
    /// affine motion of the phyxels moves the surfels alike.
    #[must_use]
    pub fn positions(&self, body: &Body) -> Vec<[f32; 3]> {
        let gradients: Vec<DMat3> = (0..body.n_phyxels()).map(|i| body.gradient(i, &body.displacements)).collect();
        let moved = self.rest.iter().zip(&self.anchors).map(|(&rest, anchors)| {
            let displacement: DVec3 = anchors
                .iter()
                .map(|&Anchor { phyxel, weight, offset }| {
                    let i = phyxel as usize;
                    weight * (body.displacements[i] + gradients[i] * offset)
                })
                .sum();
            #[expect(clippy::cast_possible_truncation, reason = "rounds")]
            (rest + displacement).to_array().map(|x| x as f32)
        });
        moved.collect()
    }
}
