//! The node hierarchy, traversed without recursion (glTF 2.0, section 3.5), and the cameras (section 3.10) and lights
//! (`KHR_lights_punctual`) of nodes.
//!
//! Transforms are in `f64`, so that a chain of nodes is rounded only once. Lights have photometric units (lux, candela), the scene
//! radiometric ones. The numbers are not converted, which only changes the exposure.

use canted_obb::Affine;
use canted_obb::vector::{add, cross, dot};
use gltf::json::camera::{Camera as SourceCamera, Type as CameraType};
use gltf::json::extensions::scene::khr_lights_punctual::{Light as SourceLight, Spot, Type as LightType};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;

use super::document::{Document, VISIBILITY};
use crate::read::error::{ReadError, WarningGroups};
use crate::read::mesh::unit;
use crate::{Camera, Light, Projection, Scene};

/// The nodes of a file.
pub(super) struct Nodes {
    /// World transform of each node.
    pub(super) world_from_node: Vec<Matrix>,
    /// Nodes of the default scene, ascending.
    drawn: Vec<usize>,
    /// Those that are not hidden by `KHR_node_visibility`, which has no effect on cameras.
    pub(super) visible: Vec<usize>,
}

/// Computes world transforms and finds the nodes of the default scene.
///
/// The default scene is `scene`, else the first one; a file without scenes draws all nodes.
///
/// # Errors
/// [`ReadError::Malformed`] if an index is invalid, or a node has two parents or is its own ancestor.
pub(super) fn read(document: &Document<'_>, grouped: &mut WarningGroups) -> Result<Nodes, ReadError> {
    let nodes = &document.root.nodes;
    let parents = parents(document)?;
    let mut world_from_node = nodes
        .iter()
        .enumerate()
        .map(|(k, node)| local(node).ok_or_else(|| last_row_error(document, k)))
        .collect::<Result<Vec<Matrix>, _>>()?;

    let roots: Vec<usize> = (0..nodes.len()).filter(|&k| parents[k].is_none()).collect();
    let mut is_reached: Vec<bool> = parents.iter().map(Option::is_none).collect();
    descend(nodes, &roots, |parent, child| {
        is_reached[child] = true;
        world_from_node[child] = world_from_node[parent].after(&world_from_node[child]);
    });
    if let Some(unreached) = is_reached.iter().position(|is_reached| !is_reached) {
        return Err(cycle_error(document, &parents, unreached));
    }

    let scene_roots = match default_scene(document)? {
        Some(scene) => scene_roots(document, scene, &parents, grouped)?,
        None => roots,
    };
    let mut is_drawn = vec![false; nodes.len()];
    let mut stack = scene_roots;
    while let Some(node) = stack.pop() {
        // A root may be below another.
        if !std::mem::replace(&mut is_drawn[node], true) {
            stack.extend(children(&nodes[node]));
        }
    }
    let drawn: Vec<usize> = (0..nodes.len()).filter(|&k| is_drawn[k]).collect();
    let visible = visible(nodes, &drawn);
    Ok(Nodes { world_from_node, drawn, visible })
}

/// The nodes among `drawn` that are not hidden, as none above them is.
fn visible(nodes: &[Node], drawn: &[usize]) -> Vec<usize> {
    let hides = |node: &Node| {
        let extension = node.extensions.as_ref().and_then(|all| all.others.get(VISIBILITY));
        extension.and_then(|extension| extension.get("visible")?.as_bool()) == Some(false)
    };
    let mut stack: Vec<usize> = (0..nodes.len()).filter(|&k| hides(&nodes[k])).collect();
    let mut is_hidden = vec![false; nodes.len()];
    while let Some(node) = stack.pop() {
        if !std::mem::replace(&mut is_hidden[node], true) {
            stack.extend(children(&nodes[node]));
        }
    }
    drawn.iter().copied().filter(|&k| !is_hidden[k]).collect()
}

