//! What the steps of a campaign tell together, while they are made: the step under way from its own readings, those behind it
//! from theirs, those ahead from the forecast.
//!
//! The numbers that all steps share are those of the forecast's fit; about them the readings of each step bring their Fisher
//! information, which adds up over the steps. A fit of all steps would say the same to second order, and takes a thousand
//! times as long.

use crate::IdentifyConfig;
use crate::end_state::end_state;
use crate::findings::Findings;
use crate::joint::expected::{ExpectedStep, condensed as condensed_forecast, end_at};
use crate::joint::rows::{End, StepRows, condensed};
use crate::joint::solve::Fisher;
use crate::joint::start::START_WITH_NOISE_S;
use crate::joint::worth::StepWorth;
use crate::samples::Samples;
use crate::{WindowRule, commands, window};
use mapper_core::{Channel, Recording, Window};
use mapper_numerics::statistics::robust_sigma;
use nalgebra::{DMatrix, DVector};

/// Scatter of T2 over the declared one from which on it is believed: below, it is that of an estimate from few samples.
const MORE_NOISE_RATIO: f64 = 1.25;
/// Second differences of white noise scatter so much more than itself.
const SECOND_DIFFERENCE: f64 = 2.449_489_742_783_178;

/// What one step tells of all that the steps share, and of its own efficiency.
#[derive(Debug, Clone, PartialEq)]
pub struct StepInformation {
    information: DMatrix<f64>,
    /// Variance of its efficiency if all that is shared were known, fraction^2.
    variance: f64,
    /// How its efficiency answers to what is shared.
    answer: DVector<f64>,
}

impl StepInformation {
    /// The same where noise is so many times what is declared, ratio, > 0.
    pub fn with_noise(&self, ratio: f64) -> Self {
        let square = ratio * ratio;
        StepInformation {
            information: &self.information / square,
            variance: self.variance * square,
            answer: self.answer.clone(),
        }
    }
}

/// A step that is under way, by its readings.
#[derive(Debug, Clone, PartialEq)]
pub struct StepSoFar {
    /// What it tells.
    pub tells: StepInformation,
    /// Whether its operating point has rested for as long as its verdict asks for.
    pub rests: bool,
}

/// What a planned campaign is forecast to know, for weighing steps in.
#[derive(Debug)]
pub struct CampaignInformation {
    worth: StepWorth,
    /// The settings by which readings are taken.
    config: IdentifyConfig,
    beforehand: DVector<f64>,
}

