//! From [`SceneFile`] to text.

use super::page::{Page, number, quoted};
use super::{Asset, AssetInstance, AssetSource, SceneFile, Setting, camera, environment, light, placement};

impl SceneFile {
    /// The text that reads back as this, with comments that say what it means.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut page = Page::default();
        page.note("A scene of canted. Lengths are world units, colours linear RGB, paths relative to this file.");
        if !self.settings.is_empty() {
            page.heading("[settings]");
            page.note("Options of `canted render` by their names; the command line has the last word.");
            self.settings.iter().for_each(|setting| write_setting(setting, &mut page));
        }
        if let Some(camera) = &self.camera {
            camera::write(camera, &mut page);
        }
        // A list that is empty is a key of the file, and those come before the tables.
        let mut keys = Page::default();
        if self.instances.as_ref().is_some_and(Vec::is_empty) {
            keys.line("instances", "[]", "nothing is placed");
        }
        match self.lights.as_deref() {
            Some([]) => light::write(&[], &mut keys),
            Some(lights) => light::write(lights, &mut page),
            None => {}
        }
        if let Some(environment) = &self.environment {
            environment::write(environment, &mut page);
        }
        self.assets.iter().for_each(|asset| write_asset(asset, &mut page));
        self.instances.iter().flatten().for_each(|instance| write_instance(instance, &mut page));
        for material in &self.materials {
            page.heading("[[materials]]");
            page.line("name", &quoted(&material.name), "new; `material` of an asset names it");
            material.edits.write(&mut page);
        }
        for change in &self.overrides {
            page.heading("[[overrides]]");
            page.line("material", &quoted(&change.material), "of the asset's file");
            if let Some(asset) = &change.asset {
                page.line("asset", &quoted(asset), "");
            }
            change.edits.write(&mut page);
        }
        keys.text + &page.text
    }
}

fn write_setting(setting: &Setting, page: &mut Page) {
    let Setting { key, value, comment, line: _ } = setting;
    match value {
        Some(value) => page.line(key, &word(value), comment),
        None => page.note(&format!("{key}: {comment}")),
    }
}

/// A number where reading keeps its letters, else a text.
fn word(value: &str) -> String {
    let is_integer = value.parse::<u32>().is_ok_and(|n| n.to_string() == value);
    let is_float = value.parse::<f32>().is_ok_and(|x| format!("{x:?}") == value && !x.is_nan());
    if is_integer || is_float { value.to_owned() } else { quoted(value) }
}

fn write_asset(asset: &Asset, page: &mut Page) {
    page.heading("[[assets]]");
    page.line("name", &quoted(&asset.name), "by which instances call it");
    match &asset.source {
        AssetSource::File(file) => page.line("file", &quoted(file), "OBJ, PLY, glTF or GLB"),
        AssetSource::Builtin => page.line("builtin", "true", "the scene that comes with the program"),
    }
    if let Some(time) = asset.time {
        page.line("time", &number(time), "seconds into its animation");
    }
    if let Some(material) = &asset.material {
        page.line("material", &quoted(material), "in place of all of its own");
    }
}

fn write_instance(instance: &AssetInstance, page: &mut Page) {
    page.heading("[[instances]]");
    page.line("asset", &quoted(&instance.asset), "");
    placement::write(&instance.open, page);
    if let Some(close) = &instance.close {
        page.text.push_str("[instances.close]\n");
        page.note("As the shutter closes; each number of the transform changes in a straight line.");
        placement::write(close, page);
    }
}
