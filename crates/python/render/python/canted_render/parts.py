"""Ranges of the samples of a picture, rendered apart and joined: the bits of the whole."""

from . import _canted_render
from .call import _request
from .picture import Picture


def render_part(scene, size, spp, first, last, *, threads=None, **options):
    """The samples from first to before last of a picture, as bytes for merge_parts; other parameters are those of render."""
    path, text, meshes, words = _request(scene, size, spp, options)
    return _canted_render.render_part(path, text, meshes, words, first, last, threads)


def merge_parts(parts):
    """Parts of one picture, in any order, as one part. Ranges of samples must be adjacent.

    Raises
    ------
    ValueError
        Parts of different pictures, gaps or overlaps.
    """
    return _canted_render.merge_parts(list(parts))


def picture_of_part(part):
    """The picture of a part: that of render if it has all samples."""
    return _picture(*_canted_render.read_part(part))


def _picture(pixels, by_name):
    return Picture(pixels, {name: values[..., 0] if values.shape[2] == 1 else values for name, values in by_name.items()})


def samples_per_pixel(scene, spp):
    """Samples per pixel: spp, else that of a scene file or dict, else 16."""
    if spp is not None:
        return int(spp)
    if isinstance(scene, dict):
        return int(dict(scene.get("settings", {})).get("spp", 16))
    if scene is not None and str(scene).endswith(".toml"):
        import re

        with open(scene, encoding="utf-8") as file:
            found = re.search(r"^\s*spp\s*=\s*(\d+)", file.read(), re.MULTILINE)
        return int(found.group(1)) if found else 16
    return 16
