//! Barriers that some invocations of a work-group may not reach.
//!
//! At such a barrier a GPU hangs or continues with incomplete data; `naga` accepts it. A value is uniform if it is the same for
//! all invocations of a work-group: constants, uniforms, read-only memory at a uniform index, `workgroupUniformLoad`,
//! work-group indices. Control flow diverges after a condition that is not uniform, after a `return` that only some invocations
//! take, and in a loop that some leave earlier.
//!
//! A local variable counts as non-uniform everywhere if any store to it is, so the check may reject correct kernels but accepts
//! no incorrect one. A pointer passed to a function makes its target non-uniform.

use std::collections::{HashMap, HashSet};

use naga::{
    AddressSpace, Binding, Block, BuiltIn, Expression, Function, Handle, LocalVariable, Module, Span, Statement,
    StorageAccess,
};

/// Location of a barrier in divergent control flow.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DivergentBarrier {
    pub(super) span: Span,
}

/// Barriers of all entry points that some invocations may not reach.
pub(super) fn divergent_barriers(module: &Module) -> Vec<DivergentBarrier> {
    let mut checker = Checker { module, found: vec![] };
    for point in module.entry_points.iter().filter(|point| point.stage == naga::ShaderStage::Compute) {
        let arguments = point.function.arguments.iter().map(|argument| is_uniform_builtin(argument.binding.as_ref()));
        checker.function(&point.function, arguments.collect(), false);
    }
    checker.found.dedup();
    checker.found
}

fn is_uniform_builtin(binding: Option<&Binding>) -> bool {
    matches!(binding, Some(Binding::BuiltIn(BuiltIn::WorkGroupId | BuiltIn::NumWorkGroups | BuiltIn::WorkGroupSize)))
}

struct Checker<'a> {
    module: &'a Module,
    found: Vec<DivergentBarrier>,
}

/// How some invocations leave a block.
#[derive(Clone, Copy, Default)]
struct Exit {
    function: bool,
    /// By `break`.
    turn: bool,
    /// By `continue`.
    rest: bool,
}

impl Exit {
    fn join(&mut self, other: Self) {
        self.function |= other.function;
        self.turn |= other.turn;
        self.rest |= other.rest;
    }

    fn any(self) -> bool {
        self.function || self.turn || self.rest
    }
}

/// State of a function call.
struct Frame<'a> {
    function: &'a Function,
    /// Whether each argument is uniform.
    arguments: Vec<bool>,
    varying: HashSet<Handle<LocalVariable>>,
    /// Whether the result of a call or of `workgroupUniformLoad` is uniform.
    results: HashMap<Handle<Expression>, bool>,
    returns_uniform: bool,
}

impl<'a> Checker<'a> {
    /// Follows a call; returns whether its result is uniform.
    fn function(&mut self, function: &'a Function, arguments: Vec<bool>, varies: bool) -> bool {
        let results = HashMap::new();
        let mut frame = Frame { function, arguments, varying: HashSet::new(), results, returns_uniform: true };
        // Stores in loops take effect after an iteration: repeat until nothing changes.
        loop {
            let (n_varying, n_found) = (frame.varying.len(), self.found.len());
            frame.returns_uniform = true;
            self.block(&mut frame, &function.body, varies);
            if frame.varying.len() == n_varying {
                return frame.returns_uniform;
            }
            self.found.truncate(n_found);
        }
    }

    fn block(&mut self, frame: &mut Frame<'a>, block: &'a Block, mut varies: bool) -> Exit {
        let outside = varies;
        let mut exit = Exit::default();
        for (statement, span) in block.span_iter() {
            let now = self.statement(frame, statement, *span, varies);
            exit.join(now);
            // After some invocations exit, control flow is divergent.
            varies = outside || exit.any();
        }
        exit
    }

