//! Text in an SVG: escaping, an estimate of its width, wrapping.

/// Escapes text for XML content and attributes; characters XML 1.0 forbids become U+FFFD.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            '\t' | '\n' | '\r' => out.push(' '),
            c if c.is_control() || matches!(c, '\u{FFFE}' | '\u{FFFF}') => out.push('\u{FFFD}'),
            c => out.push(c),
        }
    }
    out
}

/// Estimated width, px; generous, because the viewer chooses the font.
pub(crate) fn width_px(text: &str, font_px: f64) -> f64 {
    let em: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | ' ' | '(' | ')' | '/' => 0.36,
            'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.92,
            c if (c as u32) > 0x2E80 => 1.0,
            _ => 0.61,
        })
        .sum();
    em * font_px
}

/// Breaks text at spaces into lines no wider than `max_px`; a single word that is too wide is cut with an ellipsis.
pub(crate) fn wrap(text: &str, font_px: f64, max_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let word = cut(word, font_px, max_px);
        let joined = if line.is_empty() { word.clone() } else { format!("{line} {word}") };
        if line.is_empty() || width_px(&joined, font_px) <= max_px {
            line = joined;
        } else {
            lines.push(std::mem::replace(&mut line, word));
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    lines
}

pub(crate) fn cut(text: &str, font_px: f64, max_px: f64) -> String {
    if width_px(text, font_px) <= max_px {
        return text.to_owned();
    }
    let mut out = String::new();
    for c in text.chars() {
        if width_px(&out, font_px) + 2.0 * font_px > max_px {
            break;
        }
        out.push(c);
    }
    out.push('…');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_and_control_characters_are_harmless() {
        assert_eq!(escape("a<b & \"c\"\u{0}\n'd'>"), "a&lt;b &amp; &quot;c&quot;\u{FFFD} &apos;d&apos;&gt;");
    }

    #[test]
    fn wrapped_lines_keep_all_words_and_fit() {
        let text = "reference state 298 K, 100 kPa; method dynamic; efficiency total to total";
        let lines = wrap(text, 12.0, 200.0);
        assert_eq!(lines.join(" "), text);
        assert!(lines.iter().all(|line| width_px(line, 12.0) <= 200.0));
        assert!(wrap(&"x".repeat(500), 12.0, 200.0)[0].ends_with('…'));
    }
}
