//! The page in a headless browser: narrow and wide, light and dark, in two font families.
//!
//! A copy of the page measures itself in a frame of the given width, because browser windows have a minimum width.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use canted_fixtures::or_skip;

use super::MADE;

/// Names of browsers; `CANTED_BROWSER` names another.
const BROWSERS: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];

/// Reports layout and contrast problems to the outer page.
const MEASURE: &str = include_str!("measure.js");

/// The result for a page without problems.
const WELL: &str = "nothing wrong";

/// The browser, or `None` after reporting a skipped test.
fn browser(test: &str) -> Option<PathBuf> {
    let named = std::env::var_os("CANTED_BROWSER").map(PathBuf::from);
    let runs =
        |name: &PathBuf| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    let found = named.into_iter().chain(BROWSERS.map(PathBuf::from)).find(runs);
    or_skip(test, found.ok_or("no browser found"))
}

/// Families of fonts that every system has; monospaced letters are among the widest.
const FAMILIES: [&str; 2] = ["sans-serif", "monospace"];

/// The problems of a page at a width, in a color scheme and a font family.
fn problems(browser: &Path, name: &str, html: &str, width: u32, is_dark: bool, family: &str) -> String {
    let folder = MADE.folder().join(format!("{name}-{width}-{is_dark}-{family}"));
    fs::create_dir_all(&folder).unwrap();
    // Forces the color scheme, regardless of the machine's.
    let scheme = if is_dark { "all" } else { "not all" };
    let html = html.replace("(prefers-color-scheme: dark)", scheme);
    assert!(html.contains("system-ui, sans-serif") && html.contains("font-family=\"sans-serif\""));
    let html = html
        .replace("system-ui, sans-serif", family)
        .replace("font-family=\"sans-serif\"", &format!("font-family=\"{family}\""));
    fs::write(folder.join("page.html"), html.replace("</body>", &format!("<script>{MEASURE}</script>\n</body>")))
        .unwrap();
    let owner = format!(
        "<!doctype html><body><pre>silent</pre><script>addEventListener('message', e => \
         document.querySelector('pre').textContent = e.data)</script><iframe src=\"page.html\" \
         style=\"width:{width}px;height:900px;border:0\"></iframe></body>"
    );
    fs::write(folder.join("owner.html"), owner).unwrap();
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("--window-size={},1000", width.max(500) + 40))
        .arg(format!("file://{}", folder.join("owner.html").display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let result = dom.split("<pre>").nth(1).and_then(|rest| rest.split("</pre>").next());
    result.unwrap_or_else(|| panic!("no answer: {dom}")).to_owned()
}

#[test]
fn the_page_is_readable_narrow_and_wide_light_and_dark() {
    let Some(browser) = browser("the_page_is_readable_narrow_and_wide_light_and_dark") else { return };
    for width in [360, 1400] {
        for (family, is_dark) in [(FAMILIES[0], false), (FAMILIES[0], true), (FAMILIES[1], false)] {
            let result = problems(&browser, "complete", &MADE.html, width, is_dark, family);
            assert!(result.ends_with(WELL), "{width} pixels, dark {is_dark}, {family}: {result}");
        }
    }
}

#[test]
fn problems_are_detected() {
    let Some(browser) = browser("problems_are_detected") else { return };
    let faults = [
        ("wide", "<main>", "<main><p style=\"width:3000px\">wide</p>", "wide"),
        ("faint", "--soft: #4d4d4d", "--soft: #cccccc", "contrast"),
        ("lost", "<circle", "<ellipse", "points"),
        ("tiny", "font-size=\"", "font-size=\"0.1\" data-was=\"", "small"),
        // Without its length, the longest label is wider than its plot.
        ("long", "textLength=\"", "data-was=\"", "outside its plot"),
    ];
    for (name, from, to, word) in faults {
        assert!(MADE.html.contains(from), "{name}: '{from}' is not in the page");
        let result = problems(&browser, name, &MADE.html.replace(from, to), 360, false, FAMILIES[1]);
        assert!(result.contains(word), "{name}: {result}");
    }
}
