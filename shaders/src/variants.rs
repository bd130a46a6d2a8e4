//! Variants of a kernel that together have every choice for its slots.

use crate::{FILES, ShaderError, Variant, assemble};

/// Stands in for constants that hosts set, such as the size of a stack.
const NUMBER: u32 = 16;

/// Names of the parts that fill a slot.
fn parts(slot: &str) -> Vec<String> {
    let of_file = |(file, text): &(&'static str, &'static str)| {
        let choices = text.lines().filter_map(|line| line.strip_prefix("// choice "));
        choices.map(|choice| format!("{file}/{choice}")).collect::<Vec<_>>()
    };
    let fills = |name: &String| name.rsplit('/').nth(1) == Some(slot);
    FILES.iter().flat_map(of_file).filter(fills).collect()
}

/// Variants of a kernel, for checks and measurements of all kernels: every combination of choices where a kernel only traces rays, and
/// otherwise so many that each part of each slot is in one, because all combinations would be thousands.
///
/// ```
/// let all = canted_shaders::variants("trace/occluded")?;
/// assert!(all.iter().any(|chosen| chosen.parts().any(|part| part == ("level", "shared/level/moving"))));
/// # Ok::<(), canted_shaders::ShaderError>(())
/// ```
///
/// # Errors
/// A name without a kernel.
pub fn variants(kernel: &str) -> Result<Vec<Variant>, ShaderError> {
    // Alpha and faces need surfaces, which kernels that only trace do not have.
    let only_traces = kernel.starts_with("trace/")
        || ["shared/module", "shared/traverse", "check/moving", "check/triangle"].contains(&kernel);
    let fills = |slot: &str| {
        let mut parts = parts(slot);
        let reads_surfaces = |part: &str| {
            part.starts_with("shared/surface_curve/") || part.starts_with("shared/mask/") && part != "shared/mask/none"
        };
        parts.retain(|part| !only_traces || !reads_surfaces(part));
        parts
    };
    let mut done = vec![];
    if only_traces {
        let mut open = vec![Variant::none()];
        while let Some(chosen) = open.pop() {
            match missing(kernel, &chosen)? {
                None => done.push(chosen),
                // Reversed, so that the first choice is the next one taken.
                Some(what) => match fills(&what) {
                    parts if parts.is_empty() => open.push(chosen.number(&what, NUMBER)),
                    parts => open.extend(parts.iter().rev().map(|part| chosen.clone().part(&what, part))),
                },
            }
        }
        return Ok(done);
    }
    let mut n_variants = 1;
    while done.len() < n_variants {
        let mut chosen = Variant::none();
        while let Some(what) = missing(kernel, &chosen)? {
            let parts = fills(&what);
            n_variants = n_variants.max(parts.len());
            chosen = match parts.get(done.len() % parts.len().max(1)) {
                Some(part) => chosen.part(&what, part),
                None => chosen.number(&what, NUMBER),
            };
        }
        done.push(chosen);
    }
    Ok(done)
}

/// The first slot or constant without a choice.
fn missing(kernel: &str, chosen: &Variant) -> Result<Option<String>, ShaderError> {
    match assemble(kernel, chosen) {
        Ok(_) => Ok(None),
        Err(ShaderError::MissingChoice { what, .. }) => Ok(Some(what)),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_that_trace_have_every_combination() {
        let all = variants("trace/closest").unwrap();
        let has = |chosen: &Variant, want: (&str, &str)| chosen.parts().any(|part| part == want);
        for level in ["single", "flat", "instances", "moving"] {
            let level = format!("shared/level/{level}");
            for kinds in [
                ("node_kinds", "shared/bvh/node_kinds/aligned"),
                ("node_kinds", "shared/bvh/node_kinds/any"),
                ("volume", "shared/bvh/volume/obb"),
            ] {
                let n = all.iter().filter(|chosen| has(chosen, kinds) && has(chosen, ("level", &level))).count();
                // With and without counts, and wide BVHs without curves, with segments, and with curves of every kind.
                assert_eq!(n, if kinds.0 == "volume" { 2 } else { 6 }, "{kinds:?}, {level}");
            }
        }
        assert!(variants("no/kernel").is_err());
    }
}
