//! Scenes of triangle meshes and instances, and scenes that change: vertices of a mesh, transforms of instances.
//!
//! Reads: meshes, rays, new vertices or transforms. Writes: hits.
//! Holds: every pointer passed to Embree outlives Embree's use of it; a scene is only read once committed; a change takes the scene
//! exclusively, so no ray is traced meanwhile.
//! Source: Embree API reference, `rtcore_scene.h`, `rtcore_geometry.h`, `rtcore_ray.h`.
#![expect(unsafe_code, reason = "the C interface; every block states why it is sound")]

use std::{
    error::Error,
    ffi::{CString, c_void},
    fmt, ptr,
    sync::atomic::{AtomicIsize, Ordering},
};

use super::{
    Found, Mesh, Options, Placement, Quality,
    library::{Context3, Handle, Library, Query, RayHit},
};

const INVALID: u32 = u32::MAX;
const TYPE_TRIANGLE: i32 = 0;
const TYPE_INSTANCE: i32 = 121;
const BUFFER_INDEX: i32 = 0;
const BUFFER_VERTEX: i32 = 1;
const FORMAT_UINT3: i32 = 0x5003;
const FORMAT_FLOAT3: i32 = 0x9003;
const FORMAT_FLOAT3X4_COLUMN_MAJOR: i32 = 0x9234;
const FLAG_DYNAMIC: i32 = 1;
const FLAG_ROBUST: i32 = 1 << 2;
const QUALITY_LOW: i32 = 0;
const QUALITY_MEDIUM: i32 = 1;
const QUALITY_HIGH: i32 = 2;
const QUALITY_REFIT: i32 = 3;

/// Why a scene was not built: Embree's error code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneError(i32);

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree rejected the scene with error {}", self.0)
    }
}

impl Error for SceneError {}

/// A device and the number of bytes it has allocated.
pub(super) struct Device {
    pub(super) library: Library,
    pub(super) handle: Handle,
    n_bytes: Box<AtomicIsize>,
}

