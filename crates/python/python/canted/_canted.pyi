import os
from collections.abc import Sequence
from typing import Any, Literal, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Preset = Literal["dynamic", "fast", "balanced", "quality"]
_Test = Literal["watertight", "moller-trumbore", "baldwin-weber"]

class Hits:
    @property
    def t(self) -> NDArray[np.float32]: ...
    @property
    def primitive(self) -> NDArray[np.int32]: ...
    @property
    def u(self) -> NDArray[np.float32]: ...
    @property
    def v(self) -> NDArray[np.float32]: ...
    @property
    def entering(self) -> NDArray[np.bool_]: ...
    @property
    def ray(self) -> NDArray[np.int64]: ...
    @property
    def hit(self) -> NDArray[np.bool_]: ...
    @property
    def instance(self) -> Optional[NDArray[np.int32]]: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    @property
    def normal(self) -> NDArray[np.float64]: ...
    def __len__(self) -> int: ...

class Nearest:
    @property
    def distance(self) -> NDArray[np.float32]: ...
    @property
    def primitive(self) -> NDArray[np.int32]: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    def __len__(self) -> int: ...

class Bvh:
    def __init__(
        self,
        vertices: ArrayLike,
        triangles: ArrayLike,
        preset: _Preset = "balanced",
        triangle_test: _Test = "watertight",
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> None: ...
    def closest_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> Hits: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> NDArray[np.bool_]: ...
    def all_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> Hits: ...
    def crossings(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> Hits: ...
    def contains(
        self, points: ArrayLike, *, origin: Optional[ArrayLike] = None, threads: Optional[int] = None
    ) -> NDArray[np.bool_]: ...
    def nearest(
        self,
        points: ArrayLike,
        max_distance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
    ) -> Nearest: ...
    def signed_distance(
        self, points: ArrayLike, *, origin: Optional[ArrayLike] = None, threads: Optional[int] = None
    ) -> NDArray[np.float32]: ...
    def refit(self, vertices: ArrayLike, *, threads: Optional[int] = None) -> dict[str, Any]: ...
    def save(self, path: Union[str, os.PathLike[str]]) -> None: ...
    @staticmethod
    def load(path: Union[str, os.PathLike[str]]) -> Bvh: ...
    def stats(self) -> dict[str, Any]: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    def __len__(self) -> int: ...

class Tlas:
    def __init__(
        self, bvhs: Sequence[Bvh], instances: Optional[Sequence[tuple[int, ArrayLike]]] = None
    ) -> None: ...
    def closest_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
    ) -> Hits: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
    ) -> NDArray[np.bool_]: ...
    def all_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
    ) -> Hits: ...
    def stats(self) -> dict[str, Any]: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    def __len__(self) -> int: ...
