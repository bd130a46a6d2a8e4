"""Pictures of scenes as NumPy arrays: the renderer of canted.

>>> import canted_render
>>> picture = canted_render.render(size=(32, 18), spp=1, aovs=["depth"])
>>> picture.shape, picture.dtype.name, picture.aovs["depth"].shape
((18, 32, 3), 'float32', (18, 32))
"""

from ._canted_render import __version__
from .picture import Picture
from .call import render

__all__ = ["Picture", "__version__", "render"]
