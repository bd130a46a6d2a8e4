import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Preset = Literal["dynamic", "fast", "balanced", "quality"]
_Test = Literal["watertight", "moller-trumbore", "baldwin-weber"]
_Form = Literal["all", "any", "count", "first"]
_Mode = Literal["winding", "parity"]
_Progress = Callable[[float], object]
_Reals = Union[NDArray[np.float32], NDArray[np.float64]]

class Hits:
    @property
    def t(self) -> _Reals: ...
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
    def to_dict(self) -> dict[str, NDArray[Any]]: ...
    def __getitem__(self, index: Any) -> Hits: ...
    def __iter__(self) -> Iterator[Hits]: ...
    def __len__(self) -> int: ...
    def __bool__(self) -> bool: ...

class Nearest:
    @property
    def distance(self) -> _Reals: ...
    @property
    def primitive(self) -> NDArray[np.int32]: ...
    @property
    def instance(self) -> Optional[NDArray[np.int32]]: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    def __len__(self) -> int: ...

class Distance:
    @property
    def distance(self) -> float: ...
    @property
    def points(self) -> NDArray[np.float64]: ...
    @property
    def primitives(self) -> NDArray[np.int32]: ...

class Contact:
    @property
    def t(self) -> float: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    @property
    def normal(self) -> NDArray[np.float64]: ...
    @property
    def primitives(self) -> NDArray[np.int32]: ...
    @property
    def starts_inside(self) -> bool: ...

class Bvh:
    def __init__(
        self,
        vertices: Any,
        triangles: Optional[ArrayLike] = None,
        preset: _Preset = "balanced",
        triangle_test: _Test = "watertight",
        *,
        aligned: bool = False,
        origin: Union[Literal["auto", "near"], ArrayLike, None] = "auto",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> None: ...
    @staticmethod
    def from_mesh(
        mesh: Any,
        preset: _Preset = "balanced",
        triangle_test: _Test = "watertight",
        *,
        aligned: bool = False,
        origin: Union[Literal["auto", "near"], ArrayLike, None] = "auto",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Bvh: ...
    def closest_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def contains(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.bool_]: ...
    def winding_number(
        self,
        points: ArrayLike,
        tolerance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.float64]: ...
    def nearest(
        self,
        points: ArrayLike,
        max_distance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def k_nearest(
        self,
        points: ArrayLike,
        k: int,
        max_distance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def signed_distance(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> _Reals: ...
    def overlapping_box(
        self,
        low: ArrayLike,
        high: ArrayLike,
        *,
        form: _Form = "all",
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_sphere(
        self,
        center: ArrayLike,
        radius: ArrayLike,
        *,
        form: _Form = "all",
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_frustum(
        self,
        near: ArrayLike,
        far: ArrayLike,
        *,
        form: _Form = "all",
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_hull(
        self,
        points: ArrayLike,
        radius: Optional[ArrayLike] = None,
        *,
        form: _Form = "all",
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def pairs(self, b: Bvh, pose: Optional[ArrayLike] = None) -> NDArray[np.int32]: ...
    def overlaps(self, b: Bvh, pose: Optional[ArrayLike] = None) -> bool: ...
    def distance_to(self, b: Bvh, pose: Optional[ArrayLike] = None) -> Distance: ...
    def self_intersections(self) -> NDArray[np.int32]: ...
    def cast_sphere(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        radius: ArrayLike,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def cast(
        self, b: Bvh, motion: ArrayLike, pose: Optional[ArrayLike] = None, t_max: float = ...
    ) -> Optional[Contact]: ...
    def refit(self, vertices: ArrayLike, *, threads: Optional[int] = None) -> dict[str, Any]: ...
    def save(self, path: Union[str, os.PathLike[str]]) -> None: ...
    @staticmethod
    def load(path: Union[str, os.PathLike[str]], mmap: bool = False) -> Bvh: ...
    def stats(self) -> dict[str, Any]: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def triangles(self) -> NDArray[np.int64]: ...
    @property
    def bounds(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    def __len__(self) -> int: ...

class Tiles:
    def __init__(self, path: Union[str, os.PathLike[str]], memory: Union[float, str, None] = ...) -> None: ...
    @staticmethod
    def build(
        vertices: Any,
        triangles: Optional[ArrayLike],
        path: Union[str, os.PathLike[str]],
        tile_triangles: int = 262_144,
        *,
        memory: Union[float, str, None] = ...,
        preset: _Preset = "balanced",
        origin: Union[Literal["auto", "near"], ArrayLike, None] = "auto",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Tiles: ...
    def closest_hit(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
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
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def contains(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.bool_]: ...
    def nearest(
        self,
        points: ArrayLike,
        max_distance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def k_nearest(
        self,
        points: ArrayLike,
        k: int,
        max_distance: float = ...,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def signed_distance(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        origin: Optional[ArrayLike] = None,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> _Reals: ...
    def check(self) -> None: ...
    def stats(self) -> dict[str, Any]: ...
    @property
    def path(self) -> Path: ...
    @property
    def bounds(self) -> Optional[NDArray[np.float64]]: ...
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
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.bool_]: ...
    def all_hits(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def crossings(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: Optional[ArrayLike] = None,
        t_max: Optional[ArrayLike] = None,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Hits: ...
    def contains(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.bool_]: ...
    def nearest(
        self,
        points: ArrayLike,
        max_distance: float = ...,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def k_nearest(
        self,
        points: ArrayLike,
        k: int,
        max_distance: float = ...,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Nearest: ...
    def signed_distance(
        self,
        points: ArrayLike,
        mode: Optional[_Mode] = None,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> _Reals: ...
    def overlapping_box(
        self,
        low: ArrayLike,
        high: ArrayLike,
        *,
        form: _Form = "all",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_sphere(
        self,
        center: ArrayLike,
        radius: ArrayLike,
        *,
        form: _Form = "all",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_frustum(
        self,
        near: ArrayLike,
        far: ArrayLike,
        *,
        form: _Form = "all",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def overlapping_hull(
        self,
        points: ArrayLike,
        radius: Optional[ArrayLike] = None,
        *,
        form: _Form = "all",
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> Union[dict[str, NDArray[Any]], NDArray[Any]]: ...
    def winding_number(
        self,
        points: ArrayLike,
        tolerance: float = ...,
        *,
        threads: Optional[int] = None,
        progress: Optional[_Progress] = None,
    ) -> NDArray[np.float64]: ...
    def instance_pairs(self) -> NDArray[np.int32]: ...
    def insert(self, index: int, matrix: ArrayLike) -> int: ...
    def remove(self, instance: int) -> None: ...
    def set_transform(self, instance: int, matrix: ArrayLike) -> None: ...
    def set_mask(self, instance: int, mask: int) -> None: ...
    def stats(self) -> dict[str, Any]: ...
    @property
    def bounds(self) -> Optional[NDArray[np.float64]]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    def __len__(self) -> int: ...
