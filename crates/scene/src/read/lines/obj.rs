//! Lines and points of OBJ: the statements `v`, `l` and, with a radius of points, `p`.

use std::path::Path;

use super::Strands;
use crate::read::error::ReadError;
use crate::read::input::ReadOptions;
use crate::read::text::{self, quoted};

pub(super) fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let mut strands = Strands::default();
    let (mut n_faces, mut n_points) = (0_usize, 0_usize);
    // Vertices may be defined after use: the greatest index, and its line.
    let mut greatest = (0, 0);
    for line in text::lines(bytes) {
        let malformed = |message: String| ReadError::malformed(path, format!("line {}", line.number), message);
        match line.keyword.to_ascii_lowercase().as_slice() {
            b"v" => {
                let mut words = text::words(line.rest);
                let mut next = || {
                    let word = words.next().ok_or_else(|| malformed("a vertex has three coordinates".to_owned()))?;
                    text::float(word).ok_or_else(|| malformed(format!("{} is not a number", quoted(word))))
                };
                strands.points.push([next()?, next()?, next()?]);
            }
            b"p" if options.point_radius.is_none() => n_points += text::words(line.rest).count(),
            keyword @ (b"l" | b"p") => {
                let n = strands.points.len() as i64;
                let index = |word: &[u8]| {
                    // A texture coordinate may follow after a slash.
                    let number = word.split(|&byte| byte == b'/').next().unwrap_or(word);
                    let given =
                        text::integer(number).ok_or_else(|| malformed(format!("{} is not an index", quoted(word))))?;
                    let index = if given < 0 { n.checked_add(given) } else { given.checked_sub(1) };
                    index
                        .and_then(|index| u32::try_from(index).ok())
                        .ok_or_else(|| malformed(format!("there is no vertex {given}")))
                };
                let indices: Vec<u32> = text::words(line.rest).map(index).collect::<Result<_, _>>()?;
                greatest = indices.iter().map(|&index| (index, line.number)).fold(greatest, Ord::max);
                if keyword == b"p" {
                    strands.segments.extend(indices.iter().map(|&index| [index; 2]));
                } else {
                    strands.segments.extend(indices.windows(2).map(|pair| [pair[0], pair[1]]));
                }
            }
            b"f" => n_faces += 1,
            _ => {}
        }
    }
    if !strands.segments.is_empty() && greatest.0 as usize >= strands.points.len() {
        let message =
            format!("there is no vertex {}, the file has {}", u64::from(greatest.0) + 1, strands.points.len());
        return Err(ReadError::malformed(path, format!("line {}", greatest.1), message));
    }
    if let Some(radius) = options.point_radius {
        strands.thicken_points(radius, options.line_radius.unwrap_or(radius));
    }
    if n_points > 0 {
        strands.warnings.push(format!("skipping points, which --point-radius makes balls: {n_points}"));
    }
    if n_faces > 0 {
        strands.warnings.push(format!("skipping faces, as lines are read: {n_faces}"));
    }
    Ok(strands)
}
