//! Acceleration structures that the driver builds, for rays that it traces itself: `shared/driver`.

use canted_lbvh::Corners;
use canted_tlas::{Instance, InstanceError};
use wgpu::{
    AccelerationStructureFlags, AccelerationStructureGeometryFlags, AccelerationStructureUpdateMode, BindingResource,
    Blas, BlasBuildEntry, BlasGeometries, BlasGeometrySizeDescriptors, BlasTriangleGeometry,
    BlasTriangleGeometrySizeDescriptor, CreateBlasDescriptor, CreateTlasDescriptor, Tlas, TlasInstance, VertexFormat,
};

use super::instances::{check_scale, untraceable};
use super::layout::check_coordinates;
use crate::commands::AsBinding;
use crate::{Buffer, Gpu, GpuError};

/// Masks of instances: drivers have eight bits, of which the last is for instances that have all.
const MOST_OF_MASK: u32 = 0x7f;

/// Instances, whose numbers have 24 bits.
const MOST_INSTANCES: u32 = 1 << 24;

/// The scene as the driver traces it.
pub(super) struct DriverScene {
    tlas: Tlas,
    /// Whether some rays hit an instance and others do not.
    pub(super) has_masks: bool,
}

impl AsBinding for DriverScene {
    fn resource(&self) -> BindingResource<'_> {
        BindingResource::AccelerationStructure(&self.tlas)
    }

    /// The driver does not tell them.
    fn n_bytes(&self) -> u64 {
        0
    }
}

impl DriverScene {
    /// Uploads meshes, and has the driver build its structures. Without instances there is one of the only mesh.
    pub(super) fn new(gpu: &Gpu, meshes: &[&[Corners]], instances: Option<&[Instance]>) -> Result<Self, GpuError> {
        if !gpu.has_ray_queries() {
            let what = "ray queries of the driver on a device without them; open it by Gpu::with_ray_queries, or with EXPERIMENTAL_RAY_QUERY";
            return Err(GpuError::Unsupported { what: what.to_owned() });
        }
        let single = [Instance::new(0, canted_obb::Affine::IDENTITY)];
        let instances = match (instances, meshes.len()) {
            (Some(instances), _) => instances,
            (None, 1) => &single,
            (None, n) => {
                return Err(GpuError::Input { message: format!("a scene of one level has one mesh, not {n}") });
            }
        };
        let n_instances = u32::try_from(instances.len()).unwrap_or(u32::MAX);
        at_most("instances", n_instances, gpu.limits().max_tlas_instance_count.min(MOST_INSTANCES))?;
        let meshes = meshes.iter().enumerate().map(|(number, corners)| Mesh::new(gpu, number, corners));
        let meshes: Vec<Option<Mesh>> = meshes.collect::<Result<_, _>>()?;
        let placed = instances.iter().enumerate().map(|(number, instance)| placed(&meshes, number, instance));
        let placed: Vec<Option<TlasInstance>> = placed.collect::<Result<_, _>>()?;
        let tlas = gpu.guarded(|| {
            let mut tlas = gpu.device.create_tlas(&CreateTlasDescriptor {
                label: Some("instances"),
                max_instances: n_instances.max(1),
                flags: AccelerationStructureFlags::PREFER_FAST_TRACE,
                update_mode: AccelerationStructureUpdateMode::Build,
            });
            for (place, instance) in (0..).zip(placed) {
                tlas[place] = instance;
            }
            let builds: Vec<BlasBuildEntry<'_>> = meshes.iter().flatten().map(Mesh::build).collect();
            let mut encoder = gpu.encoder();
            encoder.build_acceleration_structures(&builds, [&tlas]);
            gpu.queue.submit([encoder.finish()]);
            tlas
        })?;
        gpu.check()?;
        Ok(Self { tlas, has_masks: instances.iter().any(|instance| ![0, u32::MAX].contains(&instance.mask)) })
    }
}

/// Rejects more than a driver takes.
fn at_most(limit: &'static str, need: u32, most: u32) -> Result<(), GpuError> {
    if need <= most {
        return Ok(());
    }
    let what = "ray queries of the driver".to_owned();
    Err(GpuError::Limit {
        what,
        need: need.into(),
        limit,
        most: most.into(),
        remedy: "open the device with its limits of acceleration structures, or use another Source",
    })
}

