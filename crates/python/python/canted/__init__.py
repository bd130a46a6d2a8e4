"""Ray and distance queries on triangle meshes.

>>> import numpy as np
>>> import canted
>>> vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
>>> bvh = canted.Bvh(vertices, [[0, 1, 2]])
>>> hits = bvh.closest_hit([[0.25, 0.5, 1.0]], [[0.0, 0.0, -1.0]])
>>> hits.t[0].item(), hits.primitive[0].item(), hits.position[0].tolist()
(1.0, 0, [0.25, 0.5, 0.0])

Every answer is that of a loop over all triangles; there is no epsilon. Bvh, also of a mesh of trimesh or Open3D, and Tlas answer queries, and so
does Tiles, of a mesh larger than memory. canted.distributed asks on Dask. canted.trimesh and
canted.open3d have the interfaces of these packages. render makes pictures; it needs the package canted_render.
"""

import importlib

from ._canted import Bvh, Contact, Distance, Hits, Nearest, Tiles, Tlas, __version__

__all__ = ["Bvh", "Contact", "Distance", "Heatmap", "Hits", "Nearest", "Tiles", "Tlas", "__version__", "distributed", "open3d", "render", "trimesh"]

# Loaded on first use, so that `import canted` takes milliseconds.
_MODULES = ("distributed", "open3d", "trimesh")


def render(scene=None, size=None, spp=None, **options):
    """A picture of a file or of a dict with meshes: an array of shape (h, w, 3), float32, linear RGB, with AOVs.

    Needs the package canted_render; its function render has these parameters and more, and describes them:
    ``help(canted_render.render)``.

    Raises
    ------
    ImportError
        canted_render is not installed.
    ValueError, OSError
        As canted_render.render.
    """
    try:
        import canted_render
    except ModuleNotFoundError as error:
        if error.name != "canted_render":
            raise
        message = "canted.render needs the package canted_render; pip install ./crates/python/render in a checkout of canted"
        raise ImportError(message, name="canted_render") from None
    return canted_render.render(scene, size, spp, **options)


def __getattr__(name):
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    if name == "Heatmap":
        return importlib.import_module(f"{__name__}.heatmap").Heatmap
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted([*globals(), *__all__])
