//! Text of plots fits by construction: each text states its length, so browsers fit it in any font.

use anyhow::{Result, anyhow, ensure};

/// Distance in pixels between text and the edge of its plot.
const MARGIN: f64 = 2.0;

/// Text is legible if it is compressed to at least this part of its usual width.
const LEGIBLE: f64 = 0.8;

/// Advance widths of the printable characters of ASCII in Helvetica, in thousandths of the font size.
/// Source: Adobe Core 14 font metrics. Common sans-serif fonts differ from them by up to a sixth.
#[rustfmt::skip]
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278,
    556, 556, 556, 556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556,
    1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667, 556, 833, 722, 778,
    667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556,
    333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556,
    556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];

/// Usual width of a text in pixels, at a font size in pixels. Characters beyond ASCII count as digits.
fn usual_width(text: &str, font_size: f64) -> f64 {
    let width = |c: char| (c as usize).checked_sub(32).and_then(|i| WIDTHS.get(i)).copied().unwrap_or(556);
    text.chars().map(|c| f64::from(width(c))).sum::<f64>() * font_size / 1000.0
}

/// Adds to each text of a plot its length: its usual width, at most the space from its anchor to the edges of the plot.
pub(super) fn fitted(svg: &str, [width, height]: [u32; 2]) -> Result<String> {
    let mut pieces = svg.split("<text ");
    let mut out = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (attributes, rest) = piece.split_once('>').ok_or_else(|| anyhow!("a text without end: {piece}"))?;
        let content = unescaped(rest.split("</text>").next().unwrap_or_default().trim());
        let listed = format!(" {attributes}");
        let value = |name: &str| {
            let (_, rest) = listed.split_once(&format!(" {name}=\""))?;
            rest.split_once('"').map(|(value, _)| value)
        };
        let number = |name: &str| value(name).and_then(|text| text.parse().ok()).unwrap_or(f64::NAN);
        // The plots have horizontal text, and text that runs upward.
        let (position, extent) = match value("transform") {
            None => (number("x"), f64::from(width)),
            Some(_) => (f64::from(height) - number("y"), f64::from(height)),
        };
        let (before, after) = (position - MARGIN, extent - position - MARGIN);
        let space = match value("text-anchor") {
            Some("start") => after,
            Some("end") => before,
            _ => 2.0 * before.min(after),
        };
        let usual = usual_width(&content, number("font-size"));
        ensure!(space >= LEGIBLE * usual, "'{content}' takes {usual:.0} pixels of {space:.0}");
        let length = usual.min(space);
        out += &format!("<text textLength=\"{length:.1}\" lengthAdjust=\"spacingAndGlyphs\" {attributes}>{rest}");
    }
    Ok(out)
}

/// Text from SVG.
fn unescaped(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&apos;", "'").replace("&amp;", "&")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(attributes: &str, content: &str) -> String {
        format!("<svg>\n<text {attributes} font-size=\"10\">\n{content}\n</text>\n</svg>")
    }

    fn length(svg: &str) -> f64 {
        let fitted = fitted(svg, [100, 200]).unwrap();
        fitted.split_once("textLength=\"").unwrap().1.split_once('"').unwrap().0.parse().unwrap()
    }

    #[test]
    fn short_text_has_its_usual_width() {
        // Three digits and a full stop.
        assert_eq!(length(&text("x=\"50\" y=\"50\" text-anchor=\"middle\"", "10.5")), 19.5);
        assert_eq!(length(&text("x=\"50\" y=\"50\" text-anchor=\"middle\"", "&lt;")), 5.8);
    }

    #[test]
    fn long_text_ends_at_the_margin() {
        // Of 20 digits, 111 pixels.
        let digits = "0".repeat(20);
        assert_eq!(length(&text("x=\"51\" y=\"9\" text-anchor=\"middle\"", &digits)), 94.0);
        assert_eq!(length(&text("x=\"98\" y=\"9\" text-anchor=\"end\"", &digits)), 96.0);
        assert_eq!(length(&text("x=\"3\" y=\"9\" text-anchor=\"start\"", &digits)), 95.0);
        let upward = "x=\"9\" y=\"150\" text-anchor=\"middle\" transform=\"rotate(270, 9, 150)\"";
        assert_eq!(length(&text(upward, &digits)), 96.0);
    }

    #[test]
    fn text_that_would_be_illegible_is_an_error() {
        let svg = text("x=\"50\" y=\"9\" text-anchor=\"middle\"", &"0".repeat(22));
        assert_eq!(
            fitted(&svg, [100, 200]).unwrap_err().to_string(),
            format!("'{}' takes 122 pixels of 96", "0".repeat(22))
        );
        // A text without a position or a size.
        assert!(fitted(&text("y=\"9\"", "0"), [100, 200]).is_err());
    }
}