/// A mesh with triangles.
struct Mesh {
    vertices: Buffer<Corners>,
    size: BlasTriangleGeometrySizeDescriptor,
    blas: Blas,
    /// Greatest coordinate.
    reach: f32,
}

impl Mesh {
    fn new(gpu: &Gpu, number: usize, corners: &[Corners]) -> Result<Option<Self>, GpuError> {
        let is_bad = |corners: &Corners| !corners.iter().flatten().all(|x| x.is_finite());
        if let Some(triangle) = corners.iter().position(is_bad) {
            let message = format!("mesh {number}: triangle {triangle} has a vertex that is not finite");
            return Err(GpuError::Input { message });
        }
        let reach = corners.iter().flatten().flatten().fold(0.0, |all: f32, x| all.max(x.abs()));
        check_coordinates(|| format!("mesh {number}"), reach.into())?;
        // A vertex has a number of 32 bits.
        let most = gpu.limits().max_blas_primitive_count.min(u32::MAX / 3);
        at_most("triangles of a mesh", u32::try_from(corners.len()).unwrap_or(u32::MAX), most)?;
        if corners.is_empty() {
            return Ok(None);
        }
        let size = BlasTriangleGeometrySizeDescriptor {
            vertex_format: VertexFormat::Float32x3,
            vertex_count: 3 * corners.len() as u32,
            index_format: None,
            index_count: None,
            flags: AccelerationStructureGeometryFlags::OPAQUE,
        };
        let descriptor = CreateBlasDescriptor {
            label: Some("mesh"),
            flags: AccelerationStructureFlags::PREFER_FAST_TRACE,
            update_mode: AccelerationStructureUpdateMode::Build,
        };
        let sizes = BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] };
        let vertices = gpu.for_driver("vertices for the driver", corners)?;
        Ok(Some(Self { vertices, blas: gpu.guarded(|| gpu.device.create_blas(&descriptor, sizes))?, size, reach }))
    }

    fn build(&self) -> BlasBuildEntry<'_> {
        let geometry = BlasTriangleGeometry {
            size: &self.size,
            vertex_buffer: self.vertices.wgpu(),
            first_vertex: 0,
            vertex_stride: size_of::<[f32; 3]>() as u64,
            index_buffer: None,
            first_index: None,
            transform_buffer: None,
            transform_buffer_offset: None,
        };
        BlasBuildEntry { blas: &self.blas, geometry: BlasGeometries::TriangleGeometries(vec![geometry]) }
    }
}

/// An instance as the driver places it; `None` where no ray can hit it.
fn placed(meshes: &[Option<Mesh>], number: usize, instance: &Instance) -> Result<Option<TlasInstance>, GpuError> {
    let refused = |why: &str| {
        Err(GpuError::Unsupported { what: format!("instance {number}, which {why}, by ray queries of the driver") })
    };
    let Some(mesh) = meshes.get(instance.blas as usize) else {
        return Err(untraceable(&InstanceError::NoSuchBlas { instance: number, blas: instance.blas }));
    };
    // A transform that cannot be inverted has no rays.
    let inverse = instance.object_from_world(number).map_err(|error| untraceable(&error))?;
    check_scale(number, &inverse)?;
    if instance.world_from_object_close.is_some_and(|close| close != instance.world_from_object) {
        return refused("moves");
    }
    let mask = match instance.mask {
        u32::MAX => u8::MAX,
        mask if mask <= MOST_OF_MASK => mask as u8,
        _ => return refused("has a mask of more than seven bits, but not all"),
    };
    let Some(mesh) = mesh else { return Ok(None) };
    check_coordinates(|| format!("instance {number}"), instance.world_from_object.reach(mesh.reach))?;
    if mask == 0 {
        return Ok(None);
    }
    let [x, y, z, shift] = instance.world_from_object.columns;
    let rows: [[f32; 4]; 3] = std::array::from_fn(|k| [x[k], y[k], z[k], shift[k]]);
    let rows = rows.as_flattened().try_into().expect("three rows of four");
    Ok(Some(TlasInstance::new(&mesh.blas, rows, number as u32, mask)))
}
