//! One self-contained HTML page, with its text escaped and its bytes in base64.

use super::Figure;
use crate::findings::{Finding, Findings};
use std::fmt::Write as _;

const STYLE: &str = "\
:root{color-scheme:light dark;--text:#1c2330;--muted:#5b6472;--page:#ffffff;--line:#d9dee6;--head:#f2f5f9}
@media (prefers-color-scheme:dark){:root{--text:#e4e8ee;--muted:#9aa5b4;--page:#14181f;--line:#333b47;--head:#1d232c}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2.5rem 1.25rem 4rem;max-width:67rem;background:var(--page);color:var(--text);\
font:16px/1.55 system-ui,-apple-system,\"Segoe UI\",Roboto,sans-serif}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 1rem}
h3{font-size:1.02rem;line-height:1.35;margin:0 0 .45rem}
h2{font-size:1.3rem;margin:2.5rem 0 .75rem;padding-bottom:.3rem;border-bottom:1px solid var(--line)}
p{margin:.75rem 0}
.scroll{overflow-x:auto;margin:1rem 0}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.93rem}
th,td{padding:.4rem .8rem;border-bottom:1px solid var(--line);text-align:left;white-space:nowrap}
th{background:var(--head);font-weight:600}
td.number{text-align:right}
p.lead{font-size:1.12rem}
table.short{margin:1rem 0}
table.short th{background:none;font-weight:400;color:var(--muted);padding-left:0}
table.short th,table.short td{white-space:normal;vertical-align:top}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));gap:1.5rem 1.2rem;margin:1.2rem 0}
figure{margin:0;min-width:0}
figure.wide{grid-column:1/-1}
.panels{display:flex;flex-wrap:wrap;gap:.5rem}
.panels svg{display:block;max-width:100%;height:auto;border:1px solid var(--line);border-radius:4px}
figure img{display:block;max-width:100%;height:auto;border:1px solid var(--line);border-radius:4px}
img.panels{min-width:40rem}
figcaption{margin-top:.4rem;color:var(--muted);font-size:.88rem;line-height:1.4}
@media (max-width:40rem){body{padding:1.2rem 1rem 2rem}h1{font-size:1.5rem}th,td{padding:.35rem .5rem}}
pre{overflow-x:auto;padding:.8rem 1rem;background:var(--head);border:1px solid var(--line);border-radius:6px;font-size:.85rem}
";

/// Builder of a report: one HTML page with inline style and embedded pictures, readable in light and dark.
///
/// All text is escaped.
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    body: String,
}

impl Report {
    /// An empty report.
    pub fn new(title: &str) -> Self {
        Self { title: title.into(), body: String::new() }
    }

    /// Adds a section heading.
    #[must_use]
    pub fn heading(mut self, text: &str) -> Self {
        let _ = writeln!(self.body, "<h2>{}</h2>", escape(text));
        self
    }

    /// Adds a paragraph.
    #[must_use]
    pub fn paragraph(mut self, text: &str) -> Self {
        let _ = writeln!(self.body, "<p>{}</p>", escape(text));
        self
    }

    /// Adds a link to a file next to the report.
    #[must_use]
    pub fn link(mut self, file: &str, text: &str) -> Self {
        let _ = writeln!(self.body, "<p><a href=\"{}\">{}</a></p>", escape(file), escape(text));
        self
    }

    /// Adds text whose line breaks and blanks stay, such as a configuration.
    #[must_use]
    pub fn preformatted(mut self, text: &str) -> Self {
        let _ = writeln!(self.body, "<pre>{}</pre>", escape(text));
        self
    }

    /// Adds a table.
    #[must_use]
    pub fn table<H: AsRef<str>, C: AsRef<str>>(mut self, headers: &[H], rows: &[Vec<C>]) -> Self {
        self.body.push_str("<div class=\"scroll\"><table>\n");
        if !headers.is_empty() {
            self.body.push_str("<thead><tr>");
            for header in headers {
                let _ = write!(self.body, "<th scope=\"col\">{}</th>", escape(header.as_ref()));
            }
            self.body.push_str("</tr></thead>\n");
        }
        self.body.push_str("<tbody>\n");
        for row in rows {
            self.body.push_str("<tr>");
            for cell in row {
                let cell = cell.as_ref();
                let class = if cell.trim_end_matches('+').parse::<f64>().is_ok() { " class=\"number\"" } else { "" };
                let _ = write!(self.body, "<td{class}>{}</td>", escape(cell));
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
        self
    }

    /// Adds sentences and tables.
    #[must_use]
    pub fn findings(self, findings: &Findings) -> Self {
        findings.parts().iter().fold(self, |report, part| match part {
            Finding::Summary { sentence, rows } => report.summary(sentence, rows),
            Finding::Heading(text) => report.heading(text),
            Finding::Line(text) => report.paragraph(text),
            Finding::Code(text) => report.preformatted(text),
            Finding::Table { headers, rows } => report.table(headers, rows),
            _ => report,
        })
    }

    /// The content that was added, for insertion into another page.
    pub fn fragment(&self) -> &str {
        &self.body
    }

    /// Adds a heading and pictures; nothing if there are none.
    #[must_use]
    pub fn section<'a>(self, heading: &str, figures: impl IntoIterator<Item = &'a Figure>) -> Self {
        let mut figures = figures.into_iter().peekable();
        if figures.peek().is_none() { self } else { self.heading(heading).figures(figures) }
    }

    /// Adds pictures, side by side where there is room; pictures with several panels get a row of their own.
    #[must_use]
    pub fn figures<'a>(mut self, figures: impl IntoIterator<Item = &'a Figure>) -> Self {
        self.body.push_str("<div class=\"figures\">\n");
        for Figure { heading, picture, caption, .. } in figures {
            let class = if picture.panels() > 1 { " class=\"wide\"" } else { "" };
            let panels = picture.to_html(if caption.is_empty() { heading } else { caption });
            let (heading, caption) = (above(heading), escape(caption));
            let _ = writeln!(
                self.body,
                "<figure{class}>{heading}<div class=\"panels\">{panels}</div><figcaption>{caption}</figcaption></figure>"
            );
        }
        self.body.push_str("</div>\n");
        self
    }

