//! Diagnosis of the gap between a rig and its nominal machine.

use crate::campaign::Campaign;
use crate::error::Error;
use crate::identification::{Described, Identification};
use crate::recording::Recording;
use crate::run::Observer;
use mapper_core::Method;
use mapper_diagnose::gap::CorrectedMap;
use mapper_session::{Gap, Session, SessionEvent};
use serde_json::Value;
use std::path::PathBuf;

/// How a recording is diagnosed. The default: with the effect library alone.
#[derive(Clone, Default)]
pub struct DiagnosisOptions {
    /// Suspected effects in addition to the library, written in rhai.
    pub effects: Vec<PathBuf>,
    /// A recording of the machine before something changed: what is in both belongs to the rig.
    pub baseline: Option<Recording>,
    /// Method of the identification that follows a correction, in place of the campaign's.
    pub method: Option<Method>,
    /// Observer of the progress.
    pub observer: Option<Observer>,
}

impl DiagnosisOptions {
    pub(crate) fn diagnose(&self, recording: &Recording, campaign: &Campaign) -> Result<Diagnosis, Error> {
        let effects = recording.plugins.effects_with(&self.effects)?;
        let recorded = recording.only_part(campaign)?;
        let baseline = self.baseline.as_ref().map(|baseline| baseline.described_by(Some(campaign)));
        let baseline = baseline.transpose()?.and_then(|parts| parts.into_iter().next());
        let (settings, channels) = (campaign.settings(), &recording.contents.channels);
        let on_event = |event: &SessionEvent| self.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&recording.plugins) };
        let gap = session.diagnose_gap(&recorded, settings, channels, effects, baseline.as_ref())?;
        Ok(Diagnosis { gap })
    }

    pub(crate) fn correct(&self, recording: &Recording, campaign: &Campaign) -> Result<Correction, Error> {
        let effects = recording.plugins.effects_with(&self.effects)?;
        let recorded = recording.only_part(campaign)?;
        let (settings, channels) = (campaign.settings(), &recording.contents.channels);
        let on_event = |event: &SessionEvent| self.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&recording.plugins) };
        let gap = session.diagnose_gap(&recorded, settings, channels, effects, None)?;
        let corrected = session.correct_gap(gap, &recorded, channels, self.method, None)?;
        let described = Described::of(std::slice::from_ref(&recorded));
        Ok(Correction {
            diagnosis: Diagnosis { gap: corrected.gap },
            map: corrected.map,
            identification: described.identification(corrected.identified),
        })
    }

    fn show(&self, event: &SessionEvent) {
        if let Some(observer) = &self.observer {
            observer(event);
        }
    }
}

impl Recording {
    /// Explains where the rig departs from the nominal machine of this campaign, with the effect library of the plug-ins.
    ///
    /// # Errors
    /// If the recording is of another machine, required data are missing, or the nominal model cannot follow it.
    pub fn diagnose(&self, campaign: &Campaign) -> Result<Diagnosis, Error> {
        self.diagnose_with(campaign, &DiagnosisOptions::default())
    }

    /// The same with options: effects of your own, a baseline, an observer.
    ///
    /// # Errors
    /// As [`Recording::diagnose`].
    pub fn diagnose_with(&self, campaign: &Campaign, options: &DiagnosisOptions) -> Result<Diagnosis, Error> {
        options.diagnose(self, campaign)
    }

    /// Diagnoses, and identifies the readings again without the causes found.
    ///
    /// # Errors
    /// As [`Recording::diagnose`] and [`Recording::identify`].
    pub fn correct(&self, campaign: &Campaign, options: &DiagnosisOptions) -> Result<Correction, Error> {
        options.correct(self, campaign)
    }
}

/// Verdict, causes with their probabilities, locations, gap reduction, and the next experiment.
pub struct Diagnosis {
    gap: Gap,
}

impl Diagnosis {
    /// Everything that was found.
    pub fn details(&self) -> &Gap {
        &self.gap
    }

    /// The object that `mapper gap diagnose --json` prints.
    ///
    /// # Errors
    /// None in practice.
    pub fn json(&self) -> Result<Value, Error> {
        Ok(mapper_report::with_messages(|| self.gap.json())?)
    }

    /// The diagnosis as one HTML page. `machine` and `recording` are the names in its title.
    ///
    /// # Errors
    /// None in practice.
    pub fn page(&self, machine: &str, recording: &str) -> Result<String, Error> {
        Ok(self.gap.page(machine, recording)?)
    }
}

/// A diagnosis, and the points without the causes that it found.
pub struct Correction {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// Efficiencies before and after, point by point.
    pub map: CorrectedMap,
    /// Identification of the corrected readings.
    pub identification: Identification,
}