impl Device {
    pub(super) fn new(library: &Library, n_threads: usize) -> Result<Self, SceneError> {
        let config = CString::new(format!("threads={n_threads}")).expect("no zero byte in it");
        let n_bytes = Box::new(AtomicIsize::new(0));
        let f = &library.functions;
        // SAFETY: the configuration is a C string that lives through the call.
        let handle = unsafe { (f.new_device)(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: a null device returns the error of the thread.
            return Err(SceneError(unsafe { (f.device_error)(ptr::null_mut()) }));
        }
        let count = ptr::from_ref::<AtomicIsize>(&n_bytes).cast_mut().cast();
        // SAFETY: the count is boxed, so it stays where it is, and dropped after the device.
        unsafe { (f.set_memory_monitor)(handle, Some(count_bytes), count) };
        Ok(Self { library: *library, handle, n_bytes })
    }

    /// The device's first error since the last check.
    pub(super) fn check(&self) -> Result<(), SceneError> {
        // SAFETY: the device is alive.
        match unsafe { (self.library.functions.device_error)(self.handle) } {
            0 => Ok(()),
            code => Err(SceneError(code)),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: released once, and fields are dropped only afterwards: the count outlives the device.
        unsafe { (self.library.functions.release_device)(self.handle) };
    }
}

/// Adds what Embree allocates and subtracts what it frees; never rejects an allocation.
unsafe extern "C" fn count_bytes(count: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: `count` is the counter that `Device::new` registered, and it outlives the device.
    unsafe { &*count.cast::<AtomicIsize>() }.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// Arrays that Embree reads in place.
pub(super) struct Buffers {
    /// Followed by one float, because Embree reads 16 bytes at each vertex.
    pub(super) positions: Vec<f32>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The first point of each segment of curves.
    pub(super) firsts: Vec<u32>,
    /// See [`Curves`](super::Curves).
    pub(super) neighbors: Vec<u8>,
}

impl Buffers {
    fn new(mesh: &Mesh<'_>) -> Self {
        let positions = mesh.positions.as_flattened().iter().copied().chain([0.0]).collect();
        Self { positions, triangles: mesh.triangles.to_vec(), firsts: vec![], neighbors: vec![] }
    }
}

/// A built scene.
pub struct Scene {
    /// The scene that rays enter, then the scenes of instanced meshes.
    pub(super) scenes: Vec<Handle>,
    pub(super) device: Device,
    pub(super) buffers: Vec<Buffers>,
}

// SAFETY: a committed scene is only read, which Embree allows from any thread; nothing here changes one afterwards.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    /// Builds one mesh, without instances.
    ///
    /// # Errors If Embree reports an error.
    pub fn of_mesh(library: &Library, mesh: &Mesh<'_>, options: &Options) -> Result<Self, SceneError> {
        let device = Device::new(library, options.n_threads)?;
        let mut scene = Self { scenes: vec![], device, buffers: vec![Buffers::new(mesh)] };
        scene.start(options);
        scene.attach_mesh(0, 0, options);
        scene.commit(0)?;
        Ok(scene)
    }

    /// Builds each mesh once, and a level of instances above.
    ///
    /// # Errors If Embree reports an error.
    ///
    /// # Panics If a placement's mesh index is out of range.
    pub fn of_instances(
        library: &Library,
        meshes: &[Mesh<'_>],
        placements: &[Placement],
        options: &Options,
    ) -> Result<Self, SceneError> {
        Self::of_levels(library, meshes, placements, [options; 2])
    }

    /// [`Scene::of_instances`] with options of the instances and of the meshes.
    fn of_levels(
        library: &Library,
        meshes: &[Mesh<'_>],
        placements: &[Placement],
        [top, options]: [&Options; 2],
    ) -> Result<Self, SceneError> {
        let device = Device::new(library, options.n_threads)?;
        let buffers = meshes.iter().map(Buffers::new).collect();
        let mut scene = Self { scenes: vec![], device, buffers };
        scene.start(top);
        for mesh in 0..meshes.len() {
            scene.start(options);
            scene.attach_mesh(mesh + 1, mesh, options);
            scene.commit(mesh + 1)?;
        }
        for placement in placements {
            scene.attach_instance(placement);
        }
        scene.commit(0)?;
        Ok(scene)
    }

    /// Bytes that the device allocated: BVHs and triangles, without the meshes passed to it.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        usize::try_from(self.device.n_bytes.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// The nearest hit with `t` in the closed interval.
    #[inline]
    #[must_use]
    pub fn closest(&self, origin: [f32; 3], direction: [f32; 3], interval: [f32; 2]) -> Option<Found> {
        let mut ray = RayHit::new(origin, direction, interval);
        self.query(self.device.library.functions.intersect, &mut ray);
        (ray.geometry != INVALID).then_some(Found {
            t: ray.t_far,
            u: ray.u,
            v: ray.v,
            primitive: ray.primitive,
            instance: if ray.instance == INVALID { 0 } else { ray.instance },
        })
    }

    /// Whether anything is hit with `t` in the closed interval.
    #[inline]
    #[must_use]
    pub fn occluded(&self, origin: [f32; 3], direction: [f32; 3], interval: [f32; 2]) -> bool {
        let mut ray = RayHit::new(origin, direction, interval);
        self.query(self.device.library.functions.occluded, &mut ray);
        // Embree reports an occluded ray by setting its end to minus infinity.
        ray.t_far < 0.0
    }

    #[inline]
    fn query(&self, query: Query, ray: &mut RayHit) {
        // SAFETY: the scene is committed and alive, the ray has the size and alignment that either version requires,
        // and null arguments mean the defaults. An any-hit query touches only the ray's first 48 bytes.
        unsafe {
            match query {
                Query::Three(query) => {
                    let mut context = Context3 { flags: 0, filter: ptr::null(), instance: INVALID };
                    query(self.scenes[0], &raw mut context, ray);
                }
                Query::Four(query) => query(self.scenes[0], ray, ptr::null_mut()),
            }
        }
    }

    /// Adds an empty scene.
    pub(super) fn start(&mut self, options: &Options) {
        let f = &self.device.library.functions;
        let quality = quality(options);
        // SAFETY: the device is alive; the scene is released in `drop`.
        unsafe {
            let scene = (f.new_scene)(self.device.handle);
            let dynamic = if matches!(options.quality, Quality::Low | Quality::Refit) { FLAG_DYNAMIC } else { 0 };
            (f.set_scene_flags)(scene, dynamic | if options.is_robust { FLAG_ROBUST } else { 0 });
            // Only a mesh can be refitted.
            (f.set_scene_quality)(scene, if quality == QUALITY_REFIT { QUALITY_LOW } else { quality });
            self.scenes.push(scene);
        }
    }

    fn attach_mesh(&self, scene: usize, mesh: usize, options: &Options) {
        let f = &self.device.library.functions;
        let Buffers { positions, triangles, .. } = &self.buffers[mesh];
        // SAFETY: the buffers live as long as this scene and hold what the counts say; the vertices are padded to
        // 16 bytes past the last one. The scene keeps the geometry after it is released here.
        unsafe {
            let geometry = (f.new_geometry)(self.device.handle, TYPE_TRIANGLE);
            let n_vertices = positions.len() / 3;
            (f.set_shared_buffer)(
                geometry,
                BUFFER_VERTEX,
                0,
                FORMAT_FLOAT3,
                positions.as_ptr().cast(),
                0,
                12,
                n_vertices,
            );
            let indices = triangles.as_ptr().cast();
            (f.set_shared_buffer)(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, indices, 0, 12, triangles.len());
            (f.set_quality)(geometry, quality(options));
            (f.commit_geometry)(geometry);
            (f.attach_geometry)(self.scenes[scene], geometry);
            (f.release_geometry)(geometry);
        }
    }

    fn attach_instance(&self, placement: &Placement) {
        let f = &self.device.library.functions;
        let matrix: *const [[f32; 3]; 4] = &raw const placement.world_from_object;
        // SAFETY: the instanced scene is alive and committed; the matrix is copied by the call.
        unsafe {
            let geometry = (f.new_geometry)(self.device.handle, TYPE_INSTANCE);
            (f.set_instanced_scene)(geometry, self.scenes[placement.mesh + 1]);
            (f.set_transform)(geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.cast());
            (f.commit_geometry)(geometry);
            (f.attach_geometry)(self.scenes[0], geometry);
            (f.release_geometry)(geometry);
        }
    }

    /// Builds.
    pub(super) fn commit(&self, scene: usize) -> Result<(), SceneError> {
        // SAFETY: the scene is alive and nobody traces through it yet.
        unsafe { (self.device.library.functions.commit_scene)(self.scenes[scene]) };
        self.device.check()
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        for &scene in &self.scenes {
            // SAFETY: each was made once and is released once; device and buffers are fields, dropped afterwards.
            unsafe { (self.device.library.functions.release_scene)(scene) };
        }
    }
}

impl RayHit {
    #[inline]
    fn new(origin: [f32; 3], direction: [f32; 3], [t_min, t_max]: [f32; 2]) -> Self {
        Self {
            origin,
            t_near: t_min,
            direction,
            time: 0.0,
            t_far: t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: INVALID,
            geometry: INVALID,
            instance: INVALID,
            instance_primitive: INVALID,
        }
    }
}

pub(super) fn quality(options: &Options) -> i32 {
    match options.quality {
        Quality::Low => QUALITY_LOW,
        Quality::Refit => QUALITY_REFIT,
        Quality::Medium => QUALITY_MEDIUM,
        Quality::High => QUALITY_HIGH,
    }
}

/// What Embree does with a mesh whose vertices have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// `RTC_BUILD_QUALITY_REFIT`.
    Refit,
    /// `RTC_BUILD_QUALITY_LOW`.
    Rebuild,
}

/// A mesh in a dynamic scene.
pub struct MovingMesh(Scene);

impl MovingMesh {
    /// Builds the mesh.
    ///
    /// # Errors If Embree reports an error.
    pub fn new(library: &Library, mesh: &Mesh<'_>, n_threads: usize, update: Update) -> Result<Self, SceneError> {
        let quality = match update {
            Update::Refit => Quality::Refit,
            Update::Rebuild => Quality::Low,
        };
        Ok(Self(Scene::of_mesh(library, mesh, &Options { quality, is_robust: false, n_threads })?))
    }

    /// The scene, for rays.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.0
    }

    /// Moves the vertices and updates the scene.
    ///
    /// # Errors If Embree reports an error.
    ///
    /// # Panics If the number of vertices has changed.
    pub fn update(&mut self, positions: &[[f32; 3]]) -> Result<(), SceneError> {
        let new = positions.as_flattened();
        let old = &mut self.0.buffers[0].positions;
        // One float of padding follows.
        assert_eq!(new.len() + 1, old.len(), "the vertices of the same mesh");
        old[..new.len()].copy_from_slice(new);
        let f = &self.0.device.library.functions;
        // SAFETY: the scene holds geometry 0, the mesh, whose buffer was changed in place.
        unsafe {
            let geometry = (f.get_geometry)(self.0.scenes[0], 0);
            (f.update_buffer)(geometry, BUFFER_VERTEX, 0);
            (f.commit_geometry)(geometry);
        }
        self.0.commit(0)
    }
}

/// Instances in a scene of Embree's default quality.
pub struct MovingInstances(Scene, u32);

impl MovingInstances {
    /// Builds the meshes with high quality, and a level of instances above with another one.
    ///
    /// # Errors If Embree reports an error.
    pub fn new(
        library: &Library,
        meshes: &[Mesh<'_>],
        placements: &[Placement],
        (n_threads, quality): (usize, Quality),
    ) -> Result<Self, SceneError> {
        let [top, bottom] = [quality, Quality::High].map(|quality| Options { quality, is_robust: false, n_threads });
        let n_instances = placements.len() as u32;
        Ok(Self(Scene::of_levels(library, meshes, placements, [&top, &bottom])?, n_instances))
    }

    /// The scene, for rays.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.0
    }

    /// Moves instances, each given by its number, and updates the scene.
    ///
    /// # Errors If Embree reports an error.
    ///
    /// # Panics If there is no instance of a number.
    pub fn update<'a>(
        &mut self,
        transforms: impl IntoIterator<Item = (u32, &'a [[f32; 3]; 4])>,
    ) -> Result<(), SceneError> {
        let f = &self.0.device.library.functions;
        for (id, matrix) in transforms {
            assert!(id < self.1, "instance {id} of {}", self.1);
            // SAFETY: instances were attached in order, so the scene holds this geometry; the matrix is copied.
            unsafe {
                let geometry = (f.get_geometry)(self.0.scenes[0], id);
                (f.set_transform)(geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, (&raw const *matrix).cast());
                (f.commit_geometry)(geometry);
            }
        }
        self.0.commit(0)
    }
}
