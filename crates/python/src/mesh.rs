//! A BVH over triangles with any triangle test, and how it is built.

use std::sync::Arc;

use canted::{
    BaldwinWeber, Blas, Config, GeometryError, HIT_ERROR, Hit, HitLists, InstanceId, LoadError, MollerTrumbore,
    NearestPoint, Obb, PredictedCost, Preset, PrimId, Query, Ray, Refit, RefitError, SimdPath, Sizes, TriangleBvh,
    Watertight,
};
use pyo3::prelude::*;

use crate::error::invalid;

/// Values of `preset`.
pub(crate) const PRESETS: [(&str, Preset); 4] = [
    ("dynamic", Preset::Dynamic),
    ("fast", Preset::Fast),
    ("balanced", Preset::Balanced),
    ("quality", Preset::Quality),
];

/// A triangle test, by its name in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Test {
    Watertight,
    MollerTrumbore,
    BaldwinWeber,
}

impl Test {
    pub(crate) const ALL: [Self; 3] = [Self::Watertight, Self::MollerTrumbore, Self::BaldwinWeber];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Watertight => "watertight",
            Self::MollerTrumbore => "moller-trumbore",
            Self::BaldwinWeber => "baldwin-weber",
        }
    }

    /// The value of `triangle_test`.
    pub(crate) fn named(name: &str) -> PyResult<Self> {
        let names = Self::ALL.map(Self::name);
        let known = Self::ALL.into_iter().find(|test| test.name() == name);
        known.ok_or_else(|| unknown("triangle_test", name, &names))
    }
}

/// The value of `preset`.
pub(crate) fn preset(name: &str) -> PyResult<(&'static str, Preset)> {
    let known = PRESETS.into_iter().find(|(known, _)| *known == name);
    known.ok_or_else(|| unknown("preset", name, &PRESETS.map(|(name, _)| name)))
}

fn unknown(argument: &str, value: &str, known: &[&str]) -> PyErr {
    let (last, others) = known.split_last().unwrap_or((&"", &[]));
    invalid(format!("{argument} is '{value}'; use {} or {last}", others.join(", ")))
}

/// A BVH over triangles.
#[derive(Clone, Debug)]
pub(crate) enum Mesh {
    Watertight(TriangleBvh<Watertight>),
    MollerTrumbore(TriangleBvh<MollerTrumbore>),
    BaldwinWeber(TriangleBvh<BaldwinWeber>),
}

/// The same expression for each triangle test.
macro_rules! of_each {
    ($mesh:expr, $bvh:ident => $result:expr) => {
        match $mesh {
            Mesh::Watertight($bvh) => $result,
            Mesh::MollerTrumbore($bvh) => $result,
            Mesh::BaldwinWeber($bvh) => $result,
        }
    };
}

impl Mesh {
    pub(crate) fn build(
        test: Test,
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        preset: Preset,
    ) -> Result<Self, GeometryError> {
        let config = Config::preset(preset);
        Ok(match test {
            Test::Watertight => Self::Watertight(TriangleBvh::build(positions, triangles, &config)?),
            Test::MollerTrumbore => Self::MollerTrumbore(TriangleBvh::build(positions, triangles, &config)?),
            Test::BaldwinWeber => Self::BaldwinWeber(TriangleBvh::build(positions, triangles, &config)?),
        })
    }

