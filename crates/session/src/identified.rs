//! From a recording to identified points beside their truth, where there is any: one way for all who need it.

use crate::declared::{identification_of, identification_with};
use crate::fusing::fused;
use crate::recorded::{Recorded, all_differ, same_machine};
use crate::surge::marks_of;
use crate::{Session, SessionError, SessionEvent};
use mapper_assemble::{RepeatedJump, repeated_jumps};
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::{IdentifiedPoint, Method, Recording, StepMarker, StepOrigin, ThermalModel, joined};
use mapper_identify::{
    FoundFault, IdentifyConfig, NominalRig, TwoParameter, ZeroOutcome, ZeroSettings, identify_beside,
    isothermal_zero, method_for,
};
use mapper_observe::FusedChannel;
use mapper_record::ChannelMap;
use mapper_record::score::{
    AwaitedTruths, ScoreSummary, ScoredMark, ScoredPoint, Truth, beside_truths, score, score_marks,
};
use serde::Serialize;
use serde_json::{Value, json};

use mapper_surge::SurgeMarks;
use std::path::{Path, PathBuf};

/// Rest before the first step, s, that is worth a word: thermocouples in a housing need it to come to the others.
const UNUSED_REST_S: f64 = 600.0;

/// What a recording gives.
#[derive(Debug)]
pub struct Identified {
    /// The recording as it was identified: several are joined, several sensors are fused, the isothermal zero is subtracted.
    pub recording: Recording,
    /// Where each step of it comes from.
    pub origins: Vec<StepOrigin>,
    /// How it was identified.
    pub config: IdentifyConfig,
    /// The points, with the truth where the recording holds it.
    pub points: Vec<ScoredPoint>,
    /// What the points share (joint method).
    pub thermal: Option<ThermalModel>,
    /// What the two-parameter method makes of the same steps (joint method).
    pub two_parameter: Vec<TwoParameter>,
    /// Faults of sensors or machine without which the recording contradicts itself.
    pub faults: Vec<FoundFault>,
    /// What became of channels with several sensors.
    pub sensors: Vec<FusedChannel>,
    /// What came of the zero.
    pub zero: ZeroOutcome,
    /// How far the points are from the truth; `None` on a real rig.
    pub score: Option<ScoreSummary>,
    /// Surge-side ends that were sought; `None` where none were.
    pub surge: Option<SoughtSurge>,
    /// What else is to be known of it.
    pub remarks: Vec<String>,
}

/// What came of the search for surge.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SoughtSurge {
    /// The marks in order of speed, with the truth where the recording holds it.
    pub marks: Vec<ScoredMark>,
    /// Lines on which surge was not found, in words.
    pub remarks: Vec<String>,
    /// How often the compressor went into surge.
    pub surges: usize,
}

impl Identified {
    /// For a program. `recording`: the first file; `warnings`: what was wrong with the files.
    pub fn json(&self, recording: Option<&Path>, warnings: &[String]) -> Value {
        let mut value = json!({
            "recording": recording,
            "reference": self.config.reference,
            "points": self.points,
            "thermal": self.thermal,
            "two_parameter": self.two_parameter,
            "faults": self.faults,
            "zero": self.zero,
            "score": self.score,
            "recording_warnings": warnings,
            "remarks": self.remarks,
        });
        if !self.sensors.is_empty() {
            value["sensors"] = json!(self.sensors);
        }
        if let Some(surge) = &self.surge {
            value["surge"] = json!(surge);
        }
        value
    }

    /// The points without their truth.
    pub fn points_alone(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.points.iter().map(|scored| &scored.point)
    }

    /// That there is a point at all.
    ///
    /// # Errors
    /// [`SessionError::NoPoints`] with what is known of the recording, `warnings` of its reader among it.
    pub fn has_points(&self, warnings: &[String]) -> Result<(), SessionError> {
        let why: Vec<&str> = warnings.iter().chain(&self.remarks).map(String::as_str).collect();
        if self.points.is_empty() { Err(SessionError::NoPoints { why: why.join("; ") }) } else { Ok(()) }
    }

