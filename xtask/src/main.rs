//! Tasks of this workspace: `cargo xtask TASK`.
//!
//! One file a task. A task that finds something wrong exits with 1, one that cannot run with 2.
#![forbid(unsafe_code)]

mod agree;
mod bench;
mod ci;
mod claims;
mod command;
mod count;
mod driver;
mod fixtures;
mod kept;
mod png;
mod report;
mod test;
mod tidy;
mod workspace;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask TASK

  test              run every test of the workspace; the last line counts them
  ci                everything that is checked before a change is taken
  tidy              the rules of style that a program can check
  bench [ARGS]      measure, and write into benches/RESULTS.md; load, build, trace, picture, textures, bias, noise,
                    wide, growth, costs, --rounds N, --scenes A,B, --engines A,B, --quick, --max-log2 N,
                    --peers (Embree, tinybvh); --device gpu|NAME measures an adapter alone
  report [ARGS]     measure what each choice costs and buys, and write target/report; --quick, names of chapters, --peers,
                    --keep (into benches/RESULTS.md and benches/report.json)
  agree A B         whether two report.json, as of a quick and a full run, agree within their spreads on what both measured
  grazing [ARGS]    shoot grazing rays at wide trees, and write into tests/GRAZING.md; --rays N, 10 million without
  watertight [ARGS] shoot rays at the edges of closed meshes, and write into tests/WATERTIGHT.md; --rays N, 100 million without
  extremes [ARGS]   put every promise to the test, and write into tests/EXTREMES.md; --effort N times the inputs, --peers
  fuzz [ARGS]       read changed files by every reader, and write into tests/FUZZ.md; --minutes N, one without, --seed N
  fixtures [DIR]    write the procedural scenes, into target/fixtures without DIR";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let is_well = match args[..] {
        ["test"] => test::run(),
        ["ci"] => ci::run(),
        ["tidy"] => tidy::run(),
        ["bench", ref args @ ..] => bench::run(args),
        ["report", ref args @ ..] => report::run(args),
        ["agree", a, b] => agree::run(a.as_ref(), b.as_ref()),
        ["grazing", ref args @ ..] => kept::GRAZING.run(args),
        ["watertight", ref args @ ..] => kept::WATERTIGHT.run(args),
        ["extremes", ref args @ ..] => kept::EXTREMES.run(args),
        ["fuzz", ref args @ ..] => kept::FUZZ.run(args),
        ["fixtures"] => fixtures::run(&workspace::root().join("target/fixtures")),
        ["fixtures", dir] => fixtures::run(dir.as_ref()),
        _ => Err(anyhow::anyhow!("{USAGE}")),
    };
    match is_well {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            command::warn(&format!("{error:#}"));
            ExitCode::from(2)
        }
    }
}
