//! Operations that can produce NaN or infinity in box and triangle tests.
//!
//! WGSL lets a compiler assume that neither exists, so a test that computes one may return anything. Rays and vertices are
//! finite and below 2^62, so sums and products stay finite. Quotients and roots are allowed only in functions that guard their
//! argument: those named `guarded_…` or `reciprocal`.

use naga::{BinaryOperator, Expression, Function, Literal, MathFunction, Module, Span};

use super::functions;

/// Numbers above which a product of two may overflow: 2^64.
const MAX_LITERAL: f32 = 18_446_744_073_709_551_616.0;

/// Locations and descriptions of operations that can produce NaN or infinity.
pub(super) fn find_unsafe(module: &Module) -> Vec<(Span, &'static str)> {
    let mut found = vec![];
    for function in functions(module) {
        let name = function.name.as_deref().unwrap_or_default();
        let is_guard = name.starts_with("guarded_") || name == "reciprocal";
        for (handle, expression) in function.expressions.iter() {
            let what = match expression {
                Expression::Literal(Literal::F32(value))
                    if value.abs() > MAX_LITERAL && value.is_finite() && !is_limit(*value) =>
                {
                    "a literal above 2^64"
                }
                _ if is_guard => continue,
                Expression::Binary { op: BinaryOperator::Divide | BinaryOperator::Modulo, left, .. }
                    if !is_integer(function, *left) =>
                {
                    "division outside of a guard function"
                }
                Expression::Math { fun, .. } if may_be_infinite(*fun) => {
                    "a function that is not finite everywhere, outside of a guard function"
                }
                _ => continue,
            };
            found.push((function.expressions.get_span(handle), what));
        }
    }
    found
}

/// `3e38` stands for "no hit" and is only compared.
fn is_limit(value: f32) -> bool {
    value == 3e38 || value == f32::MAX
}

fn may_be_infinite(fun: MathFunction) -> bool {
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

/// Whether an operator exists for integers alone.
fn is_of_integers(op: BinaryOperator) -> bool {
    use BinaryOperator as B;
    matches!(op, B::And | B::ExclusiveOr | B::InclusiveOr | B::ShiftLeft | B::ShiftRight)
}

/// Whether an operand is an integer, as far as its form shows.
fn is_integer(function: &Function, operand: naga::Handle<Expression>) -> bool {
    match &function.expressions[operand] {
        Expression::Literal(literal) => !matches!(literal, Literal::F32(_) | Literal::AbstractFloat(_)),
        Expression::As { kind, .. } => matches!(kind, naga::ScalarKind::Uint | naga::ScalarKind::Sint),
        Expression::Binary { op, left, right } => {
            // Both operands have the same kind of number.
            is_of_integers(*op) || is_integer(function, *left) || is_integer(function, *right)
        }
        Expression::ArrayLength(_) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n_unsafe(functions: &str) -> usize {
        find_unsafe(&naga::front::wgsl::parse_str(functions).unwrap()).len()
    }

    #[test]
    fn only_guards_may_divide() {
        assert_eq!(n_unsafe("fn reciprocal(x: f32) -> f32 { return 1.0 / max(abs(x), 0.001); }"), 0);
        assert_eq!(n_unsafe("fn guarded_root(x: f32) -> f32 { return sqrt(max(x, 0.0)); }"), 0);
        assert_eq!(n_unsafe("fn slab(x: f32) -> f32 { return 2.0 / x; }"), 1);
        assert_eq!(n_unsafe("fn root(x: f32) -> f32 { return sqrt(x); }"), 1);
        assert_eq!(n_unsafe("fn far(x: f32) -> f32 { return x * 1e30; }"), 1);
        assert_eq!(n_unsafe("fn row(x: u32) -> u32 { return u32(x) / 4u; }"), 0);
    }
}
