//! Why a file was not read, and warnings: one line per kind, with the first location and the number of further ones.

use std::path::{Path, PathBuf};
use std::{fmt, io};

use super::text::printable;

/// Why a file could not be read: one sentence with file, location and value.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReadError {
    /// A file could not be opened or read.
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Neither the content nor the extension is that of a supported format.
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file violates its format.
    Malformed {
        /// The file.
        path: PathBuf,
        /// Location in the file: `line 7`, `accessor 3`, `element vertex`.
        location: String,
        /// What is wrong, with the value found.
        message: String,
    },
    /// The file is valid but uses an unsupported feature.
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Name of the feature.
        feature: String,
    },
    /// The file has no animation of this name or number.
    UnknownAnimation {
        /// The file.
        path: PathBuf,
        /// The name or number.
        wanted: String,
        /// Number and name of each animation that the file has.
        known: Vec<String>,
    },
    /// The file has no material variant of this name or number.
    UnknownVariant {
        /// The file.
        path: PathBuf,
        /// The name or number.
        wanted: String,
        /// Number and name of each variant that the file has.
        known: Vec<String>,
    },
    /// A pose makes a vertex infinite or NaN.
    VertexNotFinite {
        /// The file.
        path: PathBuf,
        /// Number and name of the mesh.
        mesh: String,
        /// The vertex within the mesh: `primitive 0 vertex 12`.
        vertex: String,
        /// Its position.
        position: [f32; 3],
    },
    /// Two poses of a scene cannot be the ends of one shutter.
    Shutter {
        /// The file.
        path: PathBuf,
        /// Times in seconds as the shutter opens and as it closes.
        times: [f32; 2],
        /// What the later pose has: `other triangles`.
        what: &'static str,
    },
    /// The file contains nothing to draw.
    Empty {
        /// The file.
        path: PathBuf,
        /// Why: `no faces`, `all 3 triangles are degenerate`.
        reason: String,
    },
}

impl ReadError {
    /// Adds `path` to an I/O error.
    pub(crate) fn io(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    /// A violation of the format at `location`.
    pub(crate) fn malformed(path: &Path, location: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), location: location.into(), message: message.into() }
    }

    /// An unsupported feature.
    pub(crate) fn unsupported(path: &Path, feature: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), feature: feature.into() }
    }

    /// A format whose reader is not part of this build.
    #[cfg(not(all(feature = "stl", feature = "off", feature = "gzip")))]
    pub(crate) fn missing_feature(path: &Path, format: &str, feature: &str) -> Self {
        Self::unsupported(path, format!("{format} (built without the feature '{feature}')"))
    }

    /// Nothing to draw.
    pub(crate) fn empty(path: &Path, reason: impl Into<String>) -> Self {
        Self::Empty { path: path.to_owned(), reason: reason.into() }
    }

    /// The file that caused the error.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. }
            | Self::UnknownFormat { path }
            | Self::Malformed { path, .. }
            | Self::Unsupported { path, .. }
            | Self::UnknownAnimation { path, .. }
            | Self::UnknownVariant { path, .. }
            | Self::VertexNotFinite { path, .. }
            | Self::Shutter { path, .. }
            | Self::Empty { path, .. } => path,
        }
    }
}

