//! The texts of all WGSL files, embedded so that a program finds them wherever it runs.

macro_rules! files {
    ($($name:literal),* $(,)?) => { &[$(($name, include_str!(concat!("../", $name, ".wgsl")))),*] };
}

/// Path of each file without its extension, and its text.
pub const FILES: &[(&str, &str)] = files![
    "build/aabbs",
    "build/adopt",
    "build/axis_aligned",
    "build/bounds",
    "build/codes",
    "build/corners",
    "build/domain",
    "build/dop_boxes",
    "build/dop_extents",
    "build/gather",
    "build/headers",
    "build/heights",
    "build/item_indices",
    "build/level_slices",
    "build/levels",
    "build/merge",
    "build/mesh_boxes",
    "build/moments",
    "build/pairs",
    "build/place",
    "build/ploc_finish",
    "build/ploc_keep",
    "build/ploc_merge",
    "build/ploc_nodes",
    "build/ploc_partners",
    "build/ploc_ranges",
    "build/ploc_start",
    "build/ploc_states",
    "build/point_boxes",
    "build/point_extents",
    "build/sort_count",
    "build/sort_scan",
    "build/sort_scatter",
    "build/tile_prefixes",
    "build/tile_sums",
    "build/tree",
    "build/tree_indices",
    "build/wide_children",
    "build/wide_kinds",
    "build/wide_levels",
    "build/wide_nodes",
    "build/wide_oriented",
    "build/wide_slots",
    "build/wide_triangles",
    "check/bsdf",
    "check/copy",
    "check/hair",
    "check/incoming",
    "check/light",
    "check/loops",
    "check/moving",
    "check/node",
    "check/sampler",
    "check/triangle",
    "render/gbuffer",
    "render/guide",
    "render/hybrid",
    "render/path",
    "shared",
    "shared/bsdf",
    "shared/build",
    "shared/bvh",
    "shared/camera",
    "shared/certain",
    "shared/curve",
    "shared/curve_kinds",
    "shared/exact",
    "shared/hair",
    "shared/level",
    "shared/light/direct",
    "shared/light/disk",
    "shared/light/environment",
    "shared/light/list",
    "shared/light/point",
    "shared/light/sampler",
    "shared/light/shape_lights",
    "shared/light/sphere",
    "shared/light/spot",
    "shared/light/sun",
    "shared/light/tree",
    "shared/light/triangle",
    "shared/listed",
    "shared/module",
    "shared/path",
    "shared/sampler",
    "shared/segment",
    "shared/surface",
    "shared/surface_curve",
    "shared/surface_kinds",
    "shared/texture",
    "shared/traverse",
    "shared/triangle",
    "shared/undecided",
    "shared/volumes",
    "trace/certain_closest",
    "trace/certain_occluded",
    "trace/certain_weights",
    "trace/closest",
    "trace/listed_closest",
    "trace/listed_occluded",
    "trace/occluded",
];

/// Names of all kernels: files with an entry point.
pub fn kernels() -> impl Iterator<Item = &'static str> {
    let is_kernel = |text: &str| text.contains("@compute") || text.contains("@vertex");
    FILES.iter().filter(move |(_, text)| is_kernel(text)).map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn every_file_is_listed() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut folders = vec![root.to_owned()];
        let mut found = vec![];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "wgsl") {
                    let name = path.strip_prefix(root).unwrap().with_extension("");
                    found.push(name.to_str().unwrap().replace('\\', "/"));
                }
            }
        }
        found.sort();
        let mut listed: Vec<_> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
        listed.sort();
        assert_eq!(found, listed);
    }
}
