//! `mapper gap diagnose`: diagnoses the difference between a recording and the nominal model.

use crate::command_line::channel_map;
use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output::FileOutput;
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_diagnose::gap::ClosureTerm;
use mapper_report::{Describe, Document, headline, with_messages};
use mapper_session::{
    DIAGNOSIS_FORMAT, Existing, Gap, Recorded, Session, SessionEvent, check_all_distinct, diagnosis_of_run,
    json_text, write_file,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Find where a recording departs from the nominal model, which effect causes it, how much that reduces the gap, and what to do next
#[derive(Debug, Args)]
pub struct Diagnose {
    /// Campaign with machine, declared uncertainties and tolerances (YAML)
    pub campaign: PathBuf,
    /// Run directory, MCAP file, or log of another program; several are diagnosed separately
    #[arg(value_name = "RECORDING", required_unless_present = "named")]
    pub recordings: Vec<PathBuf>,
    /// The same, by name
    #[arg(long = "recording", value_name = "FILE")]
    pub named: Vec<PathBuf>,
    /// Reference recording of the same rig and steps, fault-free: report changes since then, not what is missing in the model
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "MAP")]
    pub channels: Option<PathBuf>,
    /// Also try a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// List causes below 5 %, too
    #[arg(long)]
    pub all: bool,
    /// Write each closure term that is found as an effect in rhai into this directory
    #[arg(long, value_name = "DIR")]
    pub closure_terms: Option<PathBuf>,
    /// Write the diagnosis to this file, from which `gap correct`, `report --gap`, `gap apply` and `gap predict` continue [default: next to the
    /// recording of a run directory]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Also write an HTML page with pictures to this new file
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Diagnose {
    /// Diagnoses one recording, or each of several.
    pub fn run(&self) -> Result<(), Failure> {
        self.html.iter().chain(&self.out).try_for_each(|file| self.output.existing().check(file))?;
        interrupt::end_at_once()?;
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry();
        let effects = registry.effects_with(&self.effects)?;
        let read = |file: &PathBuf| Recorded::read(&registry, file, &map, Some(&campaign));
        let baseline = self.baseline.as_ref().map(read).transpose()?;
        let progress = output_options::progress();
        progress.show(&SessionEvent::Progress { done_ratio: 0.0, what: "reading".to_owned() });
        let read_run = |file: &PathBuf| Recorded::read_run(&registry, file, &map, Some(&campaign));
        // Each part of a resumed run is a separate recording.
        let recordings = self.recordings.iter().chain(&self.named).map(read_run);
        let recordings: Vec<Recorded> =
            recordings.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        check_all_distinct(recordings.iter().chain(&baseline))?;
        let files = [&self.html, &self.closure_terms, &self.out];
        if files.iter().any(|file| file.is_some()) && recordings.len() > 1 {
            let message =
                "--out, --html and --closure-terms need exactly one recording (a resumed run has several)";
            return Err(Failure::new(Code::BadInput, message));
        }
        let kept = self.out.clone().or_else(|| recordings.first().and_then(diagnosis_of_run));
        let mut gaps = Vec::with_capacity(recordings.len());
        for recorded in recordings {
            let on_event = |event: &_| progress.show(event);
            let session = Session { on_event: &on_event, ..Session::new(&registry) };
            let mut gap =
                session.diagnose_gap(&recorded, &campaign, &map, effects.clone(), baseline.as_ref())?;
            progress.clear();
            gap.diagnosed.diagnosis.lists_all = self.all;
            gaps.push((recorded.path.display().to_string(), gap));
        }
        if let [(title, gap)] = &mut gaps[..] {
            self.write_closure_terms(&mut gap.diagnosed.diagnosis.closure_terms)?;
            if let Some(file) = &self.html {
                let page = gap.page(&campaign.machine.name, title)?;
                self.output.write(file, page.as_bytes())?;
            }
            if let Some(file) = kept {
                self.write_diagnosis(&file, gap)?;
            }
        }
        if let [(_, gap)] = &gaps[..] {
            return if self.output.json {
                standard_output::print_json(&with_messages(|| gap.json())?)
            } else {
                standard_output::show(&document(gap))
            };
        }
        if self.output.json {
            let each: Result<Vec<Value>, Failure> = gaps
                .iter()
                .map(|(path, gap)| {
                    let mut value = with_messages(|| gap.json())?;
                    value["recording"] = json!(path);
                    Ok(value)
                })
                .collect();
            let each = json!({ "format_version": DIAGNOSIS_FORMAT, "recordings": each? });
            return standard_output::print_json(&each);
        }
        let mut document = Document::default();
        let head = |(path, gap): &(String, Gap)| format!("{path}: {}", headline(&gap.diagnosed.diagnosis));
        document.list(gaps.iter().map(head));
        standard_output::show(&document)
    }

    /// Writes the file of the diagnosis. That of a run directory belongs to the program, which replaces it.
    fn write_diagnosis(&self, file: &Path, gap: &Gap) -> Result<(), Failure> {
        let text = json_text(&with_messages(|| gap.json())?)?;
        if self.out.is_some() {
            return Ok(self.output.write(file, text.as_bytes())?);
        }
        if let Err(error) = write_file(file, text.as_bytes(), Existing::Replaced) {
            standard_output::say(&format!("the diagnosis is not kept: {error}\n"));
        }
        Ok(())
    }

    /// Writes the closure terms that can be written into `directory`; next to the page if only that was asked for.
    fn write_closure_terms(&self, terms: &mut [ClosureTerm]) -> Result<(), Failure> {
        let (directory, page) = (self.closure_terms.as_deref(), self.html.as_deref());
        if let Some(directory) = directory.filter(|_| terms.iter().any(|term| term.script.is_some())) {
            std::fs::create_dir_all(directory)
                .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", directory.display())))?;
        }
        for (place, term) in terms.iter_mut().enumerate() {
            let Some(script) = &term.script else { continue };
            let file = match (directory, page) {
                (Some(directory), _) => directory.join(format!("closure_term_{}.rhai", place + 1)),
                (None, Some(page)) => page.with_extension(format!("closure_term_{}.rhai", place + 1)),
                (None, None) => continue,
            };
            self.output.write(&file, script.as_bytes())?;
            term.rhai = Some(file.display().to_string());
        }
        Ok(())
    }
}

fn document(gap: &Gap) -> Document {
    let mut document = gap.diagnosed.diagnosis.document();
    document.append(gap.sensors.document());
    document.append(gap.diagnosed.zero.document());
    document
}
