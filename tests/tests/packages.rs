//! Dependencies point one way, checked in every manifest of the workspace; each published package has its license texts.
//!
//! Not covered here: what code does (reading a file needs no dependency), versions, licenses of dependencies.

use std::{collections::BTreeMap, fs, path::Path, process::Command};

/// Our packages with the packages that each depends on. A new arrow, and a new package, get a row here on purpose.
const ALLOWED: &[(&str, &[&str])] = &[
    ("obb", &[]),
    ("trace", &["obb"]),
    ("lbvh", &["obb"]),
    ("sah", &["obb", "lbvh"]),
    ("wide", &["obb", "trace", "lbvh", "sah"]),
    ("bvh2", &["obb", "trace", "lbvh", "sah"]),
    ("bih", &["obb", "trace", "lbvh"]),
    ("kdtree", &["obb", "trace", "lbvh"]),
    ("tlas", &["obb", "trace", "lbvh", "wide"]),
    ("collide", &["obb", "trace", "wide", "tlas"]),
    ("tiles", &["obb", "trace", "lbvh", "wide", "tlas"]),
    (
        "canted",
        &["obb", "trace", "lbvh", "sah", "wide", "bvh2", "bih", "kdtree", "tlas", "collide", "tiles", "scene", "gpu"],
    ),
    ("film", &[]),
    ("scene", &["obb"]),
    ("shaders", &[]),
    ("gpu", &["obb", "trace", "lbvh", "wide", "bvh2", "tlas", "shaders"]),
    ("renderer", &["obb", "trace", "lbvh", "sah", "wide", "bvh2", "bih", "kdtree", "tlas", "film", "scene", "gpu"]),
    (
        "cli",
        &["obb", "trace", "lbvh", "wide", "bvh2", "bih", "kdtree", "tlas", "tiles", "film", "scene", "gpu", "renderer"],
    ),
    ("python", &["canted"]),
    ("elastic", &["obb", "trace", "lbvh", "wide", "film", "scene", "renderer"]),
];

/// Further packages that tests alone may depend on; those of any package may use `fixtures`.
const ALLOWED_IN_TESTS: &[(&str, &[&str])] =
    &[("obb", &["obb"]), ("tlas", &["bvh2", "bih", "kdtree"]), ("collide", &["lbvh"]), ("renderer", &["shaders"])];

/// Crates with few dependencies, and those that they may have.
const MINIMAL: &[&str] = &["obb", "trace", "lbvh", "sah", "wide", "bvh2", "bih", "kdtree", "tlas", "collide", "canted"];
const MINIMAL_DEPENDENCIES: &[&str] = &["glam", "bytemuck", "rayon", "libm", "memmap2"];

/// Those of them that must be optional.
const OPTIONAL: &[&str] = &["rayon", "libm"];

/// External crates restricted to some packages; tests of any package may use peers.
const RESTRICTED: &[(&str, &[&str])] = &[
    ("memmap2", &["wide"]),
    ("obvhs", &["renderer", "tests", "benches"]),
    ("tinybvh-rs", &["benches"]),
    ("libloading", &["benches"]),
    ("ash", &["kernels"]),
    ("wgpu", &["gpu"]),
    ("naga", &["shaders"]),
    ("exr", &["scene", "film"]),
    ("gltf", &["scene", "benches"]),
    ("tobj", &["scene"]),
    ("clap", &["cli", "xtask", "benches"]),
    ("indicatif", &["cli"]),
];

#[derive(Debug, PartialEq, Eq)]
struct Dependency {
    name: String,
    for_tests: bool,
    optional: bool,
}