/// The format of a file name that is not read, and a way to one that is.
fn converter(path: &Path) -> Option<(&'static str, &'static str)> {
    const BLENDER: &str = "import it in Blender and export glTF";
    let extension = path.extension()?.to_str()?.to_lowercase();
    Some(match extension.as_str() {
        "fbx" => ("FBX", "convert it with FBX2glTF, or import it in Blender and export glTF"),
        "usd" | "usda" | "usdc" | "usdz" => ("USD", BLENDER),
        "abc" => ("Alembic", BLENDER),
        "blend" => ("a Blender file", "open it in Blender and export glTF"),
        "dae" => ("COLLADA", "convert it with `assimp export in.dae out.glb`"),
        "3ds" | "lwo" | "x3d" | "wrl" => {
            ("this format", "convert it to .glb with `assimp export`, or import it in Blender and export glTF")
        }
        "3mf" => ("3MF", "convert it to STL with `prusa-slicer --export-stl`"),
        "amf" => ("AMF", "convert it to STL with `prusa-slicer --export-stl`"),
        "step" | "stp" | "iges" | "igs" => ("CAD data", "open it in FreeCAD and export glTF or STL"),
        "xml" => ("a Mitsuba scene", "import it in Blender with the add-on mitsuba-blender and export glTF"),
        "pbrt" => {
            ("a pbrt scene", "write its meshes as PLY with `pbrt --toply`, and name them in a scene file (.toml)")
        }
        "vtk" | "vtu" | "msh" => ("a simulation mesh", "convert its surface to PLY with ParaView or meshio"),
        "drc" => ("Draco data without glTF", "convert it to PLY with `draco_decoder -i in.drc -o out.ply`"),
        "splat" | "spz" | "ksplat" => {
            ("a cloud of Gaussian splats", "it has no faces, so export a mesh of it as PLY, OBJ or glTF")
        }
        "zip" | "7z" | "rar" | "tar" | "tgz" => ("an archive", "unpack it, and name the model in it"),
        "dxf" => ("DXF", "import it in FreeCAD and export glTF or STL"),
        "ifc" => ("IFC", "convert it with `IfcConvert in.ifc out.glb`"),
        "skp" => ("a SketchUp file", "open it in SketchUp and export glTF, OBJ or STL"),
        "max" => ("a 3ds Max file", "open it in 3ds Max and export glTF, OBJ or STL"),
        "3dm" => ("a Rhino file", "open it in Rhino and export glTF, OBJ or STL"),
        _ => return None,
    })
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.path().display();
        let list = |what: &str, known: &[String]| match known {
            [] => format!(": the file has no {what}"),
            known => format!("; the file has {}", known.join(", ")),
        };
        let sentence = match self {
            Self::Io { source, .. } => format!("{file}: cannot read file: {source}"),
            Self::UnknownFormat { path } => match converter(path) {
                Some((format, way)) => format!("{file}: {format} is not supported; {way}"),
                None => format!(
                    "{file}: unsupported scene format; use OBJ, PLY, STL, OFF, glTF, GLB, .hair, .tck, .trk, .pdb, .xyz or .gcode"
                ),
            },
            Self::Malformed { location, message, .. } => format!("{file}: {location}: {message}"),
            Self::Unsupported { feature, .. } => format!("{file}: {feature} is not supported"),
            Self::UnknownAnimation { wanted, known, .. } => {
                format!("{file}: unknown animation '{wanted}'{}", list("animation", known))
            }
            Self::UnknownVariant { wanted, known, .. } => {
                format!("{file}: unknown variant '{wanted}'{}", list("material variant", known))
            }
            Self::VertexNotFinite { mesh, vertex, position: [x, y, z], .. } => {
                format!("{file}: {mesh}: {vertex} is not finite: {x}, {y}, {z}")
            }
            Self::Shutter { times: [open, close], what, .. } => {
                format!("{file}: at {close} seconds the scene has {what} than at {open}; use a shorter shutter")
            }
            Self::Empty { reason, .. } => format!("{file}: nothing to draw: {reason}"),
        };
        f.write_str(&printable(&sentence))
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// Grouped warnings in order of first occurrence.
#[derive(Default)]
pub(crate) struct WarningGroups {
    list: Vec<WarningGroup>,
}

struct WarningGroup {
    what: String,
    /// Where it happened first, or a sentence about it.
    first: String,
    is_sentence: bool,
    n_more: usize,
}

impl WarningGroups {
    /// Adds the warning `what` at `location`.
    pub(crate) fn add(&mut self, what: &str, location: &str) {
        self.count(what, location, false);
    }

    /// Adds a whole sentence, which stands for all of its kind.
    pub(crate) fn add_sentence(&mut self, kind: &str, sentence: &str) {
        self.count(kind, sentence, true);
    }

    fn count(&mut self, what: &str, first: &str, is_sentence: bool) {
        let is_same = |group: &&mut WarningGroup| group.what == what && group.is_sentence == is_sentence;
        match self.list.iter_mut().find(is_same) {
            Some(group) => group.n_more += 1,
            None => {
                let (what, first) = (what.to_owned(), first.to_owned());
                self.list.push(WarningGroup { what, first, is_sentence, n_more: 0 });
            }
        }
    }

    /// As [`WarningGroups::add`], unless `what` was added before.
    pub(crate) fn add_once(&mut self, what: &str, location: &str) {
        if self.list.iter().all(|group| group.what != what) {
            self.add(what, location);
        }
    }

    /// Appends one line per kind.
    pub(crate) fn finish(self, warnings: &mut Vec<String>) {
        warnings.extend(self.list.into_iter().map(|WarningGroup { what, first, is_sentence, n_more }| {
            let sentence = if is_sentence { first } else { format!("{what}: {first}") };
            let more = match (n_more, is_sentence) {
                (0, _) => String::new(),
                (n, true) => format!(", and {n} more"),
                (n, false) => format!(" and {n} more"),
            };
            printable(&format!("{sentence}{more}")).into_owned()
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_equal_warnings() {
        let mut groups = WarningGroups::default();
        for (what, location) in [("ignoring b", "node 1"), ("ignoring a", "node 2"), ("ignoring b", "node 3")] {
            groups.add(what, location);
        }
        groups.add_once("ignoring b", "the file");
        for name in ["c", "d", "e"] {
            groups.add_sentence("absent", &format!("skipping {name}: absent"));
        }
        let mut warnings = Vec::new();
        groups.finish(&mut warnings);
        let of_c = "skipping c: absent, and 2 more";
        assert_eq!(warnings, ["ignoring b: node 1 and 1 more", "ignoring a: node 2", of_c]);
    }
}
