use crate::bound::Enclosure;
use crate::round::U;
use crate::vector::{self, Vector};
use crate::{Affine, Obb, frame};

impl Obb {
    /// A box that contains the exact image of this one; its axes are the images of the axes, skewed where the map
    /// shears.
    ///
    /// The axes have lengths between one and four. An axis that the map flattens to a point is replaced by one
    /// perpendicular to the others. Where the map makes the axes dependent, the axis-aligned box of the image is returned.
    #[must_use]
    pub fn transformed(&self, to_from_self: &Affine) -> Self {
        let center = to_from_self.point_f64(vector::to_f64(self.center));
        let directions = self.frame.map(|axis| to_from_self.vector_f64(vector::to_f64(axis)));
        let sides: [Vector; 3] =
            core::array::from_fn(|a| vector::scale(directions[a], f64::from(self.half_extents[a])));
        // Products of two f32 are exact in f64. A coordinate of the center then takes three roundings, one of a side
        // two and a third for its half-extent, each relative to the sum of absolute terms; the fourth unit covers the
        // sum itself.
        let reach: Vector = core::array::from_fn(|k| {
            let sides = (0..3).map(|a| f64::from(self.frame[a][k].abs()) * f64::from(self.half_extents[a]));
            f64::from(self.center[k].abs()) + sides.sum::<f64>()
        });
        let magnitude: Vector = core::array::from_fn(|k| {
            let linear = (0..3).map(|j| f64::from(to_from_self.columns[j][k].abs()) * reach[j]);
            f64::from(to_from_self.columns[3][k].abs()) + linear.sum::<f64>()
        });
        let limit = f64::from(f32::MAX);
        let origin = vector::to_f32(center.map(|x| x.clamp(-limit, limit)));
        let mut enclosure = Enclosure::new(frame::complete(directions), origin);
        enclosure.add_parallelepiped(center, sides, 4.0 * U * vector::reach(magnitude));
        enclosure.finish()
    }

    /// A box with these axes that contains every point that is within `distance` of a point of this one in each coordinate.
    ///
    /// Axes too close to dependent are replaced by those of the coordinates.
    #[must_use]
    pub fn grown(&self, distance: f64) -> Self {
        let mut enclosure = Enclosure::new(self.frame, self.center);
        let sides = core::array::from_fn(|a| {
            // A product of two f32 is exact in f64.
            vector::scale(vector::to_f64(self.frame[a]), f64::from(self.half_extents[a]))
        });
        enclosure.add_parallelepiped(vector::to_f64(self.center), sides, distance);
        enclosure.finish()
    }
}
