//! The text of a score.

use crate::blind::scoring::interval::Share;
use crate::blind::scoring::score::{CLASSES_SIGMA, Score, ScoredCase};
use std::collections::BTreeSet;

impl Score {
    /// A heading and a row for each class of signature length.
    pub fn class_rows(&self) -> Vec<[String; 6]> {
        let heading =
            ["signature", "single", "both of two", "one of two", "outside, said so", "falsely explained"];
        let ends = CLASSES_SIGMA.iter();
        let rows = self.classes.iter().zip(ends).map(|(class, end)| {
            let range = if end.is_finite() {
                format!("{:.0} to {end:.0} sigma", class.from_sigma)
            } else {
                format!("{:.0} sigma and more", class.from_sigma)
            };
            let share = |share: Share| format!("{}/{}", share.hits, share.trials);
            let shares =
                [class.single, class.pair, class.one_of_pair, class.outside, class.falsely_explained];
            let [single, pair, one, outside, falsely] = shares.map(share);
            [range, single, pair, one, outside, falsely]
        });
        std::iter::once(heading.map(str::to_owned)).chain(rows).collect()
    }

    /// Labels and values of the table, in its order.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let number = |value: Option<f64>, decimals: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        let percent = self.parameter_error_median.map(|error| 100.0 * error);
        vec![
            ("no effect, none named", self.none.to_string()),
            ("  an effect named", self.none_named.to_string()),
            ("single effect named", self.single.to_string()),
            ("both of two named", self.pair.to_string()),
            ("  at least one of two", self.one_of_pair.to_string()),
            ("all of three named", self.triple.to_string()),
            ("  at least two of three", self.two_of_triple.to_string()),
            ("outside, said so", self.outside.to_string()),
            ("  falsely explained", self.falsely_explained.to_string()),
            ("place right (first two)", self.place.to_string()),
            ("parameter error, median", format!("{} %", number(percent, 1))),
            ("95 % interval covers truth", self.covered.to_string()),
            ("gap reduction, median", number(self.gap_reduction_median, 3)),
            ("mean squared error of p", number(self.squared_miss_mean, 3)),
            ("set size, mean", number(self.set_size_mean, 2)),
        ]
    }

    /// A line for each case.
    pub fn case_lines(&self) -> String {
        let line = |case: &ScoredCase| {
            format!(
                "{}: {} {}{} -> {} {} {}\n",
                case.name,
                case.kind.name(),
                list(&case.causes),
                case.sigma.map_or_else(String::new, |sigma| format!(" ({sigma:.0} sigma)")),
                case.verdict.as_deref().unwrap_or("no diagnosis"),
                list(&case.named),
                if case.right { "ok" } else { "WRONG" },
            )
        };
        self.cases.iter().map(line).collect()
    }

    /// The table in Markdown with a second column for other cases, e.g. the same causes in another simulator.
    pub fn compare_with(&self, heads: [&str; 2], other: &Score) -> String {
        let mut text = format!("| | {} | {} |\n|---|---|---|\n", heads[0], heads[1]);
        for ((label, own_shares), (_, other_shares)) in self.rows().into_iter().zip(other.rows()) {
            text += &format!("| {} | {own_shares} | {other_shares} |\n", label.trim());
        }
        text
    }
}

fn list(ids: &BTreeSet<String>) -> String {
    if ids.is_empty() { "-".to_owned() } else { ids.iter().cloned().collect::<Vec<_>>().join(" + ") }
}
