//! The functions of Embree, as its headers `rtcore_*.h` of versions 3.13 and 4.4 declare them.
//!
//! Reads: a library path. Writes: a table of functions.
//! Holds: each function type matches its declaration in the header of the version that the library reports.
//! Source: Embree API reference, `rtcore_builder.h`, `rtcore_device.h`, `rtcore_scene.h`, `rtcore_geometry.h`, `rtcore_ray.h`.
#![expect(unsafe_code, reason = "the C interface; every block states why it is sound")]

use std::{
    error::Error,
    ffi::{c_char, c_void},
    fmt, mem,
    path::{Path, PathBuf},
    ptr,
};

use super::builder::Arguments;

/// An opaque Embree object: device, scene or geometry.
pub(super) type Handle = *mut c_void;
/// User pointer, bytes, whether the allocation already happened; returns whether to continue.
pub(super) type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;
/// `rtcIntersect1` and `rtcOccluded1` of version 3: scene, context, ray.
type Query3 = unsafe extern "C" fn(Handle, *mut Context3, *mut RayHit);
/// The same functions of version 4: scene, ray, arguments, which may be null.
type Query4 = unsafe extern "C" fn(Handle, *mut RayHit, *mut c_void);
type NewDevice = unsafe extern "C" fn(*const c_char) -> Handle;
type Release = unsafe extern "C" fn(Handle);
type Property = unsafe extern "C" fn(Handle, i32) -> isize;

const PROPERTY_VERSION: i32 = 0;

/// `RTCRayHit`. Version 4 may write one word more than version 3; the struct has space for both.
#[repr(C, align(16))]
pub(super) struct RayHit {
    pub(super) origin: [f32; 3],
    pub(super) t_near: f32,
    pub(super) direction: [f32; 3],
    pub(super) time: f32,
    pub(super) t_far: f32,
    pub(super) mask: u32,
    pub(super) id: u32,
    pub(super) flags: u32,
    pub(super) normal: [f32; 3],
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) primitive: u32,
    pub(super) geometry: u32,
    pub(super) instance: u32,
    pub(super) instance_primitive: u32,
}

/// `RTCIntersectContext` of version 3.
#[repr(C)]
pub(super) struct Context3 {
    pub(super) flags: i32,
    pub(super) filter: *const c_void,
    pub(super) instance: u32,
}

/// The two signatures of a ray query.
#[derive(Clone, Copy)]
pub(super) enum Query {
    Three(Query3),
    Four(Query4),
}

/// The functions in use, named as in the headers.
#[derive(Clone, Copy)]
pub(super) struct Functions {
    pub(super) new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    pub(super) release_device: unsafe extern "C" fn(Handle),
    pub(super) device_error: unsafe extern "C" fn(Handle) -> i32,
    pub(super) set_memory_monitor: unsafe extern "C" fn(Handle, Option<MemoryMonitor>, *mut c_void),
    pub(super) new_scene: unsafe extern "C" fn(Handle) -> Handle,
    pub(super) release_scene: unsafe extern "C" fn(Handle),
    pub(super) set_scene_flags: unsafe extern "C" fn(Handle, i32),
    pub(super) set_scene_quality: unsafe extern "C" fn(Handle, i32),
    pub(super) commit_scene: unsafe extern "C" fn(Handle),
    pub(super) new_geometry: unsafe extern "C" fn(Handle, i32) -> Handle,
    pub(super) release_geometry: unsafe extern "C" fn(Handle),
    pub(super) commit_geometry: unsafe extern "C" fn(Handle),
    pub(super) attach_geometry: unsafe extern "C" fn(Handle, Handle) -> u32,
    pub(super) get_geometry: unsafe extern "C" fn(Handle, u32) -> Handle,
    pub(super) update_buffer: unsafe extern "C" fn(Handle, i32, u32),
    pub(super) set_quality: unsafe extern "C" fn(Handle, i32),
    pub(super) set_shared_buffer: unsafe extern "C" fn(Handle, i32, u32, i32, *const c_void, usize, usize, usize),
    pub(super) set_instanced_scene: unsafe extern "C" fn(Handle, Handle),
    pub(super) set_transform: unsafe extern "C" fn(Handle, u32, i32, *const c_void),
    pub(super) new_bvh: unsafe extern "C" fn(Handle) -> Handle,
    pub(super) release_bvh: unsafe extern "C" fn(Handle),
    pub(super) build_bvh: unsafe extern "C" fn(*const Arguments) -> *mut c_void,
    pub(super) intersect: Query,
    pub(super) occluded: Query,
}

/// Why a library cannot be used.
#[derive(Debug)]
pub struct LoadError(String);

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no usable Embree: {}", self.0)
    }
}

impl Error for LoadError {}

/// A loaded library, which stays loaded until the program ends.
#[derive(Clone, Copy)]
pub struct Library {
    pub(super) functions: Functions,
    /// Major, minor, patch as one number: 40400.
    version: u32,
}

