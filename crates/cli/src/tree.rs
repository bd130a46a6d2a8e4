//! `canted tree`: Morton codes and the topology of the radix tree, for verification.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Domain, Sorted, Tree};
use canted_scene::Scene;

use crate::{
    load::{self, FileArgs},
    options::one_of,
    output::{self, Named},
    settings::SceneSettings,
};

/// Options of `canted tree`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  canted tree bunny.ply --codes codes.csv --nodes nodes.csv\n  canted tree bunny.ply --bits 30 --codes codes.csv --nodes nodes.csv"
)]
pub(crate) struct Args {
    /// Scene: OBJ, PLY, STL, OFF, glTF, GLB, or a scene file (.toml). All instances form one mesh in world space.
    scene: PathBuf,
    #[command(flatten)]
    files: FileArgs,
    /// Number of bits of a Morton code.
    #[arg(long, default_value = "63", value_parser = one_of(&[("30", Bits::B30), ("63", Bits::B63)]), value_name = "BITS")]
    bits: Bits,
    /// Output file for the sorted codes (code,prim).
    #[arg(long, value_name = "FILE")]
    codes: PathBuf,
    /// Output file for the inner nodes in Karras numbering (left,right,first,last); leaf i is -(i+1).
    #[arg(long, value_name = "FILE")]
    nodes: PathBuf,
}

/// Builds the tree and writes both files.
pub(crate) fn run(args: &Args) -> Result<()> {
    SceneSettings::check(Some(&args.scene))?;
    let inputs = load::Inputs::of(Some(&args.scene))?;
    let outputs: [Named; 2] = [("--codes", &args.codes), ("--nodes", &args.nodes)];
    output::check_distinct(&inputs.named(), &outputs)?;
    let scene = load::scene(Some(&args.scene), &args.files.read_options(None, None))?;
    load::check_outputs(Some(&args.scene), &scene, &outputs)?;
    output::probe(&args.codes)?;
    output::probe(&args.nodes)?;
    let (sorted, tree) = build(&scene, args.bits).map_err(|error| anyhow!("{}: {error}", args.scene.display()))?;
    let mut codes_out = AtomicFile::create(&args.codes)?;
    let mut nodes_out = AtomicFile::create(&args.nodes)?;
    let numbers = file_numbers(&scene);
    codes_out.write(|out| {
        writeln!(out, "code,prim")?;
        sorted
            .codes
            .iter()
            .zip(&sorted.leaves)
            .try_for_each(|(code, leaf)| writeln!(out, "{code},{}", numbers[leaf.index()]))
    })?;
    nodes_out.write(|out| {
        writeln!(out, "left,right,first,last")?;
        tree.nodes.iter().try_for_each(|node| {
            writeln!(out, "{},{},{},{}", reference(node.left), reference(node.right), node.first, node.last)
        })
    })?;
    codes_out.finish()?;
    Ok(nodes_out.finish()?)
}

fn build(scene: &Scene, bits: Bits) -> Result<(Sorted, Tree)> {
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let (corners, bounds) = lbvh::triangle_corners(&positions, &triangles)?;
    let sorted = lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(&bounds, 3, bits), &corners), bits);
    Ok((sorted.clone(), lbvh::radix(sorted)))
}

/// The number of each triangle of the flattened scene in the scene's own numbering.
fn file_numbers(scene: &Scene) -> Vec<u32> {
    let numbers = scene.instances.iter().flat_map(|instance| {
        let n = scene.meshes[instance.mesh.0 as usize].triangles.len();
        (instance.first_primitive..).take(n)
    });
    numbers.collect()
}

/// The number of an inner node, or `-(i + 1)` for the leaf at position `i`.
fn reference(child: Child) -> i64 {
    match child.kind() {
        ChildKind::Leaf(position) => -(i64::from(position) + 1),
        ChildKind::Inner(id) => i64::from(id.0),
    }
}
