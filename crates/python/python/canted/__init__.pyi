from . import open3d as open3d
from . import trimesh as trimesh
from ._canted import Bvh as Bvh
from ._canted import Hits as Hits
from ._canted import Nearest as Nearest
from ._canted import Tlas as Tlas
from .heatmap import Heatmap as Heatmap

__version__: str
__all__: list[str]
