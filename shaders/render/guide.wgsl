// What camera rays meet first, beside their light: one sample of one pixel an invocation, as render/path takes them.
//
// `?count` counts the tests of the ray, `?shape_lights` are the lights that it may meet, `?material` tells how a surface shines; `?time`
// says when the ray flies.
// use shared/camera
// use shared/picture
// use shared/ray_key
// use shared/surface
// use shared/trace
// use ?shape_lights
// use ?material
// use ?time

struct Guide {
    /// Unit normal of the triangle, on the viewer's side, and the distance along the view axis.
    normal: vec3<f32>,
    depth: f32,
    /// Unit normal to shade with, on that side too, and the number of boxes tested.
    shading_normal: vec3<f32>,
    n_boxes: f32,
    /// What white light becomes, and the number of triangles tested.
    albedo: vec3<f32>,
    n_triangles: f32,
    /// The triangle, as its mesh numbers it; `NONE` for a miss.
    primitive: u32,
    /// `NONE` for a miss and for a light.
    instance: u32,
}

/// For each work-group its 64 pixels, row by row.
@group(1) @binding(11) var<storage, read_write> guides: array<Guide>;

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group_id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let group = group_id.y * groups.x + group_id.x;
    let one = taken(group, local);
    if one.is_inside {
        choose_time(one);
        // The key of a path's first ray.
        ray_key = derived_key(derived_key(0u, bits(picture.sampler, one.pixel, one.sample, PASSAGE)), 0u);
        guides[64u * group + local] = guide_of(camera_ray(one));
    }
}

fn guide_of(camera: CameraRay) -> Guide {
    let hit = traverse(camera.ray, false);
    let tests = vec2<f32>(n_tested());
    let ray = camera.ray;
    let is_miss = hit.instance == NONE;
    let met = intersect_shape_lights(Ray(ray.origin, ray.t_min, ray.direction, select(hit.t, ray.t_max, is_miss)));
    if met.is_hit {
        let way = met.t * ray.direction;
        let normal = shape_light_normal(met.number, ray.origin + way);
        let facing = select(normal, -normal, dot(normal, ray.direction) > 0.0);
        let depth = dot(picture.forward, (ray.origin - picture.eye) + way);
        return Guide(facing, depth, facing, tests.x, vec3(0.0), tests.y, 0u, NONE);
    }
    if is_miss {
        return Guide(vec3(0.0), 0.0, vec3(0.0), tests.x, vec3(0.0), tests.y, NONE, NONE);
    }
    let surface = surface_at(hit, camera.ray.direction, camera.cone);
    let depth = dot(picture.forward, surface.position - picture.eye);
    let albedo = white_becomes(bsdf_of(surface));
    return Guide(
        surface.normal, depth, surface.shading_normal, tests.x, albedo, tests.y, hit.primitive, hit.instance
    );
}

/// The colour of a surface for a denoiser: seen from outside along the normal.
fn white_becomes(bsdf: Bsdf) -> vec3<f32> {
    let root = (1.0 - bsdf.ior) / (1.0 + bsdf.ior);
    let gloss = (1.0 - bsdf.metallic) * bsdf.specular * root * root;
    return gloss + (1.0 - gloss) * bsdf.base_color;
}
