import os
from collections.abc import Mapping
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import open3d as open3d
from . import trimesh as trimesh
from ._canted import Bvh as Bvh
from ._canted import Contact as Contact
from ._canted import Distance as Distance
from ._canted import Hits as Hits
from ._canted import Nearest as Nearest
from ._canted import Tiles as Tiles
from ._canted import Tlas as Tlas
from .heatmap import Heatmap as Heatmap

__version__: str
__all__: list[str]

def render(
    scene: Union[str, os.PathLike[str], Mapping[str, Any], None] = None,
    size: Optional[tuple[int, int]] = None,
    spp: Optional[int] = None,
    **options: Any,
) -> NDArray[np.float32]: ...