/// Visits all descendants of `roots`, parents first.
fn descend(nodes: &[Node], roots: &[usize], mut visit: impl FnMut(usize, usize)) {
    let mut stack = roots.to_vec();
    while let Some(parent) = stack.pop() {
        for child in children(&nodes[parent]) {
            visit(parent, child);
            stack.push(child);
        }
    }
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

/// The parent of each node.
fn parents(document: &Document<'_>) -> Result<Vec<Option<usize>>, ReadError> {
    let nodes = &document.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for child in children(node) {
            document.get(nodes, child, "node", &format!("node {parent}"))?;
            if let Some(first) = parents[child].replace(parent) {
                return Err(
                    document.malformed(format!("node {child}"), format!("child of two nodes, {first} and {parent}"))
                );
            }
        }
    }
    Ok(parents)
}

/// Local transform of a node; `None` for a matrix that is not affine.
fn local(node: &Node) -> Option<Matrix> {
    if let Some(matrix) = &node.matrix {
        return Matrix::from_4x4(matrix);
    }
    let rotation = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0);
    Some(Matrix::from_parts(node.translation.unwrap_or_default(), rotation, node.scale.unwrap_or([1.0; 3])))
}

/// Index of the scene to draw.
fn default_scene(document: &Document<'_>) -> Result<Option<usize>, ReadError> {
    let scenes = &document.root.scenes;
    let Some(scene) = document.root.scene else { return Ok((!scenes.is_empty()).then_some(0)) };
    document.get(scenes, scene.value(), "scene", "default scene")?;
    Ok(Some(scene.value()))
}

/// The distinct root nodes of a scene. A root that has a parent is drawn once, placed as the parent's child.
fn scene_roots(
    document: &Document<'_>,
    scene: usize,
    parents: &[Option<usize>],
    grouped: &mut WarningGroups,
) -> Result<Vec<usize>, ReadError> {
    let location = format!("scene {scene}");
    let mut roots: Vec<usize> = document.root.scenes[scene].nodes.iter().map(|node| node.value()).collect();
    roots.sort_unstable();
    roots.dedup();
    for &root in &roots {
        let parent = document.get(parents, root, "node", &location)?;
        if let Some(parent) = parent {
            grouped.add(
                &format!("placing a root of {location} as a child of its parent"),
                &format!("node {root} of {parent}"),
            );
        }
    }
    Ok(roots)
}

fn last_row_error(document: &Document<'_>, node: usize) -> ReadError {
    document.malformed(format!("node {node}"), "the last row of its matrix is not 0 0 0 1")
}

/// The error for a cycle above the node `unreached`. Each node has at most one parent.
fn cycle_error(document: &Document<'_>, parents: &[Option<usize>], unreached: usize) -> ReadError {
    // Without a root above, as many steps up as there are nodes end inside the cycle.
    let in_cycle = parents.iter().fold(unreached, |node, _| parents[node].unwrap_or(node));
    document.malformed(format!("node {in_cycle}"), "node is its own ancestor")
}

/// Largest error of the last row of a matrix: 256 roundings of numbers around 1, as chains of products in exporters leave.
const MAX_ROUNDING: f32 = 128.0 * f32::EPSILON;

/// An affine transform as in [`Affine`]: images of the three axes and of the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Matrix {
    pub(super) columns: [[f64; 3]; 4],
}

