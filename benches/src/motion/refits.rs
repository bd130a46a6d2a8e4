//! A mesh whose vertices move: refit or rebuild.

use std::{fmt::Write, time::Duration};

use anyhow::Result;
use canted_bih::Bih;
use canted_fixtures::Mesh;
use canted_trace::Watertight;
use canted_wide::{Config, Preset, TriangleBvh};
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris};

use super::{Updated, row, run};
use crate::{
    options::Options,
    wide::{growth, obvhs as theirs},
};

/// Logarithm of the number of triangles.
const LOG2: u32 = 20;

const PRESETS: [(&str, Preset); 3] =
    [("dynamic", Preset::Dynamic), ("fast", Preset::Fast), ("balanced", Preset::Balanced)];

/// The frames of a mesh: twisted about its z axis to and fro.
struct Frames {
    mesh: Mesh,
    twisted: [Vec<[f32; 3]>; 2],
}

impl Frames {
    fn of(mesh: Mesh) -> Self {
        let [least, greatest] =
            mesh.positions.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], p| [a.min(p[2]), b.max(p[2])]);
        let height = (greatest - least).max(f32::MIN_POSITIVE);
        let twist = |degrees: f32| {
            let turned = |&[x, y, z]: &[f32; 3]| {
                let (sin, cos) = (degrees.to_radians() * (z - least) / height).sin_cos();
                [cos * x - sin * y, sin * x + cos * y, z]
            };
            mesh.positions.iter().map(turned).collect()
        };
        Self { twisted: [twist(5.0), twist(10.0)], mesh }
    }

    fn positions(&self, frame: usize) -> &[[f32; 3]] {
        &self.twisted[frame % 2]
    }

    /// The mesh at a frame.
    fn at(&self, frame: usize) -> Mesh {
        Mesh { positions: self.positions(frame).to_vec(), triangles: self.mesh.triangles.clone() }
    }
}

/// Measures and writes the table.
pub(super) fn table(out: &mut String, options: &Options) -> Result<()> {
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build()?;
    let _ = writeln!(
        out,
        "\n### Refit and rebuild of a deforming mesh\n\nMeshes twisted by 5 and by 10 degrees in turn; {n_threads} threads. Last column: wall and \
         processor time relative to WideBvh's refit, preset fast.\n\n| scene | update | ms | processor ms | relative |\n| --- | --- | --- | --- | --- |",
    );
    for (name, generate) in growth::SCENES {
        let mesh = generate(if options.is_quick { LOG2 - 4 } else { LOG2 });
        let scene = format!("{name}, {} triangles", mesh.triangles.len());
        let frames = Frames::of(mesh);
        let mut all = ours(&frames)?;
        all.push(of_obvhs(&frames));
        #[cfg(feature = "peers")]
        of_embree(&frames, n_threads, &mut all)?;
        run(&mut all, options.rounds, &pool)?;
        let reference = all.iter().position(|one| one.name == "WideBvh fast, refit").map(|i| &all[i]);
        all.iter().for_each(|one| row(out, &scene, one, reference));
    }
    Ok(())
}

fn ours(frames: &Frames) -> Result<Vec<Updated<'_>>> {
    let triangles = &frames.mesh.triangles[..];
    let mut all = vec![];
    for (name, preset) in PRESETS {
        let config = Config::preset(preset);
        let mut bvh = TriangleBvh::<Watertight>::build(&frames.mesh.positions, triangles, &config)?;
        all.push(Updated::new(format!("WideBvh {name}, refit"), move |frame| {
            bvh.refit(frames.positions(frame), triangles)?;
            Ok(())
        }));
    }
    for (name, preset) in &PRESETS[..2] {
        let config = Config::preset(*preset);
        all.push(Updated::new(format!("WideBvh {name}, rebuild"), move |frame| {
            TriangleBvh::<Watertight>::build(frames.positions(frame), triangles, &config)?;
            Ok(())
        }));
    }
    all.push(Updated::new("BIH, rebuild", move |frame| {
        Bih::<Watertight>::build(frames.positions(frame), triangles, &canted_bih::Config::default())?;
        Ok(())
    }));
    Ok(all)
}

/// Their refit, with new boxes of the leaves as their example sets them; their triangles are new, too.
fn of_obvhs(frames: &Frames) -> Updated<'_> {
    let all = theirs::triangles(&frames.mesh);
    let mut bvh = build_bvh2_from_tris(&all, BvhBuildParams::fastest_build(), &mut Duration::default());
    let at = [0, 1].map(|frame| theirs::triangles(&frames.at(frame)));
    Updated::new("obvhs BVH2 fastest, refit", move |frame| {
        let triangles = &at[frame % 2];
        for i in 0..bvh.nodes.len() {
            let node = bvh.nodes[i];
            if node.is_leaf() {
                let first = node.first_index as usize;
                let of_leaf = &bvh.primitive_indices[first..first + node.prim_count as usize];
                let aabb =
                    of_leaf.iter().fold(obvhs::aabb::Aabb::INVALID, |all, &i| all.union(&triangles[i as usize].aabb()));
                bvh.nodes[i].set_aabb(aabb);
            }
        }
        bvh.refit_all();
        Ok(())
    })
}

#[cfg(feature = "peers")]
fn of_embree<'a>(frames: &'a Frames, n_threads: usize, all: &mut Vec<Updated<'a>>) -> Result<()> {
    use canted_peers::embree::{self, MovingMesh, Update};

    let mesh = embree::Mesh { positions: &frames.mesh.positions, triangles: &frames.mesh.triangles };
    for library in embree::libraries().into_iter().take(1) {
        let version = library.version();
        for (name, update) in [("refit", Update::Refit), ("rebuild, low quality", Update::Rebuild)] {
            let mut moving = MovingMesh::new(&library, &mesh, n_threads, update)?;
            let name = format!("Embree {}.{} dynamic, {name}", version / 10_000, version / 100 % 100);
            all.push(Updated::new(name, move |frame| Ok(moving.update(frames.positions(frame))?)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_move_what_is_above_the_bottom() {
        let frames = Frames::of(canted_fixtures::scaffold_of(1, false, 3));
        let moved = frames.positions(0).iter().zip(frames.positions(1)).filter(|(a, b)| a != b).count();
        assert!(moved > frames.mesh.positions.len() / 2, "{moved}");
        assert_eq!(frames.positions(0), frames.positions(2));
    }
}
