//! What can make NaN or infinity where boxes and triangles are met.
//!
//! WGSL lets a compiler assume that there are none, so a test that meets one may answer anything. Rays and vertices are
//! finite and below 2^62. Then sums and products stay finite by their bounds; what is left are quotients and roots, and
//! they may stand in functions that guard their argument: those whose name starts with `guarded_` or is `reciprocal`.

use naga::{BinaryOperator, Expression, Function, Literal, MathFunction, Module, Span};

use super::functions;

/// Numbers from which a product of two may overflow: 2^64.
const GREAT: f32 = 18_446_744_073_709_551_616.0;

/// Places of what can make NaN or infinity, and what it is.
pub(super) fn wild(module: &Module) -> Vec<(Span, &'static str)> {
    let mut found = vec![];
    for function in functions(module) {
        let name = function.name.as_deref().unwrap_or_default();
        let is_guard = name.starts_with("guarded_") || name == "reciprocal";
        for (handle, expression) in function.expressions.iter() {
            let what = match expression {
                Expression::Literal(Literal::F32(value))
                    if value.abs() > GREAT && value.is_finite() && !is_limit(*value) =>
                {
                    "a number beyond 2^64"
                }
                _ if is_guard => continue,
                Expression::Binary { op: BinaryOperator::Divide | BinaryOperator::Modulo, left, .. }
                    if !is_integer(function, *left) =>
                {
                    "a quotient outside of a function that guards its divisor"
                }
                Expression::Math { fun, .. } if makes_wild(*fun) => {
                    "a function that is not finite everywhere, outside of one that guards it"
                }
                _ => continue,
            };
            found.push((function.expressions.get_span(handle), what));
        }
    }
    found
}

/// `3e38` stands for "no hit" and is compared only.
fn is_limit(value: f32) -> bool {
    value == 3e38 || value == f32::MAX
}

fn makes_wild(fun: MathFunction) -> bool {
    use MathFunction as F;
    matches!(
        fun,
        F::Acos
            | F::Asin
            | F::Acosh
            | F::Atanh
            | F::Exp
            | F::Exp2
            | F::InverseSqrt
            | F::Log
            | F::Log2
            | F::Normalize
            | F::Pow
            | F::Sqrt
            | F::Tan
    )
}

/// Whether an operand is made of integers, as far as its form tells.
fn is_integer(function: &Function, operand: naga::Handle<Expression>) -> bool {
    match &function.expressions[operand] {
        Expression::Literal(literal) => !matches!(literal, Literal::F32(_) | Literal::AbstractFloat(_)),
        Expression::As { kind, .. } => matches!(kind, naga::ScalarKind::Uint | naga::ScalarKind::Sint),
        Expression::Binary { left, .. } => is_integer(function, *left),
        Expression::ArrayLength(_) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n_wild(functions: &str) -> usize {
        wild(&naga::front::wgsl::parse_str(functions).unwrap()).len()
    }

    #[test]
    fn guards_may_divide_and_others_not() {
        assert_eq!(n_wild("fn reciprocal(x: f32) -> f32 { return 1.0 / max(abs(x), 0.001); }"), 0);
        assert_eq!(n_wild("fn guarded_root(x: f32) -> f32 { return sqrt(max(x, 0.0)); }"), 0);
        assert_eq!(n_wild("fn slab(x: f32) -> f32 { return 2.0 / x; }"), 1);
        assert_eq!(n_wild("fn root(x: f32) -> f32 { return sqrt(x); }"), 1);
        assert_eq!(n_wild("fn far(x: f32) -> f32 { return x * 1e30; }"), 1);
        assert_eq!(n_wild("fn row(x: u32) -> u32 { return u32(x) / 4u; }"), 0);
    }
}
