"""Pictures of scenes as NumPy arrays: the renderer of canted.

>>> import canted_render
>>> picture = canted_render.render(size=(32, 18), spp=1, aovs=["depth"])
>>> picture.shape, picture.dtype.name, picture.aovs["depth"].shape
((18, 32, 3), 'float32', (18, 32))
"""

from ._canted_render import __version__
from .picture import Picture
from .call import render
from .parts import merge_parts, picture_of_part, render_part, samples_per_pixel

__all__ = ["Picture", "__version__", "merge_parts", "picture_of_part", "render", "render_part", "samples_per_pixel"]