    /// Adds a PNG picture with heading and caption.
    #[must_use]
    pub fn pixels(self, png: &[u8], texts: [&str; 2]) -> Self {
        self.figure(("image/png", png), "", texts)
    }

    /// Adds an SVG picture with heading and caption; it is embedded as an image, so that no script in it can run.
    #[must_use]
    pub fn image(self, svg: &[u8], texts: [&str; 2]) -> Self {
        // Panels scroll if they are too wide for the page.
        let panels = svg.windows(8).filter(|bytes| bytes == b"\n<svg x=").count();
        self.figure(("image/svg+xml", svg), if panels > 1 { " class=\"panels\"" } else { "" }, texts)
    }

    /// Adds a picture of a media type, with attributes, between its heading and its caption.
    fn figure(mut self, (media, bytes): (&str, &[u8]), attributes: &str, [heading, caption]: [&str; 2]) -> Self {
        let (data, heading, caption) = (base64(bytes), above(heading), escape(caption));
        let _ = writeln!(
            self.body,
            "<figure>{heading}<div class=\"scroll\"><img{attributes} alt=\"{caption}\" src=\"data:{media};base64,{data}\"></div>\
             <figcaption>{caption}</figcaption></figure>"
        );
        self
    }

    /// Adds the most important result: a sentence and a short table of numbers.
    #[must_use]
    pub fn summary(mut self, sentence: &str, rows: &[[String; 2]]) -> Self {
        let _ = writeln!(self.body, "<p class=\"lead\">{}</p>", escape(sentence));
        self.body.push_str("<table class=\"short\"><tbody>\n");
        for [what, value] in rows {
            let _ = writeln!(self.body, "<tr><th scope=\"row\">{}</th><td>{}</td></tr>", escape(what), escape(value));
        }
        self.body.push_str("</tbody></table>\n");
        self
    }

    /// The whole page.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{}</body>\n</html>\n",
            self.body
        )
    }
}

/// The heading of a picture; empty if it has none.
fn above(heading: &str) -> String {
    if heading.is_empty() { String::new() } else { format!("<h3>{}</h3>", escape(heading)) }
}

/// Base64 with padding (RFC 4648, section 4).
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for place in 0..4 {
            if place <= chunk.len() {
                text.push(char::from(ALPHABET[(bits >> (18 - 6 * place) & 63) as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

/// Escapes the characters that have a meaning in HTML, and drops control characters that HTML forbids.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() && !"\n\r\t".contains(c) => {}
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{LinePlot, Series, line_plot};

    #[test]
    fn everything_is_escaped_and_nothing_external() {
        let evil = "<script>alert('1' & \"2\")</script>\u{0}";
        let plot = LinePlot {
            x_label: evil.into(),
            y_label: evil.into(),
            series: vec![Series::new(evil, &[0.0, 1.0], &[0.0, 1.0])],
            ..LinePlot::default()
        };
        let (file, picture) = (String::new(), line_plot(&plot).unwrap());
        let figure = Figure { file, heading: evil.into(), picture, caption: evil.into() };
        let html = Report::new(evil)
            .heading(evil)
            .paragraph(evil)
            .link(evil, evil)
            .preformatted(evil)
            .table(&[evil], &[vec![evil, "1.5e-3"]])
            .summary(evil, &[[evil.to_string(), evil.to_string()]])
            .image(&[1, 2, 3], [evil; 2])
            .figures(&[figure])
            .to_html();
        assert!(!html.contains("<script") && !html.contains("http") && !html.contains('\u{0}'));
        // Title, header of the page, heading, paragraph, link and its text, preformatted, two cells; sentence and two cells; three of the image; the
        // figure: heading, description, caption, two labels.
        assert_eq!(html.matches("&lt;script&gt;alert(&#39;1&#39; &amp; &quot;2&quot;)&lt;/script&gt;").count(), 20);
        assert!(html.contains("data:image/svg+xml;base64,AQID\""));
        assert!(html.contains("<td class=\"number\">1.5e-3</td>"));
        assert!(html.contains("prefers-color-scheme:dark"));
        // A picture comes below its heading.
        let place = |part: &str| html.rfind(part).unwrap();
        assert!(place("<h3>") < place("class=\"panels\"") && place("class=\"panels\"") < place("<figcaption>"));
    }

    #[test]
    fn base64_of_the_standard() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xff, 0xfe, 0xfd]), "//79");
    }
}
