"""The scenes of the oracle for Mitsuba.

`PICTURES` lists every picture: model, surface simplification, camera, lights and path length. `tests/tests/pictures/scenes.rs` has the
same numbers. World +y is up, angles are in degrees, colors are linear.
"""

import os
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import mitsuba as mi
import numpy as np

import meshes

ASSETS = Path(os.environ.get("CANTED_SCENES", Path(__file__).parent / "../../../shared/scenes"))


@dataclass(frozen=True)
class Sun:
    direction: tuple  # of travel
    irradiance: tuple


@dataclass(frozen=True)
class Point:
    position: tuple
    intensity: tuple


@dataclass(frozen=True)
class Spot:
    position: tuple
    target: tuple
    intensity: tuple
    angle: float  # half the cone; the edge is hard


@dataclass(frozen=True)
class Sphere:
    center: tuple
    radius: float
    radiance: tuple


@dataclass(frozen=True)
class Sky:
    file: str  # image of all directions, centered on -z with +x to the right


@dataclass(frozen=True)
class Picture:
    model: str
    size: tuple
    eye: tuple
    target: tuple
    fov: float  # vertical
    lights: tuple = ()
    environment: tuple = (0.0, 0.0, 0.0)
    lamp_drop: float | None = None  # lowers the model's emitters and makes them two-sided
    is_lambert: bool = True  # whether Lambert surfaces of the same color replace metal and glass
    curves: str | None = None  # how Mitsuba calls their shape
    lens: tuple | None = None  # radius, focus distance
    n_segments: int | None = None  # of a path, including the camera's; None for no limit
    samples: int = 4096  # per pixel


BLUE = (0.4, 0.5, 0.65)
CORNELL = Picture("cornell/cornellBox.obj", (64, 64), (-0.23, 2.58, 9.0), (-0.23, 2.58, -3.0), 36.0)
SPONZA = Picture(
    "sponza/sponza.obj", (96, 64), (700.0, 700.0, -100.0), (-300.0, 250.0, 100.0), 60.0, samples=2048
)
KITCHEN = Picture(
    "kitchen/country_kitchen.glb", (112, 64), (1.211, 1.80475, 3.85239), (0.7729, 1.76308, 2.95443), 36.5, is_lambert=False, samples=1024
)
# The court from above its opening, and the kitchen floor lit by the sun through the window. Most light there is direct, so few
# samples suffice.
COURT = replace(SPONZA, eye=(600.0, 1350.0, 0.0), target=(-300.0, 450.0, 0.0))
KITCHEN_FLOOR = replace(KITCHEN, size=(96, 64), eye=(0.7, 2.0, 3.0), target=(1.5, 0.0, 1.3), fov=36.0, samples=4096)
FLOOR = Picture("floor", (64, 64), (0.0, 4.0, 8.0), (0.0, 0.0, 0.0), 40.0)

CORNELL_SUN = Sun((0.3, -0.5, -1.0), (3.0, 2.8, 2.5))
SPONZA_SUN = Sun((-0.15, -1.0, 0.12), (12.0, 11.0, 9.0))
KITCHEN_SUN = Sun((0.3, -0.5, 1.0), (60.0, 55.0, 45.0))

