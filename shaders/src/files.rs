//! The texts of all files, so that a program has them wherever it runs.

macro_rules! files {
    ($($name:literal),* $(,)?) => { &[$(($name, include_str!(concat!("../", $name, ".wgsl")))),*] };
}

/// Every file by its path without the ending, and its text.
pub const FILES: &[(&str, &str)] = files![
    "alternatives/traverse/bits",
    "alternatives/traverse/links",
    "alternatives/traverse/parents",
    "alternatives/wavefront/generate",
    "alternatives/wavefront/paths",
    "alternatives/wavefront/queue",
    "alternatives/wavefront/shade",
    "alternatives/wavefront/trace",
    "build/aabbs",
    "build/axis_aligned",
    "build/bounds",
    "build/codes",
    "build/domain",
    "build/dop_boxes",
    "build/dop_extents",
    "build/gather",
    "build/heights",
    "build/item_indices",
    "build/levels",
    "build/merge",
    "build/sort_count",
    "build/sort_scan",
    "build/sort_scatter",
    "build/tree",
    "build/tree_indices",
    "check/bsdf",
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
    "shared/alpha/plain",
    "shared/alpha/texture",
    "shared/angle",
    "shared/boundary",
    "shared/bsdf/full",
    "shared/bsdf/lambert",
    "shared/build/average",
    "shared/build/bounded",
    "shared/build/boxes",
    "shared/build/climb",
    "shared/build/content",
    "shared/build/curve",
    "shared/build/digit",
    "shared/build/eigen",
    "shared/build/enclosure",
    "shared/build/fixed_frame",
    "shared/build/forest",
    "shared/build/frame",
    "shared/build/grid",
    "shared/build/node",
    "shared/build/ordered",
    "shared/build/quaternion",
    "shared/build/scan",
    "shared/build/slice",
    "shared/build/small_nodes",
    "shared/bvh",
    "shared/camera",
    "shared/code/narrow",
    "shared/code/wide",
    "shared/cone",
    "shared/count/none",
    "shared/count/tests",
    "shared/direct/list",
    "shared/direct/none",
    "shared/emission/constant",
    "shared/emission/textured",
    "shared/film/samples",
    "shared/filter/box",
    "shared/filter/table",
    "shared/fresnel",
    "shared/ggx",
    "shared/groups",
    "shared/hash",
    "shared/instance",
    "shared/item/boxes",
    "shared/item/triangles",
    "shared/iterations",
    "shared/leaf",
    "shared/lens/disk",
    "shared/lens/pinhole",
    "shared/level/flat",
    "shared/level/instances",
    "shared/level/moving",
    "shared/level/single",
    "shared/light/asked",
    "shared/light/emitters",
    "shared/light/incoming",
    "shared/light/lights",
    "shared/light/list",
    "shared/light/listed",
    "shared/light/receiver",
    "shared/light/sample",
    "shared/light/sampler",
    "shared/light/tree",
    "shared/light/triangle",
    "shared/local/both",
    "shared/local/emitters",
    "shared/local/lights",
    "shared/local/none",
    "shared/lod/aniso",
    "shared/lod/cone",
    "shared/lod/none",
    "shared/mask/alpha",
    "shared/mask/none",
    "shared/material/full",
    "shared/material/lambert",
    "shared/mesh",
    "shared/motion",
    "shared/node",
    "shared/node_kinds/aligned",
    "shared/node_kinds/any",
    "shared/normal/flat",
    "shared/normal/mapped",
    "shared/normal/smooth",
    "shared/numbers",
    "shared/path",
    "shared/pattern/random",
    "shared/pattern/sobol",
    "shared/pattern/stratified",
    "shared/picture",
    "shared/placed/flat",
    "shared/placed/instances",
    "shared/placed/moving",
    "shared/placed/single",
    "shared/placement",
    "shared/presence",
    "shared/ray",
    "shared/ray_key",
    "shared/ray_time",
    "shared/rule/combined",
    "shared/rule/pca_bounded",
    "shared/rule/quaternion",
    "shared/sampler",
    "shared/sampling",
    "shared/scattering",
    "shared/shape_lights/list",
    "shared/shape_lights/none",
    "shared/sky/black",
    "shared/sky/constant",
    "shared/sky/image",
    "shared/skylight/black",
    "shared/skylight/cosine",
    "shared/skylight/image",
    "shared/square_footprint",
    "shared/suns/list",
    "shared/suns/none",
    "shared/surface",
    "shared/texels/four",
    "shared/texels/one",
    "shared/texture/lookup",
    "shared/texture/none",
    "shared/time/shutter",
    "shared/time/still",
    "shared/trace",
    "shared/transmission/glass",
    "shared/transmission/none",
    "shared/traverse/stack",
    "shared/triangle",
    "shared/vector",
    "shared/vertex",
    "shared/vertex_normal",
    "shared/view/orthographic",
    "shared/view/perspective",
    "shared/world",
    "trace/closest",
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

    /// The list must not forget a file that lies in a folder.
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
