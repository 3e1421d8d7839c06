//! A report as one HTML page that needs nothing else: no scripts, nothing from elsewhere, pictures within the text.
//!
//! Drawings of [`super::svg::frame`] follow the page's colours, by day and by night; those of plotters keep their own.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::svg::escape;

const STYLE: &str = include_str!("page.css");

/// The page: its title, rules of style beside those that all pages have, and what it shows, as HTML.
#[must_use]
pub fn document(title: &str, style: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        escape(title)
    )
}

/// A section: its heading, a sentence about it (none if empty), and its content as HTML.
#[must_use]
pub fn section(heading: &str, explanation: &str, content: &str) -> String {
    let explanation = if explanation.is_empty() { String::new() } else { format!("<p class=\"aside\">{}</p>\n", escape(explanation)) };
    format!("<section>\n<h2>{}</h2>\n{explanation}{content}\n</section>\n", escape(heading))
}

/// Sentences as a list; those that are warnings stand out.
#[must_use]
pub fn sentences<'s>(sentences: impl IntoIterator<Item = (&'s str, bool)>) -> String {
    let item = |(text, warning): (&str, bool)| format!("<li{}>{}</li>\n", if warning { " class=\"warning\"" } else { "" }, escape(text));
    format!("<ul>\n{}</ul>", sentences.into_iter().map(item).collect::<String>())
}

/// Drawings with their captions beside and below each other, as there is room.
#[must_use]
pub fn grid(figures: impl IntoIterator<Item = (String, String)>) -> String {
    let one = |(caption, svg): (String, String)| format!("<figure><figcaption>{}</figcaption>{svg}</figure>\n", escape(&caption));
    format!("<div class=\"grid\">\n{}</div>", figures.into_iter().map(one).collect::<String>())
}

/// A PNG file as what `href` and `src` take.
#[must_use]
pub fn png_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_files_stays_text() {
        let bad = "<img src=x onerror=\"alert(1)\">";
        let body = section(bad, bad, &[sentences([(bad, true)]), grid([(bad.to_owned(), String::new())])].concat());
        let page = document(bad, ".own { color: red; }\n", &body);
        assert!(!page.contains("<img") && page.contains(".own") && page.contains("class=\"warning\""), "{page}");
        assert_eq!(page.matches("&lt;img").count(), 5);
    }

    #[test]
    fn bytes_are_coded_as_rfc_4648_says() {
        assert_eq!(png_uri(b"foobar"), "data:image/png;base64,Zm9vYmFy");
    }
}
