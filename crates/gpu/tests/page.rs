//! The front page of this crate states the layout of buffers: it is that of the kernels.

use std::collections::BTreeSet;

use canted_shaders::choice::{Count, Each, Level, Mask, NodeKinds, Traverse, Volume};
use canted_shaders::{Number, Shader, Variant, wgsl};

/// The page.
const PAGE: &str = include_str!("../src/lib.rs");

/// Kernels that read every buffer, structure and kind of node.
fn shaders() -> Vec<Shader> {
    let chosen = |level| {
        let chosen = Variant::none().with(level).with(Mask::None).with(Count::None).with(Each::All);
        chosen.number(Number::MaxIterations, 1000).number(Number::StackSize, 4)
    };
    let wide = |level| chosen(level).with(NodeKinds::Any).with(Traverse::Wide);
    let binary = |volume: Volume| chosen(Level::Single).with(Traverse::Binary).with(volume);
    let levels = [Level::Single, Level::Flat, Level::Instances, Level::Moving].map(wide);
    let all = levels.into_iter().chain([Volume::Aabb, Volume::Obb].map(binary));
    all.map(|chosen| Shader::new(wgsl::trace::CLOSEST, &chosen).unwrap()).collect()
}

/// Rows of the page that start with this.
fn rows(start: &str) -> BTreeSet<String> {
    PAGE.lines()
        .filter_map(|line| line.strip_prefix("//! "))
        .filter(|line| line.starts_with(start))
        .map(str::to_owned)
        .collect()
}

#[test]
fn the_page_states_the_bindings_of_the_kernels() {
    let bindings: BTreeSet<String> = shaders()
        .iter()
        .flat_map(|shader| &shader.entry("main").unwrap().bindings)
        .filter(|binding| binding.group == 0)
        .map(|binding| format!("{} `{}`", binding.number, binding.name))
        .collect();
    let stated: BTreeSet<String> = rows("| ")
        .iter()
        .filter_map(|row| row.split(" | ").next()?.strip_prefix("| "))
        .filter(|cell| cell.starts_with(|c: char| c.is_ascii_digit()))
        .map(str::to_owned)
        .collect();
    assert_eq!(stated, bindings);
}

#[test]
fn the_page_states_the_structures_of_the_kernels() {
    let shaders = shaders();
    for name in ["Bvh", "Instance", "Motion", "Ray", "Hit"] {
        let layout = shaders.iter().find_map(|shader| shader.layout(name)).unwrap();
        let members: Vec<String> = layout.members.iter().map(|(name, offset)| format!("`{name}` {offset}")).collect();
        let row = format!("| `{name}` | {} | {} |", layout.size, members.join(", "));
        assert!(rows("| `").contains(&row), "the page lacks {row}");
    }
}

#[test]
fn the_page_states_the_sizes_of_nodes() {
    let quads = |shader: &Shader| {
        let (_, rest) = shader.source.split_once("const CHILD_QUADS: u32 = ")?;
        rest.split_once('u')?.0.parse::<u32>().ok()
    };
    let bytes: BTreeSet<u32> = shaders().iter().filter_map(quads).map(|quads| 16 * quads).collect();
    assert_eq!(bytes, BTreeSet::from([32, 64]));
    for bytes in bytes {
        let of_node = format!("a node has {} bytes", 2 * bytes);
        assert!(PAGE.contains(&of_node), "the page lacks: {of_node}");
    }
}
