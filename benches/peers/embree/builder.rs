//! The trees of Embree's builders over boxes: those of its own triangle scenes, which it does not show, have the same binning and splits.
//!
//! Reads: boxes, a function that splits a primitive. Writes: nodes of up to [`Shape::width`] children, leaves.
//! Holds: what Embree calls writes only the state passed with it, under a lock, and splits primitives by a function that threads may
//! share; names of nodes are numbers, never addresses.
//! Source: Embree API reference, `rtcBuildBVH`.
#![expect(unsafe_code, reason = "the C interface; every block states why it is sound")]

use std::{
    ffi::c_void,
    mem, ptr, slice,
    sync::{Mutex, PoisonError},
};

use super::{
    library::{Handle, Library},
    scene::{Device, SceneError},
};

/// The least and the greatest corner of a box.
pub type Bounds = [[f32; 3]; 2];

/// The boxes of the parts of a primitive within a box, below and above a plane perpendicular to an axis.
pub type Split<'a> = &'a (dyn Fn(u32, Bounds, usize, f32) -> [Bounds; 2] + Sync);

/// The form of a tree.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Most children of a node, at most 8.
    pub width: u32,
    /// Fewest primitives of a node that is divided, less one.
    pub min_leaf: u32,
    /// Most primitives of a leaf.
    pub max_leaf: u32,
    /// References for each primitive, at least 1; above 1 primitives are split.
    pub references: f32,
}

impl Shape {
    /// What Embree's scenes of high quality have: leaves of up to seven blocks of four, and a fifth more references.
    pub const HIGH: Self = Self { width: 8, min_leaf: 4, max_leaf: 28, references: 1.2 };
}

/// A primitive in a leaf, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Index of the primitive.
    pub primitive: u32,
    /// The box of the part.
    pub bounds: Bounds,
}

/// A subtree, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subtree {
    /// Of [`Tree::nodes`].
    Node(usize),
    /// Of [`Tree::leaves`].
    Leaf(usize),
}

/// A tree.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// `None` without primitives.
    pub root: Option<Subtree>,
    /// Children with their boxes.
    pub nodes: Vec<Vec<(Subtree, Bounds)>>,
    /// Primitives, at least one each.
    pub leaves: Vec<Vec<Part>>,
}

/// `RTCBuildPrimitive`.
#[repr(C, align(32))]
#[derive(Clone, Copy, Default)]
struct Primitive {
    lower: [f32; 3],
    geometry: u32,
    upper: [f32; 3],
    primitive: u32,
}

/// `RTCBounds`.
#[repr(C, align(16))]
struct PaddedBounds {
    lower: [f32; 3],
    pad_lower: f32,
    upper: [f32; 3],
    pad_upper: f32,
}

type NewNode = unsafe extern "C" fn(*mut c_void, u32, *mut c_void) -> *mut c_void;
type SetChildren = unsafe extern "C" fn(*mut c_void, *mut *mut c_void, u32, *mut c_void);
type SetBounds = unsafe extern "C" fn(*mut c_void, *mut *const PaddedBounds, u32, *mut c_void);
type NewLeaf = unsafe extern "C" fn(*mut c_void, *const Primitive, usize, *mut c_void) -> *mut c_void;
type SplitPrimitive =
    unsafe extern "C" fn(*const Primitive, u32, f32, *mut PaddedBounds, *mut PaddedBounds, *mut c_void);

/// `RTCBuildArguments`.
#[repr(C)]
pub(super) struct Arguments {
    n_bytes: usize,
    quality: i32,
    flags: i32,
    max_branching: u32,
    max_depth: u32,
    sah_block: u32,
    min_leaf: u32,
    max_leaf: u32,
    traversal_cost: f32,
    intersection_cost: f32,
    bvh: Handle,
    primitives: *mut Primitive,
    n_primitives: usize,
    capacity: usize,
    new_node: NewNode,
    set_children: SetChildren,
    set_bounds: SetBounds,
    new_leaf: NewLeaf,
    split: Option<SplitPrimitive>,
    progress: *const c_void,
    user: *mut c_void,
}

const QUALITY_HIGH: i32 = 2;
/// Depth of a tree of this many children: Embree's own eight-wide ones have 32, the last eight of them without a choice by cost.
fn max_depth(width: u32) -> u32 {
    if width == 2 { 8 + 3 * 24 } else { 32 }
}
/// Triangles of a block of its leaves.
const BLOCK: u32 = 4;

/// What callbacks work on.
struct State<'a> {
    split: Split<'a>,
    tree: Mutex<Tree>,
}

