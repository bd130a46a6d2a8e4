//! Exact signs of sums of products by error-free transformations (Dekker, Knuth, Shewchuk).

use core::cmp::Ordering;

use crate::math::mul_add;
use crate::round::two_sum;

/// A sum of products held exactly as an unevaluated sum of `f64`, at most `N` of them.
///
/// Exact as long as no product leaves the normal range of `f64`, which products of up to four `f32` do not.
pub(crate) struct ExactSum<const N: usize> {
    /// Nonoverlapping, in increasing magnitude.
    parts: [f64; N],
    length: usize,
}

impl<const N: usize> ExactSum<N> {
    pub(crate) fn new() -> Self {
        Self { parts: [0.0; N], length: 0 }
    }

    /// Adds `a · b` as two parts: the rounded product and its exact error.
    pub(crate) fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(mul_add(a, b, -product));
        self.add(product);
    }

    /// Adds a number; zero parts are dropped (Shewchuk 1997, grow expansion with zero elimination).
    fn add(&mut self, term: f64) {
        let mut carry = term;
        let mut kept = 0;
        for i in 0..self.length {
            let (sum, rest) = two_sum(carry, self.parts[i]);
            carry = sum;
            if rest != 0.0 {
                self.parts[kept] = rest;
                kept += 1;
            }
        }
        if carry != 0.0 {
            self.parts[kept] = carry;
            kept += 1;
        }
        self.length = kept;
    }

    /// Sign of the sum: that of its greatest part.
    pub(crate) fn sign(&self) -> Ordering {
        match self.length {
            0 => Ordering::Equal,
            n => self.parts[n - 1].total_cmp(&0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_exact_where_f64_loses_terms() {
        let mut sum = ExactSum::<10>::new();
        sum.add_product(1e30, 1e30);
        sum.add_product(1e-30, 1e-30);
        sum.add_product(-1e30, 1e30);
        assert_eq!(sum.sign(), Ordering::Greater);
        sum.add_product(1e-30, -1e-30);
        assert_eq!(sum.sign(), Ordering::Equal);
        sum.add_product(f64::from(f32::from_bits(1)), -f64::from(f32::from_bits(1)));
        assert_eq!(sum.sign(), Ordering::Less);
    }
}