impl Matrix {
    /// The identity.
    pub(super) const IDENTITY: Self =
        Self { columns: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]] };

    /// From a column-major 4 x 4 matrix; `None` if the last row is not `0 0 0 1` up to the roundings of a product of matrices.
    pub(super) fn from_4x4(numbers: &[f32; 16]) -> Option<Self> {
        let column = |k: usize| std::array::from_fn(|row| f64::from(numbers[4 * k + row]));
        let last_row = [numbers[3], numbers[7], numbers[11], numbers[15]];
        let is_affine = last_row.iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(x, y)| (x - y).abs() <= MAX_ROUNDING);
        is_affine.then(|| Self { columns: std::array::from_fn(column) })
    }

    /// Scale, then rotation by a quaternion `x y z w`, then translation.
    ///
    /// The quaternion is normalized, so that rounded components do not scale.
    pub(super) fn from_parts(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Self {
        let [x, y, z, w] = rotation.map(f64::from);
        let twice = 2.0 / (x * x + y * y + z * z + w * w);
        let axes = [
            [1.0 - twice * (y * y + z * z), twice * (x * y + z * w), twice * (x * z - y * w)],
            [twice * (x * y - z * w), 1.0 - twice * (x * x + z * z), twice * (y * z + x * w)],
            [twice * (x * z + y * w), twice * (y * z - x * w), 1.0 - twice * (x * x + y * y)],
        ];
        let [a, b, c] = std::array::from_fn(|k| axes[k].map(|axis: f64| axis * f64::from(scale[k])));
        Self { columns: [a, b, c, translation.map(f64::from)] }
    }

    /// `self * inner`.
    pub(super) fn after(&self, inner: &Self) -> Self {
        let [a, b, c, origin] = inner.columns;
        Self { columns: [self.vector(a), self.vector(b), self.vector(c), self.point(origin)] }
    }

    /// Transforms a point.
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        add(self.vector(p), self.columns[3])
    }

    /// Transforms a vector.
    pub(super) fn vector(&self, v: [f64; 3]) -> [f64; 3] {
        let c = &self.columns;
        std::array::from_fn(|k| c[0][k] * v[0] + c[1][k] * v[1] + c[2][k] * v[2])
    }

    /// Transforms a normal by the cofactor matrix, with the sign of the determinant; not normalized.
    pub(super) fn normal(&self, n: [f64; 3]) -> [f64; 3] {
        let [a, b, c, _] = self.columns;
        let rows = [cross(b, c), cross(c, a), cross(a, b)];
        let sign = self.sign();
        std::array::from_fn(|k| sign * (rows[0][k] * n[0] + rows[1][k] * n[1] + rows[2][k] * n[2]))
    }

    /// Sign of the determinant; -1 for mirroring transforms.
    pub(super) fn sign(&self) -> f64 {
        let [a, b, c, _] = self.columns;
        dot(a, cross(b, c)).signum()
    }

    /// `self + weight * other`, for skinning.
    pub(super) fn add_scaled(&self, weight: f64, other: &Self) -> Self {
        let entry = |k: usize, row: usize| self.columns[k][row] + weight * other.columns[k][row];
        Self { columns: std::array::from_fn(|k| std::array::from_fn(|row| entry(k, row))) }
    }

    /// The transform in single precision; `None` if it is not invertible there.
    ///
    /// Rounding changes each entry by a factor within 1 ± u, and the determinant by at most `((1 + u)³ - 1)` times the
    /// permanent of the absolute entries. Below that bound the exact transform may be singular.
    pub(super) fn rounded(&self) -> Option<Affine> {
        let affine = Affine { columns: self.columns.map(|column| column.map(|x| x as f32)) };
        let [a, b, c, origin] = affine.columns.map(|column| column.map(f64::from));
        let determinant = dot(a, cross(b, c));
        let permanent = dot(a.map(f64::abs), cross_of_absolutes(b, c));
        let rows = [cross(b, c), cross(c, a), cross(a, b)];
        let largest_of_inverse = rows
            .iter()
            .flat_map(|&row| row.into_iter().chain([dot(row, origin)]))
            .fold(0.0, |most: f64, x| most.max(x.abs()))
            / determinant.abs();
        let has_inverse = affine.is_finite()
            && determinant.abs() > DETERMINANT_ERROR * permanent
            && largest_of_inverse <= f64::from(f32::MAX);
        has_inverse.then_some(affine)
    }
}

/// Error of a 3 x 3 determinant of entries rounded to `f32`, relative to the permanent of the absolute entries.
///
/// Each product has three roundings by u = 2⁻²⁴: `(1 + u)³ - 1 < 3u / (1 - 3u)`. The arithmetic adds at most five roundings
/// by 2⁻⁵³, which the factor 4 covers.
const DETERMINANT_ERROR: f64 = 4.0 * U / (1.0 - 4.0 * U);
/// Unit roundoff of `f32`.
const U: f64 = f32::EPSILON as f64 / 2.0;

/// [`cross`] with sums of absolute products.
fn cross_of_absolutes(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        (a[i] * b[j]).abs() + (a[j] * b[i]).abs()
    })
}

/// Adds the cameras of the default scene; skips invalid ones with a warning.
pub(super) fn read_cameras(document: &Document<'_>, nodes: &Nodes, scene: &mut Scene) -> Result<(), ReadError> {
    for &k in &nodes.drawn {
        let Some(index) = document.root.nodes[k].camera else { continue };
        let source = document.get(&document.root.cameras, index.value(), "camera", &format!("node {k}"))?;
        match projection(source).and_then(|projection| placed(&nodes.world_from_node[k], projection)) {
            Ok(camera) => {
                scene.cameras.push(camera);
                let name = source.name.as_ref().or(document.root.nodes[k].name.as_ref());
                scene.camera_names.push(name.cloned().unwrap_or_default());
            }
            Err(why) => scene.warnings.push(format!("skipping camera {} of node {k}: {why}", index.value())),
        }
    }
    Ok(())
}

