//! Why a map could not be exported.

/// Why a map could not be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The CSV writer failed.
    #[error("failed to write the map as CSV")]
    Csv(#[from] csv::Error),
    /// The CSV rows could not be gathered.
    #[error("failed to gather the rows of the CSV: {message}")]
    CsvBuffer {
        /// What the writer said.
        message: String,
    },
    /// The JSON writer failed.
    #[error("failed to write the map as JSON")]
    Json(#[from] serde_json::Error),
    /// A coordinate is not a number: JSON would turn it into null, and the file could not be read back.
    #[error("step {step}: {quantity} is {value}; the format cannot hold it, leave the point out of the map")]
    NotFinite {
        /// Index of the step.
        step: usize,
        /// Which field.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// The format is a table over the whole map, and the map has only points.
    #[error(
        "`{format}` needs a fitted map, not points alone; fit it (`mapper map fit FILE --out NEW`), or see why the fit was not possible"
    )]
    NeedsFit {
        /// The format.
        format: &'static str,
    },
    /// The picture could not be drawn as pixels.
    #[error("failed to draw the picture as PNG")]
    Png(#[from] mapper_chart::PngError),
}
