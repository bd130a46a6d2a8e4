//! `cargo xtask kernels`: instructions, registers, spills and scratch memory of the kernels, from a driver that compiles without a device.
//!
//! Mesa's RADV does so for any family of AMD's devices; `benches/kernels` asks it. A machine without a GPU sees what a change costs:
//! `cargo xtask ci` compares the numbers with the recorded ones, which belong to one version of Mesa.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use crate::{
    bench::KEEP,
    command::{self, cargo, say, succeeds},
};

/// The recorded table, in the form of `--json`.
const RECORD: &str = "benches/results/kernels.json";

/// RDNA 3, and GCN 5, which has other limits.
const FAMILIES: [&str; 2] = ["gfx1100", "vega10"];

/// How much longer than recorded a kernel may become before `ci` fails, in percent.
const TOLERANCE: u64 = 2;

/// A kernel in one variant, compiled for one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    kernel: String,
    /// Choices for its slots.
    variant: String,
    family: String,
    instructions: u64,
    vgprs: u64,
    spilled_vgprs: u64,
    spilled_sgprs: u64,
    scratch_bytes: u64,
    code_bytes: u64,
    /// Name and version of the driver.
    driver: String,
}

impl Row {
    /// Waves of 64 lanes that a SIMD holds at once, as far as vector registers decide: what more registers cost.
    fn waves(&self) -> u64 {
        let (registers, most) = if self.family == FAMILIES[0] { (768, 16) } else { (256, 10) };
        most.min(registers / self.vgprs.max(1))
    }
}

/// What `benches/kernels` prints.
#[derive(Deserialize)]
#[serde(untagged)]
enum Measured {
    Rows(Vec<Row>),
    Missing { missing: String },
}

/// Result of a comparison with the recorded table.
pub(crate) enum Outcome {
    Well,
    /// With a line for each kernel.
    Costlier(String),
    Undecided(String),
}

/// Prints the table, writes it where `args` say, and compares it with the recorded one. Returns whether no kernel is costlier.
pub(crate) fn run(args: &[&str]) -> Result<bool> {
    let (mut file, mut keeps) = (None, false);
    let mut rest = args.iter();
    while let Some(&arg) = rest.next() {
        match arg {
            "--json" => file = Some(*rest.next().context("--json needs a file")?),
            KEEP => keeps = true,
            _ => bail!("unknown argument '{arg}'; kernels takes --json FILE and {KEEP}"),
        }
    }
    let rows = match measured(&FAMILIES, &[])? {
        Measured::Rows(rows) => rows,
        Measured::Missing { missing } => {
            say(&format!("skipped: {missing}"));
            return Ok(true);
        }
    };
    table(&rows).iter().for_each(|line| say(line));
    if let Some(file) = file {
        fs::write(file, list(&rows)?).with_context(|| format!("cannot write {file}"))?;
        say(&format!("wrote {file}"));
    }
    if keeps {
        command::write(RECORD, &list(&rows)?)?;
        return Ok(true);
    }
    match compared(&recorded()?, &rows) {
        Outcome::Well => say(&format!("no kernel costs more than in {RECORD}")),
        Outcome::Undecided(reason) => say(&format!("not compared: {reason}")),
        Outcome::Costlier(lines) => {
            say(&lines);
            return Ok(false);
        }
    }
    Ok(true)
}

/// Compares kernels of the first family with the recorded table, without the exact ones for instances: these and other families take most of the minutes,
/// and most of what becomes costlier there does so elsewhere, too; `cargo xtask kernels` shows them.
pub(crate) fn check() -> Result<Outcome> {
    Ok(match measured(&FAMILIES[..1], &["--quick"])? {
        Measured::Rows(rows) => compared(&recorded()?, &rows),
        Measured::Missing { missing } => Outcome::Undecided(missing),
    })
}

