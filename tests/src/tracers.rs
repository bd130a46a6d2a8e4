//! Everything that traces rays through a mesh, by name: both kinds of tree, one level and two, every path, the device.

mod device;

use std::{cell::Cell, rc::Rc};

use canted_bvh2::{BuildConfig, Bvh2};
use canted_fixtures::Mesh;
use canted_gpu::{Choice, Gpu};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::Affine;
use canted_tlas::{Blas, Instance, Tlas, TopConfig};
use canted_trace::{Hit, InstanceId, Ray, Watertight};
use canted_wide::{Config, Costs, Preset, SimdPath, TriangleBvh};

use crate::{
    closed::{baked, mirrors},
    crossings::{self, all_hits, opposite},
    instances,
};

/// Something that holds a mesh and answers rays.
pub trait Tracer {
    /// The nearest hit of each ray; of a peer's only `t` and the primitive count.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>>;

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &[Ray]) -> Vec<bool>;

    /// Every crossing of the surface, in order, its side by the winding in world space; `None` of who tells first hits alone.
    fn crossings(&self, _: &Ray) -> Option<Vec<Hit>> {
        None
    }
}

/// What a tracer promises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Word {
    /// The answers of a loop over all triangles, bit for bit.
    Loop,
    /// Whatever that loop hits, and besides only what is within this much of the ray, relative to `|o|∞ + ρ∞`.
    Device(f32),
    /// Nothing: another project's.
    Peer,
}

/// Makes a tracer for a mesh and where it stands.
pub type Make = Box<dyn Fn(&Mesh, &Affine) -> Box<dyn Tracer>>;

/// A way to trace, by name.
pub struct Way {
    /// The name in tables.
    pub name: String,
    /// What it promises.
    pub word: Word,
    /// Builds it. Where there is one level, vertices are moved and rounded.
    pub make: Make,
    /// Answers so far that a driver cut short: the CPU gave them in the device's place.
    n_cut: Rc<Cell<usize>>,
}

impl Way {
    /// A way of which no answer is cut short.
    #[must_use]
    pub fn new(name: impl Into<String>, word: Word, make: Make) -> Self {
        Self { name: name.into(), word, make, n_cut: Rc::default() }
    }

    /// What `ask` gives, and how many answers a driver cut short meanwhile.
    pub fn with_cuts<T>(&self, ask: impl FnOnce() -> T) -> (T, usize) {
        let before = self.n_cut.get();
        let answer = ask();
        (answer, self.n_cut.get() - before)
    }

    /// Builds it for a mesh that stands as it is.
    #[must_use]
    pub fn of(&self, mesh: &Mesh) -> Box<dyn Tracer> {
        (self.make)(mesh, &Affine::IDENTITY)
    }

    fn of_one<T: Tracer + 'static>(name: impl Into<String>, make: impl Fn(Mesh) -> T + 'static) -> Self {
        let make: Make = Box::new(move |mesh, place| Box::new(make(baked(mesh, place))));
        Self::new(name, Word::Loop, make)
    }

    fn of_two<B: Blas + 'static>(name: impl Into<String>, make: impl Fn(&Mesh) -> B + 'static) -> Self {
        let make: Make = Box::new(move |mesh, place| Box::new(TwoLevels::new(make(mesh), mesh, place)));
        Self::new(name, Word::Loop, make)
    }
}

/// Every way of ours that this machine has; those that it lacks, by name.
#[must_use]
pub fn ours() -> (Vec<Way>, Vec<String>) {
    let (there, lacking): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    let mut missing: Vec<String> = lacking.into_iter().map(|path| path.name().to_owned()).collect();
    let mut ways = vec![
        Way::of_one("binary aabb", |mesh| OneLevel::new(mesh, Strategy::Aabb)),
        Way::of_one("binary dop", |mesh| OneLevel::new(mesh, Strategy::Dop)),
        Way::of_one("binary combined", |mesh| OneLevel::new(mesh, Strategy::Combined)),
        Way::of_two("two levels of binary", |mesh| binary(mesh, Strategy::Dop)),
    ];
    for path in there {
        let name = path.name();
        ways.push(Way::of_one(format!("wide {name}"), move |mesh| wide(&mesh, &Config::default()).with_path(path)));
        ways.push(Way::of_one(format!("wide lean {name}"), move |mesh| wide(&mesh, &lean()).with_path(path)));
    }
    ways.push(Way::of_two("two levels of wide", |mesh| wide(mesh, &Config::default())));
    match Gpu::open(&Choice::Best) {
        Ok(gpu) => ways.extend(device::ways(&Rc::new(gpu))),
        Err(error) => missing.push(format!("device ({error})")),
    }
    (ways, missing)
}

