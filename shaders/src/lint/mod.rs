//! Checks for errors that compilers accept and devices do not.

mod numbers;
mod uniform;

use naga::{Barrier, Block, Function, Module, Span, Statement};

use crate::{ShaderError, ShaderName, Variant, assemble, reflection};

/// Findings in a kernel, as sentences with line numbers:
///
/// * A barrier that not all invocations of a work-group reach.
/// * A `storageBarrier` whose line does not say "Shared in this work-group". Other work-groups see writes only in a later dispatch, never
///   after a barrier.
/// * In kernels of `trace/`, operations that can produce NaN or infinity; see `numbers`.
///
/// # Errors
/// The kernel cannot be assembled.
pub fn lint(name: ShaderName, chosen: &Variant) -> Result<Vec<String>, ShaderError> {
    of_text(name.as_str(), &assemble(name, chosen)?, chosen.overrides())
}

/// What a line with a `storageBarrier` says if only its own work-group reads what was written.
const SHARED: &str = "// Shared in this work-group";

/// Findings in a text, under the name of a kernel.
fn of_text(name: &str, source: &str, overrides: &[(&'static str, f64)]) -> Result<Vec<String>, ShaderError> {
    let (module, _) = reflection::specialized(name, source, overrides)?;
    let at = |span: Span| span.location(source).line_number;
    let mut findings = vec![];
    for found in uniform::divergent_barriers(&module) {
        let line = at(found.span);
        findings.push(format!("{name}: some invocations of a work-group may not reach the barrier in line {line}"));
    }
    for span in storage_barriers(&module) {
        let line = at(span);
        if source.lines().nth(line as usize - 1).is_some_and(|text| text.contains(SHARED)) {
            continue;
        }
        findings.push(format!(
            "{name}: storageBarrier in line {line}: other work-groups see writes only in a later dispatch"
        ));
    }
    if name.starts_with("trace/") {
        findings.extend(
            numbers::find_unsafe(&module).into_iter().map(|(span, what)| format!("{name}: line {}: {what}", at(span))),
        );
    }
    Ok(findings)
}

/// All functions, including entry points.
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

/// Calls `each` for every statement of a block and its nested blocks.
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

    /// Findings in a kernel of this folder whose third line is `declared` and whose body starts in line five.
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
    fn storage_barriers_are_found() {
        let finding_in = |line: u32| {
            format!(
                "build/flawed: storageBarrier in line {line}: other work-groups see writes only in a later dispatch"
            )
        };
        for body in [
            "words[i] = 1u;\nstorageBarrier();\nboth[i] = words[i + 64u];",
            "for (var k = 0u; k < 3u; k++) {\nstorageBarrier(); }",
            "if arrayLength(&words) > 3u { words[i] = 1u; } else {\nstorageBarrier(); }",
            "switch arrayLength(&words) { case 1u: {\nstorageBarrier(); } default: {} }",
        ] {
            assert_eq!(found("", body), [finding_in(6)], "{body}");
        }
        let fence = "fn fence() { storageBarrier(); }";
        assert_eq!(found(fence, "words[i] = 1u; fence(); both[i] = words[i + 64u];"), [finding_in(3)]);
    }

    #[test]
    fn work_group_barriers_are_accepted() {
        for body in [
            "words[i] = 1u;\nworkgroupBarrier();\nboth[i] = words[63u - i];",
            "words[i] = 1u;\nstorageBarrier(); // Shared in this work-group.\nboth[i] = words[63u - i];",
            "both[i] = words[i]; sync(); words[i] = both[63u - i];",
            "words[i] = workgroupUniformLoad(&both[3]);",
        ] {
            assert_eq!(found("fn sync() { workgroupBarrier(); }", body), [""; 0], "{body}");
        }
    }

    #[test]
    fn findings_contain_the_line() {
        let divergent = "build/flawed: some invocations of a work-group may not reach the barrier in line 5";
        assert_eq!(found("", "if i < 3u { workgroupBarrier(); }"), [divergent]);
        let quotient = "words[i] = u32(1.0 / f32(i));";
        let unsafe_number = "trace/flawed: line 5: division outside of a guard function";
        assert_eq!(found_in("trace", "", quotient), [unsafe_number]);
        assert_eq!(found("", quotient), [""; 0]);
    }
}
