//! Every kernel with every part that can be chosen for it: valid, linted, within what all devices allow.

use canted_shaders::{
    BindingKind, FILES, MAX_STORAGE_BUFFERS, Shader, ShaderError, Specialisation, Stage, assemble, complaints, kernels,
};

/// What stands for numbers that hosts give.
const NUMBER: u32 = 16;

/// What every device allows: the defaults of WebGPU, but for storage buffers.
const MOST_INVOCATIONS: u32 = 256;
const MOST_WORKGROUP_BYTES: u32 = 16_384;

/// Choices of what a kernel leaves open, for a part `name` among the files of `shared/name/`: so many that each file is in one.
///
/// All combinations would be thousands.
fn is_helper(name: &str) -> bool {
    name == "alternatives/traverse/parents"
}

fn choices(kernel: &str) -> Vec<Specialisation> {
    let mut n_choices = 1;
    let mut all = vec![];
    while all.len() < n_choices {
        let mut chosen = Specialisation::none();
        while let Err(error) = assemble(kernel, &chosen) {
            let ShaderError::NotChosen { what, .. } = error else { panic!("{error}") };
            let folders = [format!("shared/{what}/"), format!("alternatives/{what}/")];
            // Alpha is a matter of surfaces, which are no part of tracing.
            let only_traces = kernel.starts_with("trace/") || ["check/moving", "check/triangle"].contains(&kernel);
            let is_apart = |name: &str| only_traces && name == "shared/mask/alpha";
            let is_choice = |name: &str| folders.iter().any(|folder| name.starts_with(folder)) && !is_helper(name);
            let files = FILES.iter().map(|(name, _)| *name).filter(|name| is_choice(name) && !is_apart(name));
            let files: Vec<_> = files.collect();
            n_choices = n_choices.max(files.len());
            chosen = match files.get(all.len() % files.len().max(1)) {
                Some(file) => chosen.part(&what, file),
                None => chosen.number(&what, NUMBER),
            };
        }
        all.push(chosen);
    }
    all
}

#[test]
fn every_kernel_is_valid_and_fits_every_device() {
    for kernel in kernels() {
        for chosen in choices(kernel) {
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
                assert!(n_storage <= MAX_STORAGE_BUFFERS as usize, "{kernel}: {n_storage} storage buffers");
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
        .flat_map(|kernel| choices(kernel).into_iter().map(move |chosen| (kernel, chosen)))
        .flat_map(|(kernel, chosen)| complaints(kernel, &chosen).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
