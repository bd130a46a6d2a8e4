//! Converts MTL materials, without textures.

use crate::read::mtl::MtlMaterial;
use crate::{AlphaMode, Material};

/// Converts a material.
///
/// The default is Lambertian: exporters write a gray `Ks` and some `Ns` for materials they do not support, so these alone do not
/// add a specular lobe. `Pr` and `Pm` give a metallic-roughness material, `illum` 3 and 5 a mirror of color `Ks` and texture
/// `map_Ks`, `illum` 4, 6, 7 and 9 glass of color `Tf` with index `Ni`; both are smooth without `Pr`. Alpha is `d`, or 1 - `Tr`; glass has none. `d`
/// takes precedence because some exporters invert `Tr`.
pub(super) fn surface(name: String, source: &MtlMaterial) -> Material {
    let plain = Material { name, ..Material::default() };
    let default_color = if source.base_color_map.is_some() { [1.0; 3] } else { plain.base_color };
    let base_color = source.base_color.unwrap_or(default_color);
    let smooth = source.roughness.unwrap_or(0.0);
    let mut material = Material { base_color, emission: source.emission.unwrap_or_default(), ..plain };
    let is_physical = source.roughness.is_some()
        || source.metallic.is_some()
        || source.roughness_map.is_some()
        || source.metallic_map.is_some();
    match source.illumination {
        Some(4 | 6 | 7 | 9) => {
            material.base_color = source.filter.unwrap_or([1.0; 3]);
            (material.specular, material.transmission) = (1.0, 1.0);
            material.roughness = smooth;
            material.ior = source.ior.unwrap_or(material.ior);
            return material;
        }
        _ if is_mirror(source) => {
            let of_map = source.specular_map.as_ref().map(|_| [1.0; 3]);
            material.base_color = source.specular.or(of_map).unwrap_or(base_color);
            (material.specular, material.metallic) = (1.0, 1.0);
            material.roughness = smooth;
        }
        _ if is_physical => {
            // Without their number, maps are not scaled.
            let of_map = |map: bool| map.then_some(1.0);
            material.specular = 1.0;
            material.metallic = source.metallic.or(of_map(source.metallic_map.is_some())).unwrap_or(0.0);
            let rough = source.roughness.or(of_map(source.roughness_map.is_some()));
            material.roughness = rough.unwrap_or_else(|| roughness(source.shininess));
        }
        _ => {}
    }
    let alpha = source.opacity.or_else(|| source.transparency.map(|transparency| 1.0 - transparency));
    if let Some(alpha) = alpha.filter(|&alpha| alpha < 1.0 && source.mask.is_none()) {
        material.alpha = alpha;
        material.alpha_mode = AlphaMode::Blend;
    }
    material
}

/// Whether the material is a mirror of color `Ks`, which replaces `Kd`.
pub(super) fn is_mirror(source: &MtlMaterial) -> bool {
    matches!(source.illumination, Some(3 | 5)) && source.metallic.is_none() && source.metallic_map.is_none()
}

/// Roughness from a shininess of 1000 (1 - roughness)², as Blender writes it; 1 if absent.
fn roughness(shininess: Option<f32>) -> f32 {
    1.0 - (shininess.unwrap_or(0.0) / 1000.0).min(1.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(source: MtlMaterial) -> Material {
        surface(String::new(), &source)
    }

    #[test]
    fn exporter_defaults_are_lambertian() {
        let source = MtlMaterial {
            base_color: Some([0.5; 3]),
            specular: Some([0.5; 3]),
            shininess: Some(250.0),
            illumination: Some(2),
            ior: Some(1.45),
            opacity: Some(1.0),
            ..MtlMaterial::default()
        };
        assert_eq!(of(source), Material { base_color: [0.5; 3], ..Material::default() });
    }

    #[test]
    fn converts_mirrors_metals_and_glass() {
        let mirror = MtlMaterial { illumination: Some(3), specular: Some([0.9, 0.8, 0.7]), ..MtlMaterial::default() };
        let want = Material {
            base_color: [0.9, 0.8, 0.7],
            metallic: 1.0,
            roughness: 0.0,
            specular: 1.0,
            ..Material::default()
        };
        assert_eq!(of(mirror.clone()), want);
        let metal = MtlMaterial { base_color: Some([1.0, 0.5, 0.0]), metallic: Some(0.75), ..mirror };
        let want = Material {
            base_color: [1.0, 0.5, 0.0],
            metallic: 0.75,
            roughness: 1.0,
            specular: 1.0,
            ..Material::default()
        };
        assert_eq!(of(metal), want);
        for illumination in [4, 6, 7, 9] {
            let glass = MtlMaterial {
                illumination: Some(illumination),
                ior: Some(1.25),
                opacity: Some(0.0),
                base_color: Some([0.0; 3]),
                ..MtlMaterial::default()
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
    fn roughness_falls_back_to_shininess() {
        let with = |roughness, shininess| {
            of(MtlMaterial { metallic: Some(0.0), roughness, shininess, ..MtlMaterial::default() }).roughness
        };
        assert_eq!(with(Some(0.25), Some(10.0)), 0.25);
        for (shininess, want) in [(None, 1.0), (Some(0.0), 1.0), (Some(250.0), 0.5), (Some(1e30), 0.0)] {
            assert_eq!(with(None, shininess), want);
        }
    }

    #[test]
    fn opacity_takes_precedence_over_transparency() {
        let with = |opacity, transparency| {
            let material = of(MtlMaterial { opacity, transparency, ..MtlMaterial::default() });
            (material.alpha, material.alpha_mode)
        };
        assert_eq!(with(Some(0.25), None), (0.25, AlphaMode::Blend));
        assert_eq!(with(None, Some(0.25)), (0.75, AlphaMode::Blend));
        assert_eq!(with(Some(1.0), Some(1.0)), (1.0, AlphaMode::Opaque));
        assert_eq!(with(None, Some(0.0)), (1.0, AlphaMode::Opaque));
    }
}
