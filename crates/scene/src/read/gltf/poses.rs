//! Poses of an animated file at many times, without reading its materials and images again.

use std::path::Path;

use gltf::json::scene::Node;

use super::document::Document;
use super::{ReadError, ReadOptions, WarningGroups, animation, nodes, read_document, read_geometry};
use crate::{Material, Scene};

/// A parsed file with its buffers in memory.
pub(in crate::read) struct Poses {
    document: Document<'static>,
    /// The nodes without an animation.
    rest: Vec<Node>,
    /// The materials, by which vertex attributes are kept or dropped.
    materials: Vec<Material>,
    /// Name or number of the animation.
    animation: Option<String>,
}

impl Poses {
    /// Reads a file as [`super::read`] does, except that a pose that makes a vertex infinite or NaN is an error. Keeps what
    /// further poses need, if the file has an animation.
    pub(in crate::read) fn open(
        path: &Path,
        bytes: &[u8],
        options: &ReadOptions,
    ) -> Result<(Option<Self>, Scene), ReadError> {
        let mut document = Document::open(path, bytes)?;
        if document.animation(options.animation.as_deref())?.is_none() {
            return Ok((None, read_document(&mut document, options)?));
        }
        let rest = document.root.nodes.clone();
        document.requires_finite = true;
        let scene = read_document(&mut document, options)?;
        let (document, animation) = (document.into_owned(), options.animation.clone());
        Ok((Some(Self { document, rest, materials: scene.materials.clone(), animation }), scene))
    }

    /// The file.
    pub(in crate::read) fn path(&self) -> &Path {
        self.document.path()
    }

    /// First and last key time of the animation in seconds.
    pub(in crate::read) fn time_range(&self) -> Option<[f32; 2]> {
        animation::time_range(&self.document, self.animation.as_deref())
    }

    /// The meshes, instances, cameras, lights and warnings at a time in seconds.
    pub(in crate::read) fn at(&mut self, time: f32) -> Result<Scene, ReadError> {
        let mut grouped = WarningGroups::default();
        self.document.root.nodes.clone_from(&self.rest);
        animation::pose(&mut self.document, self.animation.as_deref(), time, &mut grouped)?;
        let nodes = nodes::read(&self.document)?;
        let mut scene = Scene { materials: self.materials.clone(), ..Scene::default() };
        read_geometry(&self.document, &nodes, grouped, &mut scene)?;
        Ok(scene)
    }
}
