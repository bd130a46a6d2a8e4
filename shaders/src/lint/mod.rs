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
    let source = assemble(name, chosen)?;
    let (module, _) = reflection::specialised(name, &source, chosen.overrides())?;
    let at = |span: Span| span.location(&source).line_number;
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