/// The projection; the aspect ratio is ignored.
fn projection(source: &SourceCamera) -> Result<Projection, String> {
    match (source.type_, &source.perspective, &source.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(lens), _) => {
            let yfov_rad = lens.yfov;
            if !(yfov_rad > 0.0 && yfov_rad < std::f32::consts::PI) {
                return Err(format!("field of view of {yfov_rad} radians is not between 0 and pi"));
            }
            Ok(Projection::Perspective { fov_degrees: f64::from(yfov_rad).to_degrees() as f32 })
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(lens)) => {
            // `ymag` is half the height.
            let height = 2.0 * lens.ymag;
            if !(height > 0.0 && height.is_finite()) {
                return Err(format!("ymag of {} is not greater than 0", lens.ymag));
            }
            Ok(Projection::Orthographic { height })
        }
        _ => Err("no projection".to_owned()),
    }
}

/// A camera at the node's origin that looks along -z, with y up; ignores scale and shear of the node.
fn placed(world_from_node: &Matrix, projection: Projection) -> Result<Camera, String> {
    let eye = world_from_node.columns[3];
    let direction = world_from_node.vector([0.0, 0.0, -1.0]);
    let up = world_from_node.vector([0.0, 1.0, 0.0]);
    let (Some(direction_unit), Some(up_unit)) = (unit(direction), unit(up)) else {
        return Err("its node has no orientation".to_owned());
    };
    // Far enough from the eye that rounding the target to `f32` hardly changes the view direction.
    let distance = eye.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
    let target = std::array::from_fn(|k| (eye[k] + distance * f64::from(direction_unit[k])) as f32);
    let eye: [f32; 3] = eye.map(|x| x as f32);
    let side = cross(direction_unit.map(f64::from), up_unit.map(f64::from));
    let is_placed = eye.iter().chain(&target).all(|x: &f32| x.is_finite()) && eye != target && dot(side, side) > 0.0;
    is_placed
        .then_some(Camera { eye, target, up: up_unit, projection, lens: None })
        .ok_or_else(|| "its node has no orientation".to_owned())
}

/// Adds the visible lights of the default scene; skips invalid ones with a warning.
pub(super) fn read_lights(
    document: &Document<'_>,
    nodes: &Nodes,
    grouped: &mut WarningGroups,
    scene: &mut Scene,
) -> Result<(), ReadError> {
    let lights: &[SourceLight] = document.root.as_ref();
    for &k in &nodes.visible {
        let extensions = document.root.nodes[k].extensions.as_ref();
        let Some(named) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else { continue };
        let index = named.light.value();
        let source = document.get(lights, index, "light", &format!("node {k}"))?;
        if source.range.is_some() {
            grouped.add("ignoring the range of lights (not physical)", &format!("light {index}"));
        }
        match light(source, &nodes.world_from_node[k]) {
            Ok(light) => scene.lights.push(light),
            Err(why) => scene.warnings.push(format!("skipping light {index} of node {k}: {why}")),
        }
    }
    Ok(())
}

/// A light at the node's origin, directed along its -z axis.
fn light(source: &SourceLight, world_from_node: &Matrix) -> Result<Light, String> {
    let power = source.color.map(|x| x * source.intensity);
    if !power.iter().all(|x| x.is_finite() && *x >= 0.0) {
        return Err(format!(
            "color {:?} and intensity {} must be finite and not negative",
            source.color, source.intensity
        ));
    }
    let position = world_from_node.columns[3].map(|x| x as f32);
    let is_somewhere = position.iter().all(|x| x.is_finite());
    let direction = unit(world_from_node.vector([0.0, 0.0, -1.0]));
    match source.type_ {
        Checked::Valid(LightType::Directional) => {
            Ok(Light::Sun { direction: direction.ok_or("its node has no orientation")?, irradiance: power })
        }
        Checked::Valid(_) if !is_somewhere => Err("its position is not finite".to_owned()),
        Checked::Valid(LightType::Point) => Ok(Light::Point { position, intensity: power }),
        Checked::Valid(LightType::Spot) => {
            let direction = direction.ok_or("its node has no orientation")?;
            let [cos_inner, cos_outer] = cosines(source.spot.as_ref())?;
            Ok(Light::Spot { position, direction, intensity: power, cos_inner, cos_outer })
        }
        Checked::Invalid => Err("unknown type".to_owned()),
    }
}