/// The dependencies of a manifest, in the forms used here: one line each, or a table each.
fn dependencies(manifest: &str) -> Vec<Dependency> {
    let mut found: Vec<Dependency> = vec![];
    let mut section = String::new();
    for line in manifest.lines().map(|line| line.split('#').next().unwrap_or_default().trim()) {
        if let Some(header) = line.strip_prefix('[') {
            section = header.trim_end_matches(']').to_owned();
            let mut parts = section.rsplitn(2, "dependencies.");
            if let (Some(name), Some(kind)) = (parts.next(), parts.next()) {
                found.push(Dependency { name: name.to_owned(), for_tests: kind.ends_with("dev-"), optional: false });
            }
            continue;
        }
        let Some((key, value)) = line.split_once('=') else { continue };
        let optional = value.replace(' ', "").contains("optional=true");
        if section.ends_with("dependencies") {
            let name = key.trim().split('.').next().unwrap_or_default().trim_matches('"').to_owned();
            found.push(Dependency { name, for_tests: section.ends_with("dev-dependencies"), optional });
        } else if section.contains("dependencies.") && key.trim() == "optional" {
            found.last_mut().expect("the header made one").optional = value.trim() == "true";
        }
    }
    found
}

/// Violations in the manifests, which are keyed by folder: sentences with package and dependency.
fn violations(manifests: &BTreeMap<String, String>) -> Vec<String> {
    let mut violations = vec![];
    for (package, manifest) in manifests {
        let row = |table: &[(&str, &'static [&'static str])]| {
            table.iter().find(|(name, _)| name == package).map(|(_, allowed)| *allowed)
        };
        let (allowed, in_tests) = (row(ALLOWED), row(ALLOWED_IN_TESTS).unwrap_or_default());
        for Dependency { name, for_tests, optional } in dependencies(manifest) {
            let ours = if name == "canted" { Some("canted") } else { name.strip_prefix("canted-") };
            let mut report = |what: &str| violations.push(format!("{package} needs {name}: {what}"));
            if let (Some(ours), Some(allowed)) = (ours, allowed) {
                if !(allowed.contains(&ours) || for_tests && (ours == "fixtures" || in_tests.contains(&ours))) {
                    report("not an allowed dependency");
                }
            } else if MINIMAL.contains(&package.as_str()) && !for_tests {
                if !MINIMAL_DEPENDENCIES.contains(&name.as_str()) {
                    report("more than glam, bytemuck, rayon, libm and memmap2");
                } else if OPTIONAL.contains(&name.as_str()) && !optional {
                    report(&format!("{name} must be optional"));
                }
            }
            if let Some((_, keepers)) = RESTRICTED.iter().find(|(kept, _)| *kept == name && !for_tests)
                && !keepers.contains(&package.as_str())
            {
                report("restricted to other packages");
            }
        }
        if allowed.is_none() && !["fixtures", "tests", "benches", "kernels", "xtask"].contains(&package.as_str()) {
            violations.push(format!("{package} has no row in the table"));
        }
    }
    violations
}

/// The manifest of every package, keyed by folder.
fn workspace() -> BTreeMap<String, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let crates = fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path());
    let others = ["shaders", "fixtures", "tests", "benches", "benches/kernels", "xtask", "examples/elastic"];
    let others = others.map(|name| root.join(name));
    crates
        .chain(others)
        .filter_map(|folder| {
            let name = folder.file_name()?.to_str()?.to_owned();
            Some((name, fs::read_to_string(folder.join("Cargo.toml")).ok()?))
        })
        .collect()
}

#[test]
fn dependencies_point_one_way() {
    let manifests = workspace();
    for package in
        ["obb", "trace", "lbvh", "tlas", "scene", "film", "renderer", "canted", "fixtures", "tests", "benches", "xtask"]
    {
        assert!(manifests.contains_key(package), "no manifest of {package}");
    }
    assert_eq!(violations(&manifests), Vec::<String>::new());
}

#[test]
fn every_allowed_dependency_exists() {
    let manifests = workspace();
    for (package, allowed) in ALLOWED.iter().chain(ALLOWED_IN_TESTS) {
        let names: Vec<String> = dependencies(&manifests[*package]).into_iter().map(|found| found.name).collect();
        let exists = |ours: &&&str| names.iter().any(|name| name.strip_prefix("canted-").unwrap_or(name) == **ours);
        let missing: Vec<_> = allowed.iter().filter(|ours| !exists(ours)).collect();
        assert!(missing.is_empty(), "{package} needs none of {missing:?}");
    }
}

