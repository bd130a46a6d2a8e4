//! What surface a material of a library means, textures aside.

use crate::read::mtl::Recipe;
use crate::{AlphaMode, Material};

/// The surface of a recipe.
///
/// A plain one is Lambert: exporters write a grey `Ks` and some `Ns` for whatever they do not know, so that those alone
/// are no gloss. `Pr` and `Pm` make it what glTF would, `illum` 3 and 5 a mirror in the colour `Ks`, 4, 6, 7 and 9 glass
/// in the colour `Tf` with the refraction `Ni`; both are smooth where `Pr` does not say otherwise. `d`, or 1 - `Tr`, is
/// alpha; glass needs none, and where both stand `d` counts, for some write `Tr` the wrong way round.
pub(super) fn surface(name: String, recipe: &Recipe) -> Material {
    let plain = Material { name, ..Material::default() };
    let uncoloured = if recipe.base_color_map.is_some() { [1.0; 3] } else { plain.base_color };
    let base_color = recipe.base_color.unwrap_or(uncoloured);
    let smooth = recipe.roughness.unwrap_or(0.0);
    let mut material = Material { base_color, emission: recipe.emission.unwrap_or_default(), ..plain };
    match recipe.illumination {
        Some(4 | 6 | 7 | 9) => {
            material.base_color = recipe.filter.unwrap_or([1.0; 3]);
            (material.specular, material.transmission) = (1.0, 1.0);
            material.roughness = smooth;
            material.ior = recipe.ior.unwrap_or(material.ior);
            return material;
        }
        Some(3 | 5) if recipe.metallic.is_none() => {
            material.base_color = recipe.specular.unwrap_or(base_color);
            (material.specular, material.metallic) = (1.0, 1.0);
            material.roughness = smooth;
        }
        _ if recipe.roughness.is_some() || recipe.metallic.is_some() => {
            material.specular = 1.0;
            material.metallic = recipe.metallic.unwrap_or(0.0);
            material.roughness = recipe.roughness.unwrap_or_else(|| roughness(recipe.shininess));
        }
        _ => {}
    }
    let alpha = recipe.opacity.or_else(|| recipe.transparency.map(|transparency| 1.0 - transparency));
    if let Some(alpha) = alpha.filter(|&alpha| alpha < 1.0 && recipe.mask.is_none()) {
        material.alpha = alpha;
        material.alpha_mode = AlphaMode::Blend;
    }
    material
}

/// Roughness of a shininess, which Blender writes as 1000 (1 - roughness)²; rough where there is none.
fn roughness(shininess: Option<f32>) -> f32 {
    1.0 - (shininess.unwrap_or(0.0) / 1000.0).min(1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(recipe: Recipe) -> Material {
        surface(String::new(), &recipe)
    }

    #[test]
    fn gloss_of_exporters_is_none() {
        let recipe = Recipe {
            base_color: Some([0.5; 3]),
            specular: Some([0.5; 3]),
            shininess: Some(250.0),
            illumination: Some(2),
            ior: Some(1.45),
            opacity: Some(1.0),
            ..Recipe::default()
        };
        assert_eq!(of(recipe), Material { base_color: [0.5; 3], ..Material::default() });
    }

    #[test]
    fn mirrors_metals_and_glass() {
        let mirror = Recipe { illumination: Some(3), specular: Some([0.9, 0.8, 0.7]), ..Recipe::default() };
        let want = Material {
            base_color: [0.9, 0.8, 0.7],
            metallic: 1.0,
            roughness: 0.0,
            specular: 1.0,
            ..Material::default()
        };
        assert_eq!(of(mirror.clone()), want);
        let metal = Recipe { base_color: Some([1.0, 0.5, 0.0]), metallic: Some(0.75), ..mirror };
        let want = Material {
            base_color: [1.0, 0.5, 0.0],
            metallic: 0.75,
            roughness: 1.0,
            specular: 1.0,
            ..Material::default()
        };
        assert_eq!(of(metal), want);
        for illumination in [4, 6, 7, 9] {
            let glass = Recipe {
                illumination: Some(illumination),
                ior: Some(1.25),
                opacity: Some(0.0),
                base_color: Some([0.0; 3]),
                ..Recipe::default()
            };
            let want = Material {
                base_color: [1.0; 3],
                transmission: 1.0,
                roughness: 0.0,
                specular: 1.0,
                ior: 1.25,
                ..Material::default()
            };
            assert_eq!(of(glass), want);
        }
    }

    #[test]
    fn roughness_is_stated_or_follows_from_shininess() {
        let with = |roughness, shininess| {
            of(Recipe { metallic: Some(0.0), roughness, shininess, ..Recipe::default() }).roughness
        };
        assert_eq!(with(Some(0.25), Some(10.0)), 0.25);
        for (shininess, want) in [(None, 1.0), (Some(0.0), 1.0), (Some(250.0), 0.5), (Some(1e30), 0.0)] {
            assert_eq!(with(None, shininess), want);
        }
    }

    #[test]
    fn opacity_counts_before_transparency() {
        let with = |opacity, transparency| {
            let material = of(Recipe { opacity, transparency, ..Recipe::default() });
            (material.alpha, material.alpha_mode)
        };
        assert_eq!(with(Some(0.25), None), (0.25, AlphaMode::Blend));
        assert_eq!(with(None, Some(0.25)), (0.75, AlphaMode::Blend));
        assert_eq!(with(Some(1.0), Some(1.0)), (1.0, AlphaMode::Opaque));
        assert_eq!(with(None, Some(0.0)), (1.0, AlphaMode::Opaque));
    }
}
