//! Lines and points of PLY: the elements `edge` (`vertex1`, `vertex2`) and, with a radius of points, `vertex`.
//!
//! Points come before edges. A property `radius` of vertices is that of points and of the ends of edges, where options state another one too.

use std::path::Path;

use super::body::{Body, Element, Kind, header};
use super::colors::{Colors, RGB};
use crate::read::error::ReadError;
use crate::read::input::ReadOptions;
use crate::read::strands::{Strands, point_index};
use crate::read::text::quoted;

/// Property names of vertices.
const VERTEX: [&[&[u8]]; 7] = [&[b"x"], &[b"y"], &[b"z"], &[b"radius"], RGB[0], RGB[1], RGB[2]];

/// Property names of edges.
const EDGE: [&[&[u8]]; 2] = [&[b"vertex1", b"v1", b"vertex_1"], &[b"vertex2", b"v2", b"vertex_2"]];

/// Parses the lines and points of a PLY file.
pub(in crate::read) fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let (header, body) = header(path, bytes)?;
    let mut body = Body::new(header.encoding, body);
    let mut strands = Strands { warnings: header.warnings, ..Strands::default() };
    let (mut radii, mut colors, mut edges) = (None, Colors::default(), Vec::new());
    let mut n_faces = 0;
    for element in &header.elements {
        let name = String::from_utf8_lossy(element.name);
        let of_element = |message| ReadError::malformed(path, format!("element {}", quoted(element.name)), message);
        let of_row = |row: usize, message| ReadError::malformed(path, format!("{name} {row}"), message);
        let n_rows = body.rows(element).map_err(of_element)?;
        match element.name {
            b"vertex" => {
                let has = |wanted: &[&[u8]]| element.properties.iter().any(|property| property.is_one_of(wanted));
                if let Some(axis) = VERTEX[..3].iter().position(|names| !has(names)) {
                    return Err(of_element(format!("missing property '{}'", ["x", "y", "z"][axis])));
                }
                let color = element.properties.iter().find(|property| property.is_one_of(RGB[0]));
                colors.scalar = color.filter(|_| VERTEX[4..].iter().all(|names| has(names))).and_then(|of| of.scalar());
                radii = has(VERTEX[3]).then(Vec::new);
                for row in 0..n_rows {
                    let [x, y, z, radius, color @ ..] = numbers(&mut body, element, &VERTEX, |body, kind| match kind {
                        Kind::Scalar(scalar) => body.float(scalar),
                        list @ Kind::List { .. } => body.skip(list).map(|()| 0.0),
                    })
                    .map_err(|message| of_row(row, message))?;
                    strands.points.push([x, y, z]);
                    if let Some(radii) = &mut radii {
                        radii.push(radius);
                    }
                    if colors.scalar.is_some() {
                        colors.list.push(color);
                    }
                }
            }
            b"edge" => {
                for row in 0..n_rows {
                    let edge = numbers(&mut body, element, &EDGE, |body, kind| match kind {
                        Kind::Scalar(scalar) => body.integer(scalar),
                        list @ Kind::List { .. } => body.skip(list).map(|()| -1),
                    });
                    edges.push(edge.map_err(|message| of_row(row, message))?);
                }
                let lacks = |names: &[&[u8]]| n_rows > 0 && element.properties.iter().all(|p| !p.is_one_of(names));
                if let Some(k) = EDGE.iter().position(|names| lacks(names)) {
                    return Err(of_element(format!("missing property '{}'", ["vertex1", "vertex2"][k])));
                }
            }
            _ => {
                n_faces += if element.name == b"face" { n_rows } else { 0 };
                for row in 0..n_rows {
                    let mut properties = element.properties.iter();
                    properties.try_for_each(|property| body.skip(property.kind)).map_err(|m| of_row(row, m))?;
                }
            }
        }
    }
    let n = point_index(path, strands.points.len())?;
    if options.point_radius.is_some() {
        strands.segments.extend((0..n).map(|point| [point; 2]));
    }
    for (row, edge) in edges.into_iter().enumerate() {
        let [a, b] = edge.map(|index| u32::try_from(index).ok().filter(|&index| index < n));
        let (Some(a), Some(b)) = (a, b) else {
            let message = format!("there are no vertices {} and {}, the file has {n}", edge[0], edge[1]);
            return Err(ReadError::malformed(path, format!("edge {row}"), message));
        };
        strands.segments.push([a, b]);
    }
    if n_faces > 0 {
        strands.warnings.push(format!("skipping faces, as lines are read: {n_faces}"));
    }
    let colors = colors.linear("vertex", &mut strands.warnings);
    strands.colors = colors.map(|colors| colors.into_iter().map(|[r, g, b, _]| [r, g, b]).collect());
    match (radii, options.point_radius) {
        (Some(radii), _) => strands.radii = Some(radii),
        (None, Some(radius)) => strands.thicken_points(radius, options.line_radius.unwrap_or(radius)),
        (None, None) => {}
    }
    Ok(strands)
}

/// The properties of a row with these names, the first of several; those that are missing are 0.
fn numbers<T: Default + Copy, const N: usize>(
    body: &mut Body,
    element: &Element,
    names: &[&[&[u8]]; N],
    read: impl Fn(&mut Body, Kind) -> Result<T, String>,
) -> Result<[T; N], String> {
    let (mut numbers, mut is_taken) = ([T::default(); N], [false; N]);
    for property in &element.properties {
        match names.iter().position(|names| property.is_one_of(names)).filter(|&slot| !is_taken[slot]) {
            Some(slot) => {
                is_taken[slot] = true;
                numbers[slot] = read(body, property.kind)?;
            }
            None => body.skip(property.kind)?,
        }
    }
    Ok(numbers)
}
