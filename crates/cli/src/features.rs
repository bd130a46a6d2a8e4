//! What this build of the program has.

/// Cargo features by name, and whether this build has them.
fn features() -> Vec<(&'static str, bool)> {
    let own =
        [("gpu", cfg!(feature = "gpu")), ("baseline", cfg!(feature = "baseline")), ("view", cfg!(feature = "view"))];
    own.into_iter().chain(canted_scene::FEATURES.iter().copied()).collect()
}

/// The end of `canted --help`.
pub(crate) fn help() -> String {
    let names = |is_built: bool| {
        let names: Vec<&str> =
            features().iter().filter(|(_, built)| *built == is_built).map(|(name, _)| *name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    format!(
        "Examples:\n  canted helmet.glb\n  canted room.obj --integrator path --spp 256 -o room.exr\n\n\
         Features of this build: {}\nNot in this build: {}",
        names(true),
        names(false)
    )
}
