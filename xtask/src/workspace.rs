//! Paths of the workspace, and values of its manifests.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use crate::command;

/// The folder of the workspace's manifest.
pub(crate) fn root() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_owned()
}

/// The optional folder of real models: `CANTED_SCENES`, else `../shared/scenes`.
pub(crate) fn models() -> PathBuf {
    std::env::var_os("CANTED_SCENES").map_or_else(|| root().join("../shared/scenes"), PathBuf::from)
}

/// Paths, relative to the root, of all files that are tracked or would be added by `git add`.
pub(crate) fn files() -> Result<Vec<PathBuf>> {
    let list = command::output("git", &["ls-files", "-z", "--cached", "--others", "--exclude-standard"])?;
    // A file deleted but not yet committed is still listed.
    Ok(list.split_terminator('\0').map(PathBuf::from).filter(|path| root().join(path).is_file()).collect())
}

/// The value of `key` in the section `[section]` of a manifest: the first such line, without quotes.
pub(crate) fn value<'a>(manifest: &'a str, section: &str, key: &str) -> Option<&'a str> {
    entries(manifest, section).find(|(name, _)| *name == key).map(|(_, value)| value.trim_matches('"'))
}

/// The lines `key = value` of the section `[section]` of a manifest.
pub(crate) fn entries<'a>(manifest: &'a str, section: &str) -> impl Iterator<Item = (&'a str, &'a str)> {
    let lines = manifest.lines().skip_while(move |line| line.trim() != format!("[{section}]")).skip(1);
    lines
        .take_while(|line| !line.starts_with('['))
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.split_once('='))
        .map(|(key, value)| (key.trim(), value.trim()))
}

/// Name and features, without `default`, of every package under `crates/` that has features.
pub(crate) fn packages_with_features() -> Result<Vec<(String, Vec<String>)>> {
    let folder = root().join("crates");
    let mut packages = vec![];
    for entry in fs::read_dir(&folder).with_context(|| format!("cannot list {}", folder.display()))? {
        let path = entry?.path().join("Cargo.toml");
        let Ok(manifest) = fs::read_to_string(&path) else { continue };
        let name = value(&manifest, "package", "name").with_context(|| format!("{}: no name", path.display()))?;
        let features = entries(&manifest, "features").map(|(key, _)| key.to_owned());
        let features: Vec<String> = features.filter(|feature| feature != "default").collect();
        if !features.is_empty() {
            packages.push((name.to_owned(), features));
        }
    }
    packages.sort();
    Ok(packages)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST: &str = "[package]\nname = \"a\"\n\n[features]\n# why = \"not\"\ndefault = [\"x\"]\nx = [\"dep:y\"]\n\n\
                            [dependencies]\nname = \"b\"\n";

    #[test]
    fn values_come_from_their_section() {
        assert_eq!(value(MANIFEST, "package", "name"), Some("a"));
        assert_eq!(value(MANIFEST, "dependencies", "name"), Some("b"));
        assert_eq!(value(MANIFEST, "lints", "name"), None);
        let keys: Vec<_> = entries(MANIFEST, "features").map(|(key, _)| key).collect();
        assert_eq!(keys, ["default", "x"]);
    }

    #[test]
    fn packages_with_features_are_found() {
        let packages = packages_with_features().unwrap();
        let lbvh = packages.iter().find(|(name, _)| name == "canted-lbvh").unwrap();
        assert_eq!(lbvh.1, ["parallel"]);
        assert!(packages.iter().all(|(name, _)| name != "canted-gpu"), "canted-gpu has no features");
    }
}