/// Compiles kernels for each of `families`, those that the arguments of the program ask for.
fn measured(families: &[&str], args: &[&str]) -> Result<Measured> {
    // With the features of the workspace: for the program alone, naga would be compiled once more.
    ensure!(
        succeeds(&mut cargo(&["build", "--quiet", "--workspace", "--bin", "canted-kernels"]))?,
        "canted-kernels does not build"
    );
    let mut all = vec![];
    for family in families {
        let mut command = command::program(command::built("canted-kernels"), args);
        with_radv(&mut command);
        // Drivers keep what they compiled, without its statistics.
        command.env("RADV_FORCE_FAMILY", family).env("MESA_SHADER_CACHE_DISABLE", "true");
        let output = command.stderr(Stdio::inherit()).output().context("cannot start canted-kernels")?;
        ensure!(output.status.success(), "canted-kernels failed for {family}: {}", output.status);
        match serde_json::from_slice(&output.stdout).context("canted-kernels wrote something else than its list")? {
            Measured::Rows(rows) => all.extend(rows),
            missing @ Measured::Missing { .. } => return Ok(missing),
        }
    }
    Ok(Measured::Rows(all))
}

/// Makes RADV the only driver, unless the caller has chosen drivers.
fn with_radv(command: &mut Command) {
    // The second name is that of older loaders.
    const CHOSEN: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];
    if CHOSEN.iter().any(|name| env::var_os(name).is_some()) {
        return;
    }
    if let Some(manifest) = radv_manifest() {
        command.envs(CHOSEN.map(|name| (name, &manifest)));
    }
}

/// The file that tells the Vulkan loader where RADV is.
fn radv_manifest() -> Option<PathBuf> {
    let data = env::var_os("XDG_DATA_DIRS").unwrap_or_else(|| "/usr/local/share:/usr/share".into());
    let folders = env::split_paths(&data).chain([PathBuf::from("/etc")]).map(|folder| folder.join("vulkan/icd.d"));
    let is_radv = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Of two word lengths, that of this program.
        name.starts_with("radeon_icd") && (!name.contains("i686") || cfg!(target_arch = "x86"))
    };
    folders.flat_map(|folder| command::files_with(&folder, "json")).find(is_radv)
}

fn recorded() -> Result<Vec<Row>> {
    let path = command::root().join(RECORD);
    read(&path).with_context(|| format!("cannot read {}", path.display()))
}

fn read(path: &Path) -> Result<Vec<Row>> {
    Ok(serde_json::from_str(&fs::read_to_string(path)?)?)
}

/// A JSON list with one kernel on each line.
fn list(rows: &[Row]) -> Result<String> {
    let lines = rows.iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("[\n{}\n]\n", lines.join(",\n")))
}

/// A table, below the name of the driver.
fn table(rows: &[Row]) -> Vec<String> {
    let mut lines = vec![
        rows.first().map_or_else(String::new, |row| format!("{}, without a device", row.driver)),
        String::new(),
        "| kernel | variant | family | instructions | VGPRs | spilled VGPRs | spilled SGPRs | scratch, bytes | code, bytes |".to_owned(),
        "|---|---|---|---:|---:|---:|---:|---:|---:|".to_owned(),
    ];
    lines.extend(rows.iter().map(|row| {
        let Row { kernel, variant, family, instructions, vgprs, spilled_vgprs, spilled_sgprs, scratch_bytes, .. } = row;
        let numbers = [instructions, vgprs, spilled_vgprs, spilled_sgprs, scratch_bytes, &row.code_bytes];
        let numbers = numbers.map(u64::to_string).join(" | ");
        format!("| {kernel} | {variant} | {family} | {numbers} |")
    }));
    lines
}

