// The light of each light of the list, along one shadow ray; a Lambert surface of reflectance r sends r/pi of its irradiance in
// every direction.
// use shared/light/asked
// use shared/light/lights
// use shared/light/incoming
// use shared/iterations

/// Beyond all bounces, one dimension for each vertex and light.
const FIRST_LIGHT: u32 = 65536u;

/// Looks for the next light behind the first `n_asked` that may reach a surface: the side that the viewer sees, and only what lies
/// above both the triangle's and the shading normal's horizon. The ray to a light has its number, of those that `vertex_key`
/// stands for.
fn ask(one: PixelSample, vertex: u32, surface: Surface, vertex_key: u32, n_asked: u32) -> Asked {
    let n_lights = arrayLength(&lights);
    var asked = NOT_ASKED;
    for (var number = n_asked; number < n_lights && !asked.is_asked; number++) {
        iterations += 1u;
        asked.n_asked = number + 1u;
        let dimension = FIRST_LIGHT + vertex * n_lights + number;
        let incoming = incoming_light(lights[number], surface.position, square(one, dimension));
        let cosine = dot(surface.shading_normal, incoming.to_light);
        if incoming.reach == NO_LIGHT || cosine <= 0.0 || dot(surface.normal, incoming.to_light) <= 0.0 {
            continue;
        }
        let reflected = surface.base_color * (incoming.radiance * (cosine / PI));
        let is_near = incoming.reach == FINITE;
        let ray = towards(surface, select(incoming.to_light, incoming.place, is_near), is_near);
        if ray.t_max <= 0.0 {
            asked.free += reflected;
        } else if !shape_light_occludes(ray, number) {
            asked.is_asked = true;
            asked.radiance = reflected;
            asked.ray = ray;
            ray_key = derived_key(vertex_key, number);
        }
    }
    return asked;
}