    fn statement(&mut self, frame: &mut Frame<'a>, statement: &'a Statement, span: Span, varies: bool) -> Exit {
        match statement {
            Statement::Block(block) => return self.block(frame, block, varies),
            Statement::If { condition, accept, reject } => {
                let varies = varies || !self.is_uniform(frame, *condition);
                let mut exit = self.block(frame, accept, varies);
                exit.join(self.block(frame, reject, varies));
                return exit;
            }
            Statement::Switch { selector, cases } => {
                let varies = varies || !self.is_uniform(frame, *selector);
                let mut exit = Exit::default();
                for case in cases {
                    exit.join(self.block(frame, &case.body, varies));
                }
                // A `break` only leaves the switch.
                return Exit { turn: false, ..exit };
            }
            Statement::Loop { body, continuing, break_if } => {
                return self.repeated(frame, body, continuing, *break_if, varies);
            }
            Statement::Break => return Exit { turn: varies, ..Exit::default() },
            Statement::Continue => return Exit { rest: varies, ..Exit::default() },
            Statement::Kill => return Exit { function: varies, ..Exit::default() },
            Statement::Return { value } => {
                let uniform = !varies && value.is_none_or(|value| self.is_uniform(frame, value));
                frame.returns_uniform &= uniform;
                return Exit { function: varies, ..Exit::default() };
            }
            Statement::ControlBarrier(_) => self.barrier(span, varies),
            Statement::WorkGroupUniformLoad { result, .. } => {
                self.barrier(span, varies);
                frame.results.insert(*result, true);
            }
            Statement::Store { pointer, value }
                if varies || !self.is_uniform(frame, *value) || !self.has_uniform_indices(frame, *pointer) =>
            {
                self.mark_varying(frame, *pointer);
            }
            Statement::Call { function, arguments, result } => {
                let uniform: Vec<bool> = arguments.iter().map(|&argument| self.is_uniform(frame, argument)).collect();
                for &argument in arguments {
                    self.mark_varying(frame, argument);
                }
                let is_uniform = self.function(&self.module.functions[*function], uniform, varies);
                if let Some(result) = result {
                    frame.results.insert(*result, is_uniform);
                }
            }
            _ => {}
        }
        Exit::default()
    }

    fn repeated(
        &mut self,
        frame: &mut Frame<'a>,
        body: &'a Block,
        continuing: &'a Block,
        break_if: Option<Handle<Expression>>,
        varies: bool,
    ) -> Exit {
        let n_found = self.found.len();
        let mut varies = varies;
        loop {
            let mut exit = self.block(frame, body, varies);
            // Invocations that continue reconverge before the next iteration.
            let alone = varies || exit.function || exit.turn;
            exit.join(self.block(frame, continuing, alone));
            exit.turn |= break_if.is_some_and(|condition| !self.is_uniform(frame, condition));
            if varies || !(exit.turn || exit.function) {
                return Exit { function: exit.function, ..Exit::default() };
            }
            // Some leave earlier: the remaining ones run all iterations in divergent control flow.
            varies = true;
            self.found.truncate(n_found);
        }
    }

    fn barrier(&mut self, span: Span, varies: bool) {
        if varies {
            self.found.push(DivergentBarrier { span });
        }
    }

    /// Marks the local variable that a pointer refers to as non-uniform.
    fn mark_varying(&self, frame: &mut Frame<'a>, pointer: Handle<Expression>) {
        match frame.function.expressions[pointer] {
            Expression::LocalVariable(variable) => {
                frame.varying.insert(variable);
            }
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.mark_varying(frame, base),
            _ => {}
        }
    }

    /// Whether all indices of a pointer are uniform.
    fn has_uniform_indices(&self, frame: &Frame<'a>, pointer: Handle<Expression>) -> bool {
        match frame.function.expressions[pointer] {
            Expression::Access { base, index } => {
                self.is_uniform(frame, index) && self.has_uniform_indices(frame, base)
            }
            Expression::AccessIndex { base, .. } => self.has_uniform_indices(frame, base),
            _ => true,
        }
    }

