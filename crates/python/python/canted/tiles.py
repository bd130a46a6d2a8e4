"""Triangles of arrays that are larger than memory, a part at a time, for Tiles.build."""

import numpy as np

from .mesh import arrays_of

# Triangles of a part: some 20 MiB of vertices.
PART = 1 << 18


def _arrays(vertices, triangles):
    """Vertices and indices, or triangles by their vertices and None; not read yet where they are not in memory."""
    if triangles is None and getattr(vertices, "ndim", None) != 3:
        vertices, triangles = arrays_of(vertices)
    if not hasattr(vertices, "shape"):
        vertices = np.asarray(vertices)
    if triangles is None:
        if vertices.ndim != 3 or vertices.shape[1:] != (3, 3):
            raise ValueError(f"vertices have shape {vertices.shape}; without triangles it must be (m, 3, 3)")
        return vertices, None
    if not hasattr(triangles, "shape"):
        triangles = np.asarray(triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"vertices have shape {vertices.shape}; it must be (n, 3)")
    if triangles.size == 0:
        triangles = np.zeros((0, 3), int)
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ValueError(f"triangles have shape {triangles.shape}; it must be (m, 3)")
    if triangles.dtype.kind not in "iu":
        raise ValueError(f"triangles have type {triangles.dtype}; use integers")
    return vertices, triangles


def _corners(vertices, triangles):
    """The vertices of all triangles, three rows for each, in parts."""
    if triangles is None:
        for first in range(0, len(vertices), PART):
            yield np.asarray(vertices[first : first + PART]).reshape(-1, 3)
        return
    n = len(vertices)
    for first in range(0, len(triangles), PART):
        part = np.asarray(triangles[first : first + PART])
        bad = (part < 0) | (part >= n)
        if bad.any():
            row = int(np.flatnonzero(bad.any(axis=1))[0])
            index = int(part[row][bad[row]][0])
            raise ValueError(f"triangle {first + row} has vertex index {index}, but there are {n} vertices")
        yield np.asarray(vertices[part.ravel()])


def push(writer, vertices, triangles):
    """Passes all triangles on to a writer; of arrays that are not in memory, such as memory maps, only a part is read at once."""
    for part in _corners(*_arrays(vertices, triangles)):
        writer.push(part)


def survey(survey, vertices, triangles, is_near):
    """Passes on what an origin is chosen by: the triangles and the vertices. float32 needs none, unless `is_near` asks for one."""
    vertices, triangles = _arrays(vertices, triangles)
    if vertices.dtype == np.float32 and not is_near:
        return
    for part in _corners(vertices, triangles):
        survey.triangles(part)
    # Those too that no triangle has.
    for first in range(0, 0 if triangles is None else len(vertices), PART):
        survey.vertices(np.asarray(vertices[first : first + PART]))
