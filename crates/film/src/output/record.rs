/// How a picture was rendered: names and values in order.
pub type Record = Vec<(String, String)>;

/// One line per entry.
pub(crate) fn record_lines(record: &[(String, String)]) -> String {
    record.iter().map(|(name, value)| format!("{name}: {value}\n")).collect()
}

/// The entries of lines; lines without a colon are skipped.
pub(crate) fn record_from_lines(text: &str) -> Record {
    let entry = |line: &str| line.split_once(": ").map(|(name, value)| (name.to_owned(), value.to_owned()));
    text.lines().filter_map(entry).collect()
}
