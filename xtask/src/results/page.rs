//! The page: for each question one sentence, one table and one plot, from the record alone.

use std::{fmt::Write as _, path::PathBuf};

use super::{Facts, Model, PAGE, RECORD, Record, Section, Table, plot_path};

/// A question and what answers it.
struct Question {
    asked: &'static str,
    /// Name of the plot's file.
    name: &'static str,
    /// Start of the section's title, and of the title of its table.
    section: &'static str,
    table: &'static str,
    /// The command that measures it.
    command: &'static str,
    /// The columns that are shown; empty: all.
    columns: &'static [&'static str],
    /// Only rows with this value in this column.
    only: Option<(&'static str, &'static str)>,
    /// Columns that name a row, and the one that is drawn: its first number.
    label: &'static [&'static str],
    drawn: &'static str,
    /// The sentence; `{least}`, `{most}`, `{median}` are values of the drawn column, `{worst}` and `{best}` their rows, `{n}` their number.
    says: &'static str,
}

const QUESTIONS: [Question; 7] = [
    Question {
        asked: "When do oriented nodes pay?",
        name: "nodes",
        section: "Oriented nodes",
        table: "",
        command: "bench nodes",
        columns: &[],
        only: None,
        label: &["scene"],
        drawn: "as built",
        says: "As built, camera rays are between {least} ({worst}) and {most} ({best}) times as fast as with aligned nodes only, {median} times \
               in the median of {n} scenes.",
    },
    Question {
        asked: "How fast are rays compared with Embree, on scenes drawn anew?",
        name: "kinds",
        section: "Generated kinds",
        table: "",
        command: "bench kinds --peers",
        columns: &["kind", "triangles", "camera", "bounce", "occlusion", "random", "hits equal"],
        only: Some(("preset", "quality")),
        label: &["kind"],
        drawn: "camera",
        says: "With preset `quality`, camera rays are between {least} ({worst}) and {most} ({best}) times as fast as with Embree's default mode, \
               {median} times in the median of {n} kinds.",
    },
    Question {
        asked: "What do the presets gain and cost?",
        name: "presets",
        section: "Generated kinds",
        table: "Geometric means",
        command: "bench kinds --peers",
        columns: &[],
        only: None,
        label: &["engine"],
        drawn: "build / medium",
        says: "Over the ordinary kinds, builds take between {least} ({worst}) and {most} ({best}) times as long as Embree's of medium quality.",
    },
    Question {
        asked: "How fast are rays on models of others, compared with the fastest peer?",
        name: "models",
        section: "WideBvh compared with peers",
        table: "Compared with peers in their fastest modes",
        command: "bench wide --peers",
        columns: &[
            "scene",
            "triangles",
            "fastest peer, M rays/s",
            "WideBvh quality, watertight",
            "WideBvh balanced, watertight",
        ],
        only: None,
        label: &["scene"],
        drawn: "WideBvh quality, watertight",
        says: "With preset `quality`, camera rays are between {least} ({worst}) and {most} ({best}) times as fast as with the fastest peer, {median} \
               times in the median of {n} scenes.",
    },
    Question {
        asked: "And compared with modes that lose no hits either?",
        name: "robust",
        section: "WideBvh compared with peers",
        table: "Compared with peers in their most robust modes",
        command: "bench wide --peers",
        columns: &["scene", "fastest peer, M rays/s", "WideBvh quality, watertight", "WideBvh balanced, watertight"],
        only: None,
        label: &["scene"],
        drawn: "WideBvh quality, watertight",
        says: "With preset `quality`, camera rays are between {least} ({worst}) and {most} ({best}) times as fast as with the fastest robust peer, \
               {median} times in the median of {n} scenes.",
    },
    Question {
        asked: "What does a moving frame cost?",
        name: "motion",
        section: "Motion",
        table: "Refit and rebuild",
        command: "bench motion --peers",
        columns: &[],
        only: None,
        label: &["scene", "update"],
        drawn: "ms",
        says: "A million triangles are updated in {least} ms ({worst}) to {most} ms ({best}).",
    },
    Question {
        asked: "What does a device do?",
        name: "device",
        section: "On ",
        table: "From the mesh to the hits",
        command: "bench --device gpu",
        columns: &[],
        only: None,
        label: &["scene", "BVH"],
        drawn: "camera",
        says: "Camera rays reach between {least} ({worst}) and {most} ({best}) million a second.",
    },
];

