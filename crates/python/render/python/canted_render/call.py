"""The call that renders: options to words of the program."""

import os
import re

import numpy as np

from . import _canted_render
from .picture import Picture
from .scene import scene_file


def render(scene=None, size=None, spp=None, *, integrator=None, seed=None, aovs=(), threads=None, progress=None, **options):
    """A picture of a scene, the bits of `canted render` with the same options on the CPU.

    Parameters
    ----------
    scene : path or dict, optional
        A file that the program reads: OBJ, PLY, STL, OFF, glTF, GLB or a scene file; or a dict, see below. Default: the built-in
        scene.
    size : (w, h), optional
        Pixels. Default: that of the scene file, else (1280, 720).
    spp : int, optional
        Samples per pixel. Default: that of the scene file, else 16.
    integrator : str, optional
        "hybrid" or "path".
    seed : int, optional
        Of the random numbers.
    aovs : sequence of str
        Additional channels: "depth", "normal", "shading-normal", "albedo", "instance", "primitive", "tests",
        "emission", "direct", "indirect", or "all".
    threads : int, optional
        1 to 1024. Default: all processors. The picture does not depend on it.
    progress : callable, optional
        Called with the finished fraction, which grows to 1.0. An exception that it raises ends the render.
    **options
        Any other option of `canted render` that determines a picture, by its long name with `_` for `-`: eye, target, up, fov, aperture,
        focus, env, sun, point, sphere, bounces, filter, sampler, noise, ao_radius, lod, time, animation, levels, accel, preset and so on;
        and crop: (left, top, width, height) in pixels, the part that is rendered and returned.
        Values are numbers, strings, or sequences of numbers; sequences of these for an option that may be repeated, such as sun.

    A dict has the tables and keys of a scene file (docs/scene-file.md): "assets", "instances", "camera", "lights", "environment", "materials",
    "overrides", "settings"; and "meshes", a list of dicts with

    * "vertices", (n, 3) floats, and "triangles", (m, 3) integers;
    * optionally "normals", (n, 3); "uvs", (n, 2); "colors", (n, 3) or (n, 4), linear;
    * optionally "color", three numbers, or "material": the name of an item of "materials", or a dict with its fields;
    * optionally "name", by which "instances" refer to it. Default: "mesh 0", "mesh 1" and so on.

    Returns
    -------
    Picture
        An array of shape (h, w, 3), float32, linear RGB, row 0 at the top, with `aovs`: a dict of arrays of shape (h, w) or (h, w, k).
        Depth is inf and instance and primitive are -1 where nothing is hit.

    Raises
    ------
    ValueError
        An unknown option, an invalid value, a damaged file, a scene that refers to an absent one. One sentence.
    OSError
        The file `scene` cannot be read.

    Warnings of the program are Python's warnings.
    """
    if progress is not None and not callable(progress):
        raise ValueError("progress is not callable")
    path, text, meshes, words = _request(scene, size, spp, {"integrator": integrator, "seed": seed, "aovs": aovs, **options})
    try:
        pixels, by_name = _canted_render.render(path, text, meshes, words, threads, progress)
    except ValueError as error:
        if text is None:
            raise
        # The text is ours: its lines say nothing.
        raise ValueError(re.sub(r"\bscene: line \d+: ", "scene: ", str(error))) from None
    return Picture(pixels, {name: values[..., 0] if values.shape[2] == 1 else values for name, values in by_name.items()})


def _request(scene, size, spp, options):
    """The scene as a path, or as the text of a scene file with meshes; options as words of the program."""
    aovs = options.get("aovs") or ()
    if isinstance(aovs, str):
        aovs = aovs.split(",")
    named = {"size": _size(size), "spp": spp, **options}
    named["aovs"] = ",".join(str(name).replace("_", "-") for name in aovs) or None
    words = [(name, word) for name, value in named.items() for word in _words(name, value)]
    path = text = None
    meshes = []
    if isinstance(scene, (str, os.PathLike)):
        path = os.fspath(scene)
    elif scene is not None:
        text, meshes = scene_file(scene)
    return path, text, meshes, words


def _size(size):
    if size is None or isinstance(size, str):
        return size
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        raise ValueError(f"size is {size!r}; it must be (w, h)") from None
    return f"{width}x{height}"


def _words(name, value):
    """The values of an option as the program parses them: none, one, or one for each repetition."""
    if value is None:
        return []
    if isinstance(value, (str, os.PathLike)):
        return [os.fspath(value)]
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim > 2:
        raise ValueError(f"{name} is {value!r}; use a number, a string or a sequence of numbers")
    return [",".join(_number(x) for x in row.ravel()) for row in (array if array.ndim == 2 else array[None])]


def _number(x):
    # As short as it can be without losing a bit.
    return str(int(x)) if isinstance(x, np.integer) else np.format_float_positional(x, trim="-") if np.isfinite(x) else str(x)
