//! What drawings on HTML pages share: escaped text, a described frame, round numbers.

/// Text as HTML and XML take it, in content and in quoted attributes. Control characters, which XML has no place for, are left out.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() && !matches!(c, '\n' | '\t') => {}
            c => escaped.push(c),
        }
    }
    escaped
}

/// A drawing of this size with its title and its description, for those who cannot see it.
#[must_use]
pub fn frame(id: &str, [width, height]: [f64; 2], title: &str, description: &str, inside: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-labelledby=\"{id}-t {id}-d\">\
         <title id=\"{id}-t\">{}</title><desc id=\"{id}-d\">{}</desc>{inside}</svg>",
        escape(title),
        escape(description)
    )
}

/// Text at a point; `class` gives its anchor and colour.
#[must_use]
pub fn text(x: f64, y: f64, class: &str, content: &str) -> String {
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{}</text>", escape(content))
}

/// A rectangle; one of no width is not drawn.
#[must_use]
pub fn rectangle([x, y, width, height]: [f64; 4], class: &str) -> String {
    if !(width > 0.0 && height > 0.0) {
        return String::new();
    }
    format!("<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" class=\"{class}\"/>")
}

/// A line.
#[must_use]
pub fn line([x1, y1, x2, y2]: [f64; 4], class: &str) -> String {
    format!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" class=\"{class}\"/>")
}

/// Three significant digits; a dash for what is no number.
#[must_use]
pub fn figure(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    let digits = if size == 0.0 { 0.0 } else { (2.0 - size.log10().floor()).max(0.0) };
    format!("{value:.0$}", digits as usize)
}

/// Round numbers from `low` to `high`, about `count` of them.
#[must_use]
pub fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let rough = (high - low) / count.max(1) as f64;
    if !(rough.is_finite() && rough > 0.0) {
        return vec![low];
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= 0.999 * rough).unwrap_or(10.0 * power);
    let first = (low / step).ceil();
    let last = ((high / step).floor() - first).clamp(0.0, 100.0) as usize;
    (0..=last).map(|k| (first + k as f64) * step).collect()
}

/// A tick with no more digits than it needs.
#[must_use]
pub fn tick(value: f64) -> String {
    let rounded = format!("{value:.6}");
    let trimmed = rounded.trim_end_matches('0').trim_end_matches('.');
    if trimmed == "-0" { "0".to_owned() } else { trimmed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_leave_its_place() {
        assert_eq!(escape("<b a='\"'>&\u{1}"), "&lt;b a=&#39;&quot;&#39;&gt;&amp;");
    }

    #[test]
    fn numbers_are_short() {
        let shown: Vec<String> = [0.0, 2.284, 0.0512, 123.4, -1.5, 2e-7, f64::NAN].map(figure).into();
        assert_eq!(shown, ["0", "2.28", "0.0512", "123", "-1.50", "2.00e-7", "-"]);
        assert_eq!(ticks(-1.2, 1.2, 4), [-1.0, 0.0, 1.0]);
        assert_eq!(ticks(0.0, 0.0, 4), [0.0]);
        assert_eq!((tick(-0.0), tick(0.25), tick(50.0)), ("0".into(), "0.25".into(), "50".into()));
    }
}
