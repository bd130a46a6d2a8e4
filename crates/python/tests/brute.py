"""Loops over all triangles in float64, simpler than a BVH."""

import numpy as np

# Rounding of a kernel of canted, relative to the coordinates of ray and triangle: HIT_ERROR of the Rust library, 20 * 2^-24.
HIT_ERROR = 20 * 2.0**-24


def intersections(vertices, triangles, origin, direction):
    """For one ray: t of its line with the plane of each triangle, and how deep it passes inside of the triangle.

    The depth is the least distance of the ray from the lines of the edges, in units of length; negative outside, and for a triangle that
    is flat or seen edge-on.
    """
    a, b, c = (vertices[triangles[:, k]].astype(np.float64) for k in range(3))
    o, d = origin.astype(np.float64), direction.astype(np.float64)
    normal = np.cross(b - a, c - a)
    with np.errstate(all="ignore"):
        t = ((a - o) * normal).sum(axis=1) / (normal @ d)
        toward = np.sign(normal @ d)
        signed = []
        for p, q in ((a, b), (b, c), (c, a)):
            # Distance of the lines of ray and edge: a point between, along the common normal.
            common = np.cross(d, q - p)
            signed.append(((o - p) * common).sum(axis=1) / np.linalg.norm(common, axis=1))
    # An edge without length, or along the ray, has no distance; fmin skips it.
    edge_on = -np.fmin.reduce(np.abs(signed))
    depth = np.where(toward == 0.0, edge_on, np.minimum.reduce(toward * np.array(signed)))
    return t, np.nan_to_num(depth, nan=0.0)


def closest(vertices, triangles, origin, direction, t_min=0.0, t_max=np.inf):
    """The first hit of one ray: (triangle or -1, t), or None where float64 and float32 may disagree.

    They may disagree where a triangle is passed within HIT_ERROR of an edge, where t is that close to an end of the interval, and where
    a plane is seen so much from the side that its t is uncertain.
    """
    t, depth = intersections(vertices, triangles, origin, direction)
    reach = np.abs(origin.astype(np.float64)).max() + np.abs(vertices[triangles]).max(axis=(1, 2)).astype(np.float64)
    # Twice: the distance of the reported point from the triangle in each coordinate, and of the edges in space (sqrt 3 < 2).
    margin = 2 * HIT_ERROR * reach
    if _matters(t, depth, margin):
        return None
    inside = (depth > 0.0) & (t >= t_min) & (t <= t_max)
    if not inside.any():
        return -1, np.inf
    first = np.flatnonzero(inside)[np.argmin(t[inside])]
    return int(first), float(t[first])


def _matters(t, depth, margin):
    """Whether an uncertain triangle lies before the first certain hit."""
    uncertain = np.abs(depth) < margin
    certain = t[(depth >= margin) & (t > 0.0)]
    first = certain.min(initial=np.inf)
    # A ray in a plane has no t: always uncertain.
    return bool((np.isnan(t[uncertain]) | (t[uncertain] <= first * (1 + 1e-3) + 1e-3)).any())


def nearest(vertices, triangles, point):
    """Distance of one point to each triangle, in float64."""
    a, b, c = (vertices[triangles[:, k]].astype(np.float64) for k in range(3))
    p = point.astype(np.float64)
    best = np.minimum.reduce([_to_segment(p, x, y) for x, y in ((a, b), (b, c), (c, a))])
    normal = np.cross(b - a, c - a)
    squared = (normal * normal).sum(axis=1)
    with np.errstate(all="ignore"):
        weights = [(np.cross(y - x, p - x) * normal).sum(axis=1) for x, y in ((a, b), (b, c), (c, a))]
        above = (np.minimum.reduce(weights) >= 0.0) & (squared > 0.0)
        to_plane = np.abs(((p - a) * normal).sum(axis=1)) / np.sqrt(squared)
    return np.where(above, to_plane, best)


def _to_segment(p, x, y):
    edge, to_point = y - x, p - x
    squared = (edge * edge).sum(axis=1)
    share = np.clip((edge * to_point).sum(axis=1) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    return np.linalg.norm(to_point - share[:, None] * edge, axis=1)


def winding(vertices, triangles, points):
    """How often a closed mesh surrounds each point: the sum of solid angles over 4 pi."""
    total = np.zeros(len(points))
    for triangle in vertices[triangles].astype(np.float64):
        a, b, c = (corner - points.astype(np.float64) for corner in triangle)
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        volume = (a * np.cross(b, c)).sum(axis=1)
        cosines = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        total += 2.0 * np.arctan2(volume, cosines)
    return total / (4.0 * np.pi)