/// The page and its plots, by path.
pub(super) fn files(record: &Record) -> Vec<(PathBuf, String)> {
    let mut plots = vec![];
    let mut page = head(record);
    for question in &QUESTIONS {
        let _ = write!(page, "\n## {}\n\n", question.asked);
        match question.answer(record) {
            Some((text, plot)) => {
                page += &text;
                plots.push((plot_path(question.name), plot));
            }
            None => {
                let _ = writeln!(page, "Not measured in this run: `cargo xtask {} --keep`.", question.command);
            }
        }
    }
    page += &others(record);
    plots.insert(0, (PathBuf::from(PAGE), page));
    plots
}

fn head(Record { facts, models, sections }: &Record) -> String {
    let Facts { machine, compiler, commit, date } = facts;
    let commands: Vec<String> = sections.iter().map(|section| format!("`{}`", section.command)).collect();
    let mut commands: Vec<&str> = commands.iter().map(String::as_str).collect();
    commands.dedup();
    let mut text = format!(
        "# Results\n\nWritten by `cargo xtask results` from [`{}`](results/record.json), which has every table in full; do not edit. One run of \
         one commit; older runs are in the history of these files.\n\n\
         * machine: {machine}; {compiler}\n* commit {commit}, {date}\n* commands: {}\n\n\
         Ratios are medians over rounds in which all engines take turns; (± %) is half the range over the median. Generated scenes are \
         determined by their seed (default: 1), and their triangles by `cargo xtask fixtures`.\n",
        RECORD.trim_start_matches("benches/"),
        commands.join(", ")
    );
    if !models.is_empty() {
        text += "\n| model | source | SHA-256 |\n| --- | --- | --- |\n";
    }
    for Model { file, source, sha256 } in models {
        let _ = writeln!(text, "| {file} | {source} | {}… |", &sha256[..sha256.len().min(12)]);
    }
    text
}

/// Sections that answer no question of this page.
fn others(record: &Record) -> String {
    let is_other = |section: &&Section| QUESTIONS.iter().all(|question| !section.title.starts_with(question.section));
    let others: Vec<&Section> = record.sections.iter().filter(is_other).collect();
    let mut text = if others.is_empty() { String::new() } else { "\n## Also measured\n\n".to_owned() };
    for section in others {
        let said = section.text.iter().find(|line| line.starts_with("**")).map_or("", |line| line.trim_matches('*'));
        let _ = writeln!(text, "* {} (`{}`): {} tables. {said}", section.title, section.command, section.tables.len());
    }
    text
}

