//! A promise about a stage, and the result of a routine.

/// What decides whether a promise holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oracle {
    /// Exact arithmetic on the bits of the input.
    Exact,
    /// A loop over all triangles with the same test.
    Loop,
    /// The same routine on an equivalent input.
    Same,
    /// Properties required by definition.
    Structure,
    /// Singular values or eigenvalues by Jacobi's method in `f64`.
    Jacobi,
    /// A result known in closed form.
    Known,
}

impl Oracle {
    /// Short text for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact arithmetic",
            Self::Loop => "loop over all triangles",
            Self::Same => "equivalent input",
            Self::Structure => "definition",
            Self::Jacobi => "Jacobi in f64",
            Self::Known => "closed form",
        }
    }
}

/// What a row's value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The number of failed inputs.
    Failed,
    /// The worst value over all inputs, in the promise's unit.
    Worst,
    /// The fraction of inputs for which the unit applies, between zero and one.
    Share,
}

/// What is promised about a stage for one kind of input.
#[derive(Clone, Copy, Debug)]
pub struct Promise {
    /// The stage: `fit`, `merge`, and so on.
    pub stage: &'static str,
    /// The kind of input.
    pub case: &'static str,
    /// The promise as text.
    pub promise: &'static str,
    /// The reference.
    pub oracle: Oracle,
    /// Greatest value that satisfies the promise; infinite if the value is only reported.
    pub bound: f64,
    /// Unit of the values.
    pub unit: &'static str,
}

impl Promise {
    /// A promise that allows no failure.
    #[must_use]
    pub const fn none(
        stage: &'static str,
        case: &'static str,
        promise: &'static str,
        oracle: Oracle,
        unit: &'static str,
    ) -> Self {
        Self { stage, case, promise, oracle, bound: 0.0, unit }
    }

    /// The same without a bound: the value is only reported.
    #[must_use]
    pub const fn reported(self) -> Self {
        Self { bound: f64::INFINITY, ..self }
    }

    /// The worst value of one of our routines.
    #[must_use]
    pub fn row(&self, routine: impl Into<String>, n_inputs: usize, worst: f64) -> Row {
        let measure = Measure::Worst;
        Row { promise: *self, routine: routine.into(), is_peer: false, n_inputs, worst, measure, n_cut: 0 }
    }

    /// The number of failures of one of our routines.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn count(&self, routine: impl Into<String>, n_inputs: usize, n_failed: usize) -> Row {
        Row { measure: Measure::Failed, ..self.row(routine, n_inputs, n_failed as f64) }
    }

    /// The number of failures of one of our routines on inputs with a certain result. Without any such input the row is only
    /// reported, because a routine that does nothing would pass.
    #[must_use]
    pub fn count_certain(&self, routine: impl Into<String>, n_certain: usize, n_failed: usize) -> Row {
        let promise = if n_certain == 0 { self.reported() } else { *self };
        promise.count(routine, n_certain, n_failed)
    }

    /// The fraction of inputs for which the unit applies.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn share(&self, routine: impl Into<String>, n_inputs: usize, n_so: usize) -> Row {
        Row { measure: Measure::Share, ..self.row(routine, n_inputs, n_so as f64 / n_inputs.max(1) as f64) }
    }
}

/// The result of one routine on one case.
#[derive(Clone, Debug)]
pub struct Row {
    /// The promise.
    pub promise: Promise,
    /// Name of the routine.
    pub routine: String,
    /// Whether it belongs to another project, which promises nothing.
    pub is_peer: bool,
    /// Number of inputs that are relevant to the promise.
    pub n_inputs: usize,
    /// The worst value over all of them, or the number of failures.
    pub worst: f64,
    /// What `worst` is.
    pub measure: Measure,
    /// Queries answered by the CPU because a driver ended the device's traversal early.
    pub n_cut: usize,
}

impl Row {
    /// Whether the row is a promise of ours: neither a peer's nor only reported.
    #[must_use]
    pub fn is_promise(&self) -> bool {
        !self.is_peer && self.promise.bound.is_finite()
    }

    /// Whether the value satisfies the bound; NaN does not.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.n_inputs > 0 && self.worst <= self.promise.bound
    }

    /// Whether it is a promise of ours that does not hold.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        self.is_promise() && !self.holds()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROMISE: Promise = Promise::none("fit", "a case", "holds", Oracle::Exact, "points");

    #[test]
    fn a_row_without_inputs_or_with_nan_does_not_hold() {
        assert!(!PROMISE.count("a", 0, 0).holds());
        assert!(!PROMISE.row("a", 1, f64::NAN).holds());
    }

    #[test]
    fn a_row_without_certain_inputs_promises_nothing() {
        let row = PROMISE.count_certain("a", 0, 0);
        assert!(!row.is_promise() && !row.is_broken());
        assert!(PROMISE.count_certain("a", 1, 1).is_broken() && !PROMISE.count_certain("a", 1, 0).is_broken());
    }
}
