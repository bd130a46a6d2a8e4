"""Files and pickles."""

import copy
import pickle
from pathlib import Path

import canted
import meshes
import numpy as np
import pytest

VERTICES, TRIANGLES = meshes.soup(300)
ORIGINS, DIRECTIONS = meshes.rays(500)


def same(a, b):
    x, y = a.closest_hit(ORIGINS, DIRECTIONS), b.closest_hit(ORIGINS, DIRECTIONS)
    return all((getattr(x, name) == getattr(y, name)).all() for name in ("t", "primitive", "u", "v"))


@pytest.mark.parametrize("test", ["watertight", "moller-trumbore", "baldwin-weber"])
def test_a_saved_bvh_is_the_same_and_can_be_refitted(tmp_path, test):
    bvh = canted.Bvh(VERTICES, TRIANGLES, "quality", test, origin=(0.5, 0, -1))
    for path in (tmp_path / "a.bvh", str(tmp_path / "b.bvh")):
        bvh.save(path)
        loaded = canted.Bvh.load(path)
        assert loaded.stats() == bvh.stats() and same(bvh, loaded)
        assert loaded.refit(VERTICES * 2) == bvh.refit(VERTICES * 2) and same(bvh, loaded)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.bvh", "b.bvh"]


def test_pickle_and_copy():
    bvh = canted.Bvh(VERTICES, TRIANGLES, "fast")
    for other in (pickle.loads(pickle.dumps(bvh)), copy.deepcopy(bvh), copy.copy(bvh)):
        assert other.stats() == bvh.stats() and same(bvh, other)


def columns_of(hits):
    return {name: column for name, column in hits.to_dict().items()}


def test_hits_nearest_points_and_instances_are_pickled():
    """Without the mesh: hits have their positions, whatever happens to it."""
    bvh = canted.Bvh(VERTICES, TRIANGLES, "fast", origin=(0.25, 0, 0))
    tlas = canted.Tlas([bvh, canted.Bvh(*meshes.box())], [(1, np.diag([2, 2, 2, 1])), (0, np.eye(4)), (1, np.diag([-1, 1, 3, 1]))])
    for answers in (bvh, tlas):
        for hits in (answers.closest_hit(ORIGINS, DIRECTIONS), answers.crossings(ORIGINS, DIRECTIONS), answers.closest_hit([0, 0, -5], [0, 0, 1])):
            for other in (pickle.loads(pickle.dumps(hits)), copy.deepcopy(hits), copy.copy(hits), pickle.loads(pickle.dumps(hits, 0))):
                a, b = columns_of(hits), columns_of(other)
                assert a.keys() == b.keys() and repr(other) == repr(hits) and len(other) == len(hits)
                assert all(np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f") and a[name].dtype == b[name].dtype for name in a)
                assert np.array_equal(other[::2].position, hits[::2].position, equal_nan=True)
        near = answers.nearest(ORIGINS)
        other = pickle.loads(pickle.dumps(near))
        assert (other.distance == near.distance).all() and (other.primitive == near.primitive).all() and (other.position == near.position).all()
        assert (other.instance is None) == (near.instance is None) and repr(other) == repr(near)
    for other in (pickle.loads(pickle.dumps(tlas)), copy.deepcopy(tlas)):
        # What a query about places finds is kept, and counted.
        assert (other.nearest(ORIGINS).distance == tlas.nearest(ORIGINS).distance).all()
        assert other.stats() == tlas.stats() and (other.bounds == tlas.bounds).all() and same(other, tlas)
        assert (other.contains(ORIGINS) == tlas.contains(ORIGINS)).all()


def test_missing_files_are_os_errors(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing.bvh"):
        canted.Bvh.load(tmp_path / "nothing.bvh")
    with pytest.raises(OSError, match="no-folder"):
        canted.Bvh(VERTICES, TRIANGLES).save(tmp_path / "no-folder" / "x.bvh")
    with pytest.raises(IsADirectoryError):
        canted.Bvh.load(tmp_path)


def test_every_damaged_file_is_a_value_error_that_names_it(tmp_path):
    path = tmp_path / "x.bvh"
    canted.Bvh(VERTICES[:60], TRIANGLES[:20]).save(path)
    good = path.read_bytes()
    random = np.random.default_rng(8)
    damaged = [good[:n] for n in random.integers(0, len(good), 100)] + [b"", b"solid x", good + b"\0"]
    for at in [*range(64), *random.integers(0, len(good), 300)]:
        changed = bytearray(good)
        changed[at] ^= 1 << random.integers(0, 8)
        damaged.append(bytes(changed))
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(ValueError, match="x.bvh: "):
            canted.Bvh.load(path)


def test_files_of_the_rust_library(tmp_path):
    """They follow the vertex indices in a file of this package."""
    path = tmp_path / "x.bvh"
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    bvh.save(path)
    content = path.read_bytes()
    path.write_bytes(content[content.index(b"CANTWIDE") :])
    loaded = canted.Bvh.load(path)
    assert same(bvh, loaded) and loaded.stats()["preset"] is None
    with pytest.raises(ValueError, match="a BVH from a file of the Rust library has no vertex indices"):
        loaded.refit(VERTICES)
    loaded.save(path)
    assert same(bvh, canted.Bvh.load(path)) and Path(path).read_bytes() != content


def test_a_mapped_bvh_is_the_saved_one(tmp_path):
    bvh = canted.Bvh(VERTICES, TRIANGLES, origin=(0.5, 0, -1))
    path = tmp_path / "a.bvh"
    bvh.save(path)
    content = path.read_bytes()
    mapped = canted.Bvh.load(path, mmap=True)
    assert mapped.stats() == bvh.stats() and same(bvh, mapped)
    assert mapped.refit(VERTICES * 2) == bvh.refit(VERTICES * 2) and same(bvh, mapped)
    assert path.read_bytes() == content
    path.write_bytes(content[content.index(b"CANTWIDE") :])
    assert len(canted.Bvh.load(path, mmap=True)) == len(bvh)
    for part in (b"", content[:50], content[:-1], content[:1000] + b"x" + content[1001:], b"other" * 30):
        path.write_bytes(part)
        with pytest.raises(ValueError, match="a.bvh: "):
            canted.Bvh.load(path, mmap=True)