#[test]
fn manifests_are_read() {
    let of = |package: &str| dependencies(&workspace()[package]);
    let names = |dependencies: &[Dependency]| dependencies.iter().map(|d| d.name.clone()).collect::<Vec<_>>();
    assert!(names(&of("tlas")).contains(&"canted-trace".to_owned()));
    assert!(of("lbvh").contains(&Dependency { name: "rayon".to_owned(), for_tests: false, optional: true }));
    assert!(of("tests").iter().any(|d| d.name == "obvhs" && d.for_tests));
}

/// The violations after lines are appended to one manifest.
fn with(package: &str, lines: &str) -> Vec<String> {
    let mut manifests = workspace();
    manifests.entry(package.to_owned()).or_default().push_str(&format!("\n{lines}\n"));
    violations(&manifests)
}

#[test]
fn reversed_dependencies_are_detected() {
    let back = |package: &str, name: &str| vec![format!("{package} needs {name}: not an allowed dependency")];
    assert_eq!(with("lbvh", "[dependencies]\ncanted-trace.workspace = true"), back("lbvh", "canted-trace"));
    assert_eq!(with("trace", "[dependencies.canted-tlas]\nworkspace = true"), back("trace", "canted-tlas"));
    assert_eq!(with("obb", "[dev-dependencies]\ncanted-lbvh = { workspace = true }"), back("obb", "canted-lbvh"));
    assert_eq!(with("scene", "[build-dependencies]\n\"canted-renderer\" = \"1\""), back("scene", "canted-renderer"));
    assert_eq!(with("tlas", "[target.'cfg(unix)'.dependencies]\ncanted = \"1\""), back("tlas", "canted"));
    assert_eq!(with("obb", "[dev-dependencies]\ncanted-fixtures.workspace = true"), Vec::<String>::new());
}

#[test]
fn restricted_and_extra_dependencies_are_detected() {
    let restricted = "restricted to other packages";
    assert_eq!(with("scene", "[dependencies]\nobvhs.workspace = true"), [format!("scene needs obvhs: {restricted}")]);
    assert_eq!(with("cli", "[dependencies.obvhs]\nversion = \"0.4\""), [format!("cli needs obvhs: {restricted}")]);
    assert_eq!(
        with("obb", "[dependencies]\nserde = { version = \"1\", optional = true }"),
        ["obb needs serde: more than glam, bytemuck, rayon, libm and memmap2"]
    );
    assert_eq!(with("trace", "[dependencies]\nrayon.workspace = true"), ["trace needs rayon: rayon must be optional"]);
    assert_eq!(with("trace", "[dependencies.rayon]\nworkspace = true\noptional = true"), Vec::<String>::new());
    assert_eq!(with("newcomer", "[dependencies]"), ["newcomer has no row in the table"]);
    assert_eq!(with("obb", "# obvhs = \"1\""), Vec::<String>::new());
}

/// Files that `cargo package` would put into each published package, by its folder.
fn packed() -> BTreeMap<String, Vec<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let crates = fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path());
    let mut packed = BTreeMap::new();
    for folder in crates.chain([root.join("shaders")]) {
        let manifest = folder.join("Cargo.toml");
        let Ok(text) = fs::read_to_string(&manifest) else { continue };
        if text.contains("publish = false") {
            continue;
        }
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
        let args = ["package", "--list", "--allow-dirty", "--offline", "--manifest-path"];
        let output = Command::new(cargo).args(args).arg(&manifest).output().unwrap();
        assert!(output.status.success(), "{}: {}", manifest.display(), String::from_utf8_lossy(&output.stderr));
        let files = String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect();
        packed.insert(folder.strip_prefix(root).unwrap().to_str().unwrap().to_owned(), files);
    }
    packed
}

#[test]
fn packages_have_their_license_texts() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let packed = packed();
    assert!(packed.len() >= 14, "{:?}", packed.keys());
    for (package, files) in packed {
        for file in ["LICENSE-APACHE", "LICENSE-MIT"] {
            assert!(files.iter().any(|packed| packed == file), "{package} is packed without {file}");
            let same = fs::read(root.join(&package).join(file)).unwrap() == fs::read(root.join(file)).unwrap();
            assert!(same, "{file} of {package} differs from that of the workspace");
        }
        assert!(files.iter().any(|packed| packed == "README.md"), "{package} is packed without README.md");
    }
}
