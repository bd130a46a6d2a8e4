"""open3d.t.geometry.RaycastingScene with exact answers, on NumPy arrays or Open3D tensors.

>>> from canted.open3d import RaycastingScene
>>> scene = RaycastingScene()
>>> geometry_id = scene.add_triangles(vertices, triangles)
>>> scene.cast_rays(rays)["t_hit"]

Open3D is not needed. Arguments are arrays or tensors, results are NumPy arrays of the same shapes and types. Where vertices are float64 and
rounding would move one by more than 1e-4 of the smallest edge, an origin near the meshes is chosen, and distances, t and points are float64.
"""

import numpy as np

from ._canted import Bvh
from .mesh import array_of as _array
from .mesh import arrays_of

__all__ = ["RaycastingScene"]


class RaycastingScene:
    """Ray and distance queries over triangle meshes that are added one by one.

    The names and meanings of Open3D's class, with these differences: rays through edges and vertices count each crossing of a
    surface once in count_intersections and list_intersections; signs and occupancy are exact, so nsamples changes nothing;
    misses have normals and coordinates of zero; inside means that a ray crosses the meshes an odd number of times.

    Parameters
    ----------
    nthreads : int
        Threads of queries whose own nthreads is 0; 0 for all processors.
    """

    #: The geometry and triangle of a miss.
    INVALID_ID = 0xFFFFFFFF

    def __init__(self, nthreads=0):
        self._nthreads = nthreads
        self._vertices = [np.zeros((0, 3), np.float32)]
        self._triangles = [np.zeros((0, 3), np.int64)]
        self._n_vertices = 0
        # Number of the first triangle of each mesh, and of all.
        self._starts = [0]
        self._built = None

    def add_triangles(self, *args, **kwargs):
        """Adds a mesh: add_triangles(vertex_positions, triangle_indices) or add_triangles(mesh).

        Parameters
        ----------
        vertex_positions : (n, 3) float32 or float64
        triangle_indices : (m, 3) integers
        mesh : open3d.t.geometry.TriangleMesh, open3d.geometry.TriangleMesh or trimesh.Trimesh

        Returns
        -------
        int
            The id of the mesh: 0, 1, 2, ...

        Raises
        ------
        ValueError
            Wrong shapes or types, an index out of range or a vertex that is not finite; nothing is added.
        """
        names = ("vertex_positions", "triangle_indices")
        if len(args) + len(kwargs) == 1:
            (mesh,) = args or kwargs.values()
            vertices, triangles = arrays_of(mesh)
        else:
            given = {**dict(zip(names, args)), **kwargs}
            if set(given) != set(names) or len(args) > 2:
                raise ValueError("add_triangles takes vertex_positions and triangle_indices, or a mesh")
            vertices, triangles = (given[name] for name in names)
        vertices, triangles = _array(vertices), _array(triangles)
        # Checks the mesh alone, so that errors name its own triangles; cheap compared with the build of the scene.
        Bvh(vertices, triangles, preset="fast")
        precision = np.float32 if vertices.dtype == np.float32 else np.float64
        self._vertices.append(vertices.astype(precision).reshape(-1, 3))
        self._triangles.append(np.asarray(triangles, dtype=np.int64).reshape(-1, 3) + self._n_vertices)
        self._n_vertices += len(self._vertices[-1])
        self._starts.append(self._starts[-1] + len(self._triangles[-1]))
        self._built = None
        return len(self._starts) - 2

    def cast_rays(self, rays, nthreads=0):
        """The first hit of each ray.

        Parameters
        ----------
        rays : (..., 6) float32
            Origins, then directions of any length but zero.

        Returns
        -------
        dict
            t_hit (...,) float32, inf for a miss; geometry_ids and primitive_ids (...,) uint32, INVALID_ID for a miss; primitive_uvs (..., 2)
            float32; primitive_normals (..., 3) float32, of the front side.
        """
        rays, shape = _rays(rays)
        hits = self._bvh().closest_hit(rays[:, :3], rays[:, 3:], threads=self._threads(nthreads))
        geometry, primitive = self._ids(hits.primitive)
        return {
            "t_hit": hits.t.reshape(shape),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": np.stack([hits.u, hits.v], axis=-1).reshape(*shape, 2),
            "primitive_normals": np.nan_to_num(hits.normal).astype(np.float32).reshape(*shape, 3),
        }

    def test_occlusions(self, rays, tnear=0.0, tfar=np.inf, nthreads=0):
        """Whether each ray, (..., 6) float32, hits anything with tnear <= t <= tfar: (...,) bool."""
        rays, shape = _rays(rays)
        occluded = self._bvh().occluded(rays[:, :3], rays[:, 3:], tnear, tfar, threads=self._threads(nthreads))
        return occluded.reshape(shape)

    def count_intersections(self, rays, nthreads=0):
        """How many surfaces each ray, (..., 6) float32, crosses: (...,) int32."""
        rays, shape = _rays(rays)
        hits = self._bvh().crossings(rays[:, :3], rays[:, 3:], threads=self._threads(nthreads))
        return np.bincount(hits.ray, minlength=len(rays)).astype(np.int32).reshape(shape)

    def list_intersections(self, rays, nthreads=0):
        """Every crossing of a surface, in order of the rays, then of t.

        Returns
        -------
        dict
            ray_splits (n + 1,) int64: the crossings of ray i are ray_splits[i] to ray_splits[i + 1]; ray_ids (k,) int64; t_hit (k,)
            float32; geometry_ids, primitive_ids (k,) uint32; primitive_uvs (k, 2) float32.
        """
        rays, _ = _rays(rays)
        hits = self._bvh().crossings(rays[:, :3], rays[:, 3:], threads=self._threads(nthreads))
        geometry, primitive = self._ids(hits.primitive)
        counts = np.bincount(hits.ray, minlength=len(rays))
        return {
            "ray_splits": np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            "ray_ids": hits.ray,
            "t_hit": hits.t,
            "geometry_ids": geometry,
            "primitive_ids": primitive,
            "primitive_uvs": np.stack([hits.u, hits.v], axis=-1),
        }

    def compute_closest_points(self, query_points, nthreads=0):
        """The nearest point of the meshes to each point, (..., 3) float32.

        Returns
        -------
        dict
            points (..., 3) float32; geometry_ids, primitive_ids (...,) uint32; primitive_uvs (..., 2) float32; primitive_normals (..., 3)
            float32.
        """
        points, shape = _points(query_points)
        nearest = self._bvh().nearest(points, threads=self._threads(nthreads))
        geometry, primitive = self._ids(nearest.primitive)
        uvs, normals = self._surface(nearest.primitive, nearest.position)
        return {
            "points": nearest.position.astype(nearest.distance.dtype).reshape(*shape, 3),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": uvs.astype(np.float32).reshape(*shape, 2),
            "primitive_normals": normals.astype(np.float32).reshape(*shape, 3),
        }

    def compute_distance(self, query_points, nthreads=0):
        """Distance of each point, (..., 3) float32, to the nearest mesh: (...,) float32."""
        points, shape = _points(query_points)
        return self._bvh().nearest(points, threads=self._threads(nthreads)).distance.reshape(shape)

    def compute_signed_distance(self, query_points, nthreads=0, nsamples=1):
        """Distance to closed meshes, negative inside: (...,) float32. nsamples changes nothing."""
        points, shape = _points(query_points)
        return self._bvh().signed_distance(points, mode="parity", threads=self._threads(nthreads)).reshape(shape)

    def compute_occupancy(self, query_points, nthreads=0, nsamples=1):
        """1 for points inside of closed meshes or on them, else 0: (...,) float32. nsamples changes nothing."""
        points, shape = _points(query_points)
        return self._bvh().contains(points, mode="parity", threads=self._threads(nthreads)).astype(np.float32).reshape(shape)

    @staticmethod
    def create_rays_pinhole(*args, **kwargs):
        """Rays of a pinhole camera: (height_px, width_px, 6) float32, through the centers of pixels.

        create_rays_pinhole(intrinsic_matrix, extrinsic_matrix, width_px, height_px), or
        create_rays_pinhole(fov_deg, center, eye, up, width_px, height_px).

        Parameters
        ----------
        intrinsic_matrix : (3, 3) floats
            Pixels from camera space.
        extrinsic_matrix : (4, 4) floats
            Camera space from world space.
        fov_deg : float
            Horizontal field of view in degrees.
        center, eye, up : (3,) floats
            The point that the camera looks at, its position, and the direction that is up in the picture.
        """
        by_matrices = ("intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px")
        by_view = ("fov_deg", "center", "eye", "up", "width_px", "height_px")
        names = by_matrices if len(args) + len(kwargs) == 4 else by_view
        given = {**dict(zip(names, args)), **kwargs}
        if set(given) != set(names) or len(given) != len(args) + len(kwargs):
            raise ValueError(f"create_rays_pinhole takes {', '.join(by_matrices)}, or {', '.join(by_view)}")
        width, height = int(given["width_px"]), int(given["height_px"])
        if names is by_matrices:
            intrinsic, extrinsic = (np.asarray(_array(given[name]), np.float64) for name in names[:2])
            if intrinsic.shape != (3, 3) or extrinsic.shape != (4, 4):
                raise ValueError(f"the matrices have shapes {intrinsic.shape} and {extrinsic.shape}, not (3, 3) and (4, 4)")
        else:
            intrinsic, extrinsic = _matrices(*(given[name] for name in by_view))
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        rotation, shift = extrinsic[:3, :3], extrinsic[:3, 3]
        directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ (rotation.T @ np.linalg.inv(intrinsic)).T
        origins = np.broadcast_to(-rotation.T @ shift, directions.shape)
        return np.concatenate([origins, directions], axis=-1).astype(np.float32)

    def _bvh(self):
        """One BVH over all meshes, so that its answers are exact across them."""
        if self._built is None:
            vertices, triangles = np.concatenate(self._vertices), np.concatenate(self._triangles)
            self._built = Bvh(vertices, triangles, threads=self._threads(0))
        return self._built

    def _threads(self, nthreads):
        n = nthreads or self._nthreads
        return n if n > 0 else None

    def _ids(self, primitive):
        """Mesh and triangle of numbers in the BVH."""
        starts = np.asarray(self._starts)
        # The last mesh that starts at or before the triangle is the one with it: empty meshes start where the next one does.
        geometry = np.searchsorted(starts[:-1], primitive, side="right") - 1
        own = primitive - starts[geometry]
        found = primitive >= 0
        return (np.where(found, ids, self.INVALID_ID).astype(np.uint32) for ids in (geometry, own))

    def _surface(self, primitive, position):
        """Barycentric coordinates of positions on triangles, and unit normals, in float64; zero where there is none."""
        uvs, normals = np.zeros((len(primitive), 2)), np.zeros((len(primitive), 3))
        found = primitive >= 0
        vertices, triangles = np.concatenate(self._vertices), np.concatenate(self._triangles)
        a, b, c = np.swapaxes(vertices.astype(np.float64)[triangles[primitive[found]]], 0, 1)
        x, y, p = b - a, c - a, position[found] - a
        xx, xy, yy, xp, yp = (np.einsum("ij,ij->i", f, g) for f, g in [(x, x), (x, y), (y, y), (x, p), (y, p)])
        determinant = xx * yy - xy * xy
        flat = determinant <= 0.0
        divisor = np.where(flat, 1.0, determinant)
        uv = np.stack([(yy * xp - xy * yp) / divisor, (xx * yp - xy * xp) / divisor], axis=-1)
        uvs[found] = np.where(flat[:, None], 0.0, np.clip(uv, 0.0, 1.0))
        normal = np.cross(x, y)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normals[found] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
        return uvs, normals


def _matrices(fov_deg, center, eye, up, width_px, height_px):
    """Intrinsic and extrinsic matrix of a camera that looks from eye to center; as in Open3D, rows of pixels go up."""
    center, eye, up = (np.asarray(_array(argument), np.float64) for argument in (center, eye, up))
    forward = (center - eye) / np.linalg.norm(center - eye)
    left = np.cross(up, forward)
    left = left / np.linalg.norm(left)
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = left, np.cross(forward, left), forward
    extrinsic[:3, 3] = -extrinsic[:3, :3] @ eye
    focal_px = 0.5 * width_px / np.tan(0.5 * np.deg2rad(fov_deg))
    return np.array([[focal_px, 0, 0.5 * width_px], [0, focal_px, 0.5 * height_px], [0, 0, 1]]), extrinsic


def _rays(rays):
    """Rays of shape (n, 6), and the shape without the last axis."""
    return _flat(rays, "rays", 6)


def _points(points):
    return _flat(points, "query_points", 3)


def _flat(argument, name, width):
    array = _array(argument)
    if array.ndim == 0 or array.shape[-1] != width:
        raise ValueError(f"{name} has shape {array.shape}, not (..., {width})")
    return array.reshape(-1, width), array.shape[:-1]
