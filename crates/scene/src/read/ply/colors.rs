//! The colors of PLY: of vertices and of faces, their own or those of the rows of the element `material` that they name, and gray values
//! of vertices.

use super::body::{Body, Element, Property, Scalar};
use crate::read::mesh::{NO_COLOR, linear_colors};

/// Property names of a color.
pub(super) const RGB: [&[&[u8]]; 3] =
    [&[b"red", b"r", b"diffuse_red"], &[b"green", b"g", b"diffuse_green"], &[b"blue", b"b", b"diffuse_blue"]];

/// Property names of a gray value.
pub(super) const GRAY: [&[u8]; 3] = [b"gray", b"grey", INTENSITY];

/// A gray value, or as a real number the strength of a reflected ray, as in the scans of the Stanford repository.
const INTENSITY: &[u8] = b"intensity";

/// Property names of a row of the element `material`, from 0.
pub(super) const MATERIAL: [&[u8]; 3] = [b"material_index", b"material_id", b"material"];

/// Whether a property is the strength of a reflected ray, which is no color.
pub(super) fn is_measured(property: &Property) -> bool {
    property.is_one_of(&[INTENSITY]) && is_real(property.scalar())
}

fn is_real(scalar: Option<Scalar>) -> bool {
    matches!(scalar, Some(Scalar::F32 | Scalar::F64))
}

/// Colors as a file has them, and the type of their numbers.
#[derive(Debug, Default)]
pub(super) struct Colors {
    pub(super) list: Vec<[f32; 3]>,
    pub(super) scalar: Option<Scalar>,
}

impl Colors {
    /// The linear colors of all that `of` names, vertices or faces; `None` without any, and with a warning where they are not colors.
    pub(super) fn linear(self, of: &str, warnings: &mut Vec<String>) -> Option<Vec<[f32; 4]>> {
        if self.list.is_empty() {
            return None;
        }
        let max = self.max();
        linear_colors(of, self.list, max).map_err(|warning| warnings.push(warning)).ok()
    }

    /// The value of full intensity; `None` where the range of the numbers decides between 255 and 1. Some programs store bytes in wider
    /// integers.
    fn max(&self) -> Option<f32> {
        match self.scalar {
            Some(Scalar::U8 | Scalar::I8) => Some(255.0),
            scalar if scalar.is_none() || is_real(scalar) => None,
            _ => self.list.iter().flatten().any(|&x| x > 255.0).then_some(65_535.0),
        }
    }

    /// Reads a row of the element `material`. A channel that it has not is full.
    pub(super) fn read(&mut self, body: &mut Body, element: &Element) -> Result<(), String> {
        let mut color = [f32::NAN; 3];
        for property in &element.properties {
            match (property.scalar(), RGB.iter().position(|names| property.is_one_of(names))) {
                (Some(scalar), Some(k)) => {
                    color[k] = body.float(scalar)?;
                    self.scalar = Some(scalar);
                }
                _ => body.skip(property.kind)?,
            }
        }
        self.list.push(color);
        Ok(())
    }

    /// The colors of the rows with these numbers; full where there is no such row.
    pub(super) fn of_rows(&self, numbers: &[i64]) -> Self {
        let row = |&number: &i64| usize::try_from(number).ok().and_then(|number| self.list.get(number));
        let list = numbers.iter().map(|number| row(number).copied().unwrap_or(NO_COLOR));
        Self { list: list.collect(), scalar: self.scalar }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::parse;
    use crate::read::input::ReadOptions;

    /// A square of two triangles with these properties and values of vertices and of faces, and what follows.
    fn square(vertex: [&str; 2], face: [&str; 2], more: [&str; 2]) -> (Option<[f32; 4]>, Vec<String>) {
        let corners = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"].map(|corner| format!("{corner} {}\n", vertex[1])).concat();
        let faces = ["3 0 1 2", "3 0 2 3"].map(|indices| format!("{indices} {}\n", face[1])).concat();
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{}\
             element face 2\nproperty list uchar int vertex_indices\n{}{}end_header\n{corners}{faces}{}",
            vertex[0], face[0], more[0], more[1]
        );
        let scene = parse(Path::new("a.ply"), text.as_bytes(), &ReadOptions::default()).unwrap();
        let colors = scene.meshes[0].colors.as_ref();
        assert!(colors.is_none_or(|colors| colors.iter().all(|color| *color == colors[0])), "{colors:?}");
        assert_eq!(scene.materials[0].base_color, [if colors.is_some() { 1.0 } else { 0.8 }; 3]);
        (colors.map(|colors| colors[0]), scene.warnings)
    }

