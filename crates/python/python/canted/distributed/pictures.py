"""Pictures: ranges of their samples, or tiles of rows, as tasks, joined on the workers."""

import json
import os
from pathlib import Path

import dask
import numpy as np

from .. import __version__
from .worker import run

# Parts that a task joins: more are written less often, fewer need less memory.
_JOINED = 4

# A part of fewer samples costs more to store and to join than to spare.
_FEWEST_SAMPLES = 64

# The most pixels of a row that a preview has.
_PREVIEW_WIDTH = 640


def render(scene=None, size=None, spp=None, *, frames=None, parts=None, tiles=None, client=None, progress=None, preview=None, checkpoint=None, **options):
    """A picture, rendered as ranges of its samples on the workers and joined there: the picture of canted_render.render, bit for bit.

    Parameters
    ----------
    scene : path or dict, optional
        As for canted_render.render; every worker must be able to read the path.
    size, spp, **options
        As for canted_render.render.
    frames : sequence, optional
        A picture for each item: a number is the `time` of an animated scene, a dict has the options in which that picture differs.
    parts : int, optional
        Ranges of samples of a picture, at most spp. Default: two for each thread of the cluster, of at least 64 samples where that occupies all threads.
    tiles : int, optional
        Tiles of a picture, of whole rows with all samples, in place of ranges of samples: for few samples per pixel. Needs size; has no checkpoint.
    client : dask.distributed.Client, optional
        Default: the current client; without one, the threads of this process.
    progress : callable, optional
        Called with the finished fraction of the parts, with a client. What it raises cancels the rest.
    preview : callable or True, optional
        Called with the picture so far, a canted_render.Picture of at most 640 pixels in a row, and the number of its frame, whenever a part is
        finished, with a client; True displays it in a notebook.
    checkpoint : path, optional
        A folder that this process and all workers share. Finished parts are kept there, as EXR files that `canted merge` reads, and a later call with the same
        arguments, of this client or another, goes on from them. It is yours to remove.

    Returns
    -------
    Picture, or a list of them with frames
        As of canted_render.render, which has no noise threshold here: parts are of fixed samples.
    """
    import canted_render

    if client is None:
        client = _current_client()
    n_threads = sum(client.nthreads().values()) if client is not None else os.cpu_count() or 1
    shots = [{}] if frames is None else [dict(frame) if isinstance(frame, dict) else {"time": frame} for frame in frames]
    if not shots:
        return []
    shots = [{"size": size, "spp": spp, **options, **shot} for shot in shots]
    if tiles is not None:
        _check_tiles(tiles, parts, checkpoint)
        pictures = [_TiledShot(scene, shot, tiles, bool(preview)) for shot in shots]
    else:
        pictures = [_Shot(scene, shot, parts, 2 * n_threads / len(shots), checkpoint, bool(preview)) for shot in shots]
    if client is None:
        found = dask.compute(*(shot.whole for shot in pictures), scheduler="threads")
    else:
        found = _wait(client, pictures, progress, _display() if preview is True else preview)
    found = [canted_render.Picture(*picture) for picture in found]
    return found[0] if frames is None else found


def _check_tiles(tiles, parts, checkpoint):
    if tiles < 1:
        raise ValueError(f"tiles is {tiles}; use 1 or more")
    for name, value in (("parts", parts), ("checkpoint", checkpoint)):
        if value is not None:
            raise ValueError(f"tiles and {name} cannot be used together")


def _check_options(options):
    if options.get("noise") is not None:
        raise ValueError("noise needs all samples of a picture in one place; use spp")
    if options.pop("threads", None) is not None:
        raise ValueError("threads is given; a task has one thread, so start workers with as many threads as tasks are to run at once")


