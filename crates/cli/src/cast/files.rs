//! Files of rays and hits.

use std::{
    io::{self, Read, Write},
    path::Path,
};

use anyhow::{Result, anyhow};
use canted_scene::Scene;
use canted_trace::Ray;

use super::is_stream;
use crate::output;

/// A file format of rays and hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Format {
    Csv,
    Bin,
}

impl Format {
    /// The format that `--format` names, else that of a file name; of `-`, csv.
    pub(super) fn of(path: &Path, given: Option<Self>) -> Result<Self> {
        if let Some(format) = given {
            return Ok(format);
        }
        match path {
            _ if is_stream(path) => Ok(Self::Csv),
            _ if output::has_extension(path, "csv") => Ok(Self::Csv),
            _ if output::has_extension(path, "bin") => Ok(Self::Bin),
            _ => Err(output::unsupported(path, ".csv or .bin")),
        }
    }
}

/// The result for one ray.
#[derive(Clone, Copy)]
pub(super) struct Answer {
    t: f32,
    prim: i64,
    u: f32,
    v: f32,
    instance: i64,
}

impl Answer {
    pub(super) const MISS: Self = Self { t: f32::INFINITY, prim: -1, u: 0.0, v: 0.0, instance: -1 };
    /// A hit of an occlusion test, which does not determine where the hit is.
    pub(super) const OCCLUDED: Self = Self { t: 0.0, prim: 0, u: 0.0, v: 0.0, instance: 0 };

    /// A closest hit; `primitive` is an index into the mesh of the instance.
    pub(super) fn hit([t, u, v]: [f32; 3], primitive: u32, instance: u32, scene: &Scene) -> Self {
        let first = scene.instances[instance as usize].first_primitive;
        Self { t, prim: i64::from(first) + i64::from(primitive), u, v, instance: instance.into() }
    }

    /// A closest hit of a triangle by its number among all instances.
    pub(super) fn in_whole([t, u, v]: [f32; 3], number: u64, instance: u32) -> Self {
        Self { t, prim: i64::try_from(number).unwrap_or(i64::MAX), u, v, instance: instance.into() }
    }

    /// A closest hit of a segment of lines.
    pub(super) fn of_segment([t, u, v]: [f32; 3], segment: u32) -> Self {
        Self { t, prim: segment.into(), u, v, instance: 0 }
    }

    /// Whether the ray hits anything.
    pub(super) fn is_hit(&self) -> bool {
        self.prim >= 0
    }
}

/// Writes one row per ray, in order.
pub(super) fn write(out: &mut dyn Write, format: Format, answers: &[Answer]) -> io::Result<()> {
    match format {
        Format::Csv => {
            writeln!(out, "t,prim,u,v,instance")?;
            for Answer { t, prim, u, v, instance } in answers {
                writeln!(out, "{t},{prim},{u},{v},{instance}")?;
            }
        }
        Format::Bin => {
            for &Answer { t, prim, u, v, .. } in answers {
                let prim = i32::try_from(prim).map_err(|_| {
                    io::Error::other(format!("triangle {prim} exceeds the 32 bits of a .bin row; use .csv"))
                })?;
                out.write_all([t.to_le_bytes(), prim.to_le_bytes(), u.to_le_bytes(), v.to_le_bytes()].as_flattened())?;
            }
        }
    }
    Ok(())
}

/// The columns of a row, in order.
const COLUMNS: [&str; 7] = ["ox", "oy", "oz", "dx", "dy", "dz", "tmax"];

/// Reads rays from a `.csv` or `.bin` file, or from standard input for `-`.
pub(super) fn read(path: &Path, format: Option<Format>) -> Result<Vec<Ray>> {
    let parse = match Format::of(path, format)? {
        Format::Csv => from_csv,
        Format::Bin => from_bin,
    };
    let (name, bytes) = if is_stream(path) {
        let mut bytes = Vec::new();
        ("standard input".to_owned(), std::io::stdin().lock().read_to_end(&mut bytes).map(|_| bytes))
    } else {
        (path.display().to_string(), std::fs::read(path))
    };
    let bytes = bytes.map_err(|error| anyhow!("cannot read {name}: {error}"))?;
    parse(&bytes).map_err(|error| anyhow!("{name}: {error}"))
}

fn from_bin(bytes: &[u8]) -> Result<Vec<Ray>> {
    const SIZE: usize = 7 * size_of::<f32>();
    if !bytes.len().is_multiple_of(SIZE) {
        return Err(anyhow!("{} bytes are not a multiple of {SIZE}, the size of a ray", bytes.len()));
    }
    bytes
        .chunks_exact(SIZE)
        .enumerate()
        .map(|(i, chunk)| {
            let mut numbers = [0.0; 7];
            for (number, word) in numbers.iter_mut().zip(chunk.chunks_exact(4)) {
                *number = f32::from_le_bytes([word[0], word[1], word[2], word[3]]);
            }
            ray(numbers).map_err(|error| anyhow!("ray {i}: {error}"))
        })
        .collect()
}

fn from_csv(bytes: &[u8]) -> Result<Vec<Ray>> {
    let text = std::str::from_utf8(bytes).map_err(|_| anyhow!("the file is not UTF-8 text"))?;
    let mut rays = vec![];
    let mut is_first = true;
    // Lines of old Macintosh programs end with CR alone.
    for (line, row) in text.lines().flat_map(|line| line.split('\r')).enumerate() {
        let row = row.trim().trim_start_matches('\u{feff}');
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != 7 {
            return Err(anyhow!("line {}: expected 7 fields, found {}", line + 1, fields.len()));
        }
        // Only the first row may be a header. `inf` and `nan` are numbers.
        let is_header = is_first && fields.iter().all(|field| is_name(field));
        is_first = false;
        if is_header {
            check_order(&fields).map_err(|error| anyhow!("line {}: {error}", line + 1))?;
            continue;
        }
        let mut numbers = [0.0; 7];
        for (number, field) in numbers.iter_mut().zip(&fields) {
            *number = field.parse().map_err(|_| anyhow!("line {}: '{field}' is not a number", line + 1))?;
        }
        rays.push(ray(numbers).map_err(|error| anyhow!("line {}: {error}", line + 1))?);
    }
    Ok(rays)
}

