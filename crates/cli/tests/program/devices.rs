//! `canted devices`: the CPU always, adapters where there are any.

use crate::support::Folder;

#[test]
fn the_cpu_is_always_there_and_every_adapter_says_what_it_is() {
    let folder = Folder::new();
    let json = folder.run("devices --json").done().json();
    assert!(json["cpu"]["threads"].as_u64().unwrap() > 0);
    for adapter in json["adapters"].as_array().unwrap() {
        assert!(!adapter["name"].as_str().unwrap().is_empty());
        assert_eq!(adapter["is_software"].as_bool().unwrap(), adapter["kind"] == "software");
    }
    let text = folder.run("devices").done().stdout;
    assert!(text.starts_with("cpu ") && text.contains("--device auto takes "), "{text}");
}
