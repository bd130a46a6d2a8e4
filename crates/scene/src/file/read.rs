//! TOML text to [`SceneFile`].

use std::collections::HashMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::Deserialize;
use serde_spanned::Spanned;

use super::curves::{self, CurveRows};
use super::light::{self, EnvironmentTable, LightTable};
use super::material::MaterialTable;
use super::patches::{self, PatchRows};
use super::placement::{self, CameraTable, Matrix, PlacementTable};
use super::tables::{
    Direction, FileName, Finite, Folders, In, NotNegative, NotZero, OptionText, Point, Source, closest_match,
};
use super::{Asset, AssetInstance, AssetSource, NewMaterial, Override, Placement, SceneFile, Setting};
use crate::ReadError;
use crate::read::{quoted, with_line_feeds};

/// Largest scene file in bytes, enough for hundreds of thousands of instances. Guards against reading a large binary file.
const MAX_BYTES: u64 = 1 << 26;

impl SceneFile {
    /// Reads a scene file, but not the files that it references.
    ///
    /// # Errors
    /// [`ReadError`] with file, line, key and value; for an unknown key also the closest known key.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(ReadError::io(path))?;
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(ReadError::io(path))?;
        if bytes.len() as u64 > MAX_BYTES {
            return Err(ReadError::unsupported(path, format!("a scene file of more than {MAX_BYTES} bytes")));
        }
        Self::parse(&bytes, path)
    }

    /// Parses the bytes of a scene file at `path`.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, ReadError> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count();
            super::tables::error_at(path, line, "invalid UTF-8")
        })?;
        let text = with_line_feeds(text);
        let source = Source::new(path, &text);
        let document: Document = source.read()?;
        let Document {
            assets,
            instances,
            curves,
            patches,
            camera,
            lights,
            environment,
            materials,
            overrides,
            settings,
        } = document;
        let each = |instances: Vec<_>| instances.into_iter().map(|table| instance(table, &source)).collect();
        let mut settings: Vec<(String, Spanned<OptionText>)> = settings.into_iter().collect();
        settings.sort_by_key(|(_, value)| value.span().start);
        let file = Self {
            path: path.to_owned(),
            given: Vec::new(),
            assets: assets.into_iter().map(|table| asset(table, &source)).collect::<Result<_, _>>()?,
            instances: instances.map(each).transpose()?,
            curves: curves.into_iter().map(|table| curves::read(table, &source)).collect::<Result<_, _>>()?,
            patches: patches.into_iter().map(|table| patches::read(table, &source)).collect::<Result<_, _>>()?,
            camera: camera.map(|table| placement::camera(&table, &source)).transpose()?,
            lights: lights
                .map(|lights| lights.into_iter().map(|table| light::light(table, &source)).collect())
                .transpose()?,
            environment: environment.map(|table| light::environment(table, &source)).transpose()?,
            materials: materials.into_iter().map(|table| material(table, &source)).collect::<Result<_, _>>()?,
            overrides: overrides.into_iter().map(|table| override_(table, &source)).collect::<Result<_, _>>()?,
            settings: settings.into_iter().map(|(key, value)| setting(key, &value, &source)).collect(),
        };
        file.check_names()?;
        Ok(file)
    }

    /// Checks that names are unique and that referenced names exist.
    fn check_names(&self) -> Result<(), ReadError> {
        let fail = |line, message: String| Err(super::tables::error_at(&self.path, line, message));
        let assets: Vec<&str> = self.assets.iter().map(|asset| &asset.name[..]).collect();
        let materials: Vec<&str> = self.materials.iter().map(|material| &material.name[..]).collect();
        let lines = self.assets.iter().map(|asset| asset.line);
        if let Some((line, name)) = repeated(&assets, lines) {
            return fail(line, format!("duplicate asset name {}", quoted(name.as_bytes())));
        }
        if let Some((line, name)) = repeated(&materials, self.materials.iter().map(|material| material.line)) {
            return fail(line, format!("duplicate material name {}", quoted(name.as_bytes())));
        }
        let used_assets = self.instances.iter().flatten().map(|instance| (&instance.asset, instance.line));
        let overridden = self.overrides.iter().filter_map(|change| Some((change.asset.as_ref()?, change.line)));
        let known: std::collections::HashSet<&str> = assets.iter().copied().collect();
        if let Some((name, line)) = used_assets.chain(overridden).find(|(name, _)| !known.contains(&name[..])) {
            return fail(line, unknown("asset", name, assets));
        }
        let used = self.assets.iter().filter_map(|asset| Some((asset.material.as_ref()?, asset.line)));
        let used = used.chain(self.curves.iter().filter_map(|curves| Some((curves.material.as_ref()?, curves.line))));
        let used =
            used.chain(self.patches.iter().filter_map(|patches| Some((patches.material.as_ref()?, patches.line))));
        if let Some((name, line)) = used.into_iter().find(|(name, _)| !materials.contains(&&name[..])) {
            return fail(line, unknown("material", name, materials));
        }
        Ok(())
    }
}

