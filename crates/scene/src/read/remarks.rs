//! What a file asks for and the scene cannot say: each thing is told once, with who asks for it first.

use super::text::printable;

/// The remarks about a file, in the order of their first cause.
#[derive(Default)]
pub(crate) struct Remarks {
    list: Vec<Remark>,
}

struct Remark {
    what: String,
    first: String,
    n_more: usize,
}

impl Remarks {
    /// Notes that `what` is the case at `place`.
    pub(crate) fn note(&mut self, what: &str, place: &str) {
        match self.list.iter_mut().find(|remark| remark.what == what) {
            Some(remark) => remark.n_more += 1,
            None => self.list.push(Remark { what: what.to_owned(), first: place.to_owned(), n_more: 0 }),
        }
    }

    /// As [`Remarks::note`], where nothing has noted it yet.
    pub(crate) fn note_once(&mut self, what: &str, place: &str) {
        if self.list.iter().all(|remark| remark.what != what) {
            self.note(what, place);
        }
    }

    /// Adds a sentence for each thing noted.
    pub(crate) fn finish(self, warnings: &mut Vec<String>) {
        warnings.extend(self.list.into_iter().map(|Remark { what, first, n_more }| match n_more {
            0 => printable(&format!("{what}: {first}")).into_owned(),
            _ => printable(&format!("{what}: {first} and {n_more} more")).into_owned(),
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thing_is_told_once() {
        let mut remarks = Remarks::default();
        for (what, place) in [("b is ignored", "node 1"), ("a is ignored", "node 2"), ("b is ignored", "node 3")] {
            remarks.note(what, place);
        }
        remarks.note_once("b is ignored", "the file");
        let mut warnings = Vec::new();
        remarks.finish(&mut warnings);
        assert_eq!(warnings, ["b is ignored: node 1 and 1 more", "a is ignored: node 2"]);
    }
}
