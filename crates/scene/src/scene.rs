//! A scene as plain arrays: meshes, instances, cameras, and counts of all of them.

use std::path::PathBuf;

use canted_obb::{Aabb, Affine};

use crate::{Environment, Light, Material, MaterialId, Texture, UvSet};

/// A scene as plain arrays that refer to each other by index.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangle meshes, object space.
    pub meshes: Vec<Mesh>,
    /// Instances of meshes, in file order.
    pub instances: Vec<Instance>,
    /// Materials; at least one if the scene has a mesh.
    pub materials: Vec<Material>,
    /// Textures that materials use.
    pub textures: Vec<Texture>,
    /// Lights from the file.
    pub lights: Vec<Light>,
    /// Environment light; `None` if the file defines none.
    pub environment: Option<Environment>,
    /// The instance that is a ground which the program added, and which is not part of the bounds; `None` without one.
    pub ground: Option<u32>,
    /// What camera rays see where they meet nothing, linear RGB; `None` for the environment.
    pub background: Option<[f32; 3]>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// The name of each camera, else of its node; empty without a name.
    pub camera_names: Vec<String>,
    /// What the reader repaired or skipped, one sentence each, without repetition.
    pub warnings: Vec<String>,
    /// Elements of the file that are not surfaces and are not drawn, such as lines and points: one sentence.
    pub notes: Vec<String>,
    /// Files that the scene's file references and that were read: material libraries, buffers and images.
    pub files: Vec<PathBuf>,
}

impl Scene {
    /// Triangles of all meshes, each mesh counted once.
    #[must_use]
    pub fn n_unique_triangles(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
    }

    /// Triangles of all instances.
    #[must_use]
    pub fn n_placed_triangles(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh.0 as usize].triangles.len()).sum()
    }

    /// Whether any mesh has curves.
    #[must_use]
    pub fn has_curves(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.curves.is_some())
    }

    /// Segments of the curves of all instances.
    #[must_use]
    pub fn n_placed_segments(&self) -> usize {
        let n = |mesh: &Mesh| mesh.curves.as_ref().map_or(0, |curves| curves.segments.len());
        self.instances.iter().map(|instance| n(&self.meshes[instance.mesh.0 as usize])).sum()
    }

    /// Whether any instance moves, or any mesh deforms, while the shutter is open.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.close.is_some()) || self.has_moving_instances()
    }

    fn has_moving_instances(&self) -> bool {
        self.instances.iter().any(|i| i.world_from_object_close.is_some_and(|close| close != i.world_from_object))
    }

    /// World-space bounds of all instances; what moves counts at shutter open and shutter close.
    #[must_use]
    pub fn bounds_world(&self) -> Aabb {
        // Transforms each vertex once rather than once per triangle.
        let used: Vec<Vec<[f32; 3]>> = self.meshes.iter().map(Mesh::used_positions).collect();
        let mut bounds = Aabb::EMPTY;
        for (number, instance) in (0..).zip(&self.instances) {
            if self.ground == Some(number) {
                continue;
            }
            if let Some(curves) = &self.meshes[instance.mesh.0 as usize].curves {
                let mesh = &self.meshes[instance.mesh.0 as usize];
                let close = mesh.close.as_ref();
                let ends = curves.segments.indices().iter().flat_map(|&i| {
                    let at_close = close.map(|close| {
                        (close.positions[i as usize], close.radii.as_ref().unwrap_or(&curves.radii)[i as usize])
                    });
                    [Some((mesh.positions[i as usize], curves.radii[i as usize])), at_close].into_iter().flatten()
                });
                for (position, radius) in ends {
                    for placed in
                        [Some(instance.world_from_object), instance.world_from_object_close].into_iter().flatten()
                    {
                        let center = placed.point(position);
                        let [a, b, c, _] = placed.columns;
                        let reach: [f32; 3] = std::array::from_fn(|k| radius * (a[k].hypot(b[k])).hypot(c[k]));
                        bounds.grow(std::array::from_fn(|k| center[k] - reach[k]));
                        bounds.grow(std::array::from_fn(|k| center[k] + reach[k]));
                    }
                }
            }
            for &position in &used[instance.mesh.0 as usize] {
                bounds.grow(instance.world_from_object.point(position));
                if let Some(close) = instance.world_from_object_close {
                    bounds.grow(close.point(position));
                }
            }
        }
        bounds
    }
}

/// Index of a mesh in [`Scene::meshes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MeshId(pub u32);

/// Consecutive triangles that share a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First triangle; the part ends where the next one starts.
    pub first_triangle: u32,
    /// Material of these triangles.
    pub material: MaterialId,
}

/// Vertices of a mesh that deforms while the shutter is open, as it closes. In between, everything is interpolated linearly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshClose {
    /// As [`Mesh::positions`], and as many.
    pub positions: Vec<[f32; 3]>,
    /// As [`Mesh::normals`].
    pub normals: Option<Vec<[f32; 3]>>,
    /// As [`Mesh::tangents`].
    pub tangents: Option<Vec<[f32; 4]>>,
    /// As [`Curves::radii`], and as many; `None` if they do not change.
    pub radii: Option<Vec<f32>>,
}

