//! The diagnosis of the gap to the nominal model, if there is one.

use crate::page::run_page::RunPage;
use maud::{Markup, html};

pub(crate) fn gap(page: &RunPage<'_>) -> Markup {
    html! {
        @if let Some(diagnosis) = &page.gap {
            section #gap aria-labelledby="gap-head" {
                h2 #gap-head { "Gap to the nominal model" }
                (diagnosis)
            }
        }
    }
}
