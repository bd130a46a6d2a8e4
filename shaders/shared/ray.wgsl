// Rays and hits, as hosts lay them out.

/// No primitive, no instance; the instance of a miss.
const NONE: u32 = 0xffffffffu;

/// The instance of a ray whose walk was cut short: the answer is not known.
const INCOMPLETE: u32 = 0xfffffffeu;

/// Farther than anything: what stands for infinity.
const FAR: f32 = 3e38;

/// `origin + t * direction` for `t_min <= t <= t_max`. Numbers are finite, the direction has any length but zero,
/// `0 <= t_min` and `t_max <= FAR`.
struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

/// Where a ray meets a triangle: weights `u` and `v` of its second and third vertex, `t` in units of the ray's direction.
struct Hit {
    t: f32,
    u: f32,
    v: f32,
    primitive: u32,
    instance: u32,
}

/// No hit.
fn miss() -> Hit {
    return Hit(FAR, 0.0, 0.0, NONE, NONE);
}

/// Whether `a` comes first: least `t`, then lowest instance, then lowest primitive.
fn before(a: Hit, b: Hit) -> bool {
    if a.t != b.t {
        return a.t < b.t;
    }
    if a.instance != b.instance {
        return a.instance < b.instance;
    }
    return a.primitive < b.primitive;
}
