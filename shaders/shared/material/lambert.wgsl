// All materials are diffuse.
// use shared/scattering

fn bsdf_of(surface: Surface) -> Bsdf {
    return Bsdf(surface.base_color, 0.0, 1.0, 0.0, 0.0, 1.5, false, false);
}
