//! Runs the program in a temporary folder.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Stdio},
};

use serde_json::Value;

/// Two triangles at depth 0 and one at depth 1, in two objects and three groups of two materials.
pub(crate) const SMALL: &str = "\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\n\
o floor\ng a\nf 1 2 3 4\no roof\ng b\nf 5 6 7\n";

/// The values of `--builder`.
pub(crate) const BUILDERS: &[&str] = &[
    "auto",
    "sah",
    "sbvh",
    "ploc",
    "hlbvh",
    "lbvh",
    "midpoint",
    "median",
    #[cfg(feature = "baseline")]
    "obvhs",
];

/// A temporary folder, removed on drop.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    /// An empty folder.
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A folder that holds [`SMALL`] as `small.obj`.
    pub(crate) fn with_small() -> Self {
        let folder = Self::new();
        folder.write("small.obj", SMALL);
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub(crate) fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The names of all files, including hidden ones, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The program with the words of `line` as arguments, in this folder.
    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_canted"));
        command.args(line.split_whitespace()).current_dir(self.0.path()).stdin(Stdio::null());
        // Mesa's device selection reports its absence as an error, unless the program prevents it.
        command.env_remove("XDG_RUNTIME_DIR");
        // Not the caches of whoever runs the tests.
        command.env("XDG_CACHE_HOME", std::env::temp_dir().join("canted-test-caches"));
        command
    }

    /// Runs the program to its end.
    #[track_caller]
    pub(crate) fn run(&self, line: &str) -> Run {
        self.run_with(line, &[])
    }

    /// As [`Folder::run`], with environment variables.
    #[track_caller]
    pub(crate) fn run_with(&self, line: &str, variables: &[(&str, &str)]) -> Run {
        let output = self.command(line).envs(variables.iter().copied()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        let (stdout, stderr) = (text(output.stdout), text(output.stderr));
        assert!(!stderr.contains("panicked"), "{line}: {stderr}");
        Run { line: line.to_owned(), code: output.status.code(), stdout, stderr }
    }
}

/// The result of a run.
pub(crate) struct Run {
    line: String,
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Run {
    /// Asserts exit code 0.
    #[track_caller]
    pub(crate) fn done(self) -> Self {
        assert_eq!(self.code, Some(0), "{}: {}", self.line, self.stderr);
        self
    }

    /// Asserts exit code 2, no standard output, and one error that contains each of `words`.
    #[track_caller]
    pub(crate) fn refused(self, words: &[&str]) -> Self {
        let Self { line, code, stdout, stderr } = &self;
        assert_eq!(*code, Some(2), "{line}: {stdout}{stderr}");
        assert_eq!(stdout, "", "{line}");
        let errors: Vec<&str> = stderr.split("error: ").skip(1).collect();
        assert_eq!(errors.len(), 1, "{line}: {stderr}");
        for word in words {
            assert!(errors[0].contains(word), "{line}: '{word}' is not in: {stderr}");
        }
        self
    }

    /// The number of warnings on standard error.
    pub(crate) fn n_warnings(&self) -> usize {
        self.stderr.lines().filter(|line| line.starts_with("warning: ")).count()
    }

    /// Standard output as one JSON value.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{}: {error}: {}", self.line, self.stdout))
    }
}

/// The numbers of each row after the header, which is checked.
#[track_caller]
pub(crate) fn rows<T: std::str::FromStr>(csv: &str, header: &str) -> Vec<Vec<T>> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some(header));
    let number = |field: &str| field.parse().unwrap_or_else(|_| panic!("'{field}' is not a number"));
    lines.map(|line| line.split(',').map(number).collect()).collect()
}

/// A linear congruential generator with Knuth's constants, of which only the high bits are used.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// An integer from 0 to `n - 1`.
    pub(crate) fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(n)).unwrap_or(0)
    }

    /// An integer from `-n` to `n`.
    pub(crate) fn around_zero(&mut self, n: u32) -> i32 {
        i32::try_from(self.below(2 * n + 1)).unwrap_or(0) - i32::try_from(n).unwrap_or(0)
    }

    /// A point whose coordinates are integers from `-n` to `n`.
    pub(crate) fn point(&mut self, n: u32) -> [i32; 3] {
        std::array::from_fn(|_| self.around_zero(n))
    }
}
