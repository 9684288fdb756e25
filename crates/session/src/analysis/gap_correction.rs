//! A map corrected for the causes that a gap diagnosis names: recording in, the files of an identification out.

use crate::analysis::gap::Gap;
use crate::analysis::identification::Identified;
use crate::recording::recording_file::Recorded;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Campaign;
use mapper_core::{IdentifiedPoint, Method, Recording, ResultRemark};
use mapper_diagnose::gap::{CorrectedMap, Correction};
use mapper_physics::rig::effect::Effect;
use mapper_recording::ChannelMap;
use std::path::Path;
use std::sync::Arc;

/// A recording with its diagnosis and the map without the causes.
pub struct GapCorrection {
    /// The diagnosis.
    pub gap: Gap,
    /// Before and after, point by point.
    pub map: CorrectedMap,
    /// Identification of the corrected readings, the uncertainty of the correction in its intervals; that of the readings as recorded, what
    /// the open causes would change in its intervals, if nothing was corrected.
    pub identified: Identified,
}

impl Session<'_> {
    /// Diagnoses a recording and identifies it again without the causes found. With `directory`, the results are written there as those of an
    /// identification.
    ///
    /// # Errors
    /// As [`Session::diagnose_gap`], [`Session::identify`] and [`Session::identify_into`].
    pub fn correct_gap(
        &self,
        recorded: &Recorded,
        (campaign, map): (&Campaign, &ChannelMap),
        effects: Vec<Arc<dyn Effect>>,
        method: Option<Method>,
        directory: Option<&Path>,
    ) -> Result<GapCorrection, SessionError> {
        let gap = self.diagnose_gap(recorded, campaign, map, effects, None)?;
        self.send(SessionEvent::Progress { done_ratio: 1.0, what: "identification".to_owned() });
        let quiet = Session::new(self.registry);
        let identify = |recording: Recording| {
            let mut recorded = recorded.clone();
            recorded.read.recording = recording;
            quiet.identify(vec![recorded], map, method)
        };
        let points = |identified: &Identified| -> Vec<IdentifiedPoint> {
            identified.points_alone().cloned().collect()
        };
        let correction = gap.diagnosed.correct(&recorded.read.recording, identify, &points)?;
        let (identified, map) = widened(correction, &gap);
        if let Some(directory) = directory {
            let identified = identified.clone();
            self.write_identification(vec![recorded.clone()], directory, |_| Ok(identified))?;
        }
        Ok(GapCorrection { gap, map, identified })
    }
}

/// The identification with the uncertainty of its correction, or of causes that are not corrected, and with what the correction rests on.
fn widened(correction: Correction<Identified>, gap: &Gap) -> (Identified, CorrectedMap) {
    let Correction { mut identified, map, added } = correction;
    let is_corrected = map.refused.is_none();
    for (scored, added) in identified.points.iter_mut().zip(&added) {
        added.widen(&mut scored.point);
        let step = scored.point.step;
        let budgets = identified.budgets.iter_mut().filter(|budgets| is_corrected && budgets.step == step);
        budgets.for_each(|budgets| added.add_to(budgets));
    }
    if is_corrected {
        identified.corrections.clone_from(&map.points);
        identified.remarks.extend(map.causes.iter().map(|cause| ResultRemark::Corrected {
            causes: cause.names.clone(),
            probability: cause.probability,
        }));
        let subtracted = |reason: &String| ResultRemark::DriftSubtracted { reason: reason.clone() };
        identified.remarks.extend(gap.diagnosed.drift.as_ref().map(|drift| subtracted(&drift.reason)));
    } else {
        identified.remarks.extend(widened_remark(&map));
    }
    (identified, map)
}

/// States that intervals are wider because of causes that the map is not corrected for; `None` if none is.
fn widened_remark(map: &CorrectedMap) -> Option<ResultRemark> {
    let largest_sigma = map.points.iter().map(|point| point.correction_sigma).fold(0.0, f64::max);
    let causes = map.causes.iter().map(|cause| cause.names.join(" + ")).collect();
    (largest_sigma > 0.0).then_some(ResultRemark::WidenedByGap { causes, largest_sigma })
}
