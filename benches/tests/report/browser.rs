//! The page in a headless browser: on a phone and on a desk, light and dark.
//!
//! A copy of the page measures itself within a frame of the wanted width, for browsers' own windows have a least one.

use std::{fs, path::PathBuf, process::Command};

use super::MADE;

/// What a browser may be called; `CANTED_BROWSER` names another.
const BROWSERS: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];

/// Tells the frame's owner everything that a reader would stumble over.
const MEASURE: &str = include_str!("measure.js");

/// What the measuring says of a page without faults.
const WELL: &str = "nothing wrong";

fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CANTED_BROWSER").map(PathBuf::from);
    let runs =
        |name: &PathBuf| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    named.into_iter().chain(BROWSERS.map(PathBuf::from)).find(runs)
}

/// What is wrong with a page at a width, and in which scheme; `None` without a browser.
fn wrong(name: &str, html: &str, width: u32, is_dark: bool) -> Option<String> {
    let browser = browser()?;
    let folder = MADE.folder().join(format!("{name}-{width}-{is_dark}"));
    fs::create_dir_all(&folder).unwrap();
    // The scheme of the machine does not matter: the rules for the dark hold always, or never.
    let scheme = if is_dark { "all" } else { "not all" };
    let html = html.replace("(prefers-color-scheme: dark)", scheme);
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
    let said = dom.split("<pre>").nth(1).and_then(|rest| rest.split("</pre>").next());
    Some(said.unwrap_or_else(|| panic!("no answer: {dom}")).to_owned())
}

#[test]
fn the_page_reads_well_on_phones_and_desks_light_and_dark() {
    for width in [360, 1400] {
        for is_dark in [false, true] {
            match wrong("whole", &MADE.html, width, is_dark) {
                None => {
                    return println!(
                        "skipped the_page_reads_well_on_phones_and_desks_light_and_dark: no browser found"
                    );
                }
                Some(said) => assert!(said.ends_with(WELL), "{width} pixels, dark {is_dark}: {said}"),
            }
        }
    }
}

#[test]
fn faults_are_seen() {
    let faults = [
        ("wide", "<main>", "<main><p style=\"width:3000px\">wide</p>", "wide"),
        ("faint", "--soft: #4d4d4d", "--soft: #cccccc", "contrast"),
        ("lost", "<circle", "<ellipse", "points"),
        ("tiny", "font-size=\"", "font-size=\"0.1\" data-was=\"", "small"),
    ];
    for (name, from, to, word) in faults {
        assert!(MADE.html.contains(from), "{name}: '{from}' is not in the page");
        match wrong(name, &MADE.html.replace(from, to), 360, false) {
            None => return println!("skipped faults_are_seen: no browser found"),
            Some(said) => assert!(said.contains(word), "{name}: {said}"),
        }
    }
}
