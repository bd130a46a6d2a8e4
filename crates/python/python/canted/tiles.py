"""Triangles of arrays that are larger than memory, a part at a time, for Tiles.build."""

import numpy as np

from .mesh import arrays_of

# Triangles of a part: some 20 MiB of vertices.
PART = 1 << 18


def push(writer, vertices, triangles):
    """Passes all triangles on to a writer; of arrays that are not in memory, such as memory maps, only a part is read at once."""
    if triangles is None and getattr(vertices, "ndim", None) != 3:
        vertices, triangles = arrays_of(vertices)
    if not hasattr(vertices, "shape"):
        vertices = np.asarray(vertices)
    if triangles is None:
        if vertices.ndim != 3 or vertices.shape[1:] != (3, 3):
            raise ValueError(f"vertices have shape {vertices.shape}; without triangles it must be (m, 3, 3)")
        for first in range(0, len(vertices), PART):
            writer.push(np.asarray(vertices[first : first + PART]).reshape(-1, 3))
        return
    if not hasattr(triangles, "shape"):
        triangles = np.asarray(triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"vertices have shape {vertices.shape}; it must be (n, 3)")
    if triangles.size == 0:
        return
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ValueError(f"triangles have shape {triangles.shape}; it must be (m, 3)")
    if triangles.dtype.kind not in "iu":
        raise ValueError(f"triangles have type {triangles.dtype}; use integers")
    n = len(vertices)
    for first in range(0, len(triangles), PART):
        part = np.asarray(triangles[first : first + PART])
        bad = (part < 0) | (part >= n)
        if bad.any():
            row = int(np.flatnonzero(bad.any(axis=1))[0])
            index = int(part[row][bad[row]][0])
            raise ValueError(f"triangle {first + row} has vertex index {index}, but there are {n} vertices")
        writer.push(np.asarray(vertices[part.ravel()]))
