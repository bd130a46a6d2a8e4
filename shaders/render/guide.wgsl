// First hits of camera rays, for AOVs and denoisers. One sample of one pixel per invocation, in the same order as render/path.
//
// `?count` counts the tests of a ray, `?shape_lights` are the lights that it may hit, `?material` gives the BSDF, `?time` the
// time of the ray.
// use shared/invocation/index
// use shared/camera
// use shared/picture
// use shared/hash/ray_key
// use shared/facing
// use shared/surface
// use ?traverse
// use ?shape_lights
// use ?material
// use ?time

struct Guide {
    /// Unit normal of the triangle on the viewer's side, and the distance along the view axis.
    normal: vec3<f32>,
    depth: f32,
    /// Unit shading normal on the same side, and the number of boxes tested.
    shading_normal: vec3<f32>,
    n_boxes: f32,
    /// Albedo, and the number of triangles tested.
    albedo: vec3<f32>,
    n_triangles: f32,
    /// Index of the primitive in its mesh; `NONE` for a miss, `INCOMPLETE` if the traversal was cut short, so that nothing is known.
    primitive: u32,
    /// `NONE` for a miss and for a light.
    instance: u32,
}

/// 64 pixels per work-group, row by row.
@group(1) @binding(11) var<storage, read_write> guides: array<Guide>;

@compute @workgroup_size(64)
fn main(id: Invocation) {
    let group = group_index(id);
    let one = taken(group, id.local);
    if one.is_inside {
        choose_time(one);
        // Key of the first ray of a path.
        ray_key = derived_key(derived_key(0u, bits(picture.sampler, one.pixel, 0u, ALPHA_DIMENSION)), 0u);
        ray_sample = one.sample;
        var guide = guide_of(camera_ray(one));
        guide.primitive = select(guide.primitive, INCOMPLETE, is_incomplete);
        guides[64u * group + id.local] = guide;
    }
}

fn guide_of(camera: CameraRay) -> Guide {
    face_along(camera.ray.direction, SEEN);
    let hit = traverse(camera.ray, false);
    let tests = vec2<f32>(n_tested());
    let ray = camera.ray;
    let is_miss = hit.instance == NONE;
    let light_hit = intersect_shape_lights(Ray(ray.origin, ray.t_min, ray.direction, select(hit.t, ray.t_max, is_miss)));
    if light_hit.is_hit {
        let delta = light_hit.t * ray.direction;
        let normal = shape_light_normal(light_hit.number, ray.origin + delta);
        let facing = select(normal, -normal, dot(normal, ray.direction) > 0.0);
        let depth = dot(picture.forward, (ray.origin - picture.eye) + delta);
        return Guide(facing, depth, facing, tests.x, vec3(0.0), tests.y, 0u, NONE);
    }
    // The ground is as bright as the background, and a denoiser that knew it from the background would show its edge.
    if is_miss || hit.instance == picture.ground {
        return Guide(vec3(0.0), 0.0, vec3(0.0), tests.x, vec3(0.0), tests.y, NONE, NONE);
    }
    let surface = surface_at(hit, camera.ray, camera.cone);
    let depth = dot(picture.forward, surface.position - picture.eye);
    let albedo = denoiser_albedo(bsdf_of(surface));
    return Guide(
        surface.normal, depth, surface.shading_normal, tests.x, albedo, tests.y, hit.primitive, hit.instance
    );
}

/// Albedo for a denoiser: viewed from outside along the normal.
fn denoiser_albedo(bsdf: Bsdf) -> vec3<f32> {
    let root = (1.0 - bsdf.ior) / (1.0 + bsdf.ior);
    let gloss = (1.0 - bsdf.metallic) * bsdf.specular * root * root;
    return gloss + (1.0 - gloss) * bsdf.base_color;
}