    /// Jumps that were made more than once.
    pub fn repeats(&self) -> Vec<RepeatedJump> {
        let points: Vec<IdentifiedPoint> = self.points_alone().cloned().collect();
        repeated_jumps(&self.recording.steps, &points)
    }
}

impl Session<'_> {
    /// Identifies all steps of one recording, or of several of the same machine together. Machine, sensors and window come from
    /// the campaign of the first, or else from the channel map; the zero is that of the first, subtracted from all.
    ///
    /// # Errors
    /// [`SessionError::NoRecording`] where there is none, [`SessionError::MachineUnknown`] where neither campaign nor channel map
    /// says what machine it is, [`SessionError::OtherMachine`] where a recording is not of the campaign's machine,
    /// [`SessionError::NotTogether`] where the recordings' own campaigns differ, [`SessionError::Identify`] where the recording
    /// lacks what the method needs.
    pub fn identify(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
    ) -> Result<Identified, SessionError> {
        let paths: Vec<PathBuf> = recorded.iter().map(|one| one.path.clone()).collect();
        beside_truths(&paths, |truths| self.identify_and_score(recorded, map, method, truths))
    }

    /// As [`identify`](Session::identify), with the truths that are being read.
    pub(crate) fn identify_and_score(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
        truths: AwaitedTruths<'_>,
    ) -> Result<Identified, SessionError> {
        let campaign = same_campaign(&recorded)?.cloned();
        all_differ(&recorded)?;
        let campaign = campaign.as_ref();
        let mut config = match (campaign, &map.machine) {
            (Some(campaign), _) => identification_with(campaign, map),
            (None, Some(machine)) => identification_of(machine, map),
            (None, None) => {
                return Err(SessionError::MachineUnknown {
                    remedy: "Give `--campaign FILE`, or `machine:` with `compressor_internal_area` in the channel map",
                });
            }
        };
        let mut remarks = Vec::new();
        config.method = method.unwrap_or_else(|| {
            let usual = config.method;
            let found = recorded.iter().map(|one| method_for(&one.read.recording, usual));
            let (method, why) =
                found.reduce(|a, b| if a.1.is_some() { a } else { b }).unwrap_or((usual, None));
            remarks.extend(why);
            method
        });
        let soak = campaign.and_then(|campaign| campaign.zero);
        let (mut recordings, mut sources) = (Vec::new(), Vec::new());
        for Recorded { read, approaches, .. } in recorded {
            sources.push(Source { steps: read.recording.steps.clone(), approaches });
            recordings.push(read.recording);
        }
        let fused = fused(recordings, config, campaign, map);
        let sensors = fused.channels.into_iter().next().unwrap_or_default();
        let first = fused.recordings.first().ok_or(SessionError::NoRecording)?;
        let zero = ZeroOutcome::of(first, &fused.config, soak);
        remarks.extend(campaign.filter(|_| soak.is_none()).and_then(|_| rest_unused(first, &fused.config)));
        let (_, config) = zero.take_off(Recording::default(), fused.config.clone());
        let off = |recording: Recording| zero.take_off(recording, fused.config.clone()).0;
        let (recording, origins) = joined(fused.recordings.into_iter().map(off).collect());
        let declared = campaign.filter(|campaign| campaign.tolerances_declared);
        let model = declared.map(nominal_model).transpose()?;
        let nominal = declared.zip(model.as_ref());
        let nominal = nominal.map(|(campaign, model)| NominalRig { model, tolerances: &campaign.tolerances });
        let found = identify_beside(&recording, &config, nominal)?;
        let points: Vec<IdentifiedPoint> = found.points.into_iter().filter_map(Result::ok).collect();
        for point in &points {
            self.tell(SessionEvent::PointIdentified(Box::new(point.clone())));
        }
        let truths = truths.wait()?;
        let surge = sought(&sources, &truths, off, campaign, &config);
        let points = scored(&sources, &truths, &recording, &origins, points);
        let score = mapper_record::score::summarise(&points);
        Ok(Identified {
            recording,
            origins,
            config,
            points,
            thermal: found.thermal,
            two_parameter: found.two_parameter,
            faults: found.faults,
            sensors,
            zero,
            score,
            surge,
            remarks,
        })
    }
}

