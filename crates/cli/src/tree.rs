//! `canted tree`: codes and topology, for checking.

use std::path::PathBuf;

use anyhow::{Result, anyhow};
use canted_film::AtomicFile;
use canted_lbvh::{self as lbvh, Bits, Child, ChildKind, Domain, Sorted, Tree};
use canted_scene::Scene;
use clap::ValueEnum;

use crate::{
    Outcome, load,
    output::{self, Named},
};

/// Options of `canted tree`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The scene: OBJ, PLY, glTF, GLB, or a scene file in TOML; taken as one mesh in world space.
    scene: PathBuf,
    /// Length of the Morton codes.
    #[arg(long, value_enum, default_value_t = BitsArg::B63, value_name = "BITS")]
    bits: BitsArg,
    /// Codes in sorted order (code,prim).
    #[arg(long, value_name = "FILE")]
    codes: PathBuf,
    /// Inner nodes in Karras numbering (left,right,first,last); leaf i is -(i+1).
    #[arg(long, value_name = "FILE")]
    nodes: PathBuf,
}

#[derive(ValueEnum, Clone, Copy)]
enum BitsArg {
    #[value(name = "30")]
    B30,
    #[value(name = "63")]
    B63,
}

/// Builds the tree and writes both files.
pub(crate) fn run(args: &Args) -> Result<Outcome> {
    let bits = match args.bits {
        BitsArg::B30 => Bits::B30,
        BitsArg::B63 => Bits::B63,
    };
    let inputs = load::Inputs::of(Some(&args.scene))?;
    let outputs: [Named; 2] = [("--codes", &args.codes), ("--nodes", &args.nodes)];
    output::check_distinct(&inputs.named(), &outputs)?;
    let scene = load::scene(Some(&args.scene))?;
    load::check_outputs(Some(&args.scene), &scene, &outputs)?;
    // Places that cannot be written are told before the work.
    output::probe(&args.codes)?;
    output::probe(&args.nodes)?;
    let (sorted, tree) = build(&scene, bits).map_err(|error| anyhow!("{}: {error}", args.scene.display()))?;
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
    nodes_out.finish()?;
    Ok(Outcome::Done)
}

fn build(scene: &Scene, bits: Bits) -> Result<(Sorted, Tree)> {
    let (positions, triangles, _) = canted_renderer::flatten(scene)?;
    let (corners, bounds) = lbvh::triangle_corners(&positions, &triangles)?;
    let sorted = lbvh::sort_by_code(&lbvh::morton_codes(&Domain::new(&bounds, 3, bits), &corners), bits);
    Ok((sorted.clone(), lbvh::radix(sorted)))
}

/// Number in the file of each triangle of the flattened scene.
fn file_numbers(scene: &Scene) -> Vec<u32> {
    let numbers = scene.instances.iter().flat_map(|instance| {
        let n = scene.meshes[instance.mesh.0 as usize].triangles.len();
        (instance.first_primitive..).take(n)
    });
    numbers.collect()
}

/// A node's number, or `-(i + 1)` for the leaf at position `i`.
fn reference(child: Child) -> i64 {
    match child.kind() {
        ChildKind::Leaf(position) => -(i64::from(position) + 1),
        ChildKind::Inner(id) => i64::from(id.0),
    }
}