/// Cosines of a spot's inner and outer angle; the defaults are 0 and pi / 4.
fn cosines(spot: Option<&Spot>) -> Result<[f32; 2], String> {
    let (inner, outer) =
        spot.map_or((0.0, std::f32::consts::FRAC_PI_4), |spot| (spot.inner_cone_angle, spot.outer_cone_angle));
    let cosines = [inner, outer].map(|angle_rad| f64::from(angle_rad).cos() as f32);
    let is_cone = inner >= 0.0 && inner < outer && f64::from(outer) <= FRAC_PI_2_ROUNDED;
    if !is_cone {
        return Err(format!("cone angles {inner} and {outer} must satisfy 0 <= inner < outer <= pi/2"));
    }
    if cosines[0] == cosines[1] {
        let limit = format!("the smallest cone from 0 is {MIN_CONE_RAD}");
        return Err(format!("cosines of cone angles {inner} and {outer} are equal in single precision ({limit})"));
    }
    Ok(cosines)
}

/// Smallest angle, rounded up, whose cosine differs from 1 in single precision: 2^-12.
const MIN_CONE_RAD: f64 = 0.000245;

/// A right angle rounded to single precision, slightly larger than pi / 2.
const FRAC_PI_2_ROUNDED: f64 = std::f32::consts::FRAC_PI_2 as f64;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NO_ROTATION: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

    /// Integers small enough for exact arithmetic.
    fn integers() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3((-9..10_i8).prop_map(f64::from))
    }

    proptest! {
        /// A transformed normal is the normal of transformed edges, up to the sign of the determinant.
        #[test]
        fn transformed_normals_stay_perpendicular(axes in prop::array::uniform3(integers()), u in integers(), v in integers()) {
            let [a, b, c] = axes;
            let determinant = dot(a, cross(b, c));
            prop_assume!(determinant != 0.0);
            let matrix = Matrix { columns: [a, b, c, [0.0; 3]] };
            let want = cross(matrix.vector(u), matrix.vector(v)).map(|x| determinant.signum() * x);
            prop_assert_eq!(matrix.normal(cross(u, v)), want);
        }

        #[test]
        fn composition_applies_inner_first(outer in prop::array::uniform4(integers()), inner in prop::array::uniform4(integers()), p in integers()) {
            let (outer, inner) = (Matrix { columns: outer }, Matrix { columns: inner });
            prop_assert_eq!(outer.after(&inner).point(p), outer.point(inner.point(p)));
        }
    }

    #[test]
    fn near_singular_transforms_are_rejected_by_the_rounding_bound() {
        let turned = Matrix::from_parts([0.0; 3], [0.0, 0.0, 0.382_683_43, 0.923_879_5], [1.0; 3]);
        assert!(turned.rounded().is_some());
        // Two nearly parallel columns: rounding may change the sign of the determinant.
        let sheared = |angle_rad: f64| {
            let mut flat = Matrix::IDENTITY;
            flat.columns[1] = [1.0, angle_rad, 0.0];
            turned.after(&flat).rounded()
        };
        assert!(sheared(1e-5).is_some());
        assert!(sheared(1e-8).is_none());
        // Short but not parallel columns are fine.
        let thin = Matrix::from_parts([0.0; 3], NO_ROTATION, [1.0, 1e-8, 1.0]);
        assert!(turned.after(&thin).rounded().is_some());
    }

    #[test]
    fn transforms_with_overflowing_inverse_are_rejected() {
        let scaled = |scale: f32| Matrix::from_parts([1.0, 0.0, 0.0], NO_ROTATION, [scale; 3]).rounded();
        assert!(scaled(1e-38).is_some());
        assert!(scaled(1e-39).is_none());
        assert!(scaled(1e38).is_some());
        assert!(scaled(f32::INFINITY).is_none());
    }
}
