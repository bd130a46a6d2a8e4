//! Wide BVHs of presets, and their tables as text and as JSON.

use std::fmt::Write;

use anyhow::Result;
use canted_lbvh::stages::{self, Stage};
use canted_obb::{Affine, Obb};
use canted_renderer::{BottomLevel, SceneBvh, SceneBvhConfig};
use canted_scene::{Instance, Mesh, MeshId, Scene};
use canted_trace::Intersect as _;
use canted_wide::{LeafPrimitive, NodeKind, Preset, SimdPath, TriangleBvh, WideBvh};
use serde_json::{Value, json};

use crate::process;

/// One preset on one level of BVHs.
#[derive(Clone, Default)]
struct Row {
    /// Nodes of each kind, in the order of [`NodeKind::ALL`].
    nodes: [usize; NodeKind::ALL.len()],
    /// Predicted traversal cost if all nodes were aligned, for a ray that enters the root, in visits of aligned nodes; over
    /// several BVHs, the mean weighted by root area.
    aligned_cost: f64,
    /// Predicted traversal cost of the BVHs as built.
    cost: f64,
    /// BVHs whose mesh is rotated into a local frame.
    n_rotated: usize,
    /// The largest angle of such a rotation.
    max_angle_rad: f64,
    /// Memory of the nodes.
    node_bytes: usize,
    /// Memory of the triangle blocks.
    block_bytes: usize,
    /// Triangles, or segments of curves, of all BVHs.
    n_triangles: usize,
    /// Nodes on the longest path from a root.
    depth: u32,
    /// Milliseconds to build all BVHs from indexed triangles.
    build_ms: f64,
    /// Sum of the root areas, the weights of the costs.
    root_area: f64,
    /// Stages of the builds; those of the same name are one.
    stages: Vec<Stage>,
}

/// All presets on one level of BVHs.
struct Level {
    n_bvhs: usize,
    /// In the order of the command line.
    rows: Vec<(Preset, Row)>,
}

/// All levels.
pub(super) struct WideStats {
    /// One BVH over all triangles in world space.
    one: Level,
    /// One BVH per mesh.
    bottom: Level,
    /// One BVH per mesh of curves, if there are any.
    curves: Option<Level>,
}

impl Row {
    /// Nodes of all kinds.
    fn n_nodes(&self) -> usize {
        self.nodes.iter().sum()
    }

    /// Fraction of nodes of one kind.
    fn share(&self, kind: NodeKind) -> f64 {
        let of_kind = NodeKind::ALL.iter().zip(self.nodes).filter(|(each, _)| **each == kind).map(|(_, n)| n);
        of_kind.sum::<usize>() as f64 / (self.n_nodes() as f64).max(1.0)
    }

    /// Memory of nodes and blocks per triangle.
    fn bytes_per_triangle(&self) -> f64 {
        (self.node_bytes + self.block_bytes) as f64 / (self.n_triangles as f64).max(1.0)
    }

    fn add<P: LeafPrimitive>(&mut self, wide: &WideBvh<P>, area: f64, build_ms: f64) {
        let (sizes, predicted) = (wide.sizes(), wide.predicted());
        for (sum, n) in self.nodes.iter_mut().zip(sizes.nodes) {
            *sum += n;
        }
        self.aligned_cost += f64::from(predicted.aligned) * area;
        self.cost += f64::from(predicted.chosen) * area;
        if wide.frame() != Obb::IDENTITY_FRAME {
            self.n_rotated += 1;
            self.max_angle_rad = self.max_angle_rad.max(angle_rad(wide.frame()));
        }
        self.node_bytes += sizes.node_bytes;
        self.block_bytes += sizes.leaf_bytes;
        self.n_triangles += wide.n_primitives();
        self.depth = self.depth.max(sizes.depth);
        self.build_ms += build_ms;
        self.root_area += area;
    }

    /// Adds the stages of a build.
    fn add_stages(&mut self, stages: &[Stage]) {
        for stage in stages {
            match self.stages.iter_mut().find(|known| known.name == stage.name) {
                Some(known) => {
                    known.seconds += stage.seconds;
                    known.serial_seconds += stage.serial_seconds;
                }
                None => self.stages.push(*stage),
            }
        }
    }
}

