//! [`SceneFile`] to TOML text.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::writer::{TomlWriter, number, quoted};
use super::{Asset, AssetInstance, AssetSource, SceneFile, Setting, curves, light, patches, placement};

/// The first line of what [`SceneFile::to_toml`] writes.
const FIRST_LINE: &str =
    "A canted scene. Lengths are in world units, colors in linear RGB, paths relative to this file.";

impl SceneFile {
    /// Whether a file begins as those that [`SceneFile::to_toml`] writes.
    #[must_use]
    pub fn is_own(path: &Path) -> bool {
        let first = format!("# {FIRST_LINE}\n");
        let mut start = vec![0; first.len()];
        let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
        read.is_ok() && start == first.as_bytes()
    }

    /// TOML text with explanatory comments that parses back to this scene file.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut out = TomlWriter::default();
        out.comment(FIRST_LINE);
        if !self.settings.is_empty() {
            out.heading("[settings]");
            out.comment("Options of `canted render`. The command line overrides them.");
            self.settings.iter().for_each(|setting| write_setting(setting, &mut out));
        }
        if let Some(camera) = &self.camera {
            placement::write_camera(camera, &mut out);
        }
        // Empty arrays are keys of the root table, which must precede all other tables.
        let mut keys = TomlWriter::default();
        if self.instances.as_ref().is_some_and(Vec::is_empty) {
            keys.entry("instances", "[]", "no instances");
        }
        match self.lights.as_deref() {
            Some([]) => light::write(&[], &mut keys),
            Some(lights) => light::write(lights, &mut out),
            None => {}
        }
        if let Some(environment) = &self.environment {
            light::write_environment(environment, &mut out);
        }
        self.assets.iter().for_each(|asset| write_asset(asset, &mut out));
        self.instances.iter().flatten().for_each(|instance| write_instance(instance, &mut out));
        self.curves.iter().for_each(|table| curves::write(table, &mut out));
        self.patches.iter().for_each(|table| patches::write(table, &mut out));
        for material in &self.materials {
            out.heading("[[materials]]");
            out.entry("name", &quoted(&material.name), "new material; assets refer to it by name");
            material.edits.write(&mut out);
        }
        for change in &self.overrides {
            out.heading("[[overrides]]");
            out.entry("material", &quoted(&change.material), "name in the asset's file");
            if let Some(asset) = &change.asset {
                out.entry("asset", &quoted(asset), "");
            }
            change.edits.write(&mut out);
        }
        // After the first line.
        let (first, rest) = out.text.split_once('\n').unwrap_or((&out.text, ""));
        format!("{first}\n{}{rest}", keys.text)
    }
}

fn write_setting(setting: &Setting, out: &mut TomlWriter) {
    let Setting { key, value, comment, line: _ } = setting;
    match value {
        Some(value) => out.entry(key, &setting_value(value), comment),
        None => out.comment(&format!("{key}: {comment}")),
    }
}

/// A number if it parses back to the same characters, else a string.
fn setting_value(value: &str) -> String {
    let is_integer = value.parse::<u32>().is_ok_and(|n| n.to_string() == value);
    let is_float = value.parse::<f32>().is_ok_and(|x| format!("{x:?}") == value && !x.is_nan());
    if is_integer || is_float { value.to_owned() } else { quoted(value) }
}

fn write_asset(asset: &Asset, out: &mut TomlWriter) {
    out.heading("[[assets]]");
    out.entry("name", &quoted(&asset.name), "instances refer to it");
    match &asset.source {
        AssetSource::File(file) => out.entry("file", &quoted(file), "OBJ, PLY, glTF or GLB"),
        AssetSource::Builtin => out.entry("builtin", "true", "the built-in scene"),
    }
    if let Some(time) = asset.time {
        out.entry("time", &number(time), "animation time in seconds");
    }
    if let Some(animation) = &asset.animation {
        out.entry("animation", &quoted(animation), "name or number of the animation");
    }
    if let Some(variant) = &asset.variant {
        out.entry("variant", &quoted(variant), "name or number of the material variant");
    }
    match &asset.texture_path[..] {
        [] => {}
        [folder] => out.entry("texture_path", &quoted(folder), "folder of images that are not beside the file"),
        folders => {
            let folders: Vec<String> = folders.iter().map(|folder| quoted(folder)).collect();
            out.entry(
                "texture_path",
                &format!("[{}]", folders.join(", ")),
                "folders of images that are not beside the file",
            );
        }
    }
    if asset.allow_parent {
        out.entry("allow_parent", "true", "the file may refer to files outside its folder");
    }
    let radii = [("line_radius", asset.line_radius, "lines"), ("point_radius", asset.point_radius, "points")];
    for (key, radius, of) in radii {
        if let Some(radius) = radius {
            out.entry(key, &number(radius), &format!("radius of {of}; with it, lines are read in place of faces"));
        }
    }
    if let Some(material) = &asset.material {
        out.entry("material", &quoted(material), "replaces all materials of the asset");
    }
}

fn write_instance(instance: &AssetInstance, out: &mut TomlWriter) {
    out.heading("[[instances]]");
    out.entry("asset", &quoted(&instance.asset), "");
    placement::write(&instance.open, out);
    if let Some(close) = &instance.close {
        out.text.push_str("[instances.close]\n");
        out.comment("Transform at shutter close; matrix entries are interpolated linearly.");
        placement::write(close, out);
    }
}
