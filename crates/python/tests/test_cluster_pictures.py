"""Pictures on Dask: the bits of one machine; frames, previews, checkpoints and cancelling."""

import sys
import types

import numpy as np
import pytest

pytest.importorskip("dask", reason="dask is not installed")
pytest.importorskip("distributed", reason="distributed is not installed")
canted_render = pytest.importorskip("canted_render", reason="canted_render is not installed")
cd = pytest.importorskip("canted.distributed")

import clusters


@pytest.fixture(scope="module")
def cluster():
    # Not the current client: it is given to each call.
    with clusters.local(2, set_as_default=False) as client:
        yield client


def test_pictures_are_those_of_one_machine(cluster):
    for options in ({}, {"integrator": "path", "aovs": ["depth"]}):
        whole = canted_render.render(size=(32, 18), spp=6, **options)
        for parts in (1, 2, 5):
            progress = []
            picture = cd.render(size=(32, 18), spp=6, parts=parts, client=cluster, progress=progress.append, **options)
            np.testing.assert_array_equal(picture, whole)
            assert progress[0] == 0 and progress[-1] == 1 and picture.shape == (18, 32, 3)
            assert_same_aovs(picture, whole)
    for options, message in [
        ({"parts": 0}, "parts is 0"),
        ({"spp": 0}, "spp is 0; use a whole number of 1 or more"),
        ({"spp": 2.5}, "spp is 2.5"),
        ({"spp": "many"}, "spp is 'many'"),
        ({"threads": 2}, "threads is given; a task has one thread"),
        ({"noise": 0.1}, "noise needs all samples"),
    ]:
        with pytest.raises(ValueError, match=message):
            cd.render(size=(4, 4), **options)
    with pytest.raises(ValueError, match="sise"):
        cd.render(sise=(4, 4), client=cluster)


def test_pictures_may_be_tiles_of_rows(cluster):
    for options in ({}, {"integrator": "path", "aovs": ["depth", "normal"], "spp": 1}):
        whole = canted_render.render(**{"size": (32, 37), "spp": 3, **options})
        for tiles in (1, 5, 40):
            seen, progress = [], []
            given = {"size": (32, 37), "spp": 3, **options, "tiles": tiles, "client": cluster, "progress": progress.append}
            picture = cd.render(**given, preview=lambda picture, frame: seen.append(picture))
            np.testing.assert_array_equal(picture, whole)
            assert_same_aovs(picture, whole)
            assert progress[-1] == 1 and len(seen) == min(tiles, 37) and (tiles == 1 or (seen[0] == 0).any())
            np.testing.assert_array_equal(seen[-1], whole)
    pictures = cd.render(size=(1300, 20), spp=1, frames=[{}, {"fov": 30}], tiles=3, client=cluster, preview=lambda picture, frame: seen.append(picture))
    np.testing.assert_array_equal(pictures[1], canted_render.render(size=(1300, 20), spp=1, fov=30))
    assert {shown.shape for shown in seen[-6:]} == {(2 + 2 + 2, 433, 3)}
    for options, message in [
        ({"tiles": 0, "size": (4, 4)}, "tiles is 0; use 1 or more"),
        ({"tiles": 2}, "tiles needs size"),
        ({"tiles": 2, "parts": 2}, "tiles and parts cannot be used together"),
        ({"tiles": 2, "checkpoint": "folder"}, "tiles and checkpoint cannot be used together"),
        ({"tiles": 2, "noise": 0.1, "size": (4, 4)}, "noise needs all samples"),
    ]:
        with pytest.raises(ValueError, match=message):
            cd.render(**options, client=cluster)


def test_a_rectangle_of_a_picture():
    whole = canted_render.render(size=(32, 18), spp=2, aovs=["depth"])
    part = canted_render.render(size=(32, 18), spp=2, aovs=["depth"], crop=(3, 5, 20, 7))
    np.testing.assert_array_equal(part, whole[5:12, 3:23])
    np.testing.assert_array_equal(part.aovs["depth"], whole.aovs["depth"][5:12, 3:23])
    with pytest.raises(ValueError, match="crop 3,5,30,7 exceeds the picture of 32 x 18 pixels"):
        canted_render.render(size=(32, 18), spp=2, crop=(3, 5, 30, 7))


def assert_same_aovs(picture, whole):
    assert picture.aovs.keys() == whole.aovs.keys()
    for name, values in whole.aovs.items():
        np.testing.assert_array_equal(picture.aovs[name], values)


