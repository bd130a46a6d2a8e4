//! Scene files: parsing, loading, writing.

mod errors;
mod loading;
mod mutated;
mod round_trip;

use std::path::Path;

use canted_scene::{EnvironmentSource, ReadError, SceneFile};

/// A file with every kind of table.
const FULL: &str = r#"
[settings]
size = "64x48"
spp = 4
ao_radius = inf
filter = "tent"
aovs = ["depth", "normal"]

[camera]
eye = [1, 2, 3.5]
target = [0.0, 1e-3, 0]
up = [0, 1, 0]
fov_degrees = 40
aperture_radius = 0.1
focus_distance = 3

[[lights]]
type = "sun"
direction = [0, -2, 0]
irradiance = [3, 3, 3]

[[lights]]
type = "point"
position = [0, 5, 0]
intensity = [1, 0, 0]

[[lights]]
type = "spot"
position = [0, 5, 0]
direction = [0.3, -1, 0.1]
intensity = [9, 9, 9]
inner_degrees = 20
outer_degrees = 90

[[lights]]
type = "sphere"
center = [0, 5, 0]
radius = 0.5
radiance = [1, 1, 1]

[[lights]]
type = "disc"
center = [0, 5, 0]
normal = [0, -1, 0]
radius = 0.5
radiance = [1, 1, 1]

[environment]
constant = [0.1, 0.2, 0.3]

[[assets]]
name = "a"
file = "a.obj"
time = 0.5

[[assets]]
name = "b"
file = "sub/b.obj"
material = "glass"

[[assets]]
name = "bridge"
builtin = true

[[instances]]
asset = "a"

[[instances]]
asset = "a"
translation = [1, 2, 3]
axis = [0, 0, 5]
angle_degrees = 90
scale = [1, 2, -3]
close = { angle_degrees = 91 }

[[instances]]
asset = "b"
matrix = [[1, 0, 0, 7], [0, 1, 0, 8], [0, 0.5, 1, 9]]
[instances.close]
matrix = [[1, 0, 0, 8], [0, 1, 0, 8], [0, 0.5, 1, 9]]

[[materials]]
name = "glass"
transmission = 1
roughness = 0
specular = 1
ior = 1.33
thin_walled = false

[[overrides]]
material = "red"
asset = "a"
base_color = [1, 0, 0]
emission = [2, 0, 0]
alpha_mode = "mask"
alpha_cutoff = 0.25
base_color_texture = "none"
"#;

/// Two triangles, one red and one green.
const TWO: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl green\nf 1 3 4\n";
const TWO_MTL: &str = "newmtl red\nKd 0.5 0 0\nnewmtl green\nKd 0 0.5 0\n";

/// A folder with `a.obj` (two materials) and `sub/b.obj` (one triangle).
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("a.obj"), TWO).unwrap();
    std::fs::write(folder.path().join("a.mtl"), TWO_MTL).unwrap();
    std::fs::write(folder.path().join("sub/b.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    folder
}

fn parse(text: &str) -> Result<SceneFile, ReadError> {
    SceneFile::parse(text.as_bytes(), Path::new("scene.toml"))
}

/// Clears line numbers and comments, which do not round-trip.
fn without_lines(mut file: SceneFile) -> SceneFile {
    file.assets.iter_mut().for_each(|asset| asset.line = 0);
    file.instances.iter_mut().flatten().for_each(|instance| instance.line = 0);
    file.materials.iter_mut().for_each(|material| material.line = 0);
    file.overrides.iter_mut().for_each(|change| change.line = 0);
    if let Some(EnvironmentSource::Image { line, .. }) = &mut file.environment {
        *line = 0;
    }
    for setting in &mut file.settings {
        setting.line = 0;
        setting.comment.clear();
    }
    file
}