impl CampaignInformation {
    /// About a campaign that was only forecast; `None` where its forecast cannot be identified. `forecast` are the settings of
    /// its rows, `readings` those of the rig.
    pub fn about(
        steps: &[ExpectedStep<'_>],
        forecast: &IdentifyConfig,
        readings: &IdentifyConfig,
    ) -> Option<Self> {
        let worth = StepWorth::about(steps, forecast)?;
        let first = steps.iter().enumerate().find_map(|(position, step)| {
            let rows = condensed_forecast(position, step, forecast)?;
            worth.fisher(&[rows], &step.estimate())
        })?;
        let beforehand = DVector::from_vec(worth.known_beforehand(&first.unknown));
        Some(CampaignInformation { worth, config: readings.clone(), beforehand })
    }

    /// What a forecast step tells.
    pub fn of_forecast(&self, step: &ExpectedStep<'_>, config: &IdentifyConfig) -> Option<StepInformation> {
        self.of_rows(condensed_forecast(0, step, config)?, step)
    }

    /// What a forecast step tells if it ends at each of these times, s after its jump, rising; about the whole step, so that what
    /// small differences between its ends do to the model is left out.
    pub fn of_forecast_ended(
        &self,
        step: &ExpectedStep<'_>,
        ends_s: &[f64],
        config: &IdentifyConfig,
    ) -> Vec<Option<StepInformation>> {
        let nothing = || vec![None; ends_s.len()];
        let Some(rows) = condensed_forecast(0, step, config).map(|rows| [rows]) else { return nothing() };
        let ends: Vec<Option<End>> =
            ends_s.iter().map(|end_s| end_at(&rows[0], step, *end_s, config)).collect();
        let known: Vec<End> = ends.iter().flatten().copied().collect();
        let mut told = self.worth.fisher_at_ends(&rows, &step.estimate(), &known).into_iter();
        ends.iter().map(|end| end.and_then(|_| self.information_of(told.next()??))).collect()
    }

    /// What the one step of a recording tells up to its end; `None` where its readings are too few, or none. `forecast` is the
    /// step as it was expected.
    pub fn of_readings(&self, recording: &Recording, forecast: &ExpectedStep<'_>) -> Option<StepSoFar> {
        let (config, marker) = (&self.config, recording.steps.first()?);
        let start_s = commands::at_rest_s(recording, marker).max(marker.start_s) + START_WITH_NOISE_S;
        let window = Window { start_s, end_s: marker.end_s };
        let samples = (start_s < marker.end_s).then(|| Samples::of(recording, window, config, true))?;
        if samples.len() < config.thresholds.fewest_samples.max(3) {
            return None;
        }
        let end = end_state(recording, marker, config, &mut Findings::new()).ok()?;
        let rows = condensed(recording, 0, &samples, &end, config)?;
        let tells = self.of_rows(rows, forecast)?;
        let noise_ratio = self.noise_ratio(&samples);
        let tells = if noise_ratio > MORE_NOISE_RATIO { tells.with_noise(noise_ratio) } else { tells };
        let needed_s = WindowRule::rest_at_end_s(marker.end_s - marker.start_s);
        let rest = window::rest(recording, marker, &config.settle_bands);
        let rests = rest.is_some_and(|rest| rest.whole || rest.settled_s >= needed_s);
        Some(StepSoFar { tells, rests })
    }

    fn of_rows(&self, rows: StepRows, forecast: &ExpectedStep<'_>) -> Option<StepInformation> {
        self.information_of(self.worth.fisher(&[rows], &forecast.estimate())?)
    }

    fn information_of(&self, fisher: Fisher) -> Option<StepInformation> {
        let (variance, answer) = fisher.steps.into_iter().next()?;
        let finite = variance.is_finite() && fisher.information.iter().all(|x| x.is_finite());
        (finite && answer.len() == self.beforehand.len()).then_some(StepInformation {
            information: fisher.information,
            variance,
            answer,
        })
    }

    /// Scatter of T2 from sample to sample over what is declared.
    fn noise_ratio(&self, samples: &Samples) -> f64 {
        let declared_k = self.config.declared.get(&Channel::T2).map_or(0.0, |declared| declared.noise_sigma);
        let differences = samples.t2_k.windows(3).map(|three| three[0] - 2.0 * three[1] + three[2]);
        let found_k = robust_sigma(differences).unwrap_or(0.0) / SECOND_DIFFERENCE;
        if declared_k > 0.0 { found_k / declared_k } else { 1.0 }
    }

    /// What steps know together: covariance of all that they share; `None` where the equations are singular.
    pub fn together<'a>(&self, steps: impl Iterator<Item = &'a StepInformation>) -> Option<Known> {
        let mut total = DMatrix::from_diagonal(&self.beforehand);
        for step in steps {
            total += &step.information;
        }
        Some(Known { covariance: total.cholesky()?.inverse() })
    }

    /// What steps are worth where these are what is known and forecast: the slope is that of the campaign as it goes, not as it was
    /// planned. `None` where the equations are singular.
    pub fn worth_now(&self, steps: &[&StepInformation]) -> Option<WorthNow> {
        let covariance = self.together(steps.iter().copied())?.covariance;
        let mut answers = DMatrix::zeros(covariance.nrows(), covariance.nrows());
        for step in steps {
            answers += &step.answer * step.answer.transpose();
        }
        let slope = &covariance * answers * &covariance;
        Some(WorthNow { covariance, slope })
    }

    /// What a step is worth to the forecast campaign, fraction^2, as [`StepWorth::of`].
    pub fn worth(&self, step: &StepInformation) -> f64 {
        self.worth.of_information(&step.information, step.variance, &step.answer)
    }
}

/// What more information is worth to a campaign as it goes.
#[derive(Debug, Clone, PartialEq)]
pub struct WorthNow {
    covariance: DMatrix<f64>,
    slope: DMatrix<f64>,
}

impl WorthNow {
    /// By how much a step makes all points more certain, less the variance of its own point, fraction^2.
    pub fn of(&self, step: &StepInformation) -> f64 {
        let variance = step.variance + step.answer.dot(&(&self.covariance * &step.answer));
        self.slope.dot(&step.information) - variance
    }
}

/// What steps know together.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    covariance: DMatrix<f64>,
}

impl Known {
    /// Standard error of a step's efficiency, fraction, where nothing that can be found is as declared. What the smoothness of the
    /// map says is not in it.
    pub fn sigma_eta(&self, step: &StepInformation) -> f64 {
        (step.variance + step.answer.dot(&(&self.covariance * &step.answer))).max(0.0).sqrt()
    }
}