/// Builds the scene in one level and in two, with each preset.
pub(super) fn measure(scene: &Scene, presets: &[Preset]) -> Result<WideStats> {
    let empty = || Level { n_bvhs: 0, rows: presets.iter().map(|&preset| (preset, Row::default())).collect() };
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let mut one = empty();
    add_mesh(&mut one, &positions, &triangles, 1.0)?;
    let mut bottom = empty();
    for (i, mesh) in scene.meshes.iter().enumerate() {
        add_mesh(&mut bottom, &mesh.positions, &mesh.triangles, super::world_scale(scene, i))?;
    }
    let mut curves = if scene.has_curves() { Some(empty()) } else { None };
    if let Some(level) = &mut curves {
        add_curves(level, scene)?;
    }
    let of_curves = curves.iter_mut().flat_map(|level| &mut level.rows);
    for (_, row) in one.rows.iter_mut().chain(&mut bottom.rows).chain(of_curves) {
        // Without any area, the costs are zero.
        let area = row.root_area.max(f64::MIN_POSITIVE);
        row.aligned_cost /= area;
        row.cost /= area;
    }
    Ok(WideStats { one, bottom, curves })
}

/// Adds the BVHs of all meshes of curves.
fn add_curves(level: &mut Level, scene: &Scene) -> Result<()> {
    for (i, mesh) in scene.meshes.iter().enumerate().filter(|(_, mesh)| mesh.curves.is_some()) {
        level.n_bvhs += 1;
        let instance = Instance {
            mesh: MeshId(0),
            world_from_object: Affine::IDENTITY,
            world_from_object_close: None,
            first_primitive: 0,
        };
        let alone = Scene {
            // Those that move count as the shutter opens.
            meshes: vec![Mesh { close: None, ..mesh.clone() }],
            instances: vec![instance],
            materials: scene.materials.clone(),
            ..Scene::default()
        };
        let scale = super::world_scale(scene, i);
        for (preset, row) in &mut level.rows {
            let bvh = SceneBvh::build(&alone, &SceneBvhConfig { preset: *preset, ..SceneBvhConfig::default() })?;
            let (area, build_ms) = (bvh.bounds().area() * scale * scale, bvh.build_time.as_secs_f64() * 1e3);
            match &bvh.bottom()[0] {
                BottomLevel::Segments(wide) => row.add(wide, area, build_ms),
                BottomLevel::Cubics(wide) => row.add(wide, area, build_ms),
                BottomLevel::Ribbons(wide) => row.add(wide, area, build_ms),
                BottomLevel::CubicRibbons(wide) => row.add(wide, area, build_ms),
                BottomLevel::Patches(wide) => row.add(wide, area, build_ms),
                _ => {}
            }
        }
    }
    Ok(())
}

fn add_mesh(level: &mut Level, positions: &[[f32; 3]], triangles: &[[u32; 3]], world_scale: f64) -> Result<()> {
    level.n_bvhs += 1;
    for (preset, row) in &mut level.rows {
        let (wide, stages) = stages::recorded(|| TriangleBvh::build_with(positions, triangles, *preset));
        let wide = wide?;
        let build_ms = stages.iter().map(|stage| stage.seconds).sum::<f64>() * 1e3;
        row.add(&wide, wide.bounds().area() * world_scale * world_scale, build_ms);
        row.add_stages(&stages);
    }
    Ok(())
}

