//! Files of hits.

use std::{
    io::{self, Write},
    path::Path,
};

use anyhow::Result;
use canted_scene::Scene;

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