/// That a recording rests before its first step, as a zero needs it, and nobody asked for one.
fn rest_unused(recording: &Recording, config: &IdentifyConfig) -> Option<String> {
    let settings = ZeroSettings { shortest_s: UNUSED_REST_S, ..ZeroSettings::default() };
    let rest = isothermal_zero(recording, config, &settings).ok().filter(|rest| !rest.offsets.is_empty())?;
    Some(format!(
        "from {:.0} to {:.0} s, before the first step, the machine rests and its sensors read alike: `zero: {{soak: {:.0} min}}` in the \
         campaign takes off what they read differently there, which leaves less of the declared offsets in the intervals",
        rest.start_s,
        rest.end_s,
        (rest.end_s - rest.start_s) / 60.0
    ))
}

/// What is kept of each recording beside what is identified.
struct Source {
    steps: Vec<StepMarker>,
    approaches: Option<Recording>,
}

/// The campaign that all recordings belong to; `None` where none names one.
fn same_campaign(recorded: &[Recorded]) -> Result<Option<&Campaign>, SessionError> {
    let first = recorded.first().ok_or(SessionError::NoRecording)?;
    let Some(campaign) = &first.campaign else { return Ok(None) };
    for other in recorded {
        same_machine(other, campaign)?;
        let Some(theirs) = &other.campaign else { continue };
        let differs = if theirs.machine != campaign.machine {
            "machine"
        } else if theirs.sensors != campaign.sensors {
            "sensors"
        } else if theirs.reference != campaign.reference {
            "reference state"
        } else {
            continue;
        };
        let (first, other) = (first.path.clone(), other.path.clone());
        return Err(SessionError::NotTogether { first, other, differs });
    }
    Ok(Some(campaign))
}

/// The points beside their truth, each from the recording that it comes from.
fn scored(
    sources: &[Source],
    truths: &[Truth],
    recording: &Recording,
    origins: &[StepOrigin],
    points: Vec<IdentifiedPoint>,
) -> Vec<ScoredPoint> {
    let origin_of = |index: usize| {
        let position = recording.steps.iter().position(|step| step.index == index)?;
        origins.get(position)
    };
    let mut scored: Vec<(usize, ScoredPoint)> = Vec::new();
    for (number, (source, truth)) in sources.iter().zip(truths).enumerate() {
        let theirs = points.iter().enumerate().filter_map(|(place, point)| {
            let origin = origin_of(point.step).filter(|origin| origin.recording == number)?;
            Some((place, point.step, IdentifiedPoint { step: origin.step, ..point.clone() }))
        });
        let (places, alone): (Vec<(usize, usize)>, Vec<IdentifiedPoint>) =
            theirs.map(|(place, step, point)| ((place, step), point)).unzip();
        let found = score(truth, &source.steps, alone);
        scored.extend(places.into_iter().zip(found).map(|((place, step), mut found)| {
            found.point.step = step;
            (place, found)
        }));
    }
    scored.sort_by_key(|(place, _)| *place);
    scored.into_iter().map(|(_, found)| found).collect()
}

/// The marks of all approaches beside their truth; `None` where surge was not sought.
fn sought(
    sources: &[Source],
    truths: &[Truth],
    off: impl Fn(Recording) -> Recording,
    campaign: Option<&Campaign>,
    config: &IdentifyConfig,
) -> Option<SoughtSurge> {
    let mut all: Option<SoughtSurge> = None;
    for (Source { approaches, .. }, truth) in sources.iter().zip(truths) {
        let Some(approaches) = approaches.clone().map(&off) else { continue };
        let SurgeMarks { marks, remarks, surges } = marks_of(&approaches, campaign, config);
        let marks = score_marks(truth, &approaches, config.reference, marks);
        let together =
            all.get_or_insert_with(|| SoughtSurge { marks: Vec::new(), remarks: Vec::new(), surges: 0 });
        together.marks.extend(marks);
        together.remarks.extend(remarks);
        together.surges += surges;
    }
    if let Some(all) = &mut all {
        all.marks.sort_by(|a, b| a.mark.speed_corrected_rpm.total_cmp(&b.mark.speed_corrected_rpm));
    }
    all
}
