//! From a recording to identified points beside their truth, where there is any: one way for all who need it.

use crate::declared::identification_with;
use crate::fusing::fused;
use crate::recorded::{Recorded, same_machine};
use crate::surge::marks_of;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::{ALPHA_AREA_SIGMA_RATIO, IdentifiedPoint, Method, Recording, ReferenceState, ThermalModel};
use mapper_identify::{IdentifyConfig, NominalRig, TwoParameter, WindowRule, ZeroOutcome, identify_beside};
use mapper_observe::FusedChannel;
use mapper_record::ChannelMap;
use mapper_record::score::{ScoreSummary, ScoredMark, ScoredPoint};
use serde::Serialize;

use mapper_surge::SurgeMarks;
use std::path::Path;

/// What a recording gives.
#[derive(Debug)]
pub struct Identified {
    /// The recording as it was identified: several sensors are fused, the isothermal zero is subtracted.
    pub recording: Recording,
    /// How it was identified.
    pub config: IdentifyConfig,
    /// The points, with the truth where the recording holds it.
    pub points: Vec<ScoredPoint>,
    /// What the points share (joint method).
    pub thermal: Option<ThermalModel>,
    /// What the two-parameter method makes of the same steps (joint method).
    pub two_parameter: Vec<TwoParameter>,
    /// What became of channels with several sensors.
    pub sensors: Vec<FusedChannel>,
    /// What came of the zero.
    pub zero: ZeroOutcome,
    /// How far the points are from the truth; `None` on a real rig.
    pub score: Option<ScoreSummary>,
    /// Surge-side ends that were sought; `None` where none were.
    pub surge: Option<SoughtSurge>,
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
    /// The points without their truth.
    pub fn points_alone(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.points.iter().map(|scored| &scored.point)
    }
}

impl Session<'_> {
    /// Identifies all steps of a recording. Machine, sensors and window come from its campaign, or else from the channel map.
    ///
    /// # Errors
    /// [`SessionError::MachineUnknown`] where neither is known, [`SessionError::OtherMachine`] where the recording is not of the
    /// campaign's machine, [`SessionError::Identify`] where the recording lacks what
    /// the method needs.
    pub fn identify(
        &self,
        recorded: Recorded,
        map: &ChannelMap,
        method: Option<Method>,
    ) -> Result<Identified, SessionError> {
        if let Some(campaign) = &recorded.campaign {
            same_machine(&recorded, campaign)?;
        }
        let mut config = match (&recorded.campaign, &map.machine) {
            (Some(campaign), _) => identification_with(campaign, map),
            (None, Some(machine)) => IdentifyConfig {
                method: Method::Joint,
                alpha_area_ratio: machine.alpha_area_ratio,
                alpha_area_sigma_ratio: ALPHA_AREA_SIGMA_RATIO,
                internal_area_m2: machine.compressor_internal_area_m2,
                reference: map.reference.unwrap_or(ReferenceState::SAE),
                window: map.window.map_or_else(WindowRule::default, |window| WindowRule::Fixed {
                    start_s: window.start_s,
                    end_s: window.end_s,
                }),
                declared: map.sensors.clone(),
                noise_colour: map.noise_colour.unwrap_or_default(),
                ..IdentifyConfig::default()
            },
            (None, None) => {
                return Err(SessionError::MachineUnknown {
                    remedy: "Give `--campaign FILE`, or `machine:` with `compressor_internal_area` in the channel map",
                });
            }
        };
        config.method = method.unwrap_or(config.method);
        let soak = recorded.campaign.as_ref().and_then(|campaign| campaign.zero);
        let fused = fused(vec![recorded.read.recording], config, recorded.campaign.as_ref(), map);
        let recording = fused.recordings.into_iter().next().unwrap_or_default();
        let sensors = fused.channels.into_iter().next().unwrap_or_default();
        let zero = ZeroOutcome::of(&recording, &fused.config, soak);
        let surge = match recorded.approaches {
            Some(approaches) => {
                let (approaches, config) = zero.take_off(approaches, fused.config.clone());
                Some(sought(&recorded.path, &approaches, recorded.campaign.as_ref(), &config)?)
            }
            None => None,
        };
        let (recording, config) = zero.take_off(recording, fused.config);
        let declared = recorded.campaign.as_ref().filter(|campaign| campaign.tolerances_declared);
        let model = declared.map(nominal_model).transpose()?;
        let nominal = declared.zip(model.as_ref());
        let nominal = nominal.map(|(campaign, model)| NominalRig { model, tolerances: &campaign.tolerances });
        let found = identify_beside(&recording, &config, nominal)?;
        let points: Vec<IdentifiedPoint> = found.points.into_iter().filter_map(Result::ok).collect();
        for point in &points {
            self.tell(SessionEvent::PointIdentified(Box::new(point.clone())));
        }
        let points = mapper_record::score::score(&recorded.path, &recording.steps, points)?;
        let score = mapper_record::score::summarise(&points);
        Ok(Identified {
            recording,
            config,
            points,
            thermal: found.thermal,
            two_parameter: found.two_parameter,
            sensors,
            zero,
            score,
            surge,
        })
    }
}

/// The marks of the approaches beside their truth.
fn sought(
    path: &Path,
    approaches: &Recording,
    campaign: Option<&Campaign>,
    config: &IdentifyConfig,
) -> Result<SoughtSurge, SessionError> {
    let SurgeMarks { marks, remarks, surges } = marks_of(approaches, campaign, config);
    let marks = mapper_record::score::score_marks(path, approaches, config.reference, marks)?;
    Ok(SoughtSurge { marks, remarks, surges })
}
