//! `mapper report`: the page of a run, with other runs for comparison.

use crate::command_line::RecordingReading;
use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output::FileOutput;
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_recording::ChannelMap;
use mapper_session::{Gap, Recorded, Registry, Session, SessionError, page_as_pdf};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Make the page of a run: map, points, transients, plan and provenance in one HTML file
#[derive(Debug, Args)]
pub struct Report {
    /// Run directory, MCAP file or log of another program; further ones are drawn for comparison
    #[arg(required = true, value_name = "RUN")]
    pub runs: Vec<PathBuf>,
    /// Write the page here [default: RUN/report.html for one run directory, otherwise report.html]
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub reading: RecordingReading,
    /// Also show the gap between the first run and the nominal model of this campaign: the diagnosis that `gap diagnose` left next to the
    /// recording, otherwise a new one, which takes up to a minute
    #[arg(long, value_name = "CAMPAIGN")]
    pub gap: Option<PathBuf>,
    /// Also print the page to a PDF next to it; needs Chromium on the path
    #[arg(long)]
    pub pdf: bool,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Report {
    pub fn run(&self) -> Result<(), Failure> {
        let out = self.out.clone().unwrap_or_else(|| match self.runs.as_slice() {
            [run] if run.is_dir() => run.join("report.html"),
            _ => PathBuf::from("report.html"),
        });
        // The page of a run directory is made from its recording, so it may be replaced.
        let is_own = self.out.is_none() && out.parent().is_some_and(|parent| !parent.as_os_str().is_empty());
        let replace = FileOutput { json: self.output.json, force: self.output.force || is_own };
        replace.existing().check(&out)?;
        let (map, given) = self.reading.read()?;
        let registry = registry();
        let read = |path: &PathBuf| Recorded::read_run(&registry, path, &map, given.as_ref());
        let mut runs = self.runs.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let others = runs.split_off(1.min(runs.len()));
        let shown = runs.pop().ok_or(SessionError::NoRecording)?;
        let first = shown.first().ok_or(SessionError::NoRecording)?;
        let gap = self.gap.as_deref().map(|file| diagnose(file, &registry, first, &map)).transpose()?;
        let page = Session::new(&registry).page(shown, others, &map, gap.as_ref())?;
        replace.write(&out, page.as_bytes())?;
        let mut files = vec![("page", out.clone())];
        if self.pdf {
            let progress = output_options::progress();
            progress.begin("printing");
            let directory = out.parent().filter(|parent| !parent.as_os_str().is_empty());
            let pdf = page_as_pdf(&page, directory.unwrap_or(Path::new(".")))
                .map_err(|error| Failure::new(Code::Failure, error))?;
            files.push(("pdf", out.with_extension("pdf")));
            replace.write(&files[1].1, &pdf)?;
        }
        if self.output.json {
            return standard_output::print_json(&files.into_iter().collect::<BTreeMap<_, _>>());
        }
        let line = |(what, path): &(&str, PathBuf)| format!("{what:<11}{}\n", path.display());
        standard_output::print(&files.iter().map(line).collect::<String>())
    }
}

fn diagnose(file: &Path, registry: &Registry, recorded: &Recorded, map: &ChannelMap) -> Result<Gap, Failure> {
    let campaign = mapper_campaign::load(file).map_err(Failure::of_campaign)?;
    let effects = registry.effects_with(&[])?;
    let progress = output_options::progress();
    let on_event = |event: &_| progress.show(event);
    let session = Session { on_event: &on_event, ..Session::new(registry) };
    interrupt::end_at_once()?;
    let gap = session.gap(recorded, (&campaign, map), effects, None);
    progress.clear();
    let gap = gap?;
    standard_output::warn_of_unused(&gap);
    Ok(gap)
}