    pub(crate) fn from_bytes(test: Test, bytes: &[u8]) -> Result<Self, LoadError> {
        Ok(match test {
            Test::Watertight => Self::Watertight(TriangleBvh::from_bytes(bytes)?),
            Test::MollerTrumbore => Self::MollerTrumbore(TriangleBvh::from_bytes(bytes)?),
            Test::BaldwinWeber => Self::BaldwinWeber(TriangleBvh::from_bytes(bytes)?),
        })
    }

    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        of_each!(self, bvh => bvh.to_bytes())
    }

    pub(crate) fn test(&self) -> Test {
        match self {
            Self::Watertight(_) => Test::Watertight,
            Self::MollerTrumbore(_) => Test::MollerTrumbore,
            Self::BaldwinWeber(_) => Test::BaldwinWeber,
        }
    }

    pub(crate) fn refit(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Refit, RefitError> {
        of_each!(self, bvh => bvh.refit(positions, triangles))
    }

    pub(crate) fn n_triangles(&self) -> usize {
        of_each!(self, bvh => bvh.n_primitives())
    }

    pub(crate) fn aabb(&self) -> canted::Aabb {
        of_each!(self, bvh => bvh.aabb())
    }

    pub(crate) fn sizes(&self) -> Sizes {
        of_each!(self, bvh => bvh.sizes())
    }

    pub(crate) fn predicted(&self) -> PredictedCost {
        of_each!(self, bvh => bvh.predicted())
    }

    pub(crate) fn path(&self) -> SimdPath {
        of_each!(self, bvh => bvh.path())
    }

    /// The vertices of a triangle that exists.
    pub(crate) fn triangle(&self, id: PrimId) -> [[f32; 3]; 3] {
        of_each!(self, bvh => bvh.triangle(id))
    }

    pub(crate) fn contains(&self, points: &[[f32; 3]], inside: &mut [bool]) {
        of_each!(self, bvh => bvh.contains_many(points, inside));
    }

    pub(crate) fn nearest(&self, point: [f32; 3], max_distance: f32) -> Option<NearestPoint> {
        of_each!(self, bvh => bvh.nearest_point(point, max_distance))
    }

    pub(crate) fn signed_distance(&self, point: [f32; 3]) -> f32 {
        of_each!(self, bvh => bvh.signed_distance(point))
    }

    /// The BVH whose crossings are exact.
    pub(crate) fn watertight(&self) -> PyResult<&TriangleBvh<Watertight>> {
        match self {
            Self::Watertight(bvh) => Ok(bvh),
            _ => {
                let test = self.test().name();
                Err(invalid(format!("crossings need triangle_test='watertight'; this BVH has '{test}'")))
            }
        }
    }
}

impl Blas for Mesh {
    fn bounds(&self) -> Obb {
        of_each!(self, bvh => bvh.bounds())
    }

    fn hit_error(&self) -> f32 {
        HIT_ERROR
    }

    fn has_local_error(&self) -> bool {
        true
    }

    fn closest_hit_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> Option<Hit> {
        of_each!(self, bvh => bvh.closest_hit_with(ray, instance, query))
    }

    fn occluded_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q) -> bool {
        of_each!(self, bvh => bvh.occluded_with(ray, instance, query))
    }

    fn all_hits_with<Q: Query>(&self, ray: &Ray, instance: InstanceId, query: &mut Q, hits: &mut Vec<Hit>) {
        of_each!(self, bvh => bvh.all_hits_with(ray, instance, query, hits));
    }
}

/// What answers the queries of slices of rays.
pub(crate) trait Target: Sync {
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]);
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);
    /// Calls `visit` with the hits of each ray, in order.
    fn all_hits(&self, rays: &[Ray], visit: impl FnMut(&[Hit]));
}

impl Target for Mesh {
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        of_each!(self, bvh => bvh.closest_hits(rays, hits));
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        of_each!(self, bvh => bvh.occluded_many(rays, occluded));
    }

    fn all_hits(&self, rays: &[Ray], visit: impl FnMut(&[Hit])) {
        let mut lists = HitLists::new();
        of_each!(self, bvh => bvh.all_hits_listed(rays, &mut lists));
        lists.of_rays().for_each(visit);
    }
}

impl Target for canted::Tlas<Arc<Mesh>> {
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_hits(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_many(rays, occluded);
    }

    fn all_hits(&self, rays: &[Ray], visit: impl FnMut(&[Hit])) {
        let mut hits = vec![vec![]; rays.len()];
        self.all_hits_many(rays, &mut hits);
        hits.iter().map(Vec::as_slice).for_each(visit);
    }
}

/// The crossings of a watertight BVH.
pub(crate) struct Crossings<'a>(pub(crate) &'a TriangleBvh<Watertight>);

impl Target for Crossings<'_> {
    fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.0.closest_hits(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.0.occluded_many(rays, occluded);
    }

    fn all_hits(&self, rays: &[Ray], visit: impl FnMut(&[Hit])) {
        let mut lists = HitLists::new();
        self.0.crossings_listed(rays, &mut lists);
        lists.of_rays().for_each(visit);
    }
}
