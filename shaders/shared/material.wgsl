// choice full
// Materials with all parameters and textures.
// use shared/scattering

fn bsdf_of(surface: Surface) -> Bsdf {
    let material = materials[surface.material];
    let rough_metal = texel(material.rough_metal_slot, surface.lookup);
    let transmission = material.transmission * texel(material.transmission_slot, surface.lookup).r;
    let thin_walled = material.thin_walled != 0u;
    return Bsdf(
        surface.base_color,
        material.metallic * rough_metal.b,
        material.roughness * rough_metal.g,
        material.specular,
        transmission,
        material.ior,
        thin_walled,
        !surface.is_front && transmission > 0.0 && !thin_walled,
    );
}

// choice lambert
// All materials are diffuse.
// use shared/scattering

fn bsdf_of(surface: Surface) -> Bsdf {
    return Bsdf(surface.base_color, 0.0, 1.0, 0.0, 0.0, 1.5, false, false);
}
