//! The pages of the workbench: the list of runs, a run, a comparison. Without a script: searching and choosing are forms.

use crate::document::{Describe, Document};
use crate::nights::{TEXT_COLUMNS, run_table, run_values};
use crate::page::run_page::{Purpose, shell};
use crate::pictures::maps_figure;
use mapper_core::CompressorMap;
use mapper_history::{CatalogueFilter, CataloguePage, CataloguedRun};
use mapper_maps::MapComparison;
use maud::{Markup, html};

/// What the list of runs shows.
pub struct RunList<'a> {
    /// The indexed directory.
    pub directory: &'a str,
    /// The filter.
    pub filter: &'a CatalogueFilter,
    /// The runs of this page.
    pub page: &'a CataloguePage,
    /// Machines to choose from.
    pub machines: &'a [String],
    /// Tags to choose from.
    pub tags: &'a [String],
    /// Folders that cannot be read, each with the reason.
    pub unreadable: &'a [(String, String)],
}

fn studio_page(title: &str, body: &Markup) -> Result<String, serde_json::Error> {
    let body = html! {
        header {
            nav aria-label="Workbench" { a href="/" { "Runs" } }
            h1 { (title) }
        }
        main #studio { (body) }
    };
    shell(&format!("{title} - mapper studio"), title, Purpose::Studio, &(), &body)
}

/// The page that asks for the token. Its script takes the one behind the `#` of the printed address.
pub fn sign_in_page() -> Result<String, serde_json::Error> {
    let body = html! {
        header { h1 { "mapper studio" } }
        main #studio {
            p { "Open the address that `mapper studio` printed, with all that stands behind its #, or enter the token here." }
            form method="post" action="/session" {
                label { "Token " input type="password" name="token" autocomplete="off" required; }
                " " button { "Sign in" }
            }
        }
    };
    shell("mapper studio", "mapper studio", Purpose::SignIn, &(), &body)
}

/// A page with one message and what to do.
pub fn studio_message(title: &str, message: &str) -> Result<String, serde_json::Error> {
    studio_page(title, &html! { p role="alert" { (message) } p { a href="/" { "Back to the runs" } } })
}

impl RunList<'_> {
    /// The page.
    pub fn page(&self) -> Result<String, serde_json::Error> {
        let CataloguePage { runs, matching, all } = self.page;
        let option = |value: &str, chosen: Option<&String>| {
            html! { option value=(value) selected[chosen.is_some_and(|chosen| chosen == value)] { (value) } }
        };
        let filter = self.filter;
        let is_filtered =
            !filter.words.is_empty() || filter.machine.is_some() || filter.tag.is_some() || filter.attention;
        let body = html! {
            p.under { "Folders with runs below " code { (self.directory) } "." }
            form.filter #filter method="get" action="/" role="search" {
                label { "Words " input type="search" name="words" value=(filter.words) size="24"; }
                label { "Machine " select name="machine" {
                    option value="" { "any" }
                    @for machine in self.machines { (option(machine, filter.machine.as_ref())) }
                } }
                label { "Tag " select name="tag" {
                    option value="" { "any" }
                    @for tag in self.tags { (option(tag, filter.tag.as_ref())) }
                } }
                label { input type="checkbox" name="attention" value="1" checked[filter.attention]; " needs attention" }
                button { "Search" }
                @if is_filtered { " " a href="/" { "Show all" } }
            }
            form method="post" action="/index" { button { "Look for new runs" } }
            p role="status" #count {
                @if *matching == *all { (all) " runs." } @else { (matching) " of " (all) " runs." }
                @if runs.len() < *matching { " Shown: " (filter.skip + 1) " to " (filter.skip + runs.len()) "." }
            }
            @if runs.is_empty() {
                p #empty {
                    @if *all == 0 { "No runs yet. Run a campaign with its output below this directory, or copy a run folder here, then look for new runs." }
                    @else { "No run has all of that. Use fewer words, or show all." }
                }
            } @else {
                form method="get" action="/compare" {
                    div.buttons { button { "Compare the chosen runs" } span.under { "two to six; the first in the list is the reference" } }
                    (choice_of_runs(runs))
                }
                div.buttons {
                    @let (newer, older) = (filter.skip.checked_sub(filter.limit), filter.skip + filter.limit);
                    @if let Some(skip) = newer { button form="filter" name="skip" value=(skip) { "Newer runs" } }
                    @if older < *matching { button form="filter" name="skip" value=(older) { "Older runs" } }
                }
            }
            @if !self.unreadable.is_empty() {
                h2 { "Folders that cannot be read" }
                ul #unreadable { @for (folder, why) in self.unreadable { li { code { (folder) } ": " (why) } } }
            }
        };
        studio_page("Runs", &body)
    }
}

fn choice_of_runs(runs: &[CataloguedRun]) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="Runs" {
            table.data #runs {
                thead {
                    tr {
                        th.text scope="col" { "choose" }
                        @for (column, (head, _)) in run_values(&CataloguedRun::default()).into_iter().enumerate() {
                            th.text[column == 0 || TEXT_COLUMNS.contains(&column)] scope="col" { (head) }
                        }
                        @for head in ["folder", "comment"] { th.text scope="col" { (head) } }
                    }
                }
                tbody {
                    @for run in runs {
                        tr data-run=(run.id) {
                            td.text { input type="checkbox" name="run" value=(run.id) aria-label=(format!("choose {}", run.folder)); }
                            @for (column, (head, value)) in run_values(run).into_iter().enumerate() {
                                @let regular = head != "end" || run.summary.is_regular();
                                td.text[column == 0 || TEXT_COLUMNS.contains(&column)].unusable[!regular] {
                                    @if column == 0 { a href=(format!("/run?run={}", run.id)) { (value) } }
                                    @else { (value) }
                                }
                            }
                            td.text { (run.folder) }
                            td.text { (run.comment) }
                        }
                    }
                }
            }
        }
        p.under { "Drift: largest change of efficiency between visits of a repeated jump; worst +/-: half of the widest 95 % interval of efficiency of a usable point; both in points." }
    }
}

