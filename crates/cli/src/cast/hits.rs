//! Files of hits.

use std::{
    io::{self, Write},
    path::Path,
};

use anyhow::{Result, anyhow};

/// How hits are written.
#[derive(Clone, Copy)]
pub(super) enum Format {
    Csv,
    Bin,
}

impl Format {
    /// By the file's ending.
    pub(super) fn of(path: &Path) -> Result<Self> {
        match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
            "csv" => Ok(Self::Csv),
            "bin" => Ok(Self::Bin),
            _ => Err(anyhow!("{}: hits end in .csv or .bin", path.display())),
        }
    }
}

/// The answer to one ray.
#[derive(Clone, Copy)]
pub(super) struct Answer {
    pub(super) t: f32,
    pub(super) prim: i64,
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) instance: i64,
}

impl Answer {
    /// Nothing is hit: `prim` says so, `t` is infinite.
    pub(super) const MISS: Self = Self { t: f32::INFINITY, prim: -1, u: 0.0, v: 0.0, instance: -1 };
    /// A hit at `[t, u, v]`; the instance's first primitive, the primitive in its mesh, and the instance.
    pub(super) fn hit([t, u, v]: [f32; 3], [first, primitive, instance]: [u32; 3]) -> Self {
        Self { t, prim: i64::from(first) + i64::from(primitive), u, v, instance: instance.into() }
    }
    /// Something is hit; what and where was not asked.
    pub(super) const OCCLUDED: Self = Self { t: 0.0, prim: 0, u: 0.0, v: 0.0, instance: 0 };

    /// Whether anything was hit.
    pub(super) fn is_hit(&self) -> bool {
        self.prim >= 0
    }
}

/// Writes one row a ray, in order.
pub(super) fn write(out: &mut dyn Write, format: Format, answers: &[Answer]) -> io::Result<()> {
    match format {
        Format::Csv => {
            writeln!(out, "t,prim,u,v,instance")?;
            for Answer { t, prim, u, v, instance } in answers {
                writeln!(out, "{t},{prim},{u},{v},{instance}")?;
            }
        }
        Format::Bin => {
            for answer in answers {
                out.write_all(&answer.t.to_le_bytes())?;
                let prim = i32::try_from(answer.prim).map_err(|_| {
                    io::Error::other(format!("triangle {} is beyond the 32 bits of a .bin row", answer.prim))
                })?;
                out.write_all(&prim.to_le_bytes())?;
                out.write_all(&answer.u.to_le_bytes())?;
                out.write_all(&answer.v.to_le_bytes())?;
            }
        }
    }
    Ok(())
}
