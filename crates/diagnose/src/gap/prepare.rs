//! A recording made ready for the diagnosis: the drift of its sensors and the offsets that its zero finds are subtracted.

use crate::drift;
use crate::drift::{CauseKind, DriftReport, DriftRequest, RecordedRun, without_drift};
use crate::gap::best_fit::adequacy::adequacy;
use crate::gap::best_fit::fit::{Effort, fit};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::calibration::Calibration;
use crate::gap::findings::warning::OffsetAtRest;
use crate::gap::preconditions::{GapError, checked_study};
use crate::gap::request::RigRecording;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use mapper_core::{Channel, DeclaredUncertainty, Recording, Soak};
use mapper_identify::{ZeroOutcome, ZeroSettings};
use mapper_observe::declared::Declared;
use mapper_physics::rig::effect::Effect;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A recording ready for the diagnosis.
pub(crate) struct Prepared {
    pub(crate) zeroed: Zeroed,
    /// The drift that was found, if it is credible; that of sensors is subtracted.
    pub(crate) drift: Option<DriftReport>,
    /// Why an apparent drift was not subtracted: tolerances alone explain the recording down to noise.
    pub(crate) rejected_drift: Option<String>,
    /// The recording linearised at the nominal model, if it is known already.
    pub(crate) linearised: Option<Linearised>,
}

/// A recording with its zero subtracted.
pub(crate) struct Zeroed {
    pub(crate) recording: Recording,
    pub(crate) declared: Declared,
    pub(crate) zero: ZeroOutcome,
    /// Sensors with offsets beyond their declaration.
    pub(crate) offsets_at_rest: Vec<OffsetAtRest>,
}

/// Whether a drift is one of sensors alone, which is subtracted from their readings.
pub(crate) fn is_of_sensors(drift: &DriftReport) -> bool {
    drift.drifts.iter().all(|drift| drift.cause.kind() == CauseKind::Sensor)
}

impl Prepared {
    /// Searches drift, which is subtracted first, and takes the zero.
    pub(crate) fn new(rig: &RigRecording, calibration: &Calibration) -> Prepared {
        let as_recorded = Zeroed::new(rig, None);
        let ready = |zeroed, drift| Prepared { zeroed, drift, rejected_drift: None, linearised: None };
        let Some(drift) = found_drift(rig) else { return ready(as_recorded, None) };
        match as_recorded.linearise_noise(rig, calibration) {
            Ok(Some(linearised)) => Prepared {
                rejected_drift: Some(drift.reason),
                linearised: Some(linearised),
                ..ready(as_recorded, None)
            },
            _ => ready(Zeroed::new(rig, Some(&drift)), Some(drift)),
        }
    }
}

/// The drift between the repeats of a recording. A recording that does not permit a drift search may still have a gap.
fn found_drift(rig: &RigRecording) -> Option<DriftReport> {
    if !rig.has_drift_search {
        return None;
    }
    let RigRecording { recording, model, identification, boundary, tolerances, .. } = rig;
    let zero = ZeroOutcome::of(recording, identification, rig.zero.map(Into::into));
    let (recording, _) = zero.subtract(recording.clone(), identification.clone());
    let report = drift::diagnose(&DriftRequest {
        runs: &[RecordedRun { recording: &recording, fingerprint: None }],
        model,
        boundary: *boundary,
        tolerances: *tolerances,
        identification,
    });
    report.ok().filter(|report| !report.drifts.is_empty())
}

impl Zeroed {
    /// Subtracts the drift of sensors and the zero, which reduces the offset uncertainty.
    fn new(rig: &RigRecording, drift: Option<&DriftReport>) -> Zeroed {
        let config = &rig.identification;
        let undrifted = drift.and_then(|drift| without_drift(&rig.recording, drift));
        let recording = undrifted.unwrap_or_else(|| rig.recording.clone());
        let settings = |soak: Soak| ZeroSettings { allows_a_fault: true, ..soak.into() };
        let zero = ZeroOutcome::of(&recording, config, rig.zero.map(settings));
        let offsets_at_rest = offsets_at_rest(&zero, &config.declared);
        let (recording, zeroed) = zero.subtract(recording, config.clone());
        let common_offsets = zero.found().map_or_else(Vec::new, |zero| zero.common.clone());
        let declared = Declared { sensors: zeroed.declared, common_offsets, ..rig.declared() };
        Zeroed { recording, declared, zero, offsets_at_rest }
    }

    /// The study of this recording with candidate effects.
    pub(crate) fn study(&self, rig: &RigRecording, effects: Vec<Arc<dyn Effect>>) -> Result<Study, GapError> {
        let (declared, judged) = (self.declared.clone(), rig.tolerances_declared);
        Ok(checked_study(&self.recording, declared, rig.model.clone(), effects, judged)?.0)
    }

    /// The linearised recording if tolerances alone explain it down to noise. In that case apparent drift in repeats is not subtracted,
    /// because the diagnosis is much more sensitive.
    fn linearise_noise(
        &self,
        rig: &RigRecording,
        calibration: &Calibration,
    ) -> Result<Option<Linearised>, GapError> {
        let study = self.study(rig, Vec::new())?;
        let linearised = Linearised::new(&study)?;
        let null = fit(&study, &linearised, &study.nothing(), &Selection::all(&study), Effort::default())?;
        let misfit = adequacy(&study, &linearised, &null);
        Ok((calibration.outside(misfit.features()) < 0.5).then_some(linearised))
    }
}

/// Zero offset, in declared standard deviations, above which a sensor is reported. Source: the usual three sigmas of a control chart (ISO 7870-2).
const BEYOND_SIGMAS: f64 = 3.0;

/// The sensors whose zero offset exceeds their declaration.
fn offsets_at_rest(
    zero: &ZeroOutcome,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> Vec<OffsetAtRest> {
    let ZeroOutcome::Found(zero) = zero else { return Vec::new() };
    let beyond = zero.offsets.iter().filter_map(|(channel, offset)| {
        let declared_sigma = declared.get(channel).map_or(0.0, |declared| declared.offset_sigma);
        let residual_offset = zero.left_sigma.get(channel).copied().unwrap_or(0.0);
        (offset.abs() > BEYOND_SIGMAS * declared_sigma.hypot(residual_offset)).then_some(OffsetAtRest {
            channel: *channel,
            offset: *offset,
            declared_sigma,
        })
    });
    beyond.collect()
}
