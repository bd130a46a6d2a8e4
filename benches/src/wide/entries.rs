use super::{engine::Entry, obvhs, ours};
use crate::{models::Model, options::Options};

/// Every available and requested engine, ours first.
pub(crate) fn entries<'a>(scene: &str, model: &'a Model, options: &Options) -> Vec<Entry<'a>> {
    let mut entries = ours::entries(model);
    #[cfg(feature = "peers")]
    entries.extend(super::embree::entries(model));
    entries.extend(obvhs::entries(&model.mesh));
    #[cfg(all(feature = "peers", target_feature = "avx2"))]
    if options.wants_engine("tinybvh") {
        entries.extend(super::tinybvh::entry(scene, &model.mesh));
    }
    #[cfg(not(all(feature = "peers", target_feature = "avx2")))]
    let _ = scene;
    entries.retain(|entry| options.wants_engine(&entry.name));
    entries
}

/// The engines whose growth is measured: ours, the newest Embree and one BVH of `obvhs`.
pub(crate) fn growing<'a>(model: &'a Model, options: &Options) -> Vec<Entry<'a>> {
    let mut entries = ours::entries(model);
    #[cfg(feature = "peers")]
    entries.extend(super::embree::newest(model));
    entries.push(obvhs::medium(&model.mesh));
    entries.retain(|entry| options.wants_engine(&entry.name));
    entries
}