/// What costs more than recorded: a kernel that is longer by more than the tolerance, of which fewer waves fit, or that spills or uses more memory.
fn compared(recorded: &[Row], rows: &[Row]) -> Outcome {
    let versions = [recorded, rows].map(|rows| rows.first().map(|row| row.driver.clone()).unwrap_or_default());
    if versions[0] != versions[1] {
        let [old, new] = versions;
        return Outcome::Undecided(format!("{RECORD} is of {old}, this is {new}"));
    }
    let key = |row: &Row| (row.kernel.clone(), row.variant.clone(), row.family.clone());
    let known: BTreeMap<_, _> = recorded.iter().map(|row| (key(row), row)).collect();
    let mut lines = vec![];
    for row in rows {
        let name = format!("{} ({}) on {}", row.kernel, row.variant, row.family);
        let Some(old) = known.get(&key(row)) else {
            lines.push(format!("{name}: not recorded"));
            continue;
        };
        let is_longer = 100 * row.instructions > (100 + TOLERANCE) * old.instructions;
        for (what, is_more, old, new) in [
            ("instructions", is_longer, old.instructions, row.instructions),
            ("VGPRs, with which fewer waves fit", row.waves() < old.waves(), old.vgprs, row.vgprs),
            ("spilled VGPRs", row.spilled_vgprs > old.spilled_vgprs, old.spilled_vgprs, row.spilled_vgprs),
            ("spilled SGPRs", row.spilled_sgprs > old.spilled_sgprs, old.spilled_sgprs, row.spilled_sgprs),
            ("bytes of scratch memory", row.scratch_bytes > old.scratch_bytes, old.scratch_bytes, row.scratch_bytes),
        ] {
            if is_more {
                lines.push(format!("{name}: {new} {what}, recorded {old}"));
            }
        }
    }
    if lines.is_empty() {
        return Outcome::Well;
    }
    lines.push(format!("`cargo xtask kernels {KEEP}` records the new numbers"));
    Outcome::Costlier(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            kernel: "trace/closest".to_owned(),
            variant: "level=single".to_owned(),
            family: "gfx1100".to_owned(),
            instructions: 1000,
            vgprs: 84,
            spilled_vgprs: 3,
            spilled_sgprs: 0,
            scratch_bytes: 0,
            code_bytes: 5000,
            driver: "Mesa 22.3.6".to_owned(),
        }
    }

    fn costlier(new: Row) -> Vec<String> {
        match compared(&[row()], &[new]) {
            Outcome::Costlier(lines) => lines.lines().map(str::to_owned).collect(),
            Outcome::Well => vec![],
            Outcome::Undecided(reason) => panic!("{reason}"),
        }
    }

    #[test]
    fn costlier_kernels_are_found() {
        let name = "trace/closest (level=single) on gfx1100";
        let recorded = "`cargo xtask kernels --keep` records the new numbers";
        assert!(costlier(row()).is_empty());
        // Shorter, and longer within the tolerance.
        assert!(costlier(Row { instructions: 900, vgprs: 72, ..row() }).is_empty());
        assert!(costlier(Row { instructions: 1020, ..row() }).is_empty());
        let longer = costlier(Row { instructions: 1021, ..row() });
        assert_eq!(longer, [&format!("{name}: 1021 instructions, recorded 1000"), recorded]);
        // Nine waves fit of kernels of 80 to 85 registers.
        assert!(costlier(Row { vgprs: 85, ..row() }).is_empty());
        let wider = costlier(Row { vgprs: 96, ..row() });
        assert_eq!(wider, [&format!("{name}: 96 VGPRs, with which fewer waves fit, recorded 84"), recorded]);
        let spilled = costlier(Row { spilled_vgprs: 4, spilled_sgprs: 1, scratch_bytes: 64, ..row() });
        let line = |what: &str| format!("{name}: {what}");
        let lines =
            ["4 spilled VGPRs, recorded 3", "1 spilled SGPRs, recorded 0", "64 bytes of scratch memory, recorded 0"];
        assert_eq!(spilled[..3], lines.map(line));
        let unknown = costlier(Row { variant: "level=flat".to_owned(), ..row() });
        assert_eq!(unknown, ["trace/closest (level=flat) on gfx1100: not recorded", recorded]);
    }

    #[test]
    fn another_driver_decides_nothing() {
        let other = Row { driver: "Mesa 25.0.7".to_owned(), spilled_vgprs: 99, ..row() };
        let Outcome::Undecided(reason) = compared(&[row()], &[other]) else { panic!("it was compared") };
        assert_eq!(reason, "benches/results/kernels.json is of Mesa 22.3.6, this is Mesa 25.0.7");
    }

    #[test]
    fn the_list_is_read_back_and_has_the_fields_of_the_table() {
        let text = list(&[row(), row()]).unwrap();
        assert_eq!(serde_json::from_str::<Vec<Row>>(&text).unwrap(), [row(), row()]);
        assert_eq!(text.lines().count(), 4);
        let line = "| trace/closest | level=single | gfx1100 | 1000 | 84 | 3 | 0 | 0 | 5000 |";
        assert_eq!(table(&[row()]).last().unwrap(), line);
    }

    #[test]
    fn the_record_has_two_families_and_the_kernels_that_trace() {
        let rows = recorded().unwrap();
        for family in FAMILIES {
            for kernel in ["trace/closest", "trace/occluded", "render/path", "build/sort/count"] {
                assert!(rows.iter().any(|row| row.family == family && row.kernel == kernel), "{kernel} on {family}");
            }
        }
    }
}
