//! One self-contained HTML page.

use std::fmt::Write as _;

const STYLE: &str = "\
:root{color-scheme:light dark;--text:#1c2330;--muted:#5b6472;--page:#ffffff;--line:#d9dee6;--head:#f2f5f9}
@media (prefers-color-scheme:dark){:root{--text:#e4e8ee;--muted:#9aa5b4;--page:#14181f;--line:#333b47;--head:#1d232c}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2.5rem 1.25rem 4rem;max-width:62rem;background:var(--page);color:var(--text);\
font:16px/1.55 system-ui,-apple-system,\"Segoe UI\",Roboto,sans-serif}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 1rem}
h2{font-size:1.3rem;margin:2.5rem 0 .75rem;padding-bottom:.3rem;border-bottom:1px solid var(--line)}
p{margin:.75rem 0}
.scroll{overflow-x:auto;margin:1rem 0}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.93rem}
th,td{padding:.4rem .8rem;border-bottom:1px solid var(--line);text-align:left;white-space:nowrap}
th{background:var(--head);font-weight:600}
td.number{text-align:right}
figure{margin:1.75rem 0}
figure img{display:block;max-width:100%;height:auto;background:#fff;border:1px solid var(--line);border-radius:6px}
figcaption{margin-top:.5rem;color:var(--muted);font-size:.92rem}
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
                let class = if cell.parse::<f64>().is_ok() { " class=\"number\"" } else { "" };
                let _ = write!(self.body, "<td{class}>{}</td>", escape(cell));
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
        self
    }

    /// Adds a picture from PNG bytes.
    #[must_use]
    pub fn figure(mut self, png: &[u8], caption: &str) -> Self {
        let caption = escape(caption);
        let data = base64(png);
        let _ = writeln!(
            self.body,
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
        );
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

/// Text with the characters that mean something in HTML replaced; control characters that HTML forbids are dropped.
fn escape(text: &str) -> String {
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

/// Base64 with padding (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xff, 0xfe, 0xfd]), "//79");
    }

    #[test]
    fn everything_is_escaped_and_nothing_external() {
        let evil = "<script>alert('1' & \"2\")</script>\u{0}";
        let html = Report::new(evil)
            .heading(evil)
            .paragraph(evil)
            .preformatted(evil)
            .table(&[evil], &[vec![evil, "1.5e-3"]])
            .figure(&[1, 2, 3], evil)
            .to_html();
        assert!(!html.contains("<script") && !html.contains("http") && !html.contains('\u{0}'));
        assert_eq!(html.matches("&lt;script&gt;alert(&#39;1&#39; &amp; &quot;2&quot;)&lt;/script&gt;").count(), 9);
        assert!(html.contains("data:image/png;base64,AQID\""));
        assert!(html.contains("<td class=\"number\">1.5e-3</td>"));
        assert!(html.contains("prefers-color-scheme:dark"));
    }
}