/// The message for an unknown name, with the closest known one.
pub(super) fn unknown<'a>(kind: &str, name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let name_quoted = quoted(name.as_bytes());
    let known: Vec<&str> = known.into_iter().collect();
    match closest_match(name, known.iter().copied()) {
        Some(near) => format!("unknown {kind} {name_quoted}; did you mean {}?", quoted(near.as_bytes())),
        None if known.is_empty() => format!("unknown {kind} {name_quoted}; none is defined"),
        None => format!("unknown {kind} {name_quoted}"),
    }
}

/// The first repeated name and its line.
fn repeated<'a>(names: &[&'a str], lines: impl Iterator<Item = usize>) -> Option<(usize, &'a str)> {
    let mut seen = std::collections::HashSet::new();
    names.iter().zip(lines).find(|(name, _)| !seen.insert(**name)).map(|(&name, line)| (line, name))
}

/// A whole file.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Document {
    assets: Vec<Spanned<AssetTable>>,
    instances: Option<Vec<Spanned<InstanceTable>>>,
    curves: Vec<Spanned<CurveRows>>,
    patches: Vec<Spanned<PatchRows>>,
    camera: Option<Spanned<CameraTable>>,
    lights: Option<Vec<LightTable>>,
    environment: Option<Spanned<EnvironmentTable>>,
    materials: Vec<Spanned<MaterialTable<true>>>,
    overrides: Vec<Spanned<MaterialTable<false>>>,
    settings: HashMap<String, Spanned<OptionText>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AssetTable {
    name: String,
    file: Option<FileName>,
    builtin: Option<Spanned<bool>>,
    time: Option<In<f32, Finite>>,
    animation: Option<String>,
    variant: Option<String>,
    material: Option<String>,
    #[serde(default)]
    texture_path: Folders,
    #[serde(default)]
    allow_parent: bool,
    line_radius: Option<In<f32, NotNegative>>,
    point_radius: Option<In<f32, NotNegative>>,
}

fn asset(table: Spanned<AssetTable>, source: &Source<'_>) -> Result<Asset, ReadError> {
    let at = table.span().start;
    let AssetTable {
        name,
        file,
        builtin,
        time,
        animation,
        variant,
        material,
        texture_path,
        allow_parent,
        line_radius,
        point_radius,
    } = table.into_inner();
    let content = match (file, builtin.filter(|builtin| *builtin.get_ref())) {
        (Some(file), None) => AssetSource::File(file.0),
        (None, Some(_)) => AssetSource::Builtin,
        (Some(_), Some(builtin)) => {
            return Err(source.error(builtin.span().start, "use either 'file' or 'builtin', not both"));
        }
        (None, None) => return Err(source.error(at, "missing key 'file' in [[assets]]")),
    };
    let line = source.line(at);
    let (time, texture_path) = (time.map(|time| time.0), texture_path.0);
    let [line_radius, point_radius] = [line_radius, point_radius].map(|radius| radius.map(|radius| radius.0));
    Ok(Asset {
        name,
        source: content,
        time,
        animation,
        variant,
        material,
        texture_path,
        allow_parent,
        line_radius,
        point_radius,
        line,
    })
}

/// A table of `[[instances]]`; its placement has the keys of [`PlacementTable`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InstanceTable {
    asset: String,
    translation: Option<Spanned<Point>>,
    axis: Option<Spanned<Direction>>,
    angle_degrees: Option<Spanned<In<f32, Finite>>>,
    scale: Option<Spanned<In<[f32; 3], NotZero>>>,
    matrix: Option<Matrix>,
    close: Option<PlacementTable>,
}

fn instance(table: Spanned<InstanceTable>, source: &Source<'_>) -> Result<AssetInstance, ReadError> {
    let line = source.line(table.span().start);
    let InstanceTable { asset, translation, axis, angle_degrees, scale, matrix, close } = table.into_inner();
    let open = PlacementTable { translation, axis, angle_degrees, scale, matrix };
    let open = open.placement(&Placement::IDENTITY, source)?;
    let close = close.map(|close| close.placement(&open, source)).transpose()?;
    Ok(AssetInstance { asset, open, close, line })
}

fn material(table: Spanned<MaterialTable<true>>, source: &Source<'_>) -> Result<NewMaterial, ReadError> {
    let at = table.span().start;
    let MaterialTable { name, edits, .. } = table.into_inner();
    let name = name.ok_or_else(|| source.error(at, "missing key 'name' in [[materials]]"))?;
    Ok(NewMaterial { name, edits, line: source.line(at) })
}

fn override_(table: Spanned<MaterialTable<false>>, source: &Source<'_>) -> Result<Override, ReadError> {
    let at = table.span().start;
    let MaterialTable { asset, material, edits, .. } = table.into_inner();
    let material = material.ok_or_else(|| source.error(at, "missing key 'material' in [[overrides]]"))?;
    Ok(Override { asset, material, edits, line: source.line(at) })
}

fn setting(key: String, value: &Spanned<OptionText>, source: &Source<'_>) -> Setting {
    let line = source.line(value.span().start);
    Setting { key, value: Some(value.get_ref().0.clone()), comment: String::new(), line }
}
