"""Pictures: the bits of the program, scenes of arrays, errors, progress and interrupts."""

import os
import signal
import subprocess
import sys
import textwrap
import time
import warnings
import zlib
from pathlib import Path

import canted
import meshes
import numpy as np
import pytest
from conftest import program

canted_render = pytest.importorskip("canted_render")

ROOT = Path(__file__).resolve().parents[3]
SMALL = {"size": (32, 24), "spp": 2}


def exr_channels(data):
    """Channels of the first layer of an EXR file of ZIP16 scan lines, by name: a reader that knows no more than the program writes."""
    at, multipart = 8, data[5] & 0x10
    headers = []

    def text():
        nonlocal at
        end = data.index(b"\0", at)
        word, at = data[at:end].decode(), end + 1
        return word

    while True:
        header = {}
        while True:
            name = text()
            if not name:
                break
            kind, size = text(), int.from_bytes(data[at : at + 4], "little")
            header[name], at = (kind, data[at + 4 : at + 4 + size]), at + 4 + size
        if header:
            headers.append(header)
        if not multipart:
            break
        if data[at] == 0:
            at += 1
            break
    header = headers[0]
    x0, y0, x1, y1 = np.frombuffer(header["dataWindow"][1], "<i4")
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels, rest = [], header["channels"][1]
    while rest[0]:
        end = rest.index(b"\0")
        channels.append((rest[:end].decode(), "<u4" if rest[end + 1] == 0 else "<f4"))
        rest = rest[end + 17 :]
    out = {name: np.zeros((height, width), kind) for name, kind in channels}
    n_blocks = -(-height // 16)
    at += 8 * n_blocks
    for _ in range(n_blocks):
        if multipart:
            at += 4
        y, size = np.frombuffer(data[at : at + 8], "<i4")
        block, at = data[at + 8 : at + 8 + size], at + 8 + size
        rows = min(16, height - y)
        n_bytes = int(rows * width * 4 * len(channels))
        if size < n_bytes:
            delta = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
            plain = (np.cumsum(delta) - 128 * np.arange(len(delta))).astype(np.uint8)
            block = np.empty(n_bytes, np.uint8)
            block[0::2], block[1::2] = plain[: (n_bytes + 1) // 2], plain[(n_bytes + 1) // 2 :]
            block = block.tobytes()
        for row in range(rows):
            for i, (name, kind) in enumerate(channels):
                start = (row * len(channels) + i) * width * 4
                out[name][y + row] = np.frombuffer(block[start : start + width * 4], kind)
    return out


SCENE = """
[[assets]]
name = "bridge"
builtin = true

[camera]
eye = [60, 30, 80]
target = [0, 10, 0]

[settings]
size = "32x24"
spp = 3
integrator = "path"
"""


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (["--size", "32x24", "--spp", "2"], SMALL),
        (["--size", "32x24", "--spp", "2", "--integrator", "path", "--seed", "5", "--bounces", "3", "--eye", "60,30,80",
          "--target", "0,10,0", "--fov", "40.5", "--sun", "0,-1,0,1,2,3", "--sun", "1,-1,0,1,1,0.1", "--aperture", "0.3"],
         {**SMALL, "integrator": "path", "seed": 5, "bounces": 3, "eye": (60, 30, 80), "target": np.array([0, 10, 0.0]),
          "fov": 40.5, "sun": [(0, -1, 0, 1, 2, 3), (1, -1, 0, 1, 1, 0.1)], "aperture": np.float32(0.3)}),
        (["scene.toml"], {"scene": "scene.toml"}),
        (["scene.toml", "--spp", "1", "--accel", "bvh2"], {"scene": "scene.toml", "spp": 1, "accel": "bvh2"}),
    ],
    ids=["default", "path", "file", "file and options"],
)  # fmt: skip
def test_pictures_are_those_of_the_program_bit_for_bit(words, options, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(SCENE)
    subprocess.run([program(), "render", *words, "--device", "cpu", "--aovs", "all", "-o", "a.exr"], check=True)
    expected = exr_channels(Path("a.exr").read_bytes())
    picture = canted.render(**options, aovs=["all"])
    assert picture.shape == (24, 32, 3) and picture.dtype == np.float32
    named = [("R", picture[..., 0]), ("G", picture[..., 1]), ("B", picture[..., 2]), ("Z", picture.aovs["depth"])]
    named += [(f"N.{x}", picture.aovs["normal"][..., k]) for k, x in enumerate("XYZ")]
    named += [(f"albedo.{x}", picture.aovs["albedo"][..., k]) for k, x in enumerate("RGB")]
    named += [("tests.boxes", picture.aovs["tests"][..., 0])]
    for name, values in named:
        assert np.array_equal(np.asarray(values).view("u4"), expected[name].view("u4")), name
    for name in ("instance", "primitive"):
        assert np.array_equal(picture.aovs[name].view("u4"), expected[f"id.{name}"]), name
    assert (picture.aovs["primitive"] == -1).any() and picture.mean() > 0.01


def box_scene(**of_mesh):
    vertices, triangles = meshes.box((-1, -1, -1), (1, 1, 1))
    mesh = {"vertices": vertices, "triangles": triangles, "name": "box", **of_mesh}
    camera = {"eye": [0, 0, 5], "target": [0, 0, 0], "fov_degrees": 40}
    return {"meshes": [mesh], "camera": camera, "lights": [], "environment": {"constant": [1, 1, 1]}}


def test_scenes_of_arrays_equal_files(tmp_path):
    vertices, triangles = meshes.sphere(2)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.astype(float).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    instances = [{"asset": "ball"}, {"asset": "ball", "translation": [2.5, 0, 0], "scale": [np.float32(0.5)] * 3}]
    materials = [{"name": "red", "base_color": [0.8, 0.1, 0.1]}]
    common = {"instances": instances, "materials": materials, "settings": {"size": "32x24", "spp": 2}}
    of_file = canted.render({"assets": [{"name": "ball", "file": str(tmp_path / "ball.obj"), "material": "red"}], **common})
    mesh = {"name": "ball", "vertices": vertices[::-1][::-1], "triangles": triangles.astype(">i8"), "material": "red"}
    of_arrays = canted.render({"meshes": [mesh], **common})
    assert np.array_equal(of_file, of_arrays) and of_file.std() > 0.01
    mesh["material"] = {"base_color": (0.1, 0.1, 0.8)}
    assert not np.array_equal(canted.render({"meshes": [mesh], **common}), of_arrays)


def test_meshes_have_colors_normals_and_coordinates():
    white = canted.render(box_scene(color=(1, 1, 1)), **SMALL, aovs="albedo")
    colored = canted.render(box_scene(color=(1, 0.5, 0.25)), **SMALL, aovs=("albedo", "shading_normal"))
    center = (12, 16)
    assert white.aovs["albedo"][center].tolist() == [1, 1, 1]
    assert colored.aovs["albedo"][center].tolist() == [1, 0.5, 0.25]
    assert set(colored.aovs) == {"albedo", "shading-normal"}
    by_vertex = canted.render(box_scene(colors=np.tile([0.5, 0.25, 1], (8, 1))), **SMALL, aovs=["albedo"])
    assert np.allclose(by_vertex.aovs["albedo"][center], np.array([0.5, 0.25, 1]) * 0.8)
    smooth = canted.render(box_scene(normals=meshes.box((-1, -1, -1), (1, 1, 1))[0] * 7), **SMALL, aovs=["shading-normal"])
    assert np.abs(smooth.aovs["shading-normal"] - colored.aovs["shading-normal"]).max() > 0.1
    canted.render(box_scene(uvs=np.zeros((8, 2))), **SMALL)


BAD_SCENES = [
    (box_scene(triangles=[[0, 1, 8]]), "mesh 'box': triangle 0 has vertices [0, 1, 8], but there are 8"),
    (box_scene(triangles=[[0, 1, 2], [0, -1, 2]]), "mesh 'box': triangle 1 has vertices [0, -1, 2], but there are 8"),
    (box_scene(triangles=[[0.0, 1.0, 2.0]]), "triangles of mesh 'box' are float64 of shape (1, 3), not integers of shape (m, 3)"),
    (box_scene(vertices=np.full((8, 3), np.nan)), "mesh 'box': triangle 0 has a vertex that is not finite"),
    (box_scene(vertices=np.zeros((8, 2))), "vertices of mesh 'box' have shape (8, 2), not (n, 3)"),
    (box_scene(vertices="many"), "vertices of mesh 'box' are no array of numbers"),
    (box_scene(normals=np.zeros((7, 3))), "mesh 'box' has 7 normals, but 8 vertices"),
    (box_scene(uvs=np.full((8, 2), np.inf)), "uvs of mesh 'box' are not all finite"),
    (box_scene(colour=(1, 0, 0)), "mesh 'box' has the unknown key 'colour'"),
    (box_scene(color=(1, 0, 0), material="red"), "mesh 'box' has both color and material; use one of them"),
    (box_scene(material="red"), "unknown material"),
    (box_scene(color=(2, 0, 0)), "base_color"),
    ({**box_scene(), "camera": {"eyes": [0, 0, 0]}}, "unknown key 'eyes' in [camera]; did you mean 'eye'?"),
    ({**box_scene(), "sky": 1}, "unknown key 'sky'"),
    ({**box_scene(), "settings": {"spq": 1}}, "unknown key 'spq' in [settings]; did you mean 'spp'?"),
    ({"meshes": [7]}, "mesh 0 is of type int, not a dict"),
    ({}, "no instances"),
    (7, "scene is of type int; use a path or a dict"),
    ({**box_scene(), "lights": object()}, "lights is of type object, which a scene cannot hold"),
]

BAD_OPTIONS = [
    ({"spq": 1}, "unknown option 'spq'; did you mean 'spp'?"),
    ({"output": "a.png"}, "unknown option 'output'"),
    ({"spp": -1}, "invalid value '-1' for '--spp <N>'"),
    ({"size": (0, 5)}, "invalid value '0x5' for '--size <WxH>'"),
    ({"size": 5}, "size is 5; it must be (w, h)"),
    ({"integrator": "pth"}, "invalid value 'pth' for '--integrator <INTEGRATOR>'"),
    ({"aovs": ["dept"]}, "unknown channel 'dept'"),
    ({"eye": (0, 0)}, "expected 3 numbers separated by commas, found 2"),
    ({"eye": (0, 0, float("nan"))}, "invalid value"),
    ({"eye": {}}, "eye is {}; use a number, a string or a sequence of numbers"),
    ({"threads": 0}, "0 is not a number of threads from 1 to 1024"),
    ({"progress": 3}, "progress is not callable"),
]


@pytest.mark.parametrize(("scene", "sentence"), BAD_SCENES, ids=lambda value: None)
def test_bad_scenes_are_value_errors_with_a_sentence(scene, sentence):
    with pytest.raises(ValueError) as error:
        canted.render(scene, **SMALL)
    assert sentence in str(error.value) and "\n" not in str(error.value) and "line" not in str(error.value)


@pytest.mark.parametrize(("options", "sentence"), BAD_OPTIONS, ids=lambda value: None)
def test_bad_options_are_value_errors_with_a_sentence(options, sentence):
    with pytest.raises(ValueError) as error:
        canted.render(**{**SMALL, **options})
    assert sentence in str(error.value) and "\n" not in str(error.value)


def test_files_that_cannot_be_read_are_os_errors(tmp_path):
    with pytest.raises(FileNotFoundError):
        canted.render(tmp_path / "absent.obj", **SMALL)
    with pytest.raises(OSError, match="NUL"):
        canted.render("absent.obj\0", **SMALL)
    # A scene that refers to it is invalid.
    with pytest.raises(ValueError, match="'file' in .*absent.obj: cannot read file"):
        canted.render({"assets": [{"name": "a", "file": "absent.obj"}]}, **SMALL)
    (tmp_path / "bad.obj").write_text("f 1 2 3\n")
    with pytest.raises(ValueError, match="bad.obj"):
        canted.render(tmp_path / "bad.obj", **SMALL)


def test_pictures_are_arrays_that_display_themselves(tmp_path):
    picture = canted.render(**SMALL)
    assert isinstance(picture, canted_render.Picture) and type(np.asarray(picture)) is np.ndarray
    assert (picture * 2).max() == 2 * picture.max() and picture[..., 0].mean().dtype == np.float32
    data = picture._repr_png_()
    assert data.startswith(b"\x89PNG\r\n\x1a\n") and data == picture.png()
    assert picture[:5, :7]._repr_png_().startswith(b"\x89PNG") and picture[0]._repr_png_() is None
    assert canted_render.Picture([[[-1.0, 0.5, 9.0]]]).srgb().tolist() == [[[0, 188, 255]]]
    picture.save(tmp_path / "a.png")
    # The array holds the samples; what the program writes with few samples is denoised by default.
    options = ["--size", "32x24", "--spp", "2", "--device", "cpu", "--denoise", "off"]
    subprocess.run([program(), "render", *options, "-o", "b.png"], cwd=tmp_path, check=True)
    difference = subprocess.run([program(), "compare", "a.png", "b.png", "--max", "0"], cwd=tmp_path, capture_output=True)
    assert difference.returncode == 0, difference.stdout
    with pytest.raises(ValueError, match="is no picture"):
        picture[0].png()


def test_threads_and_progress():
    seen = []
    one = canted.render(size=(160, 120), spp=8, threads=1, progress=seen.append)
    assert seen[-1] == 1.0 and seen == sorted(seen) and len(set(seen)) == len(seen) and 0.0 < seen[0]
    assert np.array_equal(one, canted.render(size=(160, 120), spp=8, threads=3))

    def stop(fraction):
        raise LookupError("enough")

    start = time.perf_counter()
    with pytest.raises(LookupError, match="enough"):
        canted.render(size=(1280, 720), spp=256, progress=stop)
    assert time.perf_counter() - start < 30


def test_control_c_ends_a_render_within_200_ms():
    program = """
        import signal, sys, time, canted
        signal.signal(signal.SIGINT, signal.default_int_handler)
        def progress(fraction):
            print(flush=True)
        try:
            canted.render(size=(1920, 1080), spp=1024, progress=progress)
        except KeyboardInterrupt:
            print(time.time())
    """
    lags = []
    for _ in range(3):
        child = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True)
        child.stdout.readline()
        at = time.time()
        child.send_signal(signal.SIGINT)
        words = child.communicate(timeout=60)[0].split()
        lags.append(float(words[-1]) - at)
    # The least: a busy machine delays any process.
    assert min(lags) < 0.2, lags


def test_warnings_of_the_program_are_warnings():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        canted.render({**box_scene(), "instances": [{"asset": "box"}], "assets": [{"name": "other", "builtin": True}]}, **SMALL)
    assert [str(warning.message) for warning in found] == ["skipping asset 'other': no instance uses it"]


def test_without_the_package_the_error_says_what_to_install():
    program = "import sys; sys.modules['canted_render'] = None; import canted; canted.render()"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "ImportError: canted.render needs the package canted_render; pip install ./crates/python/render" in result.stderr
