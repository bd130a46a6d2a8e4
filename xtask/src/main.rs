//! Tasks of this workspace: `cargo xtask TASK`.
//!
//! One file per task. Exit code 1: the task found a problem; 2: it could not run.
#![forbid(unsafe_code)]

mod agree;
mod bench;
mod browser;
mod ci;
mod command;
mod driver;
mod figures;
mod fixtures;
mod looping;
mod png;
mod publish;
mod python;
mod record;
mod report;
mod tables;
mod test;
mod tidy;
mod window;
mod workspace;

use std::process::ExitCode;

use publish::Outcome;

const USAGE: &str = "usage: cargo xtask TASK

  test              run all tests; the last line counts them
  ci                run all checks: formatting, tidy, lints, documentation, features, packages, tests
  packages          check every package as it would be uploaded
  wheel             build the Python packages into target/wheels; needs Python 3.9 or newer
  python [RAYS [ROUNDS]]  measure the Python package and its peers into benches/PYTHON.md, and fill the tables
  window            build `canted view` with its window in target/view, and test it on a virtual X server; needs Xvfb, xdotool, xwd
  browser [test]    build the example page into target/browser/page and serve it, or run it in headless Chromium
  tidy              check style rules that formatters and lints do not cover
  tables            fill the measured tables of README.md and docs from benches/RESULTS.md
  bench [ARGS]      run benchmarks and write benches/RESULTS.md: load, build, trace, picture, textures, bias, noise,
                    wide, growth, kinds, costs; --rounds N, --scenes A,B, --engines A,B, --quick, --max-log2 N, --seed N,
                    --peers (Embree, tinybvh); --device gpu|NAME measures that adapter only, beside the CPU
  report [ARGS]     compare all choices and write target/report; --quick, chapter names, --peers,
                    --keep (into benches/RESULTS.md and benches/report.json)
  agree A B         compare two report.json, e.g. of a quick and a full run, within their spreads
  grazing [ARGS]    trace grazing rays and write tests/GRAZING.md; --rays N [default: 10 million]
  grazing-device [ARGS]  trace them on a device and write tests/GRAZING_DEVICE.md; --rays N for each BVH [default: 1 million]
  watertight [ARGS] trace rays at edges of closed meshes and write tests/WATERTIGHT.md; --rays N [default: 100 million]
  extremes [ARGS]   test every numerical promise and write tests/EXTREMES.md; --effort N multiplies the inputs, --peers
  fuzz [ARGS]       read mutated files with every reader and write tests/FUZZ.md; --minutes N [default: 1], --seed N
  loop OUT FPS PNG...  join frames into an animated PNG for documents
  fixtures [DIR]    write the procedural scenes as files [default: target/fixtures]";

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
        ["tables"] => tables::run(),
        ["bench", ref args @ ..] => bench::run(args),
        ["report", ref args @ ..] => report::run(args),
        ["agree", a, b] => agree::run(a.as_ref(), b.as_ref()),
        ["grazing", ref args @ ..] => record::GRAZING.run(args),
        ["grazing-device", ref args @ ..] => record::GRAZING_DEVICE.run(args),
        ["watertight", ref args @ ..] => record::WATERTIGHT.run(args),
        ["extremes", ref args @ ..] => record::EXTREMES.run(args),
        ["fuzz", ref args @ ..] => record::FUZZ.run(args),
        ["loop", out, fps, ref frames @ ..] => looping::run(out.as_ref(), fps, frames),
        ["fixtures"] => fixtures::run(&workspace::root().join("target/fixtures")),
        ["fixtures", dir] => fixtures::run(dir.as_ref()),
        _ => Err(anyhow::anyhow!("{USAGE}")),
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
fn packages() -> anyhow::Result<bool> {
    match publish::dry_run()? {
        Outcome::Well => Ok(true),
        // cargo has said it.
        Outcome::Faulty(_) => Ok(false),
        Outcome::Undecided(reason) => anyhow::bail!("the packages cannot be checked: {reason}"),
    }
}
