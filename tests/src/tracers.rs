//! Everything that traces rays through a mesh, by name: binary and wide BVHs and BIHs, one level and two, every SIMD path, the device.

use std::{cell::Cell, rc::Rc};

use canted_bih::{Bih, BihConfig, LeafSize};
use canted_bvh2::{Bvh2, Bvh2Config};
use canted_fixtures::Mesh;
use canted_gpu::{Choice, DeviceHit, Gpu, HIT_ERROR, Options, Outcome, Source, TracedScene, block_on};
use canted_kdtree::{KdTraversal, KdTree, KdTreeConfig};
use canted_lbvh::{Strategy, VolumeConfig};
use canted_obb::{Affine, PrimId};
use canted_tlas::{Instance, Tlas, TopConfig};
use canted_trace::{Accept, Crossings, Hit, InstanceId, Intersect, Query, Ray, Side};
use canted_wide::{Config, Costs, Preset, SimdPath, TriangleBvh};

use crate::{
    brute,
    crossings::{self, all_hits, opposite},
    scenes::{baked, mirrors, with_another},
};

/// A mesh that can be queried with rays.
pub trait Tracer {
    /// The closest hit of each ray; peers set only `t` and the primitive.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>>;

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &[Ray]) -> Vec<bool>;

    /// Every crossing of the surface, in order, with its side by the world-space winding; `None` if only first hits are supported.
    fn crossings(&self, _: &Ray) -> Option<Vec<Hit>> {
        None
    }
}

/// The guarantee of a tracer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Guarantee {
    /// The bits of a loop over all triangles.
    Loop,
    /// All hits of that loop, and others only within this error of the ray, relative to `|o|∞ + ρ∞`.
    Device(f32),
    /// None: another project's tracer.
    Peer,
}

/// Makes a tracer for a mesh and its transform.
pub type Make = Box<dyn Fn(&Mesh, &Affine) -> Box<dyn Tracer>>;

/// A tracing method, by name.
pub struct Method {
    /// Name for tables.
    pub name: String,
    /// Its guarantee.
    pub guarantee: Guarantee,
    /// Builds the tracer. With one level, vertices are transformed and rounded.
    pub make: Make,
    /// Queries so far that the CPU answered because a driver ended the device's traversal early.
    n_cut: Rc<Cell<usize>>,
}

impl Method {
    /// A method that never ends early.
    #[must_use]
    pub fn new(name: impl Into<String>, guarantee: Guarantee, make: Make) -> Self {
        Self { name: name.into(), guarantee, make, n_cut: Rc::default() }
    }

    /// The result of `ask`, and how many queries a driver ended early meanwhile.
    pub fn with_cuts<T>(&self, ask: impl FnOnce() -> T) -> (T, usize) {
        let before = self.n_cut.get();
        let answer = ask();
        (answer, self.n_cut.get() - before)
    }

    /// Builds it for an untransformed mesh.
    #[must_use]
    pub fn of(&self, mesh: &Mesh) -> Box<dyn Tracer> {
        (self.make)(mesh, &Affine::IDENTITY)
    }

    fn of_one<T: Tracer + 'static>(name: impl Into<String>, make: impl Fn(Mesh) -> T + 'static) -> Self {
        let make: Make = Box::new(move |mesh, placement| Box::new(make(baked(mesh, placement))));
        Self::new(name, Guarantee::Loop, make)
    }

    fn of_two<B: Intersect + 'static>(name: impl Into<String>, make: impl Fn(&Mesh) -> B + 'static) -> Self {
        let make: Make = Box::new(move |mesh, placement| Box::new(TwoLevels::new(make(mesh), mesh, placement)));
        Self::new(name, Guarantee::Loop, make)
    }
}

/// All our methods that this machine supports, and the names of those that it lacks.
#[must_use]
pub fn ours() -> (Vec<Method>, Vec<String>) {
    let (there, lacking): (Vec<_>, Vec<_>) = SimdPath::ALL.into_iter().partition(|path| path.is_available());
    let mut missing: Vec<String> = lacking.into_iter().map(|path| path.name().to_owned()).collect();
    let mut methods = vec![
        Method::of_one("binary aabb", |mesh| OneLevel::new(mesh, |mesh| binary(mesh, Strategy::Aabb))),
        Method::of_one("binary dop", |mesh| OneLevel::new(mesh, |mesh| binary(mesh, Strategy::Dop))),
        Method::of_one("binary combined", |mesh| OneLevel::new(mesh, |mesh| binary(mesh, Strategy::Combined))),
        Method::of_one("bih", |mesh| OneLevel::new(mesh, |mesh| bih(mesh, 4))),
        Method::of_one("bih leaf 1", |mesh| OneLevel::new(mesh, |mesh| bih(mesh, 1))),
        Method::of_one("kd-tree", |mesh| OneLevel::new(mesh, |mesh| kd_tree(mesh, KdTraversal::Stack))),
        Method::of_one("kd-tree ropes", |mesh| OneLevel::new(mesh, |mesh| kd_tree(mesh, KdTraversal::Ropes))),
        Method::of_two("two-level binary", |mesh| binary(mesh, Strategy::Dop)),
        Method::of_two("two-level bih", |mesh| bih(mesh, 4)),
        Method::of_two("two-level kd-tree", |mesh| kd_tree(mesh, KdTraversal::Stack)),
    ];
    for path in there {
        let name = path.name();
        methods
            .push(Method::of_one(format!("wide {name}"), move |mesh| wide(&mesh, &Config::default()).with_path(path)));
        methods.push(Method::of_one(format!("wide oriented {name}"), move |mesh| {
            wide(&mesh, &many_oriented()).with_path(path)
        }));
    }
    methods.push(Method::of_two("two-level wide", |mesh| wide(mesh, &Config::default())));
    match block_on(Gpu::open(&Choice::Best)) {
        Ok(gpu) => methods.extend(device_methods(&Rc::new(gpu))),
        Err(error) => missing.push(format!("device ({error})")),
    }
    (methods, missing)
}

