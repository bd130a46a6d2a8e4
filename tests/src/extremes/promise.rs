//! What is promised of a station, and what a routine did.

/// What says whether a promise was kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oracle {
    /// Integers or fractions on the same bits of input.
    Exact,
    /// A loop over all triangles with the same test.
    Loop,
    /// The routine itself on an input whose answer must be the same, or known from this one's.
    Same,
    /// What a sound result looks like, by definition.
    Structure,
    /// Singular values or eigenvalues by Jacobi's method in `f64`.
    Jacobi,
    /// An answer known in closed form.
    Known,
}

impl Oracle {
    /// A few words for tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact arithmetic",
            Self::Loop => "every triangle",
            Self::Same => "the same in other words",
            Self::Structure => "definition",
            Self::Jacobi => "Jacobi in f64",
            Self::Known => "closed form",
        }
    }
}

/// How a row's value counts its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The inputs that failed.
    Failed,
    /// The worst of all inputs, in the promise's unit.
    Worst,
    /// A part of what the promise's unit names, between nothing and one.
    Share,
}

/// What is promised of a station on one kind of input.
#[derive(Clone, Copy, Debug)]
pub struct Promise {
    /// The station: `fit`, `merge`, and so on.
    pub station: &'static str,
    /// The kind of input.
    pub case: &'static str,
    /// The promise, in words.
    pub promise: &'static str,
    /// What judges it.
    pub oracle: Oracle,
    /// Greatest value of a row that keeps it; infinite where the value is told and nothing is promised of it.
    pub bound: f64,
    /// What the values count.
    pub unit: &'static str,
}

impl Promise {
    /// A promise of which a count of failures says everything: there may be none.
    #[must_use]
    pub const fn none(
        station: &'static str,
        case: &'static str,
        promise: &'static str,
        oracle: Oracle,
        unit: &'static str,
    ) -> Self {
        Self { station, case, promise, oracle, bound: 0.0, unit }
    }

    /// The same without a bound: the value is told, and nothing is promised of it.
    #[must_use]
    pub const fn told(self) -> Self {
        Self { bound: f64::INFINITY, ..self }
    }

    /// What a routine of ours did at worst.
    #[must_use]
    pub fn row(&self, routine: impl Into<String>, n_inputs: usize, worst: f64) -> Row {
        let measure = Measure::Worst;
        Row { promise: *self, routine: routine.into(), is_peer: false, n_inputs, worst, measure, n_cut: 0 }
    }

    /// How often a routine of ours failed.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn count(&self, routine: impl Into<String>, n_inputs: usize, n_failed: usize) -> Row {
        Row { measure: Measure::Failed, ..self.row(routine, n_inputs, n_failed as f64) }
    }

    /// How often a routine of ours failed on the inputs of which something is certain; where none is, that is told, for a
    /// promise of nothing is kept by whoever answers nothing.
    #[must_use]
    pub fn count_certain(&self, routine: impl Into<String>, n_certain: usize, n_failed: usize) -> Row {
        let promise = if n_certain == 0 { self.told() } else { *self };
        promise.count(routine, n_certain, n_failed)
    }

    /// Of how many inputs a routine of ours did what is told.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^52")]
    pub fn share(&self, routine: impl Into<String>, n_inputs: usize, n_so: usize) -> Row {
        Row { measure: Measure::Share, ..self.row(routine, n_inputs, n_so as f64 / n_inputs.max(1) as f64) }
    }
}

/// What one routine did on one case.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was promised.
    pub promise: Promise,
    /// Who was asked.
    pub routine: String,
    /// Whether it is another project's, of which nothing is promised.
    pub is_peer: bool,
    /// Inputs tried, of those that say anything about the promise.
    pub n_inputs: usize,
    /// The worst value over all of them, or how many failed.
    pub worst: f64,
    /// Which of these it is.
    pub measure: Measure,
    /// Answers that the CPU gave because a driver cut the device's walk short.
    pub n_cut: usize,
}

impl Row {
    /// Whether ours promises it: neither a peer's nor one that is only told.
    #[must_use]
    pub fn is_promise(&self) -> bool {
        !self.is_peer && self.promise.bound.is_finite()
    }

    /// Whether the promise was kept; what is not a number keeps none.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.n_inputs > 0 && self.worst <= self.promise.bound
    }

    /// Whether a promise of ours was not kept.
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
    fn no_input_and_no_number_keep_no_promise() {
        assert!(!PROMISE.count("a", 0, 0).holds());
        assert!(!PROMISE.row("a", 1, f64::NAN).holds());
    }

    #[test]
    fn what_is_certain_of_nothing_is_told() {
        let row = PROMISE.count_certain("a", 0, 0);
        assert!(!row.is_promise() && !row.is_broken());
        assert!(PROMISE.count_certain("a", 1, 1).is_broken() && !PROMISE.count_certain("a", 1, 0).is_broken());
    }
}
