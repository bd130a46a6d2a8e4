"""Ranges of the samples of a picture, rendered apart and joined: the bits of the whole."""

import re

from . import _canted_render
from .call import _request
from .picture import Picture


def render_part(scene, size, spp, first, last, *, threads=None, **options):
    """The samples from first to before last of a picture, as bytes for merge_parts; other parameters are those of render."""
    # The pattern of the whole, which depends on the number of samples for one sampler only: that is not stated for the others.
    sampler = options.pop("sampler", None) or _setting(scene, "sampler", r'"?([a-z-]+)') or "stratified"
    path, text, meshes, words = _request(scene, size, spp if sampler == "stratified" else None, {"sampler": sampler, **options})
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
    spp = spp if spp is not None else _setting(scene, "spp", r"(\d+)") or 16
    if not re.fullmatch("0*[1-9][0-9]*", str(spp)):
        raise ValueError(f"spp is {spp!r}; use a whole number of 1 or more")
    return int(spp)


def _setting(scene, name, value):
    """A setting of a dict or of a scene file; None where it states none."""
    if isinstance(scene, dict):
        return dict(scene.get("settings", {})).get(name)
    if scene is None or not str(scene).endswith(".toml"):
        return None
    with open(scene, encoding="utf-8") as file:
        found = re.search(rf"^\s*{name}\s*=\s*{value}", file.read(), re.MULTILINE)
    return found.group(1) if found else None
