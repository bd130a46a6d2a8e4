//! Every kernel with every part that can be chosen for it: valid, linted, within what all devices allow.

use canted_shaders::{BindingKind, FILES, Shader, ShaderError, Specialisation, Stage, assemble, complaints, kernels};

/// What stands for numbers that hosts give.
const NUMBER: u32 = 16;

/// What every device allows: the defaults of WebGPU, and the storage buffers that the program asks for.
const MOST_INVOCATIONS: u32 = 256;
const MOST_WORKGROUP_BYTES: u32 = 16_384;
const MOST_STORAGE_BUFFERS: usize = 24;

/// All choices that a kernel leaves open: for a part `name` each file of `shared/name/`.
fn choices(kernel: &str, chosen: Specialisation) -> Vec<Specialisation> {
    match assemble(kernel, &chosen) {
        Err(ShaderError::NotChosen { what, .. }) => {
            let folder = format!("shared/{what}/");
            let files: Vec<_> = FILES.iter().map(|(name, _)| *name).filter(|name| name.starts_with(&folder)).collect();
            if files.is_empty() {
                return choices(kernel, chosen.number(&what, NUMBER));
            }
            files.into_iter().flat_map(|file| choices(kernel, chosen.clone().part(&what, file))).collect()
        }
        Err(error) => panic!("{error}"),
        Ok(_) => vec![chosen],
    }
}

#[test]
fn every_kernel_is_valid_and_fits_every_device() {
    for kernel in kernels() {
        for chosen in choices(kernel, Specialisation::none()) {
            let shader = Shader::new(kernel, &chosen).unwrap_or_else(|error| panic!("{error}"));
            assert!(!shader.entries.is_empty(), "{kernel} has no entry point");
            for entry in &shader.entries {
                let is_compute = entry.stage == Stage::Compute;
                assert_eq!(is_compute, entry.name == "main", "{kernel}: {} is no name of its stage", entry.name);
                let invocations: u32 = entry.workgroup_size.iter().product();
                assert!(invocations <= MOST_INVOCATIONS, "{kernel}: {invocations} invocations");
                assert!(
                    entry.workgroup_bytes <= MOST_WORKGROUP_BYTES,
                    "{kernel}: {} bytes shared",
                    entry.workgroup_bytes
                );
                let is_storage = |kind: &BindingKind| matches!(kind, BindingKind::Storage { .. });
                let n_storage = entry.bindings.iter().filter(|binding| is_storage(&binding.kind)).count();
                assert!(n_storage <= MOST_STORAGE_BUFFERS, "{kernel}: {n_storage} storage buffers");
                let mut names: Vec<_> = entry.bindings.iter().map(|binding| &binding.name).collect();
                names.sort();
                names.dedup();
                assert_eq!(names.len(), entry.bindings.len(), "{kernel}: two bindings of one name");
            }
        }
    }
}

#[test]
fn every_kernel_passes_the_lint() {
    let found: Vec<String> = kernels()
        .flat_map(|kernel| choices(kernel, Specialisation::none()).into_iter().map(move |chosen| (kernel, chosen)))
        .flat_map(|(kernel, chosen)| complaints(kernel, &chosen).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