class _TiledShot:
    """The tasks of a picture in tiles: runs of rows, which are put below each other."""

    def __init__(self, scene, options, tiles, has_preview):
        _check_options(options)
        size, spp = options.pop("size"), options.pop("spp")
        if size is None:
            raise ValueError("tiles needs size")
        width, height = self.size = tuple(size)
        if isinstance(scene, (str, os.PathLike)) and os.path.exists(scene):
            scene = os.path.abspath(scene)
        n = min(tiles, height)
        ends = [height * i // n for i in range(n + 1)]
        self.ranges = list(zip(ends, ends[1:]))
        request = dask.delayed((scene, self.size, spp, options), traverse=False, pure=False)
        task = dask.delayed(run, pure=False)
        rows = [task(__version__, "render_rows", request, first, last - first) for first, last in self.ranges]
        self.whole = task(__version__, "join_rows", rows)
        self.reports = [task(__version__, "small_rows", own, _PREVIEW_WIDTH if has_preview else None) for own in rows]
        self._shown = {}

    def add(self, first, last, pixels):
        """The picture so far, with a range that is finished; black where others are missing."""
        self._shown[first] = pixels
        n = -(-self.size[0] // _PREVIEW_WIDTH)
        n_rows = [max(1, (last - first) // min(n, last - first)) for first, last in self.ranges]
        black = [np.zeros((n, *pixels.shape[1:]), np.float32) for n in n_rows]
        return np.concatenate([self._shown.get(first, black[i]) for i, (first, _) in enumerate(self.ranges)])


class _Shot:
    """The tasks of a picture: its parts, and the whole."""

    def __init__(self, scene, options, parts, n_wanted, checkpoint, has_preview):
        import canted_render

        _check_options(options)
        self._sums = 0.0, 0
        if parts is not None and parts < 1:
            raise ValueError(f"parts is {parts}; use 1 or more")
        size = options.pop("size")
        spp = canted_render.samples_per_pixel(scene, options.pop("spp"))
        stamp = ""
        if isinstance(scene, (str, os.PathLike)) and os.path.exists(scene):
            scene, stamp = os.path.abspath(scene), str(os.stat(scene).st_mtime_ns)
        request = (scene, size, spp, options)
        is_given = parts is not None
        if not is_given:
            parts = max(1, min(round(n_wanted), max(round(n_wanted / 2), spp // _FEWEST_SAMPLES)))
        self.ranges, kept = _ranges(spp, min(parts, spp)), None
        if checkpoint is not None:
            kept = Path(checkpoint).absolute() / dask.base.tokenize(request, stamp, __version__)
            self.ranges = _kept_ranges(kept, self.ranges, is_given)
        request = dask.delayed(request, traverse=False, pure=False)
        task = dask.delayed(run, pure=False)
        parts = [task(__version__, "render_part", request, first, last, kept and str(kept)) for first, last in self.ranges]
        level = parts
        while len(level) > 1:
            groups = [level[i : i + _JOINED] for i in range(0, len(level), _JOINED)]
            level = [task(__version__, "merge_parts", group) if len(group) > 1 else group[0] for group in groups]
        self.whole = task(__version__, "picture", level[0])
        # What the client hears of finished parts: little, so that they need not be kept for it.
        width = _PREVIEW_WIDTH if has_preview else None
        self.reports = [task(__version__, "small_picture", part, width) for part in parts]

    def add(self, first, last, pixels):
        """The picture so far, with a range that is finished."""
        pixels, n = self._sums[0] + (last - first) * pixels, self._sums[1] + last - first
        self._sums = pixels, n
        return pixels / n


def _ranges(spp, parts):
    """Ranges of samples of similar sizes, from multiples of 64 on where there are enough: such parts store the fewest sums."""
    unit = 64 if spp >= 64 * parts else 1
    n = spp // unit
    ends = [unit * (n * i // parts) for i in range(parts)] + [spp]
    return list(zip(ends, ends[1:]))


def _kept_ranges(folder, ranges, is_given):
    """The ranges of an earlier call with the same checkpoint, unless this one states how many."""
    path = folder / "ranges.json"
    try:
        if not is_given:
            return [(int(first), int(last)) for first, last in json.loads(path.read_text())]
    except FileNotFoundError:
        pass
    folder.mkdir(parents=True, exist_ok=True)
    partial = folder / f"ranges.{os.getpid()}.partial"
    partial.write_text(json.dumps(ranges))
    os.replace(partial, path)
    return ranges


def _current_client():
    try:
        from distributed import get_client

        return get_client()
    except (ImportError, ValueError):
        return None


def _wait(client, shots, progress, preview):
    """The pictures, while reports of finished parts are passed on; whatever ends this cancels what is left."""
    from distributed import as_completed

    wholes = client.compute([shot.whole for shot in shots])
    reports = client.compute([report for shot in shots for report in shot.reports]) if progress or preview else []
    origins = dict(zip(reports, ((i, *ends) for i, shot in enumerate(shots) for ends in shot.ranges)))
    try:
        if progress:
            progress(0.0)
        for n_done, report in enumerate(as_completed(reports, loop=client.loop), 1):
            if preview:
                frame, first, last = origins[report]
                _preview(preview, shots[frame].add(first, last, report.result()), frame)
            if progress:
                progress(n_done / len(reports))
        return client.gather(wholes)
    except BaseException:
        client.cancel([*wholes, *reports])
        raise


def _preview(preview, pixels, frame):
    import canted_render

    preview(canted_render.Picture(pixels), frame)


def _display():
    """Displays previews in a notebook, each frame in one place."""
    from IPython.display import display

    places = {}

    def show(picture, frame):
        if frame in places:
            places[frame].update(picture)
        else:
            places[frame] = display(picture, display_id=True)

    return show
