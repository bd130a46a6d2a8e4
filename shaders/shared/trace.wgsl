// Questions to the scene.
// use shared/ray
// use ?traverse

/// The first hit that the mask accepts; of equal `t` the lowest instance, then the lowest primitive.
///
/// A primitive is numbered as in its mesh, an instance as in the scene, whatever the levels.
fn closest_hit(ray: Ray) -> Hit {
    return traverse(ray, false);
}

/// Whether there is any hit that the mask accepts.
fn occluded(ray: Ray) -> bool {
    return traverse(ray, true).instance != NONE;
}