impl Library {
    /// Loads the library at `path`, or of that name where the system's loader knows it.
    ///
    /// # Errors If the library is missing, lacks a function, or has a version other than 3 or 4.
    pub fn open(path: &Path) -> Result<Self, LoadError> {
        let complain = |error: libloading::Error| LoadError(error.to_string());
        // SAFETY: loading runs the library's initializers; the caller names an Embree.
        let code = unsafe { libloading::Library::new(path) }.map_err(complain)?;
        // SAFETY: the property's function has this signature in both versions.
        let (new_device, device_property, release_device) = unsafe {
            (
                *code.get(b"rtcNewDevice\0").map_err(complain)?,
                *code.get(b"rtcGetDeviceProperty\0").map_err(complain)?,
                *code.get(b"rtcReleaseDevice\0").map_err(complain)?,
            )
        };
        let version = version(new_device, device_property, release_device)?;
        let functions = functions(&code, version, new_device, release_device).map_err(complain)?;
        // Never unloaded: its worker threads may run its code until the program ends.
        mem::forget(code);
        Ok(Self { functions, version })
    }

    /// Major, minor and patch as one number: 40400 is 4.4.0.
    #[must_use]
    pub fn version(&self) -> u32 {
        self.version
    }
}

/// Reads the version from a temporary device.
fn version(new_device: NewDevice, device_property: Property, release_device: Release) -> Result<u32, LoadError> {
    // SAFETY: a null configuration is the default one; the device is released once, after its last use.
    let version = unsafe {
        let device = new_device(ptr::null());
        if device.is_null() {
            return Err(LoadError("it creates no device".to_owned()));
        }
        let version = device_property(device, PROPERTY_VERSION);
        release_device(device);
        version
    };
    match u32::try_from(version) {
        Ok(version) if (30_000..50_000).contains(&version) => Ok(version),
        _ => Err(LoadError(format!("unsupported version {version}"))),
    }
}

fn functions(
    code: &libloading::Library,
    version: u32,
    new_device: NewDevice,
    release_device: Release,
) -> Result<Functions, libloading::Error> {
    // SAFETY: each field's type is the signature that the headers of both versions give for that name; only the ray
    // queries differ, and the version selects between the two.
    unsafe {
        let query = |name: &[u8]| {
            Ok::<_, libloading::Error>(if version < 40_000 {
                Query::Three(*code.get(name)?)
            } else {
                Query::Four(*code.get(name)?)
            })
        };
        Ok(Functions {
            new_device,
            release_device,
            device_error: *code.get(b"rtcGetDeviceError\0")?,
            set_memory_monitor: *code.get(b"rtcSetDeviceMemoryMonitorFunction\0")?,
            new_scene: *code.get(b"rtcNewScene\0")?,
            release_scene: *code.get(b"rtcReleaseScene\0")?,
            set_scene_flags: *code.get(b"rtcSetSceneFlags\0")?,
            set_scene_quality: *code.get(b"rtcSetSceneBuildQuality\0")?,
            commit_scene: *code.get(b"rtcCommitScene\0")?,
            new_geometry: *code.get(b"rtcNewGeometry\0")?,
            release_geometry: *code.get(b"rtcReleaseGeometry\0")?,
            commit_geometry: *code.get(b"rtcCommitGeometry\0")?,
            attach_geometry: *code.get(b"rtcAttachGeometry\0")?,
            get_geometry: *code.get(b"rtcGetGeometry\0")?,
            update_buffer: *code.get(b"rtcUpdateGeometryBuffer\0")?,
            set_quality: *code.get(b"rtcSetGeometryBuildQuality\0")?,
            set_shared_buffer: *code.get(b"rtcSetSharedGeometryBuffer\0")?,
            set_instanced_scene: *code.get(b"rtcSetGeometryInstancedScene\0")?,
            set_transform: *code.get(b"rtcSetGeometryTransform\0")?,
            new_bvh: *code.get(b"rtcNewBVH\0")?,
            release_bvh: *code.get(b"rtcReleaseBVH\0")?,
            build_bvh: *code.get(b"rtcBuildBVH\0")?,
            intersect: query(b"rtcIntersect1\0")?,
            occluded: query(b"rtcOccluded1\0")?,
        })
    }
}

/// Names under which systems install the library, newest first.
const INSTALLED: [&str; 2] = ["libembree4.so.4", "libembree3.so.3"];

/// Every available Embree, one per version, newest first: those that `CANTED_EMBREE` names (files, or folders that
/// contain them, separated as in `PATH`), then those that the system's loader finds.
#[must_use]
pub fn libraries() -> Vec<Library> {
    let named = std::env::var_os("CANTED_EMBREE").unwrap_or_default();
    let mut libraries: Vec<Library> = vec![];
    let paths = std::env::split_paths(&named).flat_map(|path| files(&path)).chain(INSTALLED.map(PathBuf::from));
    for path in paths {
        if let Ok(library) = Library::open(&path)
            && libraries.iter().all(|known| known.version() != library.version())
        {
            libraries.push(library);
        }
    }
    libraries.sort_by_key(|library| std::cmp::Reverse(library.version()));
    libraries
}

/// The path itself, or the Embree libraries in the folder.
fn files(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = path.read_dir() else { return vec![path.to_owned()] };
    let is_embree = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with("libembree"))
    };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_embree).collect();
    files.sort();
    files
}
