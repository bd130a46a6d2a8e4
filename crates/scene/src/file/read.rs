//! TOML text to [`SceneFile`].

use std::fs;
use std::path::Path;

use toml_edit::Document;

use super::table::{Bounds, Source, Table};
use super::{
    Asset, AssetInstance, AssetSource, MaterialEdits, NewMaterial, Override, Placement, SceneFile, Setting, camera,
    closest_match, environment, light, placement,
};
use crate::ReadError;
use crate::read::quoted;

/// Largest scene file in bytes, enough for hundreds of thousands of instances. Guards against reading a large binary file.
const MAX_BYTES: u64 = 1 << 26;

const KEYS: [&str; 8] =
    ["assets", "instances", "camera", "lights", "environment", "materials", "overrides", "settings"];

impl SceneFile {
    /// Reads a scene file, but not the files that it references.
    ///
    /// # Errors
    /// [`ReadError`] with file, line, key and value; for an unknown key also the closest known key.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let io_error = ReadError::io(path);
        let n_bytes = fs::metadata(path).map_err(&io_error)?.len();
        if n_bytes > MAX_BYTES {
            let feature = format!("a scene file of {n_bytes} bytes (limit: {MAX_BYTES})");
            return Err(ReadError::unsupported(path, feature));
        }
        Self::parse(&fs::read(path).map_err(&io_error)?, path)
    }

    /// Parses the bytes of a scene file at `path`.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, ReadError> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count();
            super::table::error_at(path, line, "invalid UTF-8")
        })?;
        let source = Source::new(path, text);
        let document = Document::parse(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
            let key = error
                .span()
                .filter(|_| message == "duplicate key")
                .map(|span| format!(" '{}'", source.quote(Some(span))));
            source.error(at, message + &key.unwrap_or_default())
        })?;
        let root = Table::root(&source, document.as_table());
        root.check_keys(&KEYS)?;
        let file = Self {
            path: path.to_owned(),
            given: Vec::new(),
            assets: list(&root, "assets", asset)?.unwrap_or_default(),
            instances: list(&root, "instances", instance)?,
            camera: root.table("camera")?.map(|table| camera::read(&table)).transpose()?,
            lights: list(&root, "lights", light::read)?,
            environment: root.table("environment")?.map(|table| environment::read(&table)).transpose()?,
            materials: list(&root, "materials", material)?.unwrap_or_default(),
            overrides: list(&root, "overrides", override_)?.unwrap_or_default(),
            settings: root.table("settings")?.map_or(Ok(Vec::new()), |table| settings(&table))?,
        };
        file.check_names()?;
        Ok(file)
    }

    /// Checks that names are unique and that referenced names exist.
    fn check_names(&self) -> Result<(), ReadError> {
        let fail = |line, message: String| Err(super::table::error_at(&self.path, line, message));
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

/// Reads an array of tables.
fn list<T>(
    root: &Table<'_>,
    key: &str,
    read: impl Fn(Table<'_>) -> Result<T, ReadError>,
) -> Result<Option<Vec<T>>, ReadError> {
    root.tables(key)?.map(|tables| tables.into_iter().map(read).collect()).transpose()
}

fn asset(table: Table<'_>) -> Result<Asset, ReadError> {
    table.check_keys(&["name", "file", "builtin", "time", "animation", "variant", "material"])?;
    let name = table.required("name", table.text("name")?)?.to_owned();
    let source = match (table.file("file")?, table.flag("builtin")?.unwrap_or(false)) {
        (Some(file), false) => AssetSource::File(file.to_owned()),
        (None, true) => AssetSource::Builtin,
        (Some(_), true) => return Err(table.error("builtin", "use either 'file' or 'builtin', not both")),
        (None, false) => table.required("file", None)?,
    };
    let time = table.number("time", Bounds::Finite)?;
    let texts = [table.text("animation")?, table.text("variant")?, table.text("material")?];
    let [animation, variant, material] = texts.map(|text| text.map(str::to_owned));
    Ok(Asset { name, source, time, animation, variant, material, line: table.line() })
}

fn instance(table: Table<'_>) -> Result<AssetInstance, ReadError> {
    table.check_keys(&[&["asset", "close"][..], &placement::KEYS].concat())?;
    let asset = table.required("asset", table.text("asset")?)?.to_owned();
    let open = placement::read(&table, &Placement::IDENTITY)?;
    let close = table.table("close")?.map(|close| {
        let close = close.with_name("[instances.close]");
        close.check_keys(&placement::KEYS)?;
        placement::read(&close, &open)
    });
    Ok(AssetInstance { asset, open, close: close.transpose()?, line: table.line() })
}

fn material(table: Table<'_>) -> Result<NewMaterial, ReadError> {
    let edits = MaterialEdits::read(&table, &["name"])?;
    Ok(NewMaterial { name: table.required("name", table.text("name")?)?.to_owned(), edits, line: table.line() })
}

fn override_(table: Table<'_>) -> Result<Override, ReadError> {
    let edits = MaterialEdits::read(&table, &["asset", "material"])?;
    let material = table.required("material", table.text("material")?)?.to_owned();
    Ok(Override { asset: table.text("asset")?.map(str::to_owned), material, edits, line: table.line() })
}

fn settings(table: &Table<'_>) -> Result<Vec<Setting>, ReadError> {
    let setting = |(key, line): (&str, usize)| {
        Ok(Setting { key: key.to_owned(), value: Some(table.option_value(key)?), comment: String::new(), line })
    };
    table.keys().map(setting).collect()
}
