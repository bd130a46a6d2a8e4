//! Variants of a kernel that together have every choice for its slots.

use crate::choice::Mask;
use crate::files::{Choice, SLOTS};
use crate::{ShaderError, ShaderName, Variant, assemble, wgsl};

/// Stands in for constants that hosts set, such as the size of a stack.
const NUMBER: u32 = 16;

/// Names of the parts that fill a slot; none for a constant.
fn parts(slot: &str) -> &'static [&'static str] {
    SLOTS.iter().find(|(known, _)| *known == slot).map_or(&[], |(_, parts)| parts)
}

/// Variants of a kernel, for checks and measurements of all kernels: every combination of choices where a kernel only traces rays, and
/// otherwise so many that each part of each slot is in one, because all combinations would be thousands.
///
/// ```
/// use canted_shaders::{choice::Level, variants, wgsl};
///
/// let all = variants(wgsl::trace::OCCLUDED)?;
/// assert!(all.iter().any(|chosen| chosen.has(Level::Moving)));
/// # Ok::<(), canted_shaders::ShaderError>(())
/// ```
///
/// # Errors
/// A choice that the kernel has no slot for.
pub fn variants(kernel: ShaderName) -> Result<Vec<Variant>, ShaderError> {
    // Alpha and faces need surfaces, which kernels that only trace do not have.
    let only_traces = kernel.as_str().starts_with("trace/")
        || [wgsl::shared::MODULE, wgsl::shared::TRAVERSE, wgsl::check::MOVING, wgsl::check::TRIANGLE].contains(&kernel);
    let fills = |slot: &str| {
        let reads_surfaces = |part: &str| {
            part.starts_with("shared/surface_curve/") || part.starts_with("shared/mask/") && part != Mask::None.part()
        };
        let usable = parts(slot).iter().copied().filter(|part| !only_traces || !reads_surfaces(part));
        usable.collect::<Vec<&'static str>>()
    };
    let mut done = vec![];
    if only_traces {
        let mut open = vec![Variant::none()];
        while let Some(chosen) = open.pop() {
            match missing(kernel, &chosen)? {
                None => done.push(chosen),
                // Reversed, so that the first choice is the next one taken.
                Some(what) => match fills(what) {
                    parts if parts.is_empty() => open.push(chosen.set(what, NUMBER)),
                    parts => open.extend(parts.iter().rev().map(|part| chosen.clone().fill(what, part))),
                },
            }
        }
        return Ok(done);
    }
    let mut n_variants = 1;
    while done.len() < n_variants {
        let mut chosen = Variant::none();
        while let Some(what) = missing(kernel, &chosen)? {
            let parts = fills(what);
            n_variants = n_variants.max(parts.len());
            chosen = match parts.get(done.len() % parts.len().max(1)) {
                Some(part) => chosen.fill(what, part),
                None => chosen.set(what, NUMBER),
            };
        }
        done.push(chosen);
    }
    Ok(done)
}

/// The first slot or constant without a choice.
fn missing(kernel: ShaderName, chosen: &Variant) -> Result<Option<&'static str>, ShaderError> {
    match assemble(kernel, chosen) {
        Ok(_) => Ok(None),
        Err(ShaderError::MissingChoice { what, .. }) => Ok(Some(what)),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::{Level, NodeKinds, Volume};

    #[test]
    fn kernels_that_trace_have_every_combination() {
        let all = variants(wgsl::trace::CLOSEST).unwrap();
        let count = |has: &dyn Fn(&Variant) -> bool| all.iter().filter(|chosen| has(chosen)).count();
        for level in [Level::Single, Level::Flat, Level::Instances, Level::Moving] {
            // All rays and listed ones, with and without counts, and wide BVHs without curves, with segments, with curves of every kind, and with patches.
            assert_eq!(count(&|chosen| chosen.has(level) && chosen.has(NodeKinds::Aligned)), 16, "{level:?}");
            assert_eq!(count(&|chosen| chosen.has(level) && chosen.has(NodeKinds::Any)), 16, "{level:?}");
            assert_eq!(count(&|chosen| chosen.has(level) && chosen.has(Volume::Obb)), 4, "{level:?}");
        }
    }
}
