use std::{
    fs::{self, File},
    io::Write,
    path::PathBuf,
};

use anyhow::{Context, Result};
use serde_json::json;

use super::subject::Measured;

/// A file of JSON lines in `target/bench`: one for each engine and set of rays, with the numbers of every round.
pub(crate) struct Record {
    file: File,
}

impl Record {
    /// Starts an empty file.
    pub(crate) fn create(name: &str) -> Result<Self> {
        let target = std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target")), PathBuf::from);
        let folder = target.join("bench");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let path = folder.join(name);
        Ok(Self { file: File::create(&path).with_context(|| format!("cannot write {}", path.display()))? })
    }

    /// Adds a line.
    pub(crate) fn line(&mut self, value: &serde_json::Value) -> Result<()> {
        Ok(writeln!(self.file, "{value}")?)
    }

    /// Adds a scene.
    pub(crate) fn add(&mut self, measured: &Measured) -> Result<()> {
        for (i, contestant) in measured.contestants.iter().enumerate() {
            let about = |more: serde_json::Value| {
                let mut line = json!({
                    "scene": measured.scene,
                    "triangles": measured.n_triangles,
                    "engine": contestant.name,
                    "owner": format!("{:?}", contestant.owner),
                    "promise": format!("{:?}", contestant.promise),
                });
                if let (Some(line), serde_json::Value::Object(more)) = (line.as_object_mut(), more) {
                    line.extend(more);
                }
                line
            };
            let built = contestant.built;
            let build = json!({
                "bytes": built.n_bytes,
                "build_one_thread_s": built.one_thread,
                "build_two_threads_s": built.two_threads,
            });
            self.line(&about(build))?;
            for set in &measured.sets {
                let verdict = set.verdicts[i];
                let set = json!({
                    "set": set.kind.name(),
                    "rays": set.n_rays,
                    "cpu_s": set.seconds[i].iter().map(|s| s.cpu).collect::<Vec<_>>(),
                    "wall_s": set.seconds[i].iter().map(|s| s.wall).collect::<Vec<_>>(),
                    "lost": verdict.lost,
                    "invented": verdict.invented,
                    "elsewhere": verdict.elsewhere,
                });
                self.line(&about(set))?;
            }
        }
        Ok(())
    }
}