    const RED: Option<[f32; 4]> = Some([1.0, 0.0, 0.0, 1.0]);

    fn rgb(scalar: &str) -> String {
        ["red", "green", "blue"].map(|name| format!("property {scalar} {name}\n")).concat()
    }

    #[test]
    fn integers_of_any_width_hold_bytes() {
        for scalar in ["uchar", "ushort", "short", "int", "uint", "float"] {
            let read = square([&rgb(scalar), "255 0 0"], ["", ""], ["", ""]);
            assert_eq!(read, (RED, vec![]), "{scalar}");
            let read = square(["", ""], [&rgb(scalar), "255 0 0"], ["", ""]);
            assert_eq!(read, (RED, vec![]), "{scalar}");
        }
        for scalar in ["ushort", "int", "uint"] {
            // 0.2 is 0.0331 in linear light, by the published table.
            let (color, _) = square([&rgb(scalar), "65535 13107 0"], ["", ""], ["", ""]);
            assert!(color.is_some_and(|c| c[0] == 1.0 && (c[1] - 0.0331).abs() < 5e-5 && c[2] == 0.0), "{color:?}");
        }
    }

    #[test]
    fn faces_and_vertices_have_the_colors_of_materials() {
        let index = "property int material_index\n";
        for names in ["", "diffuse_"] {
            let properties = rgb("uchar").replace(" red", &format!(" {names}red"));
            let properties = properties.replace(" green", &format!(" {names}green"));
            let properties = properties.replace(" blue", &format!(" {names}blue"));
            let element = format!("element material 2\nproperty uchar ambient_red\n{properties}property float gloss\n");
            let more = [&element[..], "9 0 0 255 0.5\n9 255 0 0 0.5\n"];
            assert_eq!(square(["", ""], [index, "1"], more), (RED, vec![]));
            assert_eq!(square([index, "1"], ["", ""], more), (RED, vec![]));
            assert_eq!(square([index, "0"], ["", ""], more).0, Some([0.0, 0.0, 1.0, 1.0]));
            assert_eq!(square(["", ""], [index, "-1"], more).0, Some([1.0; 4]));
            let ignored = "ignoring the element 'material', as neither faces nor vertices have 'material_index'";
            assert_eq!(square(["", ""], ["", ""], more), (None, vec![ignored.to_owned()]));
        }
        assert_eq!(square(["", ""], [index, "1"], ["", ""]), (None, vec![]));
    }

    #[test]
    fn gray_values_are_colors() {
        // 51 / 255 = 0.2, see above.
        for (property, value) in [("uchar intensity", "51"), ("ushort intensity", "13107"), ("float gray", "0.2")] {
            let (color, warnings) = square([&format!("property {property}\n"), value], ["", ""], ["", ""]);
            let color = color.unwrap_or_else(|| panic!("{property}"));
            assert!(color[..3].iter().all(|x| (x - 0.0331).abs() < 5e-5), "{property}: {color:?}");
            assert_eq!(warnings, [""; 0]);
        }
        let both = format!("property uchar intensity\n{}", rgb("uchar"));
        assert_eq!(square([&both, "9 255 0 0"], ["", ""], ["", ""]).0, RED);
        let measured = "ignoring 'intensity' of vertices, which as a real number is no color";
        let (color, warnings) = square(["property float intensity\n", "0.5"], ["", ""], ["", ""]);
        assert_eq!((color, warnings), (None, vec![measured.to_owned()]));
    }
}
