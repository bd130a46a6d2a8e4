//! Tasks of this workspace: `cargo xtask TASK`.
//!
//! One file per task. Exit code 1: the task found a problem; 2: it could not run.
#![forbid(unsafe_code)]

mod bench;
mod browser;
mod ci;
mod circles;
mod command;
mod kernels;
mod looping;
mod pack;
mod publish;
mod python;
mod results;
mod test;
mod tidy;
mod window;

use std::{path::Path, process::ExitCode};

use anyhow::{Context, Result};

use publish::Outcome;

const USAGE: &str = "usage: cargo xtask TASK

  test              run all tests; the last line counts them
  ci                run all checks: formatting, tidy, lints, documentation, features, packages, tests
  packages          check every package as it would be uploaded
  wheel             build the Python packages into target/wheels; needs Python 3.9 or newer
  window            build `canted view` with its window in target/view, and test it on a virtual X server; needs Xvfb, xdotool, xwd
  browser [test]    build the example page into target/browser/page and serve it, or run it in headless Chromium
  tidy              check rules that formatters and lints do not cover
  loop OUT FPS PNG...  join frames into an animated PNG for documents
  fixtures [DIR]    write the procedural scenes as files [default: target/fixtures]

What measures prints its result; with --keep it records it in benches/results. --peers adds Embree and tinybvh:

  bench [ARGS]      measure speed: nodes, kinds, wide, motion, picture, bodies, curves [default: all]; --rounds N, --scenes A,B, --engines A,B,
                    --quick, --seed N; --device gpu|NAME measures that adapter only, compared with the CPU; --chapters A,B some of it
  bench kinds --fresh [SEED]   kinds whose forms a seed draws, a new one unless it is given; --models FOLDER measures files
  bench claims      measure what README's table states, and fail if a figure is more than 5 % too high
  bench --peers trees  visits a ray of our trees and of Embree's, and our loop over both; --scenes names kinds
  bench tiles [--triangles N]  write a store of tiles in the folder of temporary files, and trace rays through it [default: 1e7]
  report [ARGS]     measure every choice and write target/report: boxes, kernels, sources, unused [default: all]; --quick
  kernels           compile every kernel with Mesa's RADV, without a device, and compare registers and spills with the recorded table;
                    --json FILE writes the list
  pack-device [DIR] write a folder that measures and tests a GPU on a machine without Rust [default: target/pack-device]
  results           write benches/RESULTS.md from benches/results/record.json
  python [RAYS [ROUNDS]]  measure the Python package and its peers: benches/PYTHON.md
  grazing           trace grazing rays; --rays N [default: 10 million]
  grazing-device    trace them on a device; --rays N for each BVH [default: 1 million]
  watertight        trace rays at edges of closed meshes; --rays N [default: 100 million]
  extremes          test every numerical promise; --effort N multiplies the inputs
  fuzz              read mutated files with every reader; --minutes N [default: 1], --seed N";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let outcome = match args[..] {
        ["test"] => test::run(),
        ["ci"] => ci::run(),
        ["packages"] => packages(),
        ["wheel"] => python::wheel(),
        ["python", ref args @ ..] => python::measure(args),
        ["window"] => window::run(),
        ["browser"] => browser::run(),
        ["browser", "test"] => browser::test_alone(),
        ["tidy"] => tidy::run(),
        ["bench", ref args @ ..] => bench::run(args),
        ["report", ref args @ ..] => bench::report(args),
        ["kernels", ref args @ ..] => kernels::run(args),
        ["pack-device"] => pack::run("target/pack-device".as_ref()),
        ["pack-device", dir] => pack::run(dir.as_ref()),
        ["results"] => results::run(),
        ["loop", out, fps, ref frames @ ..] => looping::run(out.as_ref(), fps, frames),
        ["fixtures"] => fixtures(&command::root().join("target/fixtures")),
        ["fixtures", dir] => fixtures(dir.as_ref()),
        [name, ref args @ ..] => bench::Long::named(name).with_context(|| USAGE).and_then(|long| long.run(args)),
        [] => Err(anyhow::anyhow!("{USAGE}")),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            command::warn(&format!("{error:#}"));
            ExitCode::from(2)
        }
    }
}

/// Checks the packages; what is wrong is said.
fn packages() -> Result<bool> {
    match publish::dry_run()? {
        Outcome::Well => Ok(true),
        // cargo has said it.
        Outcome::Faulty(_) => Ok(false),
        Outcome::Undecided(reason) => anyhow::bail!("the packages cannot be checked: {reason}"),
    }
}

/// Writes every procedural scene into `dir` and prints the paths.
fn fixtures(dir: &Path) -> Result<bool> {
    let paths = [canted_fixtures::write_all, canted_fixtures::write_strands]
        .into_iter()
        .map(|write| write(dir).with_context(|| format!("cannot write into {}", dir.display())))
        .collect::<Result<Vec<_>>>()?
        .concat();
    paths.iter().for_each(|path| command::say(&path.display().to_string()));
    Ok(true)
}
