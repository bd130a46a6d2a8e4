//! `canted devices`: the CPU and all adapters.

use crate::support::Folder;

#[test]
fn lists_the_cpu_and_describes_every_adapter() {
    let folder = Folder::new();
    let json = folder.run("devices --json").done().json();
    assert!(json["cpu"]["threads"].as_u64().unwrap() > 0);
    for adapter in json["adapters"].as_array().unwrap() {
        assert!(!adapter["name"].as_str().unwrap().is_empty());
        assert_eq!(adapter["is_software"].as_bool().unwrap(), adapter["kind"] == "software");
    }
    let text = folder.run("devices").done().stdout;
    assert!(text.starts_with("cpu ") && text.contains("--device auto selects "), "{text}");
}