/// An indexed triangle mesh in object space. Every index is in range and every referenced position is finite.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name from the file, used in messages.
    pub name: String,
    /// Vertex positions, object space.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices in file order, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, one per position, of length 1 or 0 (0: use the geometric normal); `None` if the file has none.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Tangents of the normal map, one per position: a unit vector towards increasing `u`, and the sign of
    /// `normal × tangent` relative to increasing `v`. `None`, or zeros at a vertex: derive them from the texture coordinates.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// First texture coordinates, one per position, `v` up; kept only if a material uses them.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Second texture coordinates, like `uvs`.
    pub second_uvs: Option<Vec<[f32; 2]>>,
    /// Linear RGBA vertex colors, one per position, multiplied by the material's color and alpha.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Parts in ascending order; the first starts at triangle 0.
    pub parts: Vec<Part>,
    /// Curves in place of triangles: positions are their points.
    pub curves: Option<Curves>,
    /// The vertices at shutter close of a mesh that deforms while the shutter is open; the lists above are those at shutter open.
    pub close: Option<MeshClose>,
}

/// Curves, which are lines with a thickness, or patches.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// The radius at each position, half the width of ribbons; at least 0 and finite. Of patches 0.
    pub radii: Vec<f32>,
    /// The segments.
    pub segments: CurveSegments,
    /// What surrounds the segments; patches have no shape of their own.
    pub shape: CurveShape,
}

/// The surface of curves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
pub enum CurveShape {
    /// Round, with spherical ends; each segment is a solid of its own.
    #[default]
    #[serde(rename = "tube")]
    Tube,
    /// Flat, facing every ray, with straight ends; without gaps between the segments of a strand.
    #[serde(rename = "ribbon")]
    Ribbon,
}

impl CurveShape {
    /// Its name in scene files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tube => "tube",
            Self::Ribbon => "ribbon",
        }
    }
}

/// Segments of curves by the indices of their points.
#[derive(Clone, Debug, PartialEq)]
pub enum CurveSegments {
    /// Straight segments: cones with spherical ends, of which equal indices make a ball, or straight ribbons.
    Linear(Vec<[u32; 2]>),
    /// Cubic Bézier curves, by their control points.
    Cubic(Vec<[u32; 4]>),
    /// Bicubic Bézier patches, by their control points: rows along the second parameter, one after another along the first.
    Patches(Vec<[u32; 16]>),
}

impl CurveSegments {
    /// Number of segments.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Linear(list) => list.len(),
            Self::Cubic(list) => list.len(),
            Self::Patches(list) => list.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The indices of all segments.
    #[must_use]
    pub fn indices(&self) -> &[u32] {
        match self {
            Self::Linear(list) => list.as_flattened(),
            Self::Cubic(list) => list.as_flattened(),
            Self::Patches(list) => list.as_flattened(),
        }
    }
}

impl Mesh {
    /// Whether it is made of patches.
    #[must_use]
    pub fn has_patches(&self) -> bool {
        self.curves.as_ref().is_some_and(|curves| matches!(curves.segments, CurveSegments::Patches(_)))
    }

    /// Number of triangles, or of segments of curves or patches.
    #[must_use]
    pub fn n_primitives(&self) -> usize {
        self.triangles.len() + self.curves.as_ref().map_or(0, |curves| curves.segments.len())
    }

    /// Texture coordinates of the given set.
    #[must_use]
    pub fn uv_set(&self, set: UvSet) -> Option<&[[f32; 2]]> {
        match set {
            UvSet::First => self.uvs.as_deref(),
            UvSet::Second => self.second_uvs.as_deref(),
        }
    }

    /// Positions referenced by triangles, each once; those at shutter close too.
    fn used_positions(&self) -> Vec<[f32; 3]> {
        let mut is_used = vec![false; self.positions.len()];
        let of_curves = self.curves.iter().flat_map(|curves| curves.segments.indices());
        for &index in self.triangles.as_flattened().iter().chain(of_curves) {
            is_used[index as usize] = true;
        }
        let close = self.close.as_ref().map(|close| &close.positions);
        let of_list = |list: &Vec<[f32; 3]>| {
            list.iter().zip(&is_used).filter_map(|(&position, &is_used)| is_used.then_some(position)).collect()
        };
        let mut used: Vec<[f32; 3]> = of_list(&self.positions);
        used.extend(close.map(of_list).unwrap_or_default());
        used
    }

    /// Material of the given triangle.
    #[must_use]
    pub fn material_of(&self, triangle: u32) -> MaterialId {
        let after = self.parts.partition_point(|part| part.first_triangle <= triangle);
        self.parts[after - 1].material
    }
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The instanced mesh.
    pub mesh: MeshId,
    /// Invertible affine transform; for a moving instance, the one at shutter open.
    pub world_from_object: Affine,
    /// Transform at shutter close for a moving instance. Matrix entries are interpolated linearly in between.
    pub world_from_object_close: Option<Affine>,
    /// Global number, in file order, of triangle 0 of this instance.
    pub first_primitive: u32,
}

/// A camera in world space. Row 0 of the image is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Center of the lens.
    pub eye: [f32; 3],
    /// A point on the optical axis, at the image center.
    pub target: [f32; 3],
    /// Up direction in the image; not parallel to the view direction.
    pub up: [f32; 3],
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Depth of field; `None` for a pinhole camera.
    pub lens: Option<Lens>,
}

/// Camera projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays start at the eye.
    Perspective {
        /// Vertical field of view in degrees, between 0 and 180.
        fov_degrees: f32,
    },
    /// All rays are parallel to the view direction.
    Orthographic {
        /// Height of the visible region in world units, above zero.
        height: f32,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the round aperture, world units, above zero.
    pub radius: f32,
    /// Distance from the eye to the plane in focus, along the view direction; above zero.
    pub focus_distance: f32,
}

impl Camera {
    /// A pinhole camera with a vertical field of view in degrees.
    #[must_use]
    pub const fn pinhole(eye: [f32; 3], target: [f32; 3], up: [f32; 3], fov_degrees: f32) -> Self {
        Self { eye, target, up, projection: Projection::Perspective { fov_degrees }, lens: None }
    }
}
