/// What a picture was made with: names and values in the order they were given.
pub type Record = Vec<(String, String)>;

/// A line for each entry.
pub(crate) fn record_lines(record: &[(String, String)]) -> String {
    record.iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
}

/// The entries of those lines; lines of another form are none.
pub(crate) fn record_from_lines(text: &str) -> Record {
    let entry = |line: &str| line.split_once(": ").map(|(name, value)| (name.to_owned(), value.to_owned()));
    text.lines().filter_map(entry).collect()
}
