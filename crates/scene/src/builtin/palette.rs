use crate::{Material, MaterialId};

/// Materials of the built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Paint {
    /// Girder and pylons.
    Steel,
    /// Stays, rails and guys.
    Cable,
    /// Piers, slabs, counterweights.
    Concrete,
    /// The road.
    Asphalt,
    /// Cranes.
    Yellow,
    /// Every other band of the masts.
    Red,
    /// The other bands, and the cabins.
    White,
    /// Tubes of the scaffolds.
    Zinc,
    /// Planks and trunks.
    Wood,
    /// Conifers.
    Needles,
    /// Broad-leaved trees in autumn.
    Leaves,
    /// Reeds at the shore.
    Reed,
    /// Tufts on the meadow.
    Meadow,
    /// The river.
    Water,
    /// Its banks.
    Sand,
    /// Meadows nearby.
    Grass,
    /// Steep ground.
    Rock,
    /// Hills beyond, paler with distance.
    Hills,
    /// Mountains at the horizon.
    Mountains,
    /// The farthest of them.
    Haze,
}

impl Paint {
    /// Name and linear reflectance of every paint, in the order of the variants.
    ///
    /// Hills, mountains and haze imitate aerial perspective.
    const ALL: [(Self, &str, [f32; 3]); 20] = [
        (Self::Steel, "orange steel", [0.78, 0.19, 0.035]),
        (Self::Cable, "cable", [0.82, 0.80, 0.74]),
        (Self::Concrete, "concrete", [0.62, 0.59, 0.53]),
        (Self::Asphalt, "asphalt", [0.10, 0.10, 0.11]),
        (Self::Yellow, "yellow steel", [0.86, 0.50, 0.04]),
        (Self::Red, "red steel", [0.68, 0.03, 0.025]),
        (Self::White, "white steel", [0.85, 0.85, 0.83]),
        (Self::Zinc, "zinc", [0.55, 0.57, 0.60]),
        (Self::Wood, "wood", [0.42, 0.25, 0.11]),
        (Self::Needles, "needles", [0.035, 0.085, 0.030]),
        (Self::Leaves, "leaves", [0.30, 0.15, 0.025]),
        (Self::Reed, "reed", [0.34, 0.29, 0.09]),
        (Self::Meadow, "meadow", [0.30, 0.31, 0.08]),
        (Self::Water, "water", [0.055, 0.165, 0.19]),
        (Self::Sand, "sand", [0.42, 0.33, 0.21]),
        (Self::Grass, "grass", [0.27, 0.265, 0.075]),
        (Self::Rock, "rock", [0.25, 0.22, 0.18]),
        (Self::Hills, "hills", [0.21, 0.24, 0.13]),
        (Self::Mountains, "mountains", [0.26, 0.33, 0.36]),
        (Self::Haze, "haze", [0.40, 0.49, 0.58]),
    ];

    /// The materials, one per paint.
    pub(super) fn materials() -> Vec<Material> {
        let material = |(_, name, base_color): (Self, &str, [f32; 3])| Material {
            name: name.into(),
            base_color,
            ..Material::default()
        };
        Self::ALL.map(material).into()
    }

    /// Index of the paint in [`Self::materials`].
    pub(super) fn material(self) -> MaterialId {
        MaterialId(self as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::Paint;

    #[test]
    fn paints_are_listed_in_order() {
        for (i, (paint, ..)) in Paint::ALL.iter().enumerate() {
            assert_eq!(paint.material().0 as usize, i);
        }
    }
}