/// Two levels of binary and of wide BVHs, the wide ones on every available SIMD path, and on the device if there is one.
#[must_use]
pub fn two_levels() -> Vec<Method> {
    let mut methods =
        vec![Method::of_two("binary", |mesh| binary(mesh, Strategy::Dop)), Method::of_two("bih", |mesh| bih(mesh, 4))];
    methods.push(Method::of_two("kd-tree", |mesh| kd_tree(mesh, KdTraversal::Stack)));
    for path in SimdPath::ALL.into_iter().filter(|path| path.is_available()) {
        let make: Make = Box::new(move |mesh, placement| {
            let tree = wide(mesh, &Config::default()).with_path(path);
            Box::new(TwoLevels::new(tree, mesh, placement).with_path(path))
        });
        methods.push(Method::new(format!("wide {}", path.name()), Guarantee::Loop, make));
    }
    if let Ok(gpu) = block_on(Gpu::open(&Choice::Best)) {
        let [_, two] = device_methods(&Rc::new(gpu));
        methods.push(Method { name: "device".to_owned(), ..two });
    }
    methods
}

/// A binary BVH with these volumes.
fn binary(mesh: &Mesh, strategy: Strategy) -> Bvh2 {
    let config = Bvh2Config { volumes: VolumeConfig { strategy, fallback: true }, ..Bvh2Config::default() };
    Bvh2::build(&mesh.positions, &mesh.triangles, &config).expect("a mesh of finite vertices")
}

/// A BIH with leaves of this size.
fn bih(mesh: &Mesh, leaf_size: u32) -> Bih {
    let config = BihConfig { leaf_size: LeafSize::AtMost(leaf_size), ..BihConfig::default() };
    Bih::build(&mesh.positions, &mesh.triangles, &config).expect("a mesh of finite vertices")
}

/// A kd-tree.
fn kd_tree(mesh: &Mesh, traversal: KdTraversal) -> KdTree {
    let config = KdTreeConfig { traversal, ..KdTreeConfig::default() };
    KdTree::build(&mesh.positions, &mesh.triangles, &config).expect("a mesh of finite vertices")
}

/// A wide BVH.
fn wide(mesh: &Mesh, config: &Config) -> TriangleBvh {
    TriangleBvh::build_with(&mesh.positions, &mesh.triangles, *config).expect("a mesh of finite vertices")
}

/// A configuration with many oriented nodes: their cost is nearly zero, and leaves hold one triangle.
#[must_use]
pub fn many_oriented() -> Config {
    let costs = Costs { aligned_node: 1e6, oriented_node: 0.01, leaf: 0.0, block: 0.01, max_leaf: 1 };
    Config { costs, rotate_mesh: false, ..Config::preset(Preset::Balanced) }
}

/// A structure over triangles with its mesh.
struct OneLevel<B> {
    bvh: B,
    mesh: Mesh,
}

impl<B: Intersect> OneLevel<B> {
    fn new(mesh: Mesh, build: impl Fn(&Mesh) -> B) -> Self {
        Self { bvh: build(&mesh), mesh }
    }
}

impl<B: Intersect> Tracer for OneLevel<B> {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        rays.iter().map(|ray| self.bvh.closest_hit(ray)).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.bvh.occluded(ray)).collect()
    }

    fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
        let hits = all_hits(|query| self.bvh.closest_hit_with(ray, query));
        Some(crossings::of_hits(&self.mesh, ray, hits))
    }
}

impl Tracer for TriangleBvh {
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
        Crossings::crossings(self, ray, &mut found);
        Some(found)
    }
}

/// An instanced mesh, and a second instance far away so that the top level has more than one leaf.
struct TwoLevels<B: Intersect> {
    tlas: Tlas<B>,
    mesh: Mesh,
    placement: Affine,
}

