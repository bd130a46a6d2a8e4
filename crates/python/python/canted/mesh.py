"""Meshes of other packages, and arrays in their memory."""

import numpy as np


def array_of(argument):
    """A NumPy array in the memory of the argument where it allows that (DLPack), else a copy on the processor."""
    if isinstance(argument, np.ndarray):
        return np.asarray(argument)
    if hasattr(argument, "__dlpack__"):
        try:
            return np.from_dlpack(argument)
        except (AttributeError, BufferError, RuntimeError, TypeError, ValueError) as error:
            # On another device, with a gradient, or of a type that DLPack does not have.
            reason = error
        array = _converted(argument)
        if array.dtype == object:
            raise reason
        return array
    return _converted(argument)


def _converted(argument):
    return np.asarray(argument.numpy() if hasattr(argument, "numpy") else argument)


def arrays_of(mesh):
    """Vertices and triangles of a mesh: of trimesh, a scene included, of Open3D, legacy or tensor, or an array of triangles by their vertices."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        # Empty meshes of Open3D lack these entries.
        parts = [(mesh.vertex, "positions"), (mesh.triangle, "indices")]
        return tuple(array_of(part[name]) if name in part else np.zeros((0, 3), int) for part, name in parts)
    if hasattr(mesh, "vertices"):
        for name in ("triangles", "faces"):
            # The triangles of trimesh are coordinates.
            indices = getattr(mesh, name, None)
            if indices is not None and array_of(indices).ndim == 2:
                return array_of(mesh.vertices), array_of(indices)
    for name in ("to_mesh", "dump"):
        if hasattr(mesh, "geometry") and hasattr(mesh, name):
            return arrays_of(mesh.to_mesh() if name == "to_mesh" else mesh.dump(concatenate=True))
    soup = array_of(mesh)
    if soup.shape == (0,):
        soup = soup.reshape(0, 3, 3)
    is_soup = soup.ndim == 3 and soup.shape[1:] == (3, 3) or soup.ndim == 2 and soup.shape[1] == 3 and len(soup) % 3 == 0
    if not is_soup or soup.dtype.kind not in "fiu":
        what = f"an array of shape {soup.shape} and dtype {soup.dtype}" if soup.ndim else f"a {type(mesh).__name__}"
        raise ValueError(
            f"{what} without triangles is no mesh; give vertices and triangles, a mesh of trimesh or Open3D, or an array of shape (m, 3, 3)"
        )
    vertices = soup.reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)