/// Two levels by each kind of tree, both levels of the wide one on every path that this machine has, and by the device if it has
/// one.
#[must_use]
pub fn two_levels() -> Vec<Way> {
    let mut ways = vec![Way::of_two("binary", |mesh| binary(mesh, Strategy::Dop))];
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        let make: Make = Box::new(move |mesh, place| {
            let tree = wide(mesh, &Config::default()).with_path(path);
            Box::new(TwoLevels::new(tree, mesh, place).with_path(path))
        });
        ways.push(Way::new(format!("wide {}", path.name()), Word::Loop, make));
    }
    if let Ok(gpu) = Gpu::open(&Choice::Best) {
        let [_, two] = device::ways(&Rc::new(gpu));
        ways.push(Way { name: "device".to_owned(), ..two });
    }
    ways
}

/// A binary tree with these volumes.
fn binary(mesh: &Mesh, strategy: Strategy) -> Bvh2<Watertight> {
    let config = BuildConfig { volumes: VolumeConfig { strategy, fallback: true }, ..BuildConfig::default() };
    Bvh2::build(&mesh.positions, &mesh.triangles, &config).expect("a mesh of finite vertices")
}

/// An eight-wide tree.
fn wide(mesh: &Mesh, config: &Config) -> TriangleBvh<Watertight> {
    TriangleBvh::build(&mesh.positions, &mesh.triangles, config).expect("a mesh of finite vertices")
}

/// Nodes with a frame for each child so cheap that hardly another is worth having, over leaves of one triangle.
#[must_use]
pub fn lean() -> Config {
    let costs = Costs { aligned_node: 1e6, oriented_node: 0.01, leaf: 0.0, block: 0.01, max_leaf: 1 };
    Config { costs, rotate_mesh: false, ..Config::preset(Preset::Balanced) }
}

/// A binary tree and what it is over.
struct OneLevel {
    blas: Bvh2<Watertight>,
    mesh: Mesh,
}

impl OneLevel {
    fn new(mesh: Mesh, strategy: Strategy) -> Self {
        Self { blas: binary(&mesh, strategy), mesh }
    }
}

impl Tracer for OneLevel {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        rays.iter().map(|ray| self.blas.closest_hit(ray)).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.blas.occluded(ray)).collect()
    }

    fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
        let hits = all_hits(|query| self.blas.closest_hit_with(ray, InstanceId(0), query));
        Some(crossings::of_hits(&self.mesh, ray, hits))
    }
}

impl Tracer for TriangleBvh<Watertight> {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        self.closest_hits(rays, &mut hits);
        hits
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let mut occluded = vec![false; rays.len()];
        self.occluded_many(rays, &mut occluded);
        occluded
    }

    fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
        let mut found = vec![];
        Self::crossings(self, ray, &mut found);
        Some(found)
    }
}

/// A mesh where it stands, and once more far off, which makes the top level a tree.
struct TwoLevels<B: Blas> {
    tlas: Tlas<B>,
    mesh: Mesh,
    place: Affine,
}

impl<B: Blas> TwoLevels<B> {
    #[expect(clippy::cast_possible_truncation, reason = "far off will do")]
    fn new(blas: B, mesh: &Mesh, place: &Affine) -> Self {
        let here = Instance::new(0, *place);
        let mut there = here;
        there.world_from_object.columns[3][0] += (9.0 * baked(mesh, place).diagonal()) as f32;
        let tlas = Tlas::new(vec![blas], &[here, there], TopConfig::default()).expect("a shift is invertible");
        Self { tlas, mesh: mesh.clone(), place: *place }
    }

    fn with_path(self, path: SimdPath) -> Self {
        Self { tlas: self.tlas.with_path(path), ..self }
    }
}

impl<B: Blas> Tracer for TwoLevels<B> {
    /// Only the instance that stands where the mesh does is asked.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        rays.iter().map(|ray| self.tlas.closest_hit_with(ray, &mut OfTheFirst)).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.tlas.occluded_with(ray, &mut OfTheFirst)).collect()
    }

    /// As the triangles see the ray: in object space, whose winding a mirror turns.
    fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
        let hits = all_hits(|query| self.tlas.closest_hit_with(ray, query));
        let mut crossings = crossings::of_hits(&self.mesh, &instances::ray_object(&self.place, ray), hits);
        if mirrors(&self.place) {
            crossings.iter_mut().for_each(|hit| hit.side = opposite(hit.side));
        }
        Some(crossings)
    }
}

/// Accepts hits of the first instance alone.
struct OfTheFirst;

impl canted_trace::Query for OfTheFirst {
    fn accepts(&mut self, hit: &Hit) -> bool {
        hit.instance == InstanceId(0)
    }
}