PICTURES = {
    "cornell-env": replace(CORNELL, environment=BLUE),
    "cornell-sun": replace(CORNELL, environment=BLUE, lights=(CORNELL_SUN,)),
    # The model's lamp hangs 9 mm below the ceiling, and only rare paths find the light from that gap, so it is moved down. It is
    # above the view, because a visible edge would cause most of the noise.
    "cornell-light": replace(CORNELL, target=(-0.23, 1.74, -3.0), fov=27.0, lamp_drop=0.5, samples=8192),
    "cornell-sphere": replace(CORNELL, lights=(Sphere((-0.9, 2.2, -1.2), 0.3, (9.0, 8.0, 6.0)),)),
    "sponza-env": replace(COURT, environment=BLUE),
    "sponza-sun": replace(SPONZA, environment=BLUE, lights=(SPONZA_SUN,)),
    "sponza-sphere": replace(SPONZA, lights=(Sphere((200.0, 1000.0, 0.0), 100.0, (30.0, 27.0, 20.0)),)),
    "sponza-sky": replace(COURT, lights=(Sky("env/sky_64x32.exr"),)),
    "kitchen-env": replace(KITCHEN, environment=BLUE),
    "kitchen-sun": replace(KITCHEN_FLOOR, environment=BLUE, lights=(KITCHEN_SUN,)),
    "kitchen-sphere": replace(KITCHEN, lights=(Sphere((1.9, 2.5, 2.2), 0.15, (20.0, 18.0, 15.0)),)),
    "penumbra": replace(FLOOR, model="floor, disc", lights=(Sphere((0.5, 3.0, 0.0), 0.4, (8.0, 8.0, 8.0)),)),
    "spot": replace(FLOOR, lights=(Spot((1.0, 4.0, 1.0), (-0.5, 0.0, 0.0), (20.0, 18.0, 14.0), 20.0),)),
    "curves-linear": replace(FLOOR, curves="linearcurve", environment=BLUE, lights=(Sun((0.3, -1.0, -0.4), (3.0, 2.8, 2.5)),)),
    "lens": replace(FLOOR, model="floor, checker", environment=BLUE, lens=(0.3, 6.0)),
    "checker": replace(FLOOR, model="checker", environment=(1.0, 1.0, 1.0)),
}
PICTURES["curves-bspline"] = replace(PICTURES["curves-linear"], curves="bsplinecurve")
# Limited paths of one, two and three bounces.
for n in (2, 3, 4):
    PICTURES[f"cornell-env-{n}"] = replace(PICTURES["cornell-env"], n_segments=n)
PICTURES["cornell-sun-3"] = replace(PICTURES["cornell-sun"], n_segments=3)
PICTURES["cornell-point-3"] = replace(CORNELL, lights=(Point((-0.9, 3.5, -1.2), (8.0, 7.0, 6.0)),), n_segments=3)
PICTURES["sponza-sun-3"] = replace(PICTURES["sponza-sun"], n_segments=3)


def quad(a, b, c, d):
    return np.float32([[a, b, c], [a, c, d]]), np.float32([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])


def part(name):
    """A part of a generated scene."""
    if name == "floor":
        corners, uvs = quad((-6, 0, 6), (6, 0, 6), (6, 0, -6), (-6, 0, -6))
        return meshes.Part(meshes.Material(name, (0.6, 0.5, 0.4)), corners)
    if name == "disc":
        # A regular polygon of 64 corners above the floor: both renderers use the same triangles.
        turn = np.linspace(0, 2 * np.pi, 65)
        edge = np.stack([0.8 * np.cos(turn), np.full(65, 1.0), -0.8 * np.sin(turn)], axis=1)
        center = np.broadcast_to([0.0, 1.0, 0.0], (64, 3))
        corners = np.stack([center, edge[:-1], edge[1:]], axis=1)
        return meshes.Part(meshes.Material(name, (0.2, 0.3, 0.6)), np.float32(corners))
    assert name == "checker", name
    # A wall of four times four texels, enlarged to show the filter.
    corners, uvs = quad((-2, 0.5, 0), (2, 0.5, 0), (2, 3.5, -1), (-2, 3.5, -1))
    texels = np.where(np.add.outer(range(4), range(4))[..., None] % 2, [230, 60, 30], [20, 90, 200])
    return meshes.Part(meshes.Material(name, (1.0, 1.0, 1.0), image=np.uint8(texels)), corners, uvs)


@cache
def parts(model):
    return meshes.read(ASSETS / model) if "." in model else [part(name) for name in model.split(", ")]