impl<B: Intersect> TwoLevels<B> {
    fn new(blas: B, mesh: &Mesh, placement: &Affine) -> Self {
        let instances = with_another(mesh, placement);
        let tlas = Tlas::new(vec![blas], &instances, TopConfig::default()).expect("a shift is invertible");
        Self { tlas, mesh: mesh.clone(), placement: *placement }
    }

    fn with_path(self, path: SimdPath) -> Self {
        Self { tlas: self.tlas.with_path(path), ..self }
    }
}

impl<B: Intersect> Tracer for TwoLevels<B> {
    /// Only the first instance is queried.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        rays.iter().map(|ray| self.tlas.closest_hit_with(ray, &mut of_the_first())).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.tlas.occluded_with(ray, &mut of_the_first())).collect()
    }

    /// Computed in object space, where the kernel runs; a mirror swaps the sides.
    fn crossings(&self, ray: &Ray) -> Option<Vec<Hit>> {
        let hits = all_hits(|query| self.tlas.closest_hit_with(ray, query));
        let mut crossings = crossings::of_hits(&self.mesh, &brute::ray_object(&self.placement, ray), hits);
        if mirrors(&self.placement) {
            crossings.iter_mut().for_each(|hit| hit.side = opposite(hit.side));
        }
        Some(crossings)
    }
}

/// Accepts only hits of the first instance.
fn of_the_first() -> impl Query {
    Accept(|hit: &Hit| hit.instance == InstanceId(0))
}

/// The device with one level and with two.
fn device_methods(gpu: &Rc<Gpu>) -> [Method; 2] {
    let cuts: [Rc<Cell<usize>>; 2] = Default::default();
    let [(of_one, cuts_of_one), (of_two, cuts_of_two)] = cuts.each_ref().map(|cuts| (Rc::clone(gpu), Rc::clone(cuts)));
    let one: Make = Box::new(move |mesh, placement| {
        let tree = wide(&baked(mesh, placement), &Config::default());
        let scene = block_on(TracedScene::new(&of_one, Source::wide(&tree), Options::default()))
            .expect("small meshes fit every device");
        Box::new(Device { gpu: Rc::clone(&of_one), scene, tree: Box::new(tree), n_cut: Rc::clone(&cuts_of_one) })
    });
    let two: Make = Box::new(move |mesh, placement| {
        let tree = wide(mesh, &Config::default());
        let placed = [Instance::new(0, *placement)];
        let scene = block_on(TracedScene::new(&of_two, Source::tlas([&tree], &placed), Options::default()))
            .expect("transforms in tests are well conditioned");
        let tree = Box::new(TwoLevels::new(tree, mesh, placement));
        Box::new(Device { gpu: Rc::clone(&of_two), scene, tree, n_cut: Rc::clone(&cuts_of_two) })
    });
    let [cuts_of_one, cuts_of_two] = cuts;
    // Static instances double the error bound of hits (`HitError::with` in `canted-gpu`).
    [
        Method { n_cut: cuts_of_one, ..Method::new("device", Guarantee::Device(HIT_ERROR), one) },
        Method { n_cut: cuts_of_two, ..Method::new("two-level device", Guarantee::Device(2.0 * HIT_ERROR), two) },
    ]
}

/// A scene on the device, and on the CPU for traversals that a driver ends early.
struct Device {
    gpu: Rc<Gpu>,
    scene: TracedScene,
    tree: Box<dyn Tracer>,
    n_cut: Rc<Cell<usize>>,
}

impl Device {
    /// The CPU's answer instead of the device's.
    fn cut<T>(&self, ask: impl FnOnce(&dyn Tracer) -> T) -> T {
        self.n_cut.update(|n| n + 1);
        ask(self.tree.as_ref())
    }
}

impl Tracer for Device {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let answers = block_on(self.scene.closest_hits(&self.gpu, rays)).expect("the device is not lost");
        let known = |(answer, ray): (Outcome<Option<DeviceHit>>, &Ray)| match answer {
            Outcome::Incomplete => self.cut(|tree| tree.closest(std::slice::from_ref(ray))[0]),
            Outcome::Complete(hit) => hit.map(|hit| Hit {
                t: hit.t,
                u: hit.u,
                v: hit.v,
                primitive: PrimId(hit.primitive),
                instance: InstanceId(hit.instance),
                side: Side::Front,
            }),
        };
        answers.into_iter().zip(rays).map(known).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let answers = block_on(self.scene.occluded(&self.gpu, rays)).expect("the device is not lost");
        let known = |(answer, ray): (Outcome<bool>, &Ray)| match answer {
            Outcome::Incomplete => self.cut(|tree| tree.occluded(std::slice::from_ref(ray))[0]),
            Outcome::Complete(found) => found,
        };
        answers.into_iter().zip(rays).map(known).collect()
    }
}
