"""The ray engine of trimesh, exact: a drop-in for trimesh.ray.ray_pyembree.

>>> import canted.trimesh
>>> canted.trimesh.enable()     # mesh.ray of meshes made from now on

or, for one mesh, ``mesh.ray = canted.trimesh.RayMeshIntersector(mesh)``.
"""

import sys

import numpy as np
import trimesh as _trimesh
from trimesh import caching as _caching

from ._canted import Bvh

__all__ = ["RayMeshIntersector", "disable", "enable"]

# How far the point by barycentric coordinates may lie from that of the float64 ray in the plane of the float64 triangle, relative to
# the reach r of the mesh (the greatest coordinate after the subtraction), in units of 2^-24. Rays start within 2.8 r of zero, so a hit
# lies within 20 * (2.8 + 1) r of the triangle; rounding moves the start by 2.8 r, the far end of the direction by 3.5 r, the
# vertices by r, and u and v move the point by 4 r: 88 r, and 96 r with second order. Points differ more where a ray runs almost in
# the plane, whose intersection then says nothing.
_AGREEMENT = 96 * 2.0**-24


class RayMeshIntersector:
    """Ray queries on a trimesh.Trimesh, with the methods of trimesh's own intersectors.

    The mesh is rounded to float32 after a point near it is subtracted; within that mesh every answer is exact. Multiple hits are the
    crossings of the surface, each once, also through edges and vertices, without an offset.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        The mesh. Changes of it are noticed.
    scale_to_box : bool
        Accepted for compatibility; nothing depends on the scale.
    threads : int, optional
        1 to 1024. Default: all processors.
    """

    def __init__(self, geometry, scale_to_box=True, threads=None):
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._threads = threads
        self._cache = _caching.Cache(id_function=self.mesh.__hash__)

    @_caching.cache_decorator
    def bvh(self):
        """The canted.Bvh of the mesh."""
        vertices = np.asarray(self.mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(self.mesh.faces, dtype=np.int64).reshape(-1, 3)
        return Bvh(vertices, faces, origin="near", threads=self._threads)

    def intersects_location(self, ray_origins, ray_directions, multiple_hits=True, **kwargs):
        """Where rays hit the mesh.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) float
            Rays; directions may have any length but zero.
        multiple_hits : bool
            Every crossing instead of the first hit.

        Returns
        -------
        locations : (m, 3) float64
        index_ray : (m,) int64
        index_tri : (m,) int64
        """
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True, **kwargs
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self, ray_origins, ray_directions, multiple_hits=True, max_hits=None, return_locations=False
    ):
        """Which triangles rays hit, in order of the rays, then along each ray.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) float
            Rays; directions may have any length but zero.
        multiple_hits : bool
            Every crossing instead of the first hit.
        max_hits : int, optional
            Most crossings of a ray. Default: all of them.
        return_locations : bool
            Return locations, too.

        Returns
        -------
        index_tri : (m,) int64
        index_ray : (m,) int64
        locations : (m, 3) float64
            Only with return_locations.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        if multiple_hits:
            hits = self.bvh.crossings(origins, directions, threads=self._threads)
            rows = slice(None) if max_hits is None else _first_of_each(hits.ray, max_hits)
        else:
            hits = self.bvh.closest_hit(origins, directions, threads=self._threads)
            rows = hits.hit
        index_tri, index_ray = hits.primitive[rows].astype(np.int64), hits.ray[rows]
        if not return_locations:
            return index_tri, index_ray
        u, v = hits.u[rows].astype(np.float64), hits.v[rows].astype(np.float64)
        return index_tri, index_ray, self._locations(origins, directions, index_tri, index_ray, u, v)

    def intersects_first(self, ray_origins, ray_directions):
        """The first triangle that each ray hits: (n,) int64, -1 for a miss."""
        origins, directions = _rays(ray_origins, ray_directions)
        return self.bvh.closest_hit(origins, directions, threads=self._threads).primitive.astype(np.int64)

    def intersects_any(self, ray_origins, ray_directions):
        """Whether each ray hits the mesh: (n,) bool."""
        origins, directions = _rays(ray_origins, ray_directions)
        return self.bvh.occluded(origins, directions, threads=self._threads)

    def contains_points(self, points):
        """Whether each point, (n, 3) float, is inside of the closed mesh or on its surface, by parity as in trimesh: (n,) bool."""
        points = np.asanyarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError("points must be (n,3)")
        return self.bvh.contains(points, mode="parity", threads=self._threads)

    def _locations(self, origins, directions, index_tri, index_ray, u, v):
        """Hit points of the float64 rays on the float64 mesh."""
        if len(index_tri) == 0:
            return np.zeros((0, 3))
        a, b, c = np.swapaxes(np.asarray(self.mesh.triangles, dtype=np.float64)[index_tri], 0, 1)
        o, d = origins[index_ray], directions[index_ray]
        by_corners = a + u[:, None] * (b - a) + v[:, None] * (c - a)
        normal = np.cross(b - a, c - a)
        with np.errstate(all="ignore"):
            t = np.einsum("ij,ij->i", a - o, normal) / np.einsum("ij,ij->i", d, normal)
            by_plane = o + t[:, None] * d
            reach = np.abs(self.bvh.bounds - self.bvh.origin).max()
            agrees = np.abs(by_plane - by_corners).max(axis=1, initial=0.0) <= _AGREEMENT * reach
        return np.where(agrees[:, None], by_plane, by_corners)

    def __getstate__(self):
        state = self.__dict__.copy()
        # The BVH is built again where it is needed.
        state.pop("_cache", None)
        return state

    def __setstate__(self, state):
        self.__dict__.update(state)
        self._cache = _caching.Cache(id_function=self.mesh.__hash__)

    def __deepcopy__(self, *args):
        return self.__copy__()

    def __copy__(self, *args):
        return RayMeshIntersector(self.mesh, scale_to_box=self._scale_to_box, threads=self._threads)


def _rays(origins, directions):
    """Rays as two float64 arrays of shape (n, 3)."""
    origins, directions = np.asarray(origins, dtype=np.float64), np.asarray(directions, dtype=np.float64)
    if origins.shape != directions.shape:
        raise ValueError("Ray origin and direction don't match!")
    if origins.size == 0:
        return origins.reshape(-1, 3), directions.reshape(-1, 3)
    if origins.ndim != 2 or origins.shape[1] != 3:
        raise ValueError(f"rays have shape {origins.shape}, not (n, 3)")
    # Lengths that float32 cannot hold become 1; the others stay as they are.
    length = np.abs(directions).max(axis=1, keepdims=True)
    extreme = (length > 2.0**64) | ((length < 2.0**-64) & (length > 0.0))
    return origins, np.divide(directions, length, out=directions.copy(), where=extreme & np.isfinite(length))


def _first_of_each(index_ray, n):
    """Rows of the first n hits of each ray; index_ray is sorted."""
    starts = np.searchsorted(index_ray, index_ray, side="left")
    return np.arange(len(index_ray)) - starts < n


# What trimesh had before enable.
_before = None


def enable():
    """Makes RayMeshIntersector the ray engine of every trimesh.Trimesh made from now on, unless made with use_embree=False."""
    global _before
    if _before is not None:
        return
    rays = _trimesh.ray
    if rays.has_embree:
        _before = ("class", rays.ray_pyembree.RayMeshIntersector)
        rays.ray_pyembree.RayMeshIntersector = RayMeshIntersector
    else:
        # Without embreex, this module takes the place of the one that could not be imported.
        _before = ("module", rays.ray_pyembree)
        rays.ray_pyembree = sys.modules["trimesh.ray.ray_pyembree"] = sys.modules[__name__]
        rays.has_embree = True


def disable():
    """Undoes enable; meshes keep the engine they have."""
    global _before
    if _before is None:
        return
    (kind, old), _before = _before, None
    rays = _trimesh.ray
    if kind == "class":
        rays.ray_pyembree.RayMeshIntersector = old
    else:
        rays.ray_pyembree, rays.has_embree = old, False
        sys.modules.pop("trimesh.ray.ray_pyembree", None)
