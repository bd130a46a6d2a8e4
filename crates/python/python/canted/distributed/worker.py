"""What runs on workers: tasks, and the BVHs that a worker holds open.

Tasks are pickled by the name of `run`, which stays in all versions, so that a worker of another version says so.
"""

import hashlib
import os
import tempfile
import threading
from collections import OrderedDict
from pathlib import Path

import numpy as np

from .. import Bvh, Tiles, __version__

# BVHs that a worker holds open: the one in use, and one of a query before.
_MOST_OPEN = 2


def run(version, task, *arguments, **options):
    """A task of this package, of a client of this version."""
    if version != __version__:
        raise RuntimeError(f"this worker has canted {__version__}, the client {version}; install one version on all")
    return TASKS[task](*arguments, **options)


def ask(*arrays, source, method, given):
    """The answer of one chunk: an array, or an Answer."""
    found = getattr(source.open(), method)(*arrays, threads=1, **given)
    return found if isinstance(found, np.ndarray) else Answer(found)


def ask_rays(origins, directions, t_min, t_max, **options):
    """As ask, of rays. The rows of t have an axis more, so that chunks align."""
    ends = [end[..., 0] if getattr(end, "ndim", 0) else end for end in (t_min, t_max)]
    return ask(origins, directions, *ends, **options)


def ask_part(origins, directions, t_min, t_max, before=None, *, source, method, given):
    """As ask_rays, of a part of a store, after parts of which `before` is the answer."""
    ends = [end[..., 0] if getattr(end, "ndim", 0) else end for end in (t_min, t_max)]
    if before is None:
        return ask(origins, directions, *ends, source=source, method=method, given=given)
    before = before.item()
    if method == "occluded":
        return _occluded_after(before, origins, directions, ends, source, given)
    t, primitive = before.field("t"), before.field("primitive")
    # A miss has t = inf.
    after = ask(origins, directions, ends[0], np.minimum(np.asarray(ends[1], np.float64), t), source=source, method=method, given=given)
    of_part, numbers = after.field("t"), after.field("primitive")
    is_closer = (numbers >= 0) & ((primitive < 0) | (of_part < t) | ((of_part == t) & (numbers < primitive)))
    if not is_closer.any():
        return before
    fields = {}
    for name in ("t", "primitive", "u", "v", "entering", "hit", "position", "normal"):
        old, new = before.field(name), after.field(name)
        fields[name] = np.where(is_closer.reshape(is_closer.shape + (1,) * (new.ndim - is_closer.ndim)), new, old)
    return Answer(fields)


def _occluded_after(before, origins, directions, ends, source, given):
    """Asks a part for the rays that are not occluded yet."""
    left = ~before
    if left.any():
        # Rows of rays; what is the same for all has one.
        origins, directions = (array[left] if array.ndim > 1 else array for array in (origins, directions))
        t_min, t_max = (end[left] if getattr(end, "ndim", 0) else end for end in ends)
        before = before.copy()
        before[left] = ask(origins, directions, t_min, t_max, source=source, method="occluded", given=given)
    return before


def render_part(request, first, last, kept):
    """The part of a picture from sample first to before last, as bytes; read from the checkpoint where it is there."""
    found = kept and _kept(kept, first, last)
    if found:
        return found
    import canted_render

    scene, size, spp, options = request
    part = canted_render.render_part(scene, size, spp, first, last, threads=1, **options)
    if kept:
        _keep(kept, first, last, part)
    return part


def render_rows(request, top, height):
    """Rows of a picture with all samples: pixels and AOVs."""
    import canted_render

    scene, size, spp, options = request
    found = canted_render.render(scene, size, spp, threads=1, crop=(0, top, size[0], height), **options)
    return np.asarray(found), found.aovs


def join_rows(rows):
    """Adjacent rows as one picture."""
    pixels, aovs = zip(*rows)
    return np.concatenate(pixels), {name: np.concatenate([own[name] for own in aovs]) for name in aovs[0]}


def small_rows(rows, most):
    """As small_picture, of rows."""
    return None if most is None else _small(rows[0], most)


def merge_parts(parts):
    """Adjacent parts as one."""
    import canted_render

    return canted_render.merge_parts(parts)


def picture(part):
    """The picture of a part that has all samples."""
    import canted_render

    found = canted_render.picture_of_part(part)
    # Without the AOVs, which would not be pickled with the array.
    return np.asarray(found), found.aovs


def small_picture(part, most):
    """The picture of a part, with each square of n x n pixels as one, so that it is at most `most` pixels wide; None if that is not wanted."""
    if most is None:
        return None
    return _small(picture(part)[0], most)


