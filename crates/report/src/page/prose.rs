//! Sentences with commands and keys between backticks, as in Markdown.

use maud::{Markup, html};

/// The sentence as HTML; text between backticks becomes code.
pub(crate) fn prose(sentence: &str) -> Markup {
    let parts: Vec<&str> = sentence.split('`').collect();
    // An unmatched backtick stays a backtick.
    let is_paired = parts.len() % 2 == 1;
    html! {
        @if is_paired {
            @for (index, part) in parts.iter().enumerate() {
                @if index % 2 == 1 { code { (part) } } @else { (part) }
            }
        } @else { (sentence) }
    }
}

/// The same with a capital first letter and a final full stop.
pub(crate) fn sentence(text: &str) -> Markup {
    let text = text.trim();
    let mut letters = text.chars();
    let first = letters.next();
    // Symbols (T2, alpha_A) keep their case.
    let is_word = letters.clone().next().is_some_and(char::is_alphabetic)
        && !text.split_whitespace().next().is_some_and(|word| word.contains('_'));
    let capital: String = match first {
        Some(first) if is_word => first.to_uppercase().chain(letters).collect(),
        _ => text.to_owned(),
    };
    prose(&if capital.ends_with(['.', ':', '!', '?']) { capital } else { format!("{capital}.") })
}

#[cfg(test)]
mod tests {
    use super::{prose, sentence};

    #[test]
    fn code_is_between_backticks_and_markup_stays_text() {
        assert_eq!(prose("`joint` finds <it>").into_string(), "<code>joint</code> finds &lt;it&gt;");
        assert_eq!(prose("one ` alone").into_string(), "one ` alone");
    }

    #[test]
    fn sentences_begin_and_end_as_sentences_do() {
        assert_eq!(sentence("no jump leads here").into_string(), "No jump leads here.");
        assert_eq!(sentence("alpha_A is assumed.").into_string(), "alpha_A is assumed.");
        assert_eq!(sentence("`joint` finds it").into_string(), "<code>joint</code> finds it.");
    }
}