def linear(srgb):
    x = srgb / 255.0
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def bitmap(data):
    """A texture of linear numbers, bilinear and repeated, kept as f32."""
    image = mi.Bitmap(np.ascontiguousarray(data, np.float32))
    return {"type": "bitmap", "bitmap": image, "raw": True, "filter_type": "bilinear", "format": "variant"}


def rgb(color):
    return {"type": "rgb", "value": list(color)}


def texture(material):
    return rgb(material.color) if material.image is None else bitmap(linear(material.image) * material.color)


def bsdf(material, is_lambert):
    """Lambert; GGX with Schlick's Fresnel for metals; a smooth dielectric of index 1.5 for glass."""
    if material.transmission > 0.5 and not is_lambert:
        return {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    if material.metallic > 0.5 and not is_lambert:
        inner = {"type": "principled", "base_color": texture(material), "metallic": 1.0, "roughness": material.roughness}
    else:
        inner = {"type": "diffuse", "reflectance": texture(material)}
    surface = {"type": "twosided", "inner": inner}
    if material.mask is None:
        return surface
    return {"type": "mask", "opacity": {"type": "cutoff", "alpha": bitmap(material.mask[..., None] / 255.0)}, "inner": surface}


class Cutoff(mi.Texture):
    """1 where a filtered texture is at least one half, else 0."""

    def __init__(self, props):
        mi.Texture.__init__(self, props)
        self.alpha = props["alpha"]

    def eval_1(self, si, active=True):
        return mi.Float(mi.ScalarFloat(1)) & (self.alpha.eval_1(si, active) >= 0.5)

    def eval(self, si, active=True):
        return mi.Color3f(self.eval_1(si, active))

    def mean(self):
        return self.alpha.mean()

    def is_spatially_varying(self):
        return True

    def to_string(self):
        return "Cutoff"


def shape(folder, number, part, picture):
    """The triangles of a part; emissive ones also get back faces, because Mitsuba's emitters are one-sided."""
    def one(suffix, part):
        path = folder / f"{number}{suffix}.ply"
        meshes.write_ply(path, part)
        mesh = {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": bsdf(part.material, picture.is_lambert)}
        if emits:
            mesh["emitter"] = {"type": "area", "radiance": rgb(part.material.emission)}
        return mesh

    emits = picture.lamp_drop is not None and any(part.material.emission)
    if emits:
        part = replace(part, corners=part.corners - np.float32([0.0, picture.lamp_drop, 0.0]))
    shapes = {f"part-{number}": one("", part)}
    if emits:
        a, b, c = np.moveaxis(part.corners.astype(float), 1, 0)
        normal = np.cross(b - a, c - a)
        # A separate surface behind the front, closer than anything else.
        behind = 1e-4 * normal / np.linalg.norm(normal, axis=1, keepdims=True)
        back = part.corners[:, ::-1] - behind[:, None]
        shapes[f"part-{number}-back"] = one("-back", meshes.Part(part.material, back))
    return shapes


def sky_image(file):
    """The image resampled so that Mitsuba's lookups equal ours.

    Ours is bilinear between texel centers, periodic around the axis and clamped at the poles. Mitsuba's first and last rows lie
    on the poles; 16 times the resolution makes the difference negligible.
    """
    texels = np.array(mi.Bitmap(str(ASSETS / file)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    height, width, _ = texels.shape
    n_rows, n_columns = 16 * height + 1, 16 * width
    y = np.clip(np.linspace(0, 1, n_rows) * height - 0.5, 0, height - 1)
    x = (np.arange(n_columns) + 0.5) / n_columns * width - 0.5
    row, column = np.minimum(np.int32(y), height - 2), np.int32(np.floor(x))
    dy, dx = (y - row)[:, None, None], (x - column)[None, :, None]
    at = lambda j, i: texels[(row + j)[:, None], (column + i)[None, :] % width]
    return (1 - dy) * ((1 - dx) * at(0, 0) + dx * at(0, 1)) + dy * ((1 - dx) * at(1, 0) + dx * at(1, 1))


def strand(i):
    """Control points and radii of a strand that bends above the floor, its ends below it and thin."""
    k = np.arange(7)
    turn, reach = 2.399963 * i, 1.8 * np.sqrt((i + 0.5) / 40)
    x = reach * np.cos(turn) + 0.3 * np.sin(0.9 * k + i)
    z = reach * np.sin(turn) + 0.3 * np.cos(1.1 * k + 2 * i)
    return np.float32(np.stack([x, 0.5 * k - 0.8, z, np.maximum(0.1 * (1 - k / 5), 0.001)], axis=1))


def curves(folder, kind):
    path = folder / "curves.txt"
    line = lambda point: " ".join(f"{float(x):.9g}" for x in point)
    path.write_text("\n\n".join("\n".join(map(line, strand(i))) for i in range(40)) + "\n")
    surface = {"type": "diffuse", "reflectance": rgb((0.7, 0.45, 0.2))}
    return {"type": kind, "filename": str(path), "bsdf": {"type": "twosided", "inner": surface}}


def light(light):
    transform = mi.ScalarTransform4f()
    match light:
        case Sun():
            return {"type": "directional", "direction": list(light.direction), "irradiance": rgb(light.irradiance)}
        case Point():
            return {"type": "point", "position": list(light.position), "intensity": rgb(light.intensity)}
        case Spot():
            place = transform.look_at(light.position, light.target, [0, 0, 1])
            # Mitsuba's falloff is linear in the angle, glTF's is a squared cosine; both are made hard.
            cone = {"cutoff_angle": light.angle, "beam_width": light.angle - 1e-3}
            return {"type": "spot", "to_world": place, "intensity": rgb(light.intensity), **cone}
        case Sphere():
            black = {"type": "diffuse", "reflectance": rgb((0, 0, 0))}
            glow = {"type": "area", "radiance": rgb(light.radiance)}
            place = {"center": list(light.center), "radius": light.radius}
            return {"type": "sphere", **place, "bsdf": black, "emitter": glow}
        case Sky():
            # Mitsuba's image is centered on +z.
            turn = transform.rotate([0, 1, 0], 180)
            return {"type": "envmap", "bitmap": mi.Bitmap(np.float32(sky_image(light.file))), "to_world": turn}
    raise TypeError(light)


def camera(picture):
    film = {"type": "hdrfilm", "width": picture.size[0], "height": picture.size[1], "rfilter": {"type": "box"}}
    film |= {"pixel_format": "rgb", "component_format": "float32"}
    view = {"type": "perspective"}
    if picture.lens:
        view = {"type": "thinlens", "aperture_radius": picture.lens[0], "focus_distance": picture.lens[1]}
    place = mi.ScalarTransform4f().look_at(picture.eye, picture.target, [0, 1, 0])
    clip = {"near_clip": 1e-3, "far_clip": 1e5}
    return view | clip | {"fov": picture.fov, "fov_axis": "y", "to_world": place, "film": film}


def scene(picture, folder):
    """The dictionary of a picture; triangles go through files in `folder`."""
    if mi.variant() != scene.variant:
        mi.register_texture("cutoff", Cutoff)
        scene.variant = mi.variant()
    # Only this integrator passes shadow rays through masked parts without counting them as an event.
    integrator = {"type": "volpath", "max_depth": picture.n_segments or -1}
    made = {"type": "scene", "integrator": integrator, "camera": camera(picture)}
    for number, part in enumerate(parts(picture.model)):
        made |= shape(folder, number, part, picture)
    if picture.curves:
        made["curves"] = curves(folder, picture.curves)
    made |= {f"light-{i}": light(each) for i, each in enumerate(picture.lights)}
    if any(picture.environment):
        made["environment"] = {"type": "constant", "radiance": rgb(picture.environment)}
    return made


scene.variant = None
