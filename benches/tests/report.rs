//! Creates a minimal report and checks its JSON, Markdown and HTML files.

mod report {
    mod browser;
    mod page;

    use std::{path::Path, process::Command, sync::LazyLock};

    use serde_json::Value;
    use tempfile::TempDir;

    /// A report created once for all tests.
    pub(crate) struct Made {
        folder: TempDir,
        pub(crate) html: String,
        pub(crate) markdown: String,
        pub(crate) json: Value,
    }

    impl Made {
        pub(crate) fn folder(&self) -> &Path {
            self.folder.path()
        }

        pub(crate) fn chapters(&self) -> &[Value] {
            self.json["chapters"].as_array().unwrap()
        }
    }

    pub(crate) static MADE: LazyLock<Made> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_canted-bench"))
            .args(["report", "--tiny", "--machine", "<machine>", "--out"])
            .arg(folder.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json = serde_json::from_str(&read("report.json")).unwrap();
        Made { html: read("index.html"), markdown: read("report.md"), json, folder }
    });
}
