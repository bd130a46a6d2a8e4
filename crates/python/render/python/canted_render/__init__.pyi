import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Optional, Union

import numpy as np
from numpy.typing import NDArray

__version__: str
__all__: list[str]

class Picture(np.ndarray[Any, np.dtype[np.float32]]):
    aovs: dict[str, NDArray[Any]]
    def srgb(self) -> NDArray[np.uint8]: ...
    def png(self) -> bytes: ...
    def save(self, path: Union[str, os.PathLike[str]]) -> None: ...

def render(
    scene: Union[str, os.PathLike[str], Mapping[str, Any], None] = None,
    size: Optional[tuple[int, int]] = None,
    spp: Optional[int] = None,
    *,
    integrator: Optional[Literal["hybrid", "path"]] = None,
    seed: Optional[int] = None,
    aovs: Union[str, Sequence[str]] = (),
    threads: Optional[int] = None,
    progress: Optional[Callable[[float], object]] = None,
    **options: Any,
) -> Picture: ...
