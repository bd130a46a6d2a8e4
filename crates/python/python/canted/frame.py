"""An origin that keeps float32 coordinates accurate, and rays that start near a mesh."""

import numpy as np

# How far outside of the sphere around a mesh rays start, relative to its radius: far more than roundings of float64 and of
# the float32 coordinates, so that no hit lies before the start.
_MARGIN = 1.0 + 2.0**-10


def origin_of(vertices):
    """A point to subtract from float64 vertices before they are rounded to float32: (3,) float64.

    It is within one extent of the mesh, so that an error of float32 is relative to the extent and not to the distance from zero. It
    is a multiple of a power of two above the extent, so that integers and other short numbers stay exact, and zero for a mesh
    around zero.
    """
    vertices = vertices[np.isfinite(vertices).all(axis=1)]
    if len(vertices) == 0:
        return np.zeros(3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = (high - low).max()
    if not (0.0 < extent < np.inf):
        # All vertices at one point, which becomes zero, or numbers that float64 cannot subtract.
        return low if extent == 0.0 else np.zeros(3)
    unit = 2.0 ** np.ceil(np.log2(extent))
    origin = np.round((low / 2 + high / 2) / unit) * unit
    return np.where(np.isfinite(origin), origin, 0.0)


def start_near(origins, directions, bounds):
    """Origins moved along their rays, in float64, to where the sphere around the bounds begins; others stay.

    Rounding a direction to float32 moves a hit by the distance times 2^-24: from near the mesh that is little.
    """
    if not np.isfinite(bounds).all():
        # An empty mesh.
        return origins
    center, radius = bounds.mean(axis=0), np.linalg.norm(bounds[1] - bounds[0]) / 2
    with np.errstate(all="ignore"):
        squared = np.einsum("ij,ij->i", directions, directions)
        distance = np.einsum("ij,ij->i", center - origins, directions) - radius * _MARGIN * np.sqrt(squared)
        step = distance / squared
    step = np.where(np.isfinite(step) & (step > 0.0), step, 0.0)
    return origins + step[:, None] * directions
