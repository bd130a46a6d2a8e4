"""Results: fields of the answers of all chunks, as Dask arrays."""

import dask
import dask.array as da
import numpy as np


def _field(answer, name):
    return answer.field(name)


class _Result:
    """Fields of the answers of all chunks, as Dask arrays. Ask for all that you need in one call of dask.compute, or persist() the result: the query then runs
    once."""

    # Fields that the answers of chunks do not have.
    _COUNTED = ()

    def __init__(self, answers, **types):
        self._answers, self._types = answers, types

    def __getattr__(self, name):
        if name.startswith("_") or name not in self._types:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}; it has {', '.join([*self._COUNTED, *self.__dict__.get('_types', ())])}")
        dtype, inner = self._types[name]
        if dtype is None:
            return None
        return self._of(name, dtype, inner)

    def _of(self, name, dtype, inner):
        ndim = self._answers.ndim
        return da.map_blocks(
            _field,
            self._answers,
            name,
            dtype=dtype,
            chunks=self._answers.chunks + tuple((n,) for n in inner),
            new_axis=list(range(ndim, ndim + len(inner))) or None,
            meta=np.empty((0,) * (ndim + len(inner)), dtype),
        )

    def persist(self, **options):
        """The result with its queries started, which stay on the workers."""
        other = type(self).__new__(type(self))
        other.__dict__.update(self.__dict__)
        (other._answers,) = dask.persist(self._answers, **options)
        return other

    def compute(self, *names, **options):
        """The named fields, or all but position and normal, as a dict of NumPy arrays: one run of the query."""
        own = [name for name, (dtype, _) in self._types.items() if dtype is not None and name not in ("position", "normal")]
        names = names or [*self._COUNTED, *own]
        return dict(zip(names, dask.compute(*(getattr(self, name) for name in names), **options)))

    def __dir__(self):
        return [*super().__dir__(), *self._types]


class Hits(_Result):
    """The fields of canted.Hits as Dask arrays: t, primitive, u, v, entering, ray, hit, position, normal; instance is None but for scenes of tiles.

    For all_hits and crossings, the number of rows is known only when they are computed.
    """

    _COUNTED = ("ray",)


class Nearest(_Result):
    """The fields of canted.Nearest as Dask arrays: distance, primitive, position; instance is None but for scenes of tiles."""


def check_sizes(sizes, name):
    """Refuses what needs the sizes of chunks that are not known before they are computed."""
    if np.isnan(sizes).any():
        raise ValueError(f"{name} have chunks of unknown sizes; call their compute_chunk_sizes() first")


class Closest(Hits):
    @property
    def ray(self):
        """The index of each ray, counted row by row."""
        shape = self._answers.shape
        check_sizes(shape, "the rays")
        return da.arange(int(np.prod(shape)), dtype=np.int64).reshape(shape).rechunk(self._answers.chunks)


class Listed(Hits):
    @property
    def ray(self):
        """The index of the ray of each hit."""
        sizes = self._sizes
        check_sizes(sizes, "the rays")
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
        return self._of("ray", np.int64, ()) + _per_block(starts, self._answers.chunks)


def _per_block(starts, chunks):
    """A Dask array with one number for each chunk, which is broadcast."""
    blocks = da.from_array(starts, chunks=1)
    return da.map_blocks(lambda block: block, blocks, chunks=chunks, dtype=np.int64, meta=np.empty(0, np.int64))
