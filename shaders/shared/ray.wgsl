// Rays and hits in the layout of the host.

/// No primitive, no instance; the instance of a miss.
const NONE: u32 = 0xffffffffu;

/// Instance of a ray whose traversal ended early: the result is unknown.
const INCOMPLETE: u32 = 0xfffffffeu;

/// Stands for infinity.
const FAR: f32 = 3e38;

/// `origin + t * direction` for `t_min <= t <= t_max`. All numbers are finite, the direction is not zero, `0 <= t_min` and
/// `t_max <= FAR`.
struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

/// Hit of a triangle: weights `u` and `v` of the second and third vertex, `t` in units of the ray's direction.
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

/// Whether `a` precedes `b`: smallest `t`, then lowest instance, then lowest primitive.
fn before(a: Hit, b: Hit) -> bool {
    if a.t != b.t {
        return a.t < b.t;
    }
    if a.instance != b.instance {
        return a.instance < b.instance;
    }
    return a.primitive < b.primitive;
}
