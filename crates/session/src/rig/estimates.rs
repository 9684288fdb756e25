//! Identifies each step as soon as it ends, so that observers see a preliminary result before the joint identification.

use crate::SessionEvent;
use crate::event::OnEvent;
use mapper_core::{Method, Recording, SampleBatch, StepMarker};
use mapper_identify::{IdentifyConfig, identify_each};
use mapper_runner::{ObserverError, RunObserver};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Scope;

/// Steps that may wait for identification. If the run is faster, estimates are dropped and the run is not delayed.
const MAX_WAITING_STEPS: usize = 4;

/// Keeps the last two steps and sends them to a separate thread, so that identification never delays the rig.
pub(crate) struct StepEstimator {
    recent: Recording,
    to_thread: SyncSender<Recording>,
}

impl StepEstimator {
    /// Starts the thread, which ends when this value is dropped.
    pub(crate) fn start<'scope, 'env>(
        scope: &'scope Scope<'scope, 'env>,
        config: IdentifyConfig,
        on_event: OnEvent<'env>,
    ) -> Self {
        let (to_thread, steps) = sync_channel::<Recording>(MAX_WAITING_STEPS);
        let config = config_for_single_steps(config);
        scope.spawn(move || {
            while let Ok(recording) = steps.recv() {
                let points = identify_each(&recording, &config).unwrap_or_default();
                if let Some(Ok(point)) = points.into_iter().last() {
                    on_event(&SessionEvent::PointEstimated(Box::new(point)));
                }
            }
        });
        StepEstimator { recent: Recording::default(), to_thread }
    }
}

impl RunObserver for StepEstimator {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        append_samples(&mut self.recent, batch);
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        retain_last_two_steps(&mut self.recent, marker);
        let _ = self.to_thread.try_send(self.recent.clone());
        Ok(())
    }
}

/// Appends samples to a recording as a file reader would: missing readings are omitted.
pub(crate) fn append_samples(recent: &mut Recording, batch: &SampleBatch) {
    for column in &batch.columns {
        let series = recent.series.entry(column.channel).or_default();
        for (t_s, value) in batch.t_s.iter().zip(&column.values).filter(|(_, value)| value.is_finite()) {
            series.t_s.push(*t_s);
            series.values.push(*value);
        }
    }
}

/// Adds an ended step and drops data before the previous one. Identification of the last step needs only these two.
pub(crate) fn retain_last_two_steps(recent: &mut Recording, marker: &StepMarker) {
    if recent.steps.len() > 1 {
        recent.steps.remove(0);
    }
    if let Some(before) = recent.steps.first().copied() {
        for series in recent.series.values_mut() {
            let old_samples = series.t_s.partition_point(|t_s| *t_s < before.start_s);
            series.t_s.drain(..old_samples);
            series.values.drain(..old_samples);
        }
    }
    recent.steps.push(*marker);
}

/// Settings for single steps. The standard errors exclude the assumed alpha_A, because further visits would not reduce that part.
pub(crate) fn config_for_single_steps(config: IdentifyConfig) -> IdentifyConfig {
    let method = match config.method {
        Method::Joint => Method::Dynamic,
        method => method,
    };
    IdentifyConfig { method, alpha_area_sigma_ratio: 0.0, ..config }
}
