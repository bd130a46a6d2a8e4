//! The texts of all files, so that a program has them wherever it runs.

macro_rules! files {
    ($($name:literal),* $(,)?) => { &[$(($name, include_str!(concat!("../", $name, ".wgsl")))),*] };
}

/// Every file by its path without the ending, and its text.
pub const FILES: &[(&str, &str)] = files![
    "build/aabbs",
    "build/bounds",
    "build/codes",
    "build/domain",
    "build/dop_boxes",
    "build/dop_extents",
    "build/gather",
    "build/heights",
    "build/levels",
    "build/merge",
    "build/number",
    "build/sort_count",
    "build/sort_scan",
    "build/sort_scatter",
    "build/tree",
    "build/trees",
    "build/unturned",
    "check/incoming",
    "check/bsdf",
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
    "shared/shape_lights/list",
    "shared/shape_lights/none",
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
    "shared/build/few",
    "shared/build/fixed",
    "shared/build/forest",
    "shared/build/frame",
    "shared/build/grid",
    "shared/build/node",
    "shared/build/ordered",
    "shared/build/quaternion",
    "shared/build/scan",
    "shared/build/slice",
    "shared/camera",
    "shared/code/narrow",
    "shared/code/wide",
    "shared/cone",
    "shared/count/none",
    "shared/count/tests",
    "shared/direct/list",
    "shared/direct/none",
    "shared/film/samples",
    "shared/filter/box",
    "shared/filter/table",
    "shared/fresnel",
    "shared/ggx",
    "shared/emission/constant",
    "shared/emission/textured",
    "shared/groups",
    "shared/item/boxes",
    "shared/item/triangles",
    "shared/lens/disk",
    "shared/lens/pinhole",
    "shared/kinds/aligned",
    "shared/kinds/any",
    "shared/leaf",
    "shared/level/flat",
    "shared/level/moving",
    "shared/level/one",
    "shared/level/two",
    "shared/light/incoming",
    "shared/light/asked",
    "shared/light/emitters",
    "shared/light/lights",
    "shared/light/list",
    "shared/light/listed",
    "shared/light/receiver",
    "shared/light/sample",
    "shared/light/sampler",
    "shared/light/tree",
    "shared/light/triangle",
    "shared/links",
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
    "shared/mix",
    "shared/motion",
    "shared/node",
    "shared/normal/flat",
    "shared/normal/mapped",
    "shared/normal/smooth",
    "shared/numbers",
    "shared/path",
    "shared/paths",
    "shared/pattern/random",
    "shared/pattern/sobol",
    "shared/pattern/stratified",
    "shared/picture",
    "shared/place",
    "shared/placed/flat",
    "shared/placed/instances",
    "shared/placed/moving",
    "shared/placed/one",
    "shared/placement",
    "shared/presence",
    "shared/queue",
    "shared/ray",
    "shared/ray_key",
    "shared/ray_time",
    "shared/rule/combined",
    "shared/rule/pca_bounded",
    "shared/rule/quaternion",
    "shared/sampler",
    "shared/sampling",
    "shared/scattering",
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
    "shared/through/glass",
    "shared/through/none",
    "shared/time/shutter",
    "shared/time/still",
    "shared/trace",
    "shared/tree",
    "shared/triangle",
    "shared/turns",
    "shared/vector",
    "shared/vertex",
    "shared/vertex_normal",
    "shared/view/orthographic",
    "shared/view/perspective",
    "shared/walk/bits",
    "shared/walk/links",
    "shared/walk/stack",
    "shared/world",
    "trace/closest",
    "trace/occluded",
    "wave/generate",
    "wave/shade",
    "wave/trace",
];

/// Names of all kernels: files that are not parts of others.
pub fn kernels() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name).filter(|name| !name.starts_with("shared/"))
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