impl State<'_> {
    fn with<T>(&self, work: impl FnOnce(&mut Tree) -> T) -> T {
        work(&mut self.tree.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Subtree {
    /// A number that is not null, as Embree passes it around.
    fn name(self) -> *mut c_void {
        ptr::without_provenance_mut(match self {
            Self::Node(i) => 2 * i + 2,
            Self::Leaf(i) => 2 * i + 3,
        })
    }

    fn named(name: *const c_void) -> Option<Self> {
        let number = name.addr().checked_sub(2)?;
        Some(if number.is_multiple_of(2) { Self::Node(number / 2) } else { Self::Leaf(number / 2) })
    }
}

/// Builds Embree's tree of high quality over boxes, on one thread.
///
/// # Errors If Embree reports an error.
pub fn build(library: &Library, boxes: &[Bounds], split: Split<'_>, shape: &Shape) -> Result<Tree, SceneError> {
    let device = Device::new(library, 1)?;
    let primitive = |(&[lower, upper], primitive): (&Bounds, u32)| Primitive { lower, geometry: 0, upper, primitive };
    let mut primitives: Vec<Primitive> = boxes.iter().zip(0..).map(primitive).collect();
    let n_primitives = primitives.len();
    let capacity = (n_primitives as f64 * f64::from(shape.references.max(1.0))) as usize;
    primitives.resize(capacity, Primitive::default());
    let state = State { split, tree: Mutex::default() };
    let f = &library.functions;
    // SAFETY: the device is alive; the BVH is released once below.
    let bvh = unsafe { (f.new_bvh)(device.handle) };
    let arguments = Arguments {
        n_bytes: mem::size_of::<Arguments>(),
        quality: QUALITY_HIGH,
        flags: 0,
        max_branching: shape.width,
        max_depth: max_depth(shape.width),
        sah_block: BLOCK,
        min_leaf: shape.min_leaf,
        max_leaf: shape.max_leaf,
        traversal_cost: 1.0,
        intersection_cost: 1.0,
        bvh,
        primitives: primitives.as_mut_ptr(),
        n_primitives,
        capacity,
        new_node,
        set_children,
        set_bounds,
        new_leaf,
        split: (capacity > n_primitives).then_some(split_primitive as SplitPrimitive),
        progress: ptr::null(),
        user: ptr::from_ref(&state).cast_mut().cast(),
    };
    // SAFETY: the arguments have the layout of the header; the primitives have the given capacity, and they and the state outlive the call,
    // which ends all callbacks. The BVH is released once, before its device; no node lies in its memory.
    let root = unsafe {
        let root = if n_primitives == 0 { ptr::null_mut() } else { (f.build_bvh)(&raw const arguments) };
        (f.release_bvh)(bvh);
        root
    };
    device.check()?;
    let mut tree = state.tree.into_inner().unwrap_or_else(PoisonError::into_inner);
    tree.root = Subtree::named(root);
    Ok(tree)
}

unsafe extern "C" fn new_node(_: *mut c_void, _: u32, user: *mut c_void) -> *mut c_void {
    // SAFETY: `user` is the state of `build`, which is alive while Embree builds and only read.
    let state = unsafe { &*user.cast::<State<'_>>() };
    state.with(|tree| {
        tree.nodes.push(vec![]);
        Subtree::Node(tree.nodes.len() - 1).name()
    })
}

unsafe extern "C" fn set_bounds(node: *mut c_void, bounds: *mut *const PaddedBounds, n: u32, user: *mut c_void) {
    // SAFETY: as in `new_node`; Embree passes `n` pointers to boxes, all valid during the call.
    let (state, all) = unsafe {
        let all = slice::from_raw_parts(bounds, n as usize).iter().map(|&bounds| [(*bounds).lower, (*bounds).upper]);
        (&*user.cast::<State<'_>>(), all.collect::<Vec<Bounds>>())
    };
    let Some(Subtree::Node(node)) = Subtree::named(node) else { unreachable!("only nodes have children") };
    // Children are made afterwards.
    state.with(|tree| tree.nodes[node] = all.into_iter().map(|bounds| (Subtree::Leaf(usize::MAX), bounds)).collect());
}

unsafe extern "C" fn set_children(node: *mut c_void, children: *mut *mut c_void, n: u32, user: *mut c_void) {
    // SAFETY: as in `new_node`; Embree passes `n` names.
    let (state, names) =
        unsafe { (&*user.cast::<State<'_>>(), slice::from_raw_parts(children.cast_const(), n as usize)) };
    let Some(Subtree::Node(node)) = Subtree::named(node) else { unreachable!("only nodes have children") };
    state.with(|tree| {
        for ((child, _), &name) in tree.nodes[node].iter_mut().zip(names) {
            *child = Subtree::named(name).expect("callbacks return no null");
        }
    });
}

unsafe extern "C" fn new_leaf(
    _: *mut c_void,
    primitives: *const Primitive,
    n: usize,
    user: *mut c_void,
) -> *mut c_void {
    // SAFETY: as in `new_node`; Embree passes `n` primitives.
    let (state, primitives) = unsafe { (&*user.cast::<State<'_>>(), slice::from_raw_parts(primitives, n)) };
    let part = |p: &Primitive| Part { primitive: p.primitive, bounds: [p.lower, p.upper] };
    state.with(|tree| {
        tree.leaves.push(primitives.iter().map(part).collect());
        Subtree::Leaf(tree.leaves.len() - 1).name()
    })
}

unsafe extern "C" fn split_primitive(
    primitive: *const Primitive,
    dimension: u32,
    position: f32,
    left: *mut PaddedBounds,
    right: *mut PaddedBounds,
    user: *mut c_void,
) {
    // SAFETY: as in `new_node`; Embree passes a primitive to read.
    let (state, whole) = unsafe { (&*user.cast::<State<'_>>(), *primitive) };
    let parts = (state.split)(whole.primitive, [whole.lower, whole.upper], dimension as usize, position);
    for (out, [lower, upper]) in [left, right].into_iter().zip(parts) {
        // SAFETY: Embree passes two boxes to write, which may be parts of primitives: their padding holds numbers and is kept.
        unsafe {
            (*out).lower = lower;
            (*out).upper = upper;
        }
    }
}
