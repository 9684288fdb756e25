//! Destination of a case: a file without its truth, or memory.

use crate::blind::cases::truth::TruthPoint;
use mapper_core::{Recording, SampleBatch, StepMarker};
use mapper_recording::{RecordError, RecordingWriter, StepPhase};
use mapper_runner::{ObserverError, RunObserver};

/// Writes the recording, and collects the truth at the end of each step for the answers.
pub(crate) struct FileDestination {
    writer: RecordingWriter,
    last: SampleBatch,
    points: Vec<TruthPoint>,
}

impl FileDestination {
    pub(crate) fn new(writer: RecordingWriter) -> Self {
        FileDestination { writer, last: SampleBatch::default(), points: Vec::new() }
    }

    /// Finishes the file and returns the truth of each point.
    pub(crate) fn finish(self) -> Result<Vec<TruthPoint>, RecordError> {
        self.writer.finish()?;
        Ok(self.points)
    }
}

impl RunObserver for FileDestination {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Start).map_err(ObserverError::new)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let without_truth = SampleBatch { truth: Vec::new(), ..batch.clone() };
        self.writer.write_batch(&without_truth).map_err(ObserverError::new)?;
        self.last = batch.clone();
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let last = |name: &str| {
            let column = self.last.truth.iter().find(|column| column.name == name);
            column.and_then(|column| column.values.last().copied()).unwrap_or(f64::NAN)
        };
        self.points.push(TruthPoint {
            valve: marker.valve_opening_ratio,
            speed_rpm: last("speed_rpm"),
            eta: last("eta"),
            h: last("h_w_m2k"),
        });
        self.writer.write_step(marker, StepPhase::End).map_err(ObserverError::new)
    }
}

/// Keeps the recording in memory without the truth.
#[derive(Default)]
pub(crate) struct MemoryDestination {
    pub(crate) recording: Recording,
}

impl RunObserver for MemoryDestination {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        for column in &batch.columns {
            let series = self.recording.series.entry(column.channel).or_default();
            series.t_s.extend(&batch.t_s);
            series.values.extend(&column.values);
        }
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.recording.steps.push(*marker);
        Ok(())
    }
}