def _small(pixels, most):
    n = -(-pixels.shape[1] // most)
    height, width = (max(1, side // n) for side in pixels.shape[:2])
    n_rows, n_columns = min(n, pixels.shape[0]), min(n, pixels.shape[1])
    squares = pixels[: height * n_rows, : width * n_columns].reshape(height, n_rows, width, n_columns, 3)
    return squares.mean(axis=(1, 3), dtype=np.float32)


class Answer:
    """The Hits or Nearest of one chunk. Dask learns how large it is, so that fields are taken where it is; where it moves, its fields do, not the BVH."""

    def __init__(self, found, missing=None):
        self.found, self.missing = found, missing or {}

    def field(self, name):
        """An array."""
        if isinstance(self.found, dict):
            if name in self.missing:
                raise ValueError(self.missing[name])
            return self.found[name]
        return getattr(self.found, name)

    def __sizeof__(self):
        # About 25 bytes for a row, and of those that moved 48 more.
        return (73 if isinstance(self.found, dict) else 25) * self.field("primitive").size

    def __reduce__(self):
        fields, missing = {}, {}
        for name in _FIELDS:
            if hasattr(type(self.found), name) or isinstance(self.found, dict):
                try:
                    fields[name] = self.field(name)
                except (KeyError, ValueError) as error:
                    # Such as positions on tiles with placements.
                    missing[name] = str(error)
        return Answer, (fields, missing)


_FIELDS = ("ray", "t", "primitive", "u", "v", "entering", "hit", "instance", "distance", "position", "normal")

TASKS = {
    "ask": ask,
    "ask_part": ask_part,
    "ask_rays": ask_rays,
    "join_rows": join_rows,
    "merge_parts": merge_parts,
    "picture": picture,
    "render_part": render_part,
    "render_rows": render_rows,
    "small_picture": small_picture,
    "small_rows": small_rows,
}


def _digest(part):
    return hashlib.sha256(part).hexdigest()[:16]


def _kept(folder, first, last):
    """The part that an earlier task kept, compared with the digest in its name; None without one."""
    for path in Path(folder).glob(f"{first}-{last}.*.exr"):
        part = path.read_bytes()
        if path.name == f"{first}-{last}.{_digest(part)}.exr":
            return part
    return None


def _keep(folder, first, last, part):
    Path(folder).mkdir(parents=True, exist_ok=True)
    path = Path(folder) / f"{first}-{last}.{_digest(part)}.exr"
    with tempfile.NamedTemporaryFile(dir=folder, suffix=".partial", delete=False) as file:
        file.write(part)
    os.replace(file.name, path)


class Source:
    """What a worker needs to open a BVH: a path, or the BVH, which other processes get as bytes."""

    def __init__(self, key, path=None, memory=None, bvh=None, data=None, part=None):
        self.key, self.path, self.memory, self.bvh, self.data, self.part = key, path, memory, bvh, data, part

    def of_part(self, first, n, n_bytes):
        """What opens `n` tiles from the number `first` on, which have so many bytes."""
        return Source(self.key, self.path, self.memory, part=(first, n, n_bytes))

    def held(self):
        """Itself, open here."""
        self.open()
        return self

    def __sizeof__(self):
        return self.part[2] if self.part else object.__sizeof__(self)

    def __reduce__(self):
        data = self.data if self.bvh is None else self.bvh.__reduce__()[1][0]
        return Source, (self.key, self.path, self.memory, None, data, self.part)

    def __dask_tokenize__(self):
        return (type(self).__name__, self.key, self.memory, self.part)

    def open(self):
        """The BVH; of several threads that ask for it, one opens it."""
        if self.bvh is not None:
            return self.bvh
        key = (self.key, self.memory, self.part)
        with _LOCK:
            lock = _LOCKS.setdefault(key, threading.Lock())
        with lock:
            with _LOCK:
                opened = _OPEN.get(key)
                if opened is not None:
                    _OPEN.move_to_end(key)
            if opened is None:
                opened = self._read()
                with _LOCK:
                    _OPEN[key] = opened
                    while len(_OPEN) > _MOST_OPEN:
                        _OPEN.popitem(last=False)
        return opened

    def _read(self):
        if self.data is not None:
            # The checked format of Bvh.save, not a pickle.
            return Bvh._from_bytes(self.data)
        path = _fetched(self.path, self.key) if "://" in self.path else self.path
        if self.part:
            return Tiles._part(path, self.memory, *self.part[:2])
        if os.path.isdir(path):
            return Tiles(path) if self.memory is None else Tiles(path, self.memory)
        return Bvh.load(path)


_LOCK = threading.Lock()
_LOCKS = {}
_OPEN = OrderedDict()


def _fetched(url, key):
    """A local copy of a file or of a folder of tiles; complete or absent, as several workers of a host share it."""
    fsspec = fsspec_module()
    system, remote = fsspec.core.url_to_fs(url)
    folder = Path(tempfile.gettempdir()) / f"canted-{os.getuid() if hasattr(os, 'getuid') else 0}" / hashlib.sha256(repr(key).encode()).hexdigest()[:32]
    if not folder.exists():
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as partial:
            target = Path(partial) / "bvh"
            system.get(remote, str(target), recursive=system.isdir(remote))
            whole = Path(partial) / "whole"
            whole.mkdir()
            target.rename(whole / "bvh")
            try:
                whole.rename(folder)
            except OSError:
                # Another worker was faster.
                if not folder.exists():
                    raise
    return str(folder / "bvh")


def fsspec_module():
    """fsspec, or an error that says why it is needed."""
    try:
        import fsspec
    except ImportError as error:
        raise ImportError("a URL of a BVH needs fsspec; pip install 'canted[distributed]'", name="fsspec") from error
    return fsspec