/// The smallest rotation angle between axis-aligned boxes and boxes in a frame of unit rows.
///
/// Boxes do not change when axes are permuted or reversed. Of the 24 rotations that give the same boxes, the one with the
/// greatest trace has the smallest angle.
fn angle_rad(rows: [[f32; 3]; 3]) -> f64 {
    const ORDERS: [([usize; 3], f64); 6] =
        [([0, 1, 2], 1.0), ([1, 2, 0], 1.0), ([2, 0, 1], 1.0), ([0, 2, 1], -1.0), ([2, 1, 0], -1.0), ([1, 0, 2], -1.0)];
    let entry = |row: usize, column: usize| f64::from(rows[row][column]);
    let cofactor = |a: usize, b: usize| entry(1, a) * entry(2, b) - entry(1, b) * entry(2, a);
    let determinant = entry(0, 0) * cofactor(1, 2) + entry(0, 1) * cofactor(2, 0) + entry(0, 2) * cofactor(0, 1);
    let traces = ORDERS.map(|(order, parity)| {
        let diagonal = [0, 1, 2].map(|row| entry(row, order[row]));
        let all: f64 = diagonal.iter().map(|x| x.abs()).sum();
        // If reversing axes to make the diagonal positive gives a reflection, the axis of least magnitude is not reversed.
        let is_rotation = diagonal.iter().fold(parity * determinant, |product, x| product * x) >= 0.0;
        let least = diagonal.iter().fold(f64::INFINITY, |least, x| least.min(x.abs()));
        if is_rotation { all } else { all - 2.0 * least }
    });
    let trace = traces.into_iter().fold(-1.0, f64::max);
    (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
}

/// Below this ratio of predicted costs, the reason states a percentage instead of a factor.
const ABOUT_EQUAL: f64 = 1.05;

/// The levels as JSON.
pub(super) fn json(stats: &WideStats) -> Value {
    let mut all = json!({
        "simd": SimdPath::detect().name(),
        "one_level": level_json(&stats.one),
        "two_level": level_json(&stats.bottom),
    });
    if let Some(curves) = &stats.curves {
        all["curves"] = level_json(curves);
    }
    all
}

fn level_json(level: &Level) -> Value {
    let presets: Vec<Value> = rows(level)
        .map(|(name, row)| {
            json!({
                "preset": name,
                "predicted_aligned_cost": row.aligned_cost,
                "predicted_cost": row.cost,
                "nodes": row.n_nodes(),
                "aligned_share": row.share(NodeKind::Aligned),
                "oriented_share": row.share(NodeKind::Oriented),
                "rotated": row.n_rotated,
                "max_angle_degrees": row.max_angle_rad.to_degrees(),
                "depth": row.depth,
                "node_bytes": row.node_bytes,
                "block_bytes": row.block_bytes,
                "bytes_per_triangle": row.bytes_per_triangle(),
                "build_ms": row.build_ms,
                "stages": stages_json(&row.stages),
                "reason": reason(level, row),
            })
        })
        .collect();
    json!({ "bvhs": level.n_bvhs, "presets": presets })
}

fn stages_json(stages: &[Stage]) -> Vec<Value> {
    let stage = |stage: &Stage| json!({ "stage": stage.name, "seconds": stage.seconds, "serial_seconds": stage.serial_seconds });
    stages.iter().map(stage).collect()
}

fn rows(level: &Level) -> impl Iterator<Item = (&'static str, &Row)> {
    level.rows.iter().map(|(preset, row)| (preset.name(), row))
}

/// One table per level, each with a reason per preset.
pub(super) fn text(out: &mut String, stats: &WideStats) {
    level_text(out, "one level", &stats.one);
    level_text(out, "two levels, bottom", &stats.bottom);
    if let Some(curves) = &stats.curves {
        level_text(out, "curves, segments for triangles", curves);
    }
}

/// The stages of the builds of one level, and how much of each only one thread can do.
pub(super) fn stages_text(out: &mut String, stats: &WideStats) {
    for (name, row) in rows(&stats.one) {
        let _ = writeln!(out, "\n{:<28}{:>12}{:>17}", format!("Build stages, {name}"), "milliseconds", "of it serial");
        for stage in &row.stages {
            let _ =
                writeln!(out, "  {:<26}{:>12.2}{:>17.2}", stage.name, 1e3 * stage.seconds, 1e3 * stage.serial_seconds);
        }
    }
}

fn level_text(out: &mut String, title: &str, level: &Level) {
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "\nWide BVH, {title} (predicted cost of a ray that enters the root, in aligned node visits)\n\
         {:<14}{:>13}{:>9}{:>9}{:>9}{:>10}{:>9}{:>7}{:>11}{:>11}{:>9}{:>10}",
        "",
        "aligned cost",
        "cost",
        "nodes",
        "aligned",
        "oriented",
        "rotated",
        "depth",
        "node mem",
        "leaf mem",
        "B/tri",
        "build ms"
    );
    for (name, row) in rows(level) {
        let percent = |kind| format!("{:.1}%", 100.0 * row.share(kind));
        let _ = writeln!(
            out,
            "{name:<14}{:>13.2}{:>9.2}{:>9}{:>9}{:>10}{:>9}{:>7}{:>11}{:>11}{:>9.1}{:>10.2}",
            row.aligned_cost,
            row.cost,
            row.n_nodes(),
            percent(NodeKind::Aligned),
            percent(NodeKind::Oriented),
            format!("{}/{}", row.n_rotated, level.n_bvhs),
            row.depth,
            process::human(row.node_bytes as u64),
            process::human(row.block_bytes as u64),
            row.bytes_per_triangle(),
            row.build_ms
        );
    }
    for (name, row) in rows(level) {
        let _ = writeln!(out, "{name}: {}", reason(level, row));
    }
}

/// The reason for the kinds of nodes, in a sentence.
fn reason(level: &Level, row: &Row) -> String {
    if row.n_nodes() == 0 {
        return "the root is a leaf".to_owned();
    }
    let degrees = row.max_angle_rad.to_degrees();
    let rotated = match (row.n_rotated, level.n_bvhs) {
        (0, _) => String::new(),
        (_, 1) => format!("; the mesh is rotated by {degrees:.0} degrees"),
        (1, n) => format!("; 1 of {n} meshes is rotated, by {degrees:.0} degrees"),
        (rotated, n) => format!("; {rotated} of {n} meshes are rotated, by at most {degrees:.0} degrees"),
    };
    let share = row.share(NodeKind::Oriented);
    // The builder chooses the cheaper kind of node, so the ratio is at least 1.
    let ratio = row.aligned_cost / row.cost;
    if share == 0.0 {
        return format!("aligned nodes are cheapest: no node is oriented{rotated}");
    }
    let more = if ratio < ABOUT_EQUAL {
        format!("{:.1} % more", 100.0 * (ratio - 1.0))
    } else {
        format!("{ratio:.1} times as much")
    };
    format!("aligned nodes alone would cost {more}: {} of nodes are oriented{rotated}", percent(share))
}