    fn is_uniform(&self, frame: &Frame<'a>, expression: Handle<Expression>) -> bool {
        let all = |list: &[Handle<Expression>]| list.iter().all(|&e| self.is_uniform(frame, e));
        match &frame.function.expressions[expression] {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::Override(_)
            | Expression::ZeroValue(_)
            | Expression::ArrayLength(_) => true,
            Expression::FunctionArgument(index) => frame.arguments[*index as usize],
            Expression::GlobalVariable(variable) => match self.module.global_variables[*variable].space {
                AddressSpace::Uniform | AddressSpace::Handle | AddressSpace::Immediate => true,
                AddressSpace::Storage { access } => !access.contains(StorageAccess::STORE),
                _ => false,
            },
            Expression::LocalVariable(variable) => !frame.varying.contains(variable),
            Expression::CallResult(_) | Expression::WorkGroupUniformLoadResult { .. } => {
                frame.results.get(&expression).copied().unwrap_or(false)
            }
            Expression::Compose { components, .. } => all(components),
            Expression::Access { base, index } => all(&[*base, *index]),
            Expression::AccessIndex { base, .. } => all(&[*base]),
            Expression::Splat { value, .. } => all(&[*value]),
            Expression::Swizzle { vector, .. } => all(&[*vector]),
            Expression::Load { pointer } => all(&[*pointer]),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => all(&[*expr]),
            Expression::Binary { left, right, .. } => all(&[*left, *right]),
            Expression::Select { condition, accept, reject } => all(&[*condition, *accept, *reject]),
            Expression::Relational { argument, .. } => all(&[*argument]),
            Expression::Math { arg, arg1, arg2, arg3, .. } => {
                let rest: Vec<_> = [Some(*arg), *arg1, *arg2, *arg3].into_iter().flatten().collect();
                all(&rest)
            }
            // Atomics, images, subgroups, derivatives: assumed to differ.
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n_found(body: &str) -> usize {
        let text = format!(
            "@group(0) @binding(0) var<uniform> turns: u32;
             @group(0) @binding(1) var<storage, read> fixed: array<u32>;
             @group(0) @binding(2) var<storage, read_write> words: array<u32>;
             var<workgroup> both: array<u32, 64>;
             fn sync() {{ workgroupBarrier(); }}
             fn odd(i: u32) -> bool {{ return (i & 1u) == 1u; }}
             @compute @workgroup_size(64)
             fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) group: vec3<u32>) {{ {body} }}"
        );
        divergent_barriers(&naga::front::wgsl::parse_str(&text).unwrap()).len()
    }

    #[test]
    fn uniform_barriers_are_accepted() {
        for body in [
            "workgroupBarrier();",
            "for (var k = 0u; k < turns; k++) { both[i] = k; workgroupBarrier(); }",
            "if fixed[group.x] > 3u { workgroupBarrier(); }",
            "if group.x > 3u { return; } workgroupBarrier();",
            "let n = workgroupUniformLoad(&both[0]); for (var k = 0u; k < n; k++) { sync(); }",
            "if i < 3u { both[i] = 1u; } workgroupBarrier();",
            "for (var k = 0u; k < i; k++) { both[i] += k; } workgroupBarrier();",
            "loop { if turns > 3u { break; } workgroupBarrier(); }",
            "if odd(group.x) { sync(); }",
            "switch turns { case 1u: { workgroupBarrier(); } default: {} }",
            "for (var k = 0u; k < 4u; k++) { if i < k { continue; } both[i] = k; } workgroupBarrier();",
        ] {
            assert_eq!(n_found(body), 0, "{body}");
        }
    }

    #[test]
    fn divergent_barriers_are_found() {
        for body in [
            "if i < 3u { workgroupBarrier(); }",
            "if i < 3u { return; } workgroupBarrier();",
            "for (var k = 0u; k < i; k++) { workgroupBarrier(); }",
            "for (var k = 0u; k < words[0]; k++) { sync(); }",
            "loop { if i > 3u { break; } workgroupBarrier(); }",
            "loop { workgroupBarrier(); if both[0] > 3u { break; } }",
            "for (var k = 0u; k < 4u; k++) { if i < k { continue; } workgroupBarrier(); }",
            "var n = turns; if i == 2u { n = 5u; } for (var k = 0u; k < n; k++) { workgroupBarrier(); }",
            "var n = turns; for (var k = 0u; k < 4u; k++) { if n > 3u { workgroupBarrier(); } n = i; }",
            "if odd(i) { sync(); }",
            "switch i { case 1u: { workgroupBarrier(); } default: {} }",
            "let n = both[0]; if n == 3u { let m = workgroupUniformLoad(&both[1]); words[i] = m; }",
            "loop { if i == 1u { return; } sync(); if turns == 1u { break; } }",
        ] {
            assert!(n_found(body) > 0, "{body}");
        }
    }
}
