//! What compilers let pass and devices do not.

mod numbers;
mod uniform;

use naga::{Barrier, Block, Function, Module, Span, Statement};

use crate::{ShaderError, Specialisation, assemble, reflection};

/// What is wrong with a kernel: sentences with the line.
///
/// * A barrier that not all invocations of a work-group reach.
/// * A `storageBarrier`: what one work-group writes, others see in a later dispatch, and never by a barrier.
/// * In kernels of `trace/`, what can make NaN or infinity: see `numbers`.
///
/// # Errors
/// A kernel that cannot be made.
pub fn complaints(name: &str, chosen: &Specialisation) -> Result<Vec<String>, ShaderError> {
    of_text(name, &assemble(name, chosen)?, chosen.overrides())
}

/// The same of a text, under the name of a kernel.
fn of_text(name: &str, source: &str, overrides: &[(String, f64)]) -> Result<Vec<String>, ShaderError> {
    let (module, _) = reflection::specialised(name, source, overrides)?;
    let at = |span: Span| span.location(source).line_number;
    let mut complaints = vec![];
    for stray in uniform::stray_barriers(&module) {
        let line = at(stray.span);
        complaints.push(format!("{name}: not all invocations of a work-group reach the barrier in line {line}"));
    }
    for span in storage_barriers(&module) {
        let line = at(span);
        complaints.push(format!(
            "{name}: line {line} fences storage, which other work-groups do not see before a later dispatch"
        ));
    }
    if name.starts_with("trace/") {
        complaints.extend(
            numbers::wild(&module).into_iter().map(|(span, what)| format!("{name}: line {}: {what}", at(span))),
        );
    }
    Ok(complaints)
}

/// All functions, entry points among them.
fn functions(module: &Module) -> impl Iterator<Item = &Function> {
    let points = module.entry_points.iter().map(|point| &point.function);
    module.functions.iter().map(|(_, function)| function).chain(points)
}

fn storage_barriers(module: &Module) -> Vec<Span> {
    let mut found = vec![];
    for function in functions(module) {
        visit(&function.body, &mut |statement, span| {
            if let Statement::ControlBarrier(kind) | Statement::MemoryBarrier(kind) = statement
                && kind.contains(Barrier::STORAGE)
            {
                found.push(span);
            }
        });
    }
    found
}

/// Calls `each` with every statement of a block and of the blocks in it.
fn visit(block: &Block, each: &mut impl FnMut(&Statement, Span)) {
    for (statement, span) in block.span_iter() {
        each(statement, *span);
        match statement {
            Statement::Block(inner) => visit(inner, each),
            Statement::If { accept, reject, .. } => {
                visit(accept, each);
                visit(reject, each);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| visit(&case.body, each)),
            Statement::Loop { body, continuing, .. } => {
                visit(body, each);
                visit(continuing, each);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is wrong with a kernel of this folder whose third line is `declared` and whose body begins in the fifth.
    fn found_in(folder: &str, declared: &str, body: &str) -> Vec<String> {
        let text = format!(
            "@group(0) @binding(0) var<storage, read_write> words: array<u32>;
             var<workgroup> both: array<u32, 64>;
             {declared}
             @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {{
             {body} }}"
        );
        of_text(&format!("{folder}/flawed"), &text, &[]).unwrap()
    }

    fn found(declared: &str, body: &str) -> Vec<String> {
        found_in("build", declared, body)
    }

    #[test]
    fn fences_between_work_groups_are_found() {
        let fence_in = |line: u32| {
            format!(
                "build/flawed: line {line} fences storage, which other work-groups do not see before a later dispatch"
            )
        };
        for body in [
            "words[i] = 1u;\nstorageBarrier();\nboth[i] = words[i + 64u];",
            "for (var k = 0u; k < 3u; k++) {\nstorageBarrier(); }",
            "if arrayLength(&words) > 3u { words[i] = 1u; } else {\nstorageBarrier(); }",
            "switch arrayLength(&words) { case 1u: {\nstorageBarrier(); } default: {} }",
        ] {
            assert_eq!(found("", body), [fence_in(6)], "{body}");
        }
        let fence = "fn fence() { storageBarrier(); }";
        assert_eq!(found(fence, "words[i] = 1u; fence(); both[i] = words[i + 64u];"), [fence_in(3)]);
    }

    #[test]
    fn barriers_of_what_a_work_group_shares_are_sound() {
        for body in [
            "words[i] = 1u;\nworkgroupBarrier();\nboth[i] = words[63u - i];",
            "both[i] = words[i]; meet(); words[i] = both[63u - i];",
            "words[i] = workgroupUniformLoad(&both[3]);",
        ] {
            assert_eq!(found("fn meet() { workgroupBarrier(); }", body), [""; 0], "{body}");
        }
    }

    #[test]
    fn every_rule_names_its_line() {
        let stray = "build/flawed: not all invocations of a work-group reach the barrier in line 5";
        assert_eq!(found("", "if i < 3u { workgroupBarrier(); }"), [stray]);
        let quotient = "words[i] = u32(1.0 / f32(i));";
        let wild = "trace/flawed: line 5: a quotient outside of a function that guards its divisor";
        assert_eq!(found_in("trace", "", quotient), [wild]);
        assert_eq!(found("", quotient), [""; 0]);
    }
}