impl Question {
    /// Sentence, table and the reference to the plot; then the plot.
    fn answer(&self, record: &Record) -> Option<(String, String)> {
        let section = record.sections.iter().find(|section| section.title.starts_with(self.section))?;
        let table = section.tables.iter().find(|table| table.title.starts_with(self.table))?;
        let at = |name: &str| table.head.iter().position(|head| head == name);
        let rows: Vec<&Vec<String>> = table
            .rows
            .iter()
            .filter(|row| row.len() == table.head.len())
            .filter(|row| self.only.is_none_or(|(column, value)| at(column).is_some_and(|i| row[i] == value)))
            .collect();
        let drawn = at(self.drawn)?;
        let label = |row: &[String]| -> String {
            self.label.iter().filter_map(|name| Some(row[at(name)?].clone())).collect::<Vec<_>>().join(": ")
        };
        let bars: Vec<(String, f64)> = rows.iter().filter_map(|row| Some((label(row), number(&row[drawn])?))).collect();
        let mut text = format!("{}\n\n{}\n\n", self.sentence(&bars)?, method(section, table));
        let shown: Vec<usize> = match self.columns {
            [] => (0..table.head.len()).collect(),
            columns => columns.iter().filter_map(|name| at(name)).collect(),
        };
        let line = |cells: &[String]| {
            let cells: Vec<&str> = shown.iter().map(|&i| &cells[i][..]).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        text += &line(&table.head);
        let _ = writeln!(text, "|{}", " --- |".repeat(shown.len()));
        rows.iter().for_each(|row| text += &line(row));
        let _ = writeln!(text, "\n![{}: {}](results/{}.svg)", self.asked, self.drawn, self.name);
        // Groups of rows stay together.
        let mut sorted = bars;
        if self.label.len() == 1 {
            sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
        Some((text, svg(self.drawn, &sorted)))
    }

    fn sentence(&self, bars: &[(String, f64)]) -> Option<String> {
        let mut sorted: Vec<&(String, f64)> = bars.iter().collect();
        sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (least, most, median) = (sorted.first()?, sorted.last()?, sorted.get(sorted.len() / 2)?);
        Some(
            self.says
                .replace("{least}", &least.1.to_string())
                .replace("{worst}", &least.0)
                .replace("{most}", &most.1.to_string())
                .replace("{best}", &most.0)
                .replace("{median}", &median.1.to_string())
                .replace("{n}", &sorted.len().to_string()),
        )
    }
}

/// How it was measured: the first paragraph of the table, or else of its section.
fn method<'a>(section: &'a Section, table: &'a Table) -> &'a str {
    table.text.first().or(section.text.first()).map_or("", |line| line)
}

/// The first number of a cell.
fn number(cell: &str) -> Option<f64> {
    let start = cell.find(|c: char| c.is_ascii_digit())?;
    let end = cell[start..].find(|c: char| !c.is_ascii_digit() && c != '.').map_or(cell.len(), |end| start + end);
    cell[start..end].parse().ok()
}

/// Horizontal bars, with a line at 1.
fn svg(title: &str, bars: &[(String, f64)]) -> String {
    const NAMES: f64 = 250.0;
    const WIDTH: f64 = 520.0;
    const ROW: f64 = 15.0;
    let most = bars.iter().map(|(_, value)| *value).fold(1.0, f64::max);
    let x = |value: f64| NAMES + value / most * WIDTH;
    let height = ROW * (bars.len() as f64 + 2.0);
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<text x=\"{NAMES}\" y=\"12\">{}</text>\n",
        NAMES + WIDTH + 60.0,
        escaped(title)
    );
    for (i, (name, value)) in bars.iter().enumerate() {
        let y = ROW * (i as f64 + 1.5);
        let _ = writeln!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text><rect x=\"{NAMES}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"11\" \
             fill=\"#0072b2\"/><text x=\"{:.1}\" y=\"{:.1}\">{value}</text>",
            NAMES - 6.0,
            y + 10.0,
            escaped(name),
            x(*value) - NAMES,
            x(*value) + 4.0,
            y + 10.0
        );
    }
    let _ = writeln!(
        out,
        "<line x1=\"{0:.1}\" y1=\"16\" x2=\"{0:.1}\" y2=\"{height}\" stroke=\"#d55e00\" stroke-dasharray=\"3 3\"/>",
        x(1.0)
    );
    out + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cells_are_read() {
        let cells = ["**3.38** (±1 %) / **2.56**", "yes", "0.6", "–", "26 %"];
        assert_eq!(cells.map(number), [Some(3.38), None, Some(0.6), None, Some(26.0)]);
    }

    #[test]
    fn a_question_is_answered_by_sentence_table_and_plot() {
        let table = |rows: &[[&str; 2]]| Table {
            head: ["scene", "as built"].map(str::to_owned).to_vec(),
            rows: rows.iter().map(|row| row.map(str::to_owned).to_vec()).collect(),
            ..Table::default()
        };
        let section = Section {
            title: "Oriented nodes".to_owned(),
            text: vec!["How.".to_owned()],
            tables: vec![table(&[["truss", "2.5 (±1 %)"], ["grid", "0.9"], ["bunny", "1"]])],
            ..Section::default()
        };
        let record = Record { sections: vec![section], ..Record::default() };
        let (text, svg) = QUESTIONS[0].answer(&record).unwrap();
        assert!(text.starts_with("As built, camera rays are between 0.9 (grid) and 2.5 (truss) times"), "{text}");
        assert!(text.contains("1 times in the median of 3 scenes.\n\nHow.\n\n| scene | as built |\n"), "{text}");
        assert_eq!(svg.matches("#0072b2").count(), 3);
        let page = &files(&record)[0].1;
        assert!(page.contains("Not measured in this run: `cargo xtask bench motion --peers --keep`."), "{page}");
    }
}