/// The page of one run: its row, files, exports, tags and comment.
pub fn studio_run_page(
    run: &CataloguedRun,
    is_run_now: bool,
    files: &[String],
    formats: &[&str],
) -> Result<String, serde_json::Error> {
    let summary = &run.summary;
    let mut facts = Document::default();
    let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
    let further = [
        ("hash of the campaign", known(&summary.campaign_sha256)),
        ("program", known(&summary.program)),
        ("folder", run.folder.clone()),
    ];
    facts.facts("", run_values(run).into_iter().chain(further));
    let body = html! {
        @if is_run_now { p role="status" #running { "A process is running it now. This page does not disturb it." } }
        @if let Some(problem) = &summary.problem { p.unusable role="alert" { (problem) } }
        (facts.html())
        h2 { "Tags and comment" }
        form method="post" action="/note" {
            input type="hidden" name="run" value=(run.id);
            p { label { "Tags, separated by commas " input name="tags" value=(run.tags.join(", ")) maxlength="1000" size="30"; } }
            p { label for="comment" { "Comment" } br; textarea #comment name="comment" rows="3" maxlength="4000" { (run.comment) } }
            button { "Keep" }
        }
        h2 { "Report and files" }
        @if files.is_empty() { p { "The run has no results yet." } }
        ul {
            @for file in files {
                li { a href=(format!("/file?run={}&name={file}", run.id)) { (file) } }
            }
        }
        @if files.iter().any(|file| file == "map.json") {
            h2 { "Its map in another format" }
            ul.signs { @for format in formats { li { a href=(format!("/export?run={}&format={format}", run.id)) download { (format) } } } }
        }
    };
    studio_page(if run.folder == "." { "Run" } else { &run.folder }, &body)
}

/// The comparison of two to six runs: the maps on one figure, and what differs most first.
pub fn compare_page(
    runs: &[&CataloguedRun],
    maps: &[CompressorMap],
    comparisons: &[MapComparison],
    formats: &[&str],
) -> Result<String, serde_json::Error> {
    let names: Vec<&str> = runs.iter().map(|run| run.folder.as_str()).collect();
    let reference = names.first().copied().unwrap_or_default();
    let mut document = Document::default();
    document.figures(
        &format!("Solid to dash-dotted: one style and colour a run. Corrected to the state of {reference}."),
        vec![maps_figure(maps, &names)],
    );
    let mut others: Vec<(&&str, &MapComparison)> = names.iter().skip(1).zip(comparisons).collect();
    others.sort_by(|(_, a), (_, b)| b.differs_ratio().total_cmp(&a.differs_ratio()));
    for (name, comparison) in others {
        document.section(format!("{name} minus {reference}"), comparison.document());
    }
    let mut properties = Document::default();
    properties.table(run_table(runs.iter().copied()));
    properties.text(campaign_sentence(runs));
    document.section("Runs", properties);
    let body = html! {
        (document.html())
        h2 { "Maps as files" }
        ul {
            @for run in runs {
                li { (run.folder) ": " @for format in formats {
                    a href=(format!("/export?run={}&format={format}", run.id)) download { (format) } " "
                } }
            }
        }
    };
    studio_page("Comparison of runs", &body)
}

fn campaign_sentence(runs: &[&CataloguedRun]) -> &'static str {
    let hashes: Option<Vec<&String>> = runs.iter().map(|run| run.summary.campaign_sha256.as_ref()).collect();
    match hashes {
        Some(hashes) if hashes.windows(2).all(|pair| pair[0] == pair[1]) => "All have the same campaign.",
        Some(_) => "Their campaigns differ.",
        None => "Whether their campaigns differ is not known: one has no journal.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hostile_name_is_text_on_every_page() {
        let hostile = "</td><script>alert(1)</script>&\"'";
        let run = CataloguedRun {
            id: 1,
            folder: hostile.to_owned(),
            summary: mapper_history::RunSummary {
                machine: hostile.to_owned(),
                campaign: hostile.to_owned(),
                problem: Some(hostile.to_owned()),
                ..Default::default()
            },
            tags: vec![hostile.to_owned()],
            comment: hostile.to_owned(),
        };
        let filter = CatalogueFilter {
            words: hostile.to_owned(),
            tag: Some(hostile.to_owned()),
            ..Default::default()
        };
        let page = CataloguePage { runs: vec![run.clone()], matching: 2, all: 3 };
        let names = [hostile.to_owned()];
        let unreadable = [(hostile.to_owned(), hostile.to_owned())];
        let list = RunList {
            directory: hostile,
            filter: &filter,
            page: &page,
            machines: &names,
            tags: &names,
            unreadable: &unreadable,
        };
        for page in [
            list.page().unwrap(),
            studio_run_page(&run, true, &names, &[]).unwrap(),
            studio_message(hostile, hostile).unwrap(),
            compare_page(&[&run, &run], &[], &[], &[]).unwrap(),
        ] {
            assert!(!page.contains("<script"), "{page}");
            assert!(page.contains("script-src 'none'") && page.contains("form-action 'self'"));
            assert!(!page.contains("&\"'\""), "an attribute ends early");
        }
    }
}