def test_frames_are_pictures_of_their_own(cluster):
    frames = [{"eye": (60, 30, 80), "target": (0, 10, 0)}, {}, {"spp": 3}]
    found = cd.render(size=(32, 18), spp=6, frames=frames, client=cluster, parts=3)
    assert len(found) == 3
    for picture, frame in zip(found, frames):
        np.testing.assert_array_equal(picture, canted_render.render(**{"size": (32, 18), "spp": 6, **frame}))
    assert cd.render(size=(32, 18), frames=[], client=cluster) == []
    with pytest.raises(ValueError, match="required arguments were not provided|--time"):
        # A number is the time of an animated scene, which the built-in one is not.
        cd.render(size=(32, 18), spp=1, frames=[0.5], client=cluster)


def test_previews_approach_the_picture(cluster):
    seen = []
    picture = cd.render(size=(32, 18), spp=8, parts=4, client=cluster, preview=lambda picture, frame: seen.append((picture, frame)))
    assert len(seen) == 4 and {frame for _, frame in seen} == {0}
    assert all(isinstance(shown, canted_render.Picture) and shown.shape == (18, 32, 3) and shown.png() for shown, _ in seen)
    np.testing.assert_allclose(seen[-1][0], picture, rtol=1e-4, atol=1e-6)
    assert np.abs(seen[0][0] - picture).max() > 1e-3
    # Large ones are reduced; every pixel is the mean of 3 x 3.
    cd.render(size=(1300, 30), spp=1, parts=1, client=cluster, preview=lambda picture, frame: seen.append((picture, frame)))
    whole = canted_render.render(size=(1300, 30), spp=1)
    np.testing.assert_allclose(seen[-1][0], whole[:, :1299].reshape(10, 3, 433, 3, 3).mean(axis=(1, 3)), rtol=1e-5, atol=1e-6)


def test_previews_are_displayed_in_notebooks(cluster, monkeypatch):
    shown = []

    class Place:
        def update(self, picture):
            shown.append(picture)

    def displayed(picture, display_id):
        assert display_id is True
        shown.append(picture)
        return Place()

    display = types.ModuleType("IPython.display")
    display.display = displayed
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    cd.render(size=(32, 18), spp=4, parts=3, client=cluster, preview=True)
    assert len(shown) == 3 and all(picture._repr_png_() for picture in shown)


def test_a_checkpoint_outlives_the_client(cluster, tmp_path, monkeypatch):
    wanted = {"size": (32, 18), "spp": 12, "parts": 6}
    whole = canted_render.render(size=(32, 18), spp=12)

    def stop(fraction):
        if fraction >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cd.render(**wanted, client=cluster, checkpoint=tmp_path, progress=stop)
    clusters.wait_until("what was left is cancelled", lambda: not any(cluster.processing().values()))
    kept = sorted(tmp_path.rglob("*.exr"))
    assert 3 <= len(kept) <= 6
    times = {path: path.stat().st_mtime_ns for path in kept}
    # Damaged parts are rendered again, finished ones are not; the ranges are those of the first call.
    kept[0].write_bytes(kept[0].read_bytes()[:-1] + b"?")
    for options in ({"client": cluster}, {}):
        picture = cd.render(size=(32, 18), spp=12, checkpoint=tmp_path, **options)
        np.testing.assert_array_equal(picture, whole)
    assert all(path.stat().st_mtime_ns == times[path] for path in kept[1:])
    assert len(list(tmp_path.rglob("*.exr"))) in (6, 7) and not list(tmp_path.rglob("*.partial"))
    # Another picture has parts of its own.
    other = cd.render(size=(32, 18), spp=12, seed=5, parts=2, client=cluster, checkpoint=tmp_path)
    np.testing.assert_array_equal(other, canted_render.render(size=(32, 18), spp=12, seed=5))
    assert len(list(tmp_path.iterdir())) == 2


def test_finished_parts_are_not_rendered_again(cluster, tmp_path, monkeypatch):
    first = cd.render(size=(32, 18), spp=4, parts=4, client=cluster, checkpoint=tmp_path)
    # On the threads of this process.
    monkeypatch.setattr(canted_render, "render_part", None)
    np.testing.assert_array_equal(cd.render(size=(32, 18), spp=4, checkpoint=tmp_path), first)
    with pytest.raises(TypeError, match="not callable"):
        cd.render(size=(32, 18), spp=4, parts=2, checkpoint=tmp_path)


def test_parts_are_as_many_as_threads_need():
    from canted.distributed.pictures import _Shot

    def n_parts(spp, n_threads):
        return len(_Shot(None, {"size": (4, 4), "spp": spp}, None, 2 * n_threads, None, False).ranges)

    assert [n_parts(spp, 8) for spp in (1, 4, 64, 512, 700, 100_000)] == [1, 4, 8, 8, 10, 16]