/// Rejects a header with a known column at a wrong position: rows are read by position, not by name.
fn check_order(header: &[&str]) -> Result<()> {
    let is_known = |name: &str| COLUMNS.iter().any(|column| column.eq_ignore_ascii_case(name));
    match header.iter().zip(COLUMNS).find(|(name, column)| !name.eq_ignore_ascii_case(column) && is_known(name)) {
        Some((name, column)) => {
            Err(anyhow!("column '{name}' is at the position of '{column}'; use the order {}", COLUMNS.join(",")))
        }
        None => Ok(()),
    }
}

/// Whether a field is a column name and not a number.
fn is_name(field: &str) -> bool {
    field.starts_with(|c: char| c.is_ascii_alphabetic()) && field.parse::<f32>().is_err()
}

/// A ray from its numbers. A ray with a zero direction or a negative `t_max` is valid and never hits.
fn ray([ox, oy, oz, dx, dy, dz, t_max]: [f32; 7]) -> Result<Ray> {
    let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
    if !origin.iter().chain(&direction).all(|x| x.is_finite()) {
        return Err(anyhow!("origin {origin:?} or direction {direction:?} is not finite"));
    }
    if t_max.is_nan() {
        return Err(anyhow!("tmax is not a number"));
    }
    Ok(Ray::new(origin, direction).between(0.0, t_max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_header_comments_and_infinity() {
        let text = b"ox,oy,oz,dx,dy,dz,tmax\n0,0,1, 0,0,-1, inf\n# comment\n\n1,2,3,4,5,6,7\r\n";
        let rays = from_csv(text).unwrap();
        assert_eq!(rays.len(), 2);
        assert_eq!(rays[0].t_max, f32::INFINITY);
        assert_eq!((rays[1].origin, rays[1].direction, rays[1].t_max), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0], 7.0));
    }

    #[test]
    fn lines_end_in_four_ways() {
        for end in ["\n", "\r\n", "\r", "\r\r\n"] {
            let text = "ox,oy,oz,dx,dy,dz,tmax\n# comment\n0,0,1,0,0,-1,inf\n1,2,3,4,5,6,7\n".replace('\n', end);
            assert_eq!(from_csv(text.as_bytes()).unwrap().len(), 2, "{end:?}");
        }
        let error = from_csv(b"0,0,0,1,0,0,1\r0,0,0,1,zero,0,1\r").unwrap_err().to_string();
        assert_eq!(error, "line 2: 'zero' is not a number");
    }

    #[test]
    fn errors_contain_line_and_value() {
        let error = from_csv(b"0,0,0,1,0,0,1\n0,0,0,1,zero,0,1\n").unwrap_err().to_string();
        assert_eq!(error, "line 2: 'zero' is not a number");
        assert_eq!(from_csv(b"1,2\n").unwrap_err().to_string(), "line 1: expected 7 fields, found 2");
        assert_eq!(from_bin(&[0; 29]).unwrap_err().to_string(), "29 bytes are not a multiple of 28, the size of a ray");
        assert!(from_csv(b"0,0,nan,1,0,0,1\n").is_err());
        let error = from_csv(b"inf,0,0,0,0,1,1\n0,0,0,0,0,1,1\n").unwrap_err().to_string();
        assert_eq!(error, "line 1: origin [inf, 0.0, 0.0] or direction [0.0, 0.0, 1.0] is not finite");
    }

    #[test]
    fn only_the_first_row_is_a_header_and_has_seven_names() {
        let row = "0,0,0,1,0,0,1\n";
        for before in ["", "\n", "# of a scan\n", "\u{feff}"] {
            let text = format!("{before}ox,oy,oz,dx,dy,dz,tmax\n{row}");
            assert_eq!(from_csv(text.as_bytes()).unwrap().len(), 1, "{before:?}");
        }
        assert_eq!(from_csv(format!("OX,y,from,dx,b,c,length\n{row}").as_bytes()).unwrap().len(), 1);
        assert_eq!(from_csv(b"a,b,c\n").unwrap_err().to_string(), "line 1: expected 7 fields, found 3");
        let error = from_csv(format!("{row}ox,oy,oz,dx,dy,dz,tmax\n").as_bytes()).unwrap_err().to_string();
        assert_eq!(error, "line 2: 'ox' is not a number");
    }

    #[test]
    fn rejects_a_header_in_another_order() {
        let row = "0,0,0,1,0,0,1\n";
        for (header, message) in [
            (
                "dx,dy,dz,ox,oy,oz,tmax",
                "line 1: column 'dx' is at the position of 'ox'; use the order ox,oy,oz,dx,dy,dz,tmax",
            ),
            (
                "\nox,oy,oz,tmax,DY,b,c",
                "line 2: column 'tmax' is at the position of 'dx'; use the order ox,oy,oz,dx,dy,dz,tmax",
            ),
            ("x,ox,z,a,b,c,d", "line 1: column 'ox' is at the position of 'oy'; use the order ox,oy,oz,dx,dy,dz,tmax"),
        ] {
            assert_eq!(from_csv(format!("{header}\n{row}").as_bytes()).unwrap_err().to_string(), message);
        }
    }
}