/// A nonzero fraction in words.
fn percent(share: f64) -> String {
    if share < 0.005 { "less than 1 %".to_owned() } else { format!("{:.0} %", 100.0 * share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason_of(row: Row) -> String {
        reason(&Level { n_bvhs: 1, rows: vec![] }, &row)
    }

    #[test]
    fn the_reason_follows_the_numbers() {
        let row = || Row { nodes: [10, 90], aligned_cost: 39.0, cost: 10.0, ..Row::default() };
        let many = "aligned nodes alone would cost 3.9 times as much: 90 % of nodes are oriented";
        assert_eq!(reason_of(row()), many);
        let rotated = Row { n_rotated: 1, max_angle_rad: 0.5, nodes: [100, 0], cost: 39.0, ..row() };
        let none = "aligned nodes are cheapest: no node is oriented; the mesh is rotated by 29 degrees";
        assert_eq!(reason_of(rotated), none);
        assert_eq!(reason_of(Row { nodes: [0; 2], ..row() }), "the root is a leaf");
    }

    #[test]
    fn a_small_gain_is_a_percentage() {
        let row = || Row { nodes: [999, 1], aligned_cost: 100.0, ..Row::default() };
        let few = "aligned nodes alone would cost 4.9 % more: less than 1 % of nodes are oriented";
        assert_eq!(reason_of(Row { cost: 100.0 / 1.049, ..row() }), few);
        let above = reason_of(Row { cost: 94.0, ..row() });
        assert!(above.starts_with("aligned nodes alone would cost 1.1 times as much: "), "{above}");
    }

    /// Rounding three entries changes the cosine of an angle by at most 3/2 of a rounding error `e`. The angle changes by at
    /// most `sqrt(2 * 1.5 * e)`, for small angles.
    fn angle_error_rad() -> f64 {
        (2.0 * 1.5 * 0.5 * f64::from(f32::EPSILON)).sqrt()
    }

    #[test]
    fn a_rotation_about_an_axis_has_its_smallest_equivalent_angle() {
        for degrees in [0.0f64, 10.0, 30.0, 44.0, 46.0, 80.0, 135.0, 200.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let [sin, cos] = [sin, cos].map(rounded);
            let least = (degrees / 90.0 - (degrees / 90.0).round()).abs() * 90.0;
            for rows in [
                [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]],
                // The same axes permuted and reversed, right- and left-handed.
                [[0.0, 0.0, -1.0], [-sin, cos, 0.0], [cos, sin, 0.0]],
                [[-sin, cos, 0.0], [cos, sin, 0.0], [0.0, 0.0, 1.0]],
            ] {
                let angle = angle_rad(rows).to_degrees();
                let bound = angle_error_rad().to_degrees();
                assert!((angle - least).abs() <= bound, "{degrees}: {angle} is not {least}");
            }
        }
    }

    #[test]
    fn the_angle_is_the_smallest_of_all_24_rotations() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from((state >> 40) as u32) / f64::from(1 << 23) - 1.0
        };
        for _ in 0..200 {
            let q = canted_obb::Quaternion { w: random(), x: random(), y: random(), z: random() };
            let rows = rows_of(q);
            let expected = smallest_of_24(rows);
            let angle = angle_rad(rows.map(|row| row.map(rounded)));
            assert!((angle - expected).abs() <= angle_error_rad(), "{angle} is not {expected}");
        }
    }

    fn rounded(x: f64) -> f32 {
        x as f32
    }

    /// The rotation matrix of a quaternion of any length.
    fn rows_of(q: canted_obb::Quaternion) -> [[f64; 3]; 3] {
        let canted_obb::Quaternion { w, x, y, z } = q;
        let n = w * w + x * x + y * y + z * z;
        [
            [n - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), n - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), n - 2.0 * (x * x + y * y)],
        ]
        .map(|row| row.map(|entry| entry / n))
    }

    /// The smallest angle of the rotation after each rotation of a cube.
    fn smallest_of_24(rows: [[f64; 3]; 3]) -> f64 {
        let mut least = f64::INFINITY;
        for (a, b) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            for signs in 0..4u8 {
                let [mut u, mut v] = [[0.0; 3]; 2];
                u[a] = if signs & 1 == 0 { 1.0 } else { -1.0 };
                v[b] = if signs & 2 == 0 { 1.0 } else { -1.0 };
                let w = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
                let trace = dot(rows[0], u) + dot(rows[1], v) + dot(rows[2], w);
                least = least.min((0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos());
            }
        }
        least
    }
}
