//! Structures whose nodes hold planes: bounding interval hierarchies and kd-trees.

use std::fmt::Write;
use std::time::Instant;

use anyhow::Result;
use canted_bih::{Bih, BihConfig};
use canted_kdtree::{KdSplit, KdTree, KdTreeConfig};
use canted_scene::Scene;
use serde_json::{Value, json};

use crate::process;

/// One structure, summed over the meshes of a level.
#[derive(Clone, Copy, Default)]
struct Row {
    /// Triangles in leaves; a kd-tree repeats some.
    references: usize,
    /// Nodes on the longest path from a root.
    depth: u32,
    node_bytes: usize,
    reference_bytes: usize,
    triangle_bytes: usize,
    /// Milliseconds to build from indexed triangles.
    build_ms: f64,
}

/// Costs of kd-trees by the surface area heuristic; over several meshes, the mean weighted by root area.
#[derive(Clone, Copy, Default)]
struct Costs {
    /// Of trees split where that costs least.
    sah: f64,
    /// Of the same triangles split at midpoints.
    sah_midpoint: f64,
    /// Sum of the root areas, the weights.
    root_area: f64,
}

/// Both structures on one level.
#[derive(Default)]
struct Level {
    bih: Row,
    kd_tree: Row,
    costs: Costs,
}

/// One level over all triangles in world space, and a structure per mesh.
pub(super) struct PlaneStats {
    one: Level,
    bottom: Level,
}

/// Builds both structures in one level and in two.
pub(super) fn measure(scene: &Scene) -> Result<PlaneStats> {
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let (mut one, mut bottom) = (Level::default(), Level::default());
    one.add(&positions, &triangles)?;
    for mesh in &scene.meshes {
        bottom.add(&mesh.positions, &mesh.triangles)?;
    }
    for Costs { sah, sah_midpoint, root_area } in [&mut one.costs, &mut bottom.costs] {
        [sah, sah_midpoint].into_iter().for_each(|sum| *sum /= root_area.max(f64::MIN_POSITIVE));
    }
    Ok(PlaneStats { one, bottom })
}

impl Level {
    fn add(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<()> {
        let start = Instant::now();
        let bih = Bih::build(positions, triangles, &BihConfig::default())?;
        let (row, memory) = (&mut self.bih, bih.memory());
        row.build_ms += milliseconds(start);
        row.references += bih.n_triangles();
        row.depth = row.depth.max(bih.boxes().depth());
        row.node_bytes += memory.nodes;
        row.reference_bytes += memory.references;
        row.triangle_bytes += memory.triangles;

        let start = Instant::now();
        let kd_tree = KdTree::build(positions, triangles, &KdTreeConfig::default())?;
        let (row, memory) = (&mut self.kd_tree, kd_tree.memory());
        row.build_ms += milliseconds(start);
        row.references += kd_tree.nodes().n_references();
        row.depth = row.depth.max(kd_tree.nodes().depth());
        row.node_bytes += memory.nodes + memory.ropes;
        row.reference_bytes += memory.references;
        row.triangle_bytes += memory.triangles;

        let config = KdTreeConfig { split: KdSplit::Midpoint, ..KdTreeConfig::default() };
        let midpoint = KdTree::build(positions, triangles, &config)?;
        let area = kd_tree.nodes().cell().area();
        self.costs.sah += kd_tree.nodes().sah(&config) * area;
        self.costs.sah_midpoint += midpoint.nodes().sah(&config) * area;
        self.costs.root_area += area;
        Ok(())
    }

    fn rows(&self) -> [(&'static str, &Row); 2] {
        [("bih", &self.bih), ("kdtree", &self.kd_tree)]
    }

    fn json(&self) -> Value {
        let row = |(name, row): (&str, &Row)| {
            let mut facts = json!({
                "accel": name,
                "references": row.references,
                "depth": row.depth,
                "node_bytes": row.node_bytes,
                "reference_bytes": row.reference_bytes,
                "triangle_bytes": row.triangle_bytes,
                "build_ms": row.build_ms,
            });
            if name == "kdtree" {
                let Costs { sah, sah_midpoint, .. } = self.costs;
                (facts["sah"], facts["sah_midpoint"]) = (json!(sah), json!(sah_midpoint));
            }
            facts
        };
        self.rows().into_iter().map(row).collect()
    }
}

impl PlaneStats {
    /// An object with an array per level.
    pub(super) fn json(&self) -> Value {
        json!({ "one_level": self.one.json(), "bottom": self.bottom.json() })
    }

    /// A table.
    pub(super) fn text(&self, out: &mut String) {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "\nBounding interval hierarchy and kd-tree\n{:<28}{:>12}{:>7}{:>11}{:>12}{:>11}{:>11}",
            "", "references", "depth", "nodes", "references", "triangles", "build"
        );
        for (level, of_level) in [("one level", &self.one), ("two levels, bottom", &self.bottom)] {
            for (name, row) in of_level.rows() {
                let _ = writeln!(
                    out,
                    "{:<28}{:>12}{:>7}{:>11}{:>12}{:>11}{:>8.2} ms",
                    format!("{name}, {level}"),
                    row.references,
                    row.depth,
                    process::human(row.node_bytes as u64),
                    process::human(row.reference_bytes as u64),
                    process::human(row.triangle_bytes as u64),
                    row.build_ms
                );
            }
        }
        for (level, Level { costs, .. }) in [("one level", &self.one), ("two levels, bottom", &self.bottom)] {
            let Costs { sah, sah_midpoint, .. } = costs;
            let _ = writeln!(out, "SAH cost of the kd-tree, {level}: {sah:.2}; split at midpoints {sah_midpoint:.2}");
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
